"""What a snapshot costs: three chips with their plants, after a second and after an hour.

Time is that of the processor, not the wall's, so that other programs do not count. ``--check``
ends with 1 where a median is above the limit.
"""

import gc
import sys
import time
from collections.abc import Callable

from in_process import start_lm629

from vbus.board import snapshot
from vbus.board.board import Board
from vbus.board.build import load_board_text

ROUNDS = 100
LIMIT_MS = 5.0
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
    """Three chips, the first in motion for the last 100 ms, one fault of each kind armed."""
    board = load_board_text(TEXT)
    for chip in ("x", "y", "z"):
        board.open_port(chip, [chip])
    board.run_until(elapsed - SECOND // 10)
    port = board.ports[0]
    start_lm629(port, kp=60, kd=600, acc=2000, vel=4)
    board.faults.arm("backlash", "x")
    board.faults.arm("byte_flipped", "x", when="cycle 1000")
    board.run_until(elapsed)
    board.catch_up()
    return board


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
    print(f"{'call':8} {'after':>8} {'median':>10} {'slowest':>10}   limit {LIMIT_MS} ms")
    for name, elapsed in (("1 s", SECOND), ("1 h", 3600 * SECOND)):
        board = made(elapsed)
        kept = snapshot.take(board)
        packed = snapshot.write(kept)

        def load(board: Board = board, kept: snapshot.Snapshot = kept) -> None:
            snapshot.restore(board, kept)

        def fork(board: Board = board) -> Board:
            return snapshot.fork(board)

        def take(board: Board = board) -> bytes:
            return snapshot.write(snapshot.take(board))

        for what, call in (("save", take), ("load", load), ("fork", fork)):
            median, slowest = worst(call)
            above = above or median > LIMIT_MS
            print(f"{what:8} {name:>8} {median:7.3f} ms {slowest:7.3f} ms   {len(packed)} bytes")
    if "--check" in sys.argv and above:
        sys.exit(f"a median is above {LIMIT_MS} ms")


if __name__ == "__main__":
    main()
