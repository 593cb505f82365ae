"""What faults cost: nothing where none is armed, and how much while one acts.

Rounds alternate between the boards, so that all see the same machine; the fastest round counts.
Ratios are to a board that has never heard of faults. Two of those tell what the noise is.
"""

import time
from collections.abc import Callable

from in_process import start_lm629

from vbus.board.board import Board
from vbus.board.build import load_board_text

ROUNDS = 21
READS = 4000
SAMPLES = 400

TEXT = """\
[board]
name = "bench"
time = "lockstep"
power_on = "done"
[chips.x]
part = "LM629N-8"
clock = "8 MHz"
plant = "m"
[plants.m]
model = "dc_motor"
"""


def moving() -> Board:
    """An LM629 in velocity mode."""
    board = load_board_text(TEXT)
    port = board.open_port("bench")
    start_lm629(port, kp=60, kd=600, acc=2000, vel=4)
    return board


def resting() -> Board:
    """An LM629 that has nothing to do."""
    board = load_board_text(TEXT)
    board.open_port("bench")
    return board


def cleared(make: Callable[[], Board]) -> Board:
    """The same after faults of every kind have come and gone."""
    board = make()
    for name in ("slip", "friction", "bit_stuck", "strobe_lost", "busy_longest"):
        board.faults.clear(board.faults.arm(name))
    board.faults.clear(board.faults.arm("byte_flipped", when="cycle 1000"))
    return board


def acting(make: Callable[[], Board], name: str) -> Board:
    """The same while a fault acts."""
    board = make()
    board.faults.arm(name, until="cleared")
    return board


def cycles(board: Board) -> float:
    """Return nanoseconds per status read."""
    read = board.ports[0].read
    start = time.perf_counter_ns()
    for _ in range(READS):
        read(0)
    return (time.perf_counter_ns() - start) / READS


def samples(board: Board) -> float:
    """Return nanoseconds per sample with its plant."""
    start = time.perf_counter_ns()
    board.run_for(SAMPLES * 256_000_000)
    board.catch_up()
    return (time.perf_counter_ns() - start) / SAMPLES


def main() -> None:
    """Print a table."""
    for what, measure, make in (("bus cycle", cycles, resting), ("sample", samples, moving)):
        boards = {
            "never armed": make(),
            "never, again": make(),
            "all cleared": cleared(make),
            "backlash acts": acting(make, "backlash"),
            "bit_stuck acts": acting(make, "bit_stuck"),
        }
        times: dict[str, list[float]] = {name: [] for name in boards}
        for _ in range(ROUNDS):
            for name, board in boards.items():
                times[name].append(measure(board))
        base = min(times["never armed"])
        for name in boards:
            here = min(times[name])
            print(f"{what:10} {name:15} {here:9.0f} ns   ratio {here / base:.3f}")


if __name__ == "__main__":
    main()
