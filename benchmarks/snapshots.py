"""What a snapshot costs: three chips with their plants, after a second and after an hour.

The state alone is that of the chips, their hosts and wires, with no fault armed. Time is that of
the processor, not the wall's, so that other programs do not count. ``--check`` ends with 1 where a
median is above its limit; that of the state is the compiled core's.
"""

import gc
import sys
import time
from collections.abc import Callable

from in_process import start_lm629

from vbus.board import snapshot
from vbus.board.board import Board
from vbus.board.build import load_board_text
from vbus.compiled import core

ROUNDS = 100
LIMIT_MS = 5.0
STATE_LIMIT_MS = 0.2
SECOND = 10**12

TEXT = """\
[board]
name = "bench"
time = "lockstep"
power_on = "done"
[chips.x]
part = "LM629N-8"
clock = "8 MHz"
plant = "servo"
[chips.y]
part = "MCP-1200"
clock = "20 MHz"
plant = "servo2"
[chips.z]
part = "MC1241A"
clock = "25 MHz"
plants = ["step1", "step2"]
[plants.servo]
model = "dc_motor"
[plants.servo2]
model = "dc_motor"
[plants.step1]
model = "stepper"
[plants.step2]
model = "stepper"
"""


def made(elapsed: int) -> Board:
    """Three chips, the first in motion for the last 100 ms."""
    board = load_board_text(TEXT)
    for chip in ("x", "y", "z"):
        board.open_port(chip, [chip])
    board.run_until(elapsed - SECOND // 10)
    port = board.ports[0]
    start_lm629(port, kp=60, kd=600, acc=2000, vel=4)
    board.run_until(elapsed)
    board.catch_up()
    return board


def arm(board: Board) -> None:
    """Arm a fault of a plant and one of the bus."""
    board.faults.arm("backlash", "x")
    board.faults.arm("byte_flipped", "x", when="cycle 1000")


def worst(call: Callable[[], object]) -> tuple[float, float]:
    """Return the median and the slowest of many calls (ms); the garbage of others is not ours."""
    times = []
    gc.collect()
    gc.disable()
    for _ in range(ROUNDS):
        start = time.thread_time_ns()
        call()
        times.append((time.thread_time_ns() - start) / 1e6)
    gc.enable()
    times.sort()
    return times[ROUNDS // 2], times[-1]


def main() -> None:
    """Print a table."""
    above = False
    print(f"{core()} core")
    print(f"{'call':11} {'after':>5} {'median':>11} {'slowest':>11} {'limit':>9}")
    for after, elapsed in (("1 s", SECOND), ("1 h", 3600 * SECOND)):
        board = made(elapsed)
        state = board.save()
        rows: list[tuple[str, Callable[[], object], float]] = [
            ("save state", board.save, STATE_LIMIT_MS),
            ("load state", lambda board=board, state=state: board.load(state), STATE_LIMIT_MS),
        ]
        armed = made(elapsed)
        arm(armed)
        kept = snapshot.take(armed)
        rows += [
            ("save", lambda armed=armed: snapshot.write(snapshot.take(armed)), LIMIT_MS),
            ("load", lambda armed=armed, kept=kept: snapshot.restore(armed, kept), LIMIT_MS),
            ("fork", lambda armed=armed: snapshot.fork(armed), LIMIT_MS),
        ]
        for what, call, limit in rows:
            median, slowest = worst(call)
            above = above or median > limit
            print(f"{what:11} {after:>5} {median:8.3f} ms {slowest:8.3f} ms {limit:6.1f} ms")
        print(f"a snapshot after {after} has {len(snapshot.write(kept))} bytes")
    if "--check" in sys.argv and above:
        sys.exit("a median is above its limit")


if __name__ == "__main__":
    main()
