"""A chip that does everything the manual allows it to do, at the worst of times.

Drivers are written beside one board, whose chip is busy for 15 us and wakes up with 84h. Another
specimen is busy for 100 us, wakes up with C4h and takes its time. :func:`scenarios` is a Hypothesis
strategy over all legal extremes of the chips of a board; :func:`find_weakness` plays them against
a host and returns the smallest set of extremes under which it hangs, misreads or fails.
"""

import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from random import Random
from textwrap import indent
from typing import Final

try:
    from hypothesis import HealthCheck, Phase, find, settings
    from hypothesis import strategies as st
    from hypothesis.errors import NoSuchExample
except ImportError as error:
    raise ImportError("vbus.testing.hostile needs Hypothesis: pip install hypothesis") from error

from vbus.board.build import build
from vbus.board.config import read_board_text
from vbus.campaign.world import extremes, section_line, with_keys
from vbus.client.bus import Bus
from vbus.core.errors import ConfigError
from vbus.core.kernel import US
from vbus.core.options import Value
from vbus.testing.in_process import connect_in_process
from vbus.testing.limits import HostStuck, HostWatch, Limits
from vbus.testing.programs import ProgramOutcome, run_program

Host = Callable[[Bus], object] | Sequence[str]
"""A function that is given a client's bus, or a program with its arguments."""

Judge = Callable[[ProgramOutcome], str]
"""Says in a sentence what is wrong with an outcome; "" if nothing is."""

PHASES: Final = 32
"""How many places in a sample a host may start at."""
PHASE: Final = 17 * US
"""From one of these places to the next (ps)."""


@dataclass(frozen=True, slots=True)
class Extremes:
    """One set of extremes.

    Attributes:
        extremes: settings by ``(chip, key)``, in the order of the board file.
        seed: of the board: of the streams its jitter draws from.
        phase: the host starts this many times 17 us after power-on, so that its first cycle falls
            into another part of a servo sample.
    """

    extremes: tuple[tuple[str, str, Value], ...] = ()
    seed: int = 0
    phase: int = 0

    def __str__(self) -> str:
        parts = [f"{chip}.{key} = {_toml(value)}" for chip, key, value in self.extremes]
        if self.seed:
            parts.append(f"seed = {self.seed}")
        if self.phase:
            parts.append(f"start {self.phase * PHASE // US} us after power-on")
        return ", ".join(parts) or "a typical chip, with no extreme at all"


@dataclass(frozen=True, slots=True)
class Weakness:
    """A host's failure under the fewest extremes that show it.

    Attributes:
        scenario: the extremes.
        reason: what the host did wrong.
        outcome: all that is known of the run.
        board: board file with these extremes: the host fails on it in every run.
    """

    scenario: Extremes
    reason: str
    outcome: ProgramOutcome
    board: str

    def __str__(self) -> str:
        last = "\n".join(f"    {line}" for line in self.outcome.transcript[-12:])
        wrong = f"\n  {self.outcome.errors.strip()}" if self.outcome.errors.strip() else ""
        return (
            f"{self.reason}\n  under: {self.scenario}{wrong}\n"
            f"  after {self.outcome.cycles} bus cycles, the last of them:\n{last}\n"
            f"  this board file repeats it:\n{indent(self.board, '    ')}"
        )


def _toml(value: Value) -> str:
    if isinstance(value, bool):
        return "true" if value else "false"
    return f'"{value}"' if isinstance(value, str) else str(value)


def possible(board: str, scenario: Extremes) -> bool:
    """Tell whether the chips of a board file (text) may have the extremes of a scenario."""
    file, _ = read_board_text(board)
    values = {(chip, key): values for chip, key, values in extremes(file)}
    return all(value in values.get((chip, key), ()) for chip, key, value in scenario.extremes)


def with_extremes(text: str, scenario: Extremes) -> str:
    """Return a board file with the settings of ``scenario`` in it.

    Raises:
        ConfigError: a chip has no section of its own in the file.
    """
    lines = text.splitlines()
    for chip, key, value in reversed(scenario.extremes):
        line = f"{key} = {_toml(value)}"
        place = section_line(lines, rf"chips\.[\"']?{re.escape(chip)}[\"']?")
        if not place:
            raise ConfigError(
                f"the board file has no section for {chip} into which {line} could go"
            )
        lines.insert(place, line)
    keys = {"seed": str(scenario.seed)} if scenario.seed else {}
    return with_keys("\n".join(lines) + "\n", "board", keys)


@st.composite
def scenarios(draw: st.DrawFn, board: str) -> Extremes:
    """Draw scenarios for the board file ``board`` (text); they shrink to the fewest extremes."""
    file, _ = read_board_text(board)
    chosen = []
    for chip, key, values in extremes(file):
        place = draw(st.integers(0, len(values)))
        if place:
            chosen.append((chip, key, values[place - 1]))
    return Extremes(tuple(chosen), draw(st.integers(0, 9)), draw(st.integers(0, PHASES - 1)))


def play(
    board: str, host: Host, scenario: Extremes, limits: Limits | None = None, name: str = ""
) -> ProgramOutcome:
    """Run a host under one scenario.

    Args:
        board: text of a board file; its time is lockstep, or a verdict would not repeat.
        host: a function or a program; see :data:`Host`.
        scenario: the extremes.
        limits: when it counts as hanging.
        name: the board file's name, for messages.

    Raises:
        ConfigError: the board file is wrong, or its time is not lockstep.
    """
    bounds = limits if limits is not None else Limits()
    file, source = read_board_text(with_extremes(board, scenario), name or "board.toml")
    if file.board.time != "lockstep":
        raise ConfigError(
            f'{file.path}: time = "{file.board.time}"; a hostile chip needs time = "lockstep",'
            " where every run repeats"
        )
    if not callable(host):
        folder = Path(name).parent if name else None
        start = scenario.phase * PHASE
        return run_program(file, source, host, bounds, folder=folder, start=start)
    made = build(file, source)
    watch = HostWatch(made, bounds)
    made.run_for(scenario.phase * PHASE)
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


def search(
    board: str, weak: Callable[[Extremes], bool], examples: int, seed: int = 0
) -> Extremes | None:
    """Return the fewest extremes of a board file (text) that are ``weak``; None if none are found.

    Args:
        board: the board file.
        weak: tells whether something fails under a scenario, the same whenever it is asked.
        examples: how many scenarios to try at most before one fails.
        seed: of the search.
    """
    try:
        return find(
            scenarios(board),
            weak,
            settings=settings(
                max_examples=examples,
                database=None,
                deadline=None,
                phases=(Phase.generate, Phase.shrink),
                suppress_health_check=list(HealthCheck),
            ),
            random=Random(seed),
        )
    except NoSuchExample:
        return None


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
        examples: how many scenarios to play at most before one fails.
        seed: of the search.
    """
    name = str(board) if isinstance(board, Path) else ""
    text = board.read_text() if isinstance(board, Path) else board
    outcomes: dict[Extremes, ProgramOutcome] = {}

    def weak(scenario: Extremes) -> bool:
        if scenario not in outcomes:
            outcomes[scenario] = play(text, host, scenario, limits, name)
        return bool(judge(outcomes[scenario]))

    worst = search(text, weak, examples, seed)
    if worst is None:
        return None
    outcome = outcomes[worst]
    return Weakness(worst, judge(outcome), outcome, with_extremes(text, worst))
