"""A chip that does everything the manual allows it to do, at the worst of times.

Drivers are written beside one board, whose chip is busy for 15 us and wakes up with 84h. Another
specimen is busy for 100 us, wakes up with C4h and takes its time. :func:`find_weakness` plays
specimens of the chips of a board against a host and returns the smallest set of extremes under
which it hangs, misreads or fails. It is a campaign in one dimension; see :mod:`vbus.campaign`.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from textwrap import indent

from vbus.board.build import build
from vbus.board.config import read_board_text
from vbus.campaign.plan import specimens, weakest
from vbus.campaign.world import REFERENCE, World, begin, of_world, with_settings
from vbus.client.bus import Bus
from vbus.core.errors import ConfigError
from vbus.serve.in_process import connect_in_process
from vbus.testing.limits import HostStuck, HostWatch, Limits
from vbus.testing.programs import ProgramOutcome, run_program

Host = Callable[[Bus], object] | Sequence[str]
"""A function that is given a client's bus, or a program with its arguments."""

Judge = Callable[[ProgramOutcome], str]
"""Says in a sentence what is wrong with an outcome; "" if nothing is."""


@dataclass(frozen=True, slots=True)
class Weakness:
    """A host's failure under the fewest extremes that show it.

    Attributes:
        world: the extremes.
        reason: what the host did wrong.
        outcome: all that is known of the run.
        board: board file with these extremes: the host fails on it in every run.
    """

    world: World
    reason: str
    outcome: ProgramOutcome
    board: str

    def __str__(self) -> str:
        last = "\n".join(f"    {line}" for line in self.outcome.transcript[-12:])
        wrong = f"\n  {self.outcome.errors.strip()}" if self.outcome.errors.strip() else ""
        return (
            f"{self.reason}\n  under: {self.world.sentence()}{wrong}\n"
            f"  after {self.outcome.cycles} bus cycles, the last of them:\n{last}\n"
            f"  this board file repeats it:\n{indent(self.board, '    ')}"
        )


def play(
    board: str, host: Host, world: World, limits: Limits | None = None, name: str = ""
) -> ProgramOutcome:
    """Run a host in one world.

    Args:
        board: text of a board file; its time is lockstep, or a verdict would not repeat.
        host: a function or a program; see :data:`Host`.
        world: the extremes.
        limits: when it counts as hanging.
        name: the board file's name, for messages.

    Raises:
        ConfigError: the board file is wrong, or its time is not lockstep.
    """
    bounds = limits if limits is not None else Limits()
    file, source = read_board_text(board, name or "board.toml")
    if file.board.time != "lockstep":
        raise ConfigError(
            f'{file.path}: time = "{file.board.time}"; a hostile chip needs time = "lockstep",'
            " where every run repeats"
        )
    file, source = of_world(file, source, world)
    if not callable(host):
        folder = Path(name).parent if name else None
        return run_program(file, source, host, bounds, folder=folder, start=world.ahead)
    made = build(file, source)
    watch = HostWatch(made, bounds)
    begin(made, world)
    outcome = ProgramOutcome()
    bus = connect_in_process(made)
    try:
        result = host(bus)
        outcome.output = "" if result is None else str(result)
    except HostStuck:
        outcome.code = 1
    except Exception as error:
        outcome.code = 1
        outcome.errors = f"{type(error).__name__}: {error}"
    finally:
        bus.close()
    outcome.take(watch)
    outcome.now = made.now
    return outcome


def failed(outcome: ProgramOutcome) -> str:
    """Say what is wrong with a host that hangs or ends with another exit code than 0."""
    if outcome.stuck:
        return f"the host hangs: {outcome.stuck}"
    return f"the host fails with exit code {outcome.code}" if outcome.code else ""


def find_weakness(
    board: str | Path,
    host: Host,
    judge: Judge = failed,
    limits: Limits | None = None,
    examples: int = 100,
    seed: int = 0,
) -> Weakness | None:
    """Look for the fewest legal extremes under which a host fails; None if none were found.

    The search is the same in every run with the same ``seed``. A host that fails with a typical
    chip is weak without any extreme.

    Args:
        board: path of a board file, or its text.
        host: a function or a program; see :data:`Host`.
        judge: what counts as wrong; :func:`failed` if not given. One that compares
            ``outcome.output`` finds hosts that misread.
        limits: when the host counts as hanging.
        examples: how many specimens to play at most before one fails.
        seed: of the search.
    """
    name = str(board) if isinstance(board, Path) else ""
    text = board.read_text() if isinstance(board, Path) else board
    outcomes: dict[World, ProgramOutcome] = {}

    def weak(world: World) -> bool:
        if world not in outcomes:
            outcomes[world] = play(text, host, world, limits, name)
        return bool(judge(outcomes[world]))

    file, _ = read_board_text(text)
    worst = weakest([REFERENCE, *specimens(file, seed, examples)], weak)
    if worst is None:
        return None
    outcome = outcomes[worst]
    return Weakness(worst, judge(outcome), outcome, with_settings(text, worst))
