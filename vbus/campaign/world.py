"""One world of a campaign: what is otherwise in it, and how a board comes to be so."""

import re
from collections.abc import Mapping
from typing import Final, NamedTuple

from msgspec import Struct

from vbus.board.board import Board
from vbus.board.config import read_board_text
from vbus.boardfile.sections import BoardFile
from vbus.boardfile.source import Source
from vbus.core.errors import ConfigError
from vbus.core.options import Value
from vbus.core.values.settings import among
from vbus.faults.faults import Faults
from vbus.faults.row import COUNTED, LINK
from vbus.faults.table import faults
from vbus.faults.trigger import read_when
from vbus.plugins import chip_class, family_of
from vbus.protocols.quantities import format_instant, parse_duration

CYCLE: Final = "cycle"
INTERRUPT: Final = "interrupt"
PHASE: Final = "phase"
SPECIMEN: Final = "specimen"
FLOATING: Final = "floating"
FAULT: Final = "fault"
THREADS: Final = "threads"
DIMENSIONS: Final = (CYCLE, INTERRUPT, PHASE, SPECIMEN, FLOATING, FAULT, THREADS)

FLIP: Final = "flip"
"""A bit of the byte is inverted on its way: ``flip0`` to ``flip7``."""
LOST: Final = "lost"
DOUBLED: Final = "doubled"
BUSY: Final = "busy"
LATE: Final = "late"
WAYS: Final = (FLIP, LOST, DOUBLED, BUSY, LATE)
"""What can happen to one bus cycle."""
NO_TURNS: Final = "only threads of a program with a card, under vbus exec, take turns"
NO_LINK: Final = "a test has no link that could break: it runs in the process of the board"
ORDER: Final = "order"
"""Before the seed by which threads of a program have their turns: ``order17``."""
EARLY: Final = "early"
AHEAD: Final = "ahead"
_FAULTS: Final = {
    LOST: "strobe_lost",
    DOUBLED: "strobe_doubled",
    BUSY: "busy_longest",
    LATE: "answer_late",
}
_HOWS: Final = {
    CYCLE: rf"{FLIP}\d+|{'|'.join(_FAULTS)}",
    INTERRUPT: rf"({EARLY}|{LATE})\d+-[01]",
    PHASE: AHEAD,
    FLOATING: "[01]",
    THREADS: rf"{ORDER}\d+",
}
"""What may be said of the way of a world, by dimension."""


class Arming(NamedTuple):
    """A fault that makes a world: what :meth:`vbus.faults.faults.Faults.arm` takes."""

    name: str
    target: str
    when: str | int | None
    until: str | int | None
    parameters: dict[str, Value]


class World(Struct, frozen=True, order=True):
    """What is otherwise in one run.

    Attributes:
        dimension: one of :data:`DIMENSIONS`; "" in the reference run.
        where: chip and number of the bus cycle (``"x.17"``), output and instant in ps
            (``"x.HI@1200"``), how far the chips are ahead (``"+64us"``), chip, or fault's target
            and instant (``"x.1@1200"``), and for how long (``"x.1@1200+500"``, ps) if not to the
            end; "program" for its threads.
        how: the way it is broken, or settings of chips (``"x.busy=worst,x.reset_status=C4"``).
        seed: of the board; 0 is that of its file.
    """

    dimension: str = ""
    where: str = ""
    how: str = ""
    seed: int = 0

    def __str__(self) -> str:
        text = f"{self.dimension}:{self.where}:{self.how}"
        return f"{text}:{self.seed}" if self.seed else text

    @property
    def way(self) -> str:
        """The column it stands in: its way, without the number of a bit or a span."""
        if self.dimension in (CYCLE, INTERRUPT):
            return self.how.rstrip("0123456789-")
        return faults()[self.how].family if self.dimension == FAULT else self.dimension

    @property
    def settings(self) -> tuple[tuple[str, str, str], ...]:
        """Settings of chips: chip, key, value."""
        if self.dimension != SPECIMEN or not self.how:
            return ()
        return tuple(
            (chip, key, value)
            for part in self.how.split(",")
            for chip, _, rest in [part.partition(".")]
            for key, _, value in [rest.partition("=")]
        )

    @property
    def ahead(self) -> int:
        """How long the board runs before its host begins (ps)."""
        return parse_duration(self.where[1:]) if self.dimension in (PHASE, SPECIMEN) else 0

    @property
    def order(self) -> int:
        """Seed of the order in which threads have their turns; 0: as they were created."""
        return int(self.how.removeprefix(ORDER)) if self.dimension == THREADS else 0

    @property
    def allowed(self) -> bool:
        """Whether nothing is broken in it: a right driver does in it what it does elsewhere."""
        return self.dimension in (PHASE, SPECIMEN, THREADS)

    @property
    def of_host(self) -> bool:
        """Whether it is of a program's threads or its link, and not of the board."""
        link = self.dimension == FAULT and faults()[self.how].target == LINK
        return self.dimension == THREADS or link

    def arming(self) -> Arming | None:
        """Return the fault that makes it, if one does."""
        place, _, instant = self.where.partition("@")
        if self.dimension == CYCLE:
            chip, _, number = place.rpartition(".")
            bit = self.how.removeprefix(FLIP)
            if bit != self.how and bit not in tuple("01234567"):
                raise ValueError(f"there is no D{bit}; write flip0 to flip7")
            name, given = ("byte_flipped", {"mask": 1 << int(bit)}) if bit != self.how else ("", {})
            cycle = f"cycle {number}"
            return Arming(name or _FAULTS[self.how], chip, cycle, "once", dict(given))
        if self.dimension == INTERRUPT:
            span, level = (int(number) for number in re.findall(r"\d+", self.how))
            return Arming("net_stuck", place, int(instant), span, {"level": level})
        if self.dimension == FLOATING:
            return Arming("bus_pulled", place, None, None, {"level": int(self.how)})
        if self.dimension == FAULT:
            row = faults().get(self.how)
            # A link without answers for good says nothing of a host that asks again.
            one = row is not None and row.target == LINK and row.acts == COUNTED
            begin, _, lasts = instant.partition("+")
            until = "once" if one else int(lasts) if lasts else None
            return Arming(self.how, place, int(begin), until, {})
        return None

    def sentence(self) -> str:
        """Say what is otherwise."""
        place, _, instant = self.where.partition("@")
        instant, _, lasts = instant.partition("+")
        when = f" at {format_instant(int(instant))}" if instant else ""
        when += f" for {format_instant(int(lasts))}" if lasts else ""
        if self.dimension == CYCLE:
            chip, _, number = place.rpartition(".")
            what = {
                LOST: "its strobe is lost",
                DOUBLED: "its strobe is doubled",
                BUSY: "busy as long as the manual allows",
                LATE: "its answer comes too late",
            }.get(self.how, f"D{self.how.removeprefix(FLIP)} is inverted")
            return f"cycle {number} of {chip}: {what}"
        if self.dimension == INTERRUPT:
            span, level = (int(number) for number in re.findall(r"\d+", self.how))
            return f"{place} is {level} for {format_instant(span)}{when}"
        if self.dimension == FLOATING:
            return f"undriven data lines of {place} show {self.how}"
        if self.dimension == FAULT:
            return f"{self.how} of {place}{when}"
        if self.dimension == THREADS:
            return f"threads of the program in the order of seed {self.order}"
        ahead = f"the chips {self.where.removeprefix('+')} ahead" if self.ahead else ""
        seed = f"seed = {self.seed}" if self.seed else ""
        settings = [f"{chip}.{key} = {_toml(value)}" for chip, key, value in self.settings]
        return ", ".join(filter(None, (*settings, seed, ahead))) or "nothing is otherwise"


REFERENCE: Final = World()


def read_dimensions(text: str | None) -> tuple[str, ...]:
    """Return the dimensions that a text names, with commas between; all of them for None.

    Raises:
        ValueError: there is no such dimension.
    """
    names = DIMENSIONS if text is None else tuple(name.strip() for name in text.split(","))
    for name in names:
        if name not in DIMENSIONS:
            known = among(name, DIMENSIONS, "there are")
            raise ValueError(f'there is no dimension "{name}"; {known}')
    return names


def read_world(text: str) -> World:
    """Return the world that a text names, as :class:`World` prints it.

    Raises:
        ValueError: it names none.
    """
    dimension, *rest = text.split(":")
    if dimension not in DIMENSIONS:
        raise ValueError(f"{text!r}: {among(dimension, DIMENSIONS, 'dimensions are')}")
    if len(rest) not in (2, 3) or (len(rest) == 3 and not rest[2].isdecimal()):
        raise ValueError(f"{text!r}: a world is DIMENSION:WHERE:HOW, perhaps with :SEED")
    world = World(dimension, rest[0], rest[1], int(rest[2]) if len(rest) == 3 else 0)
    try:
        if dimension in _HOWS and not re.fullmatch(_HOWS[dimension], world.how):
            raise ValueError(f'"{world.how}" is no way of this dimension')
        world.sentence()
        arming = world.arming()
        if arming is not None:
            read_when(arming.when)
            Faults.find(arming.name)
        if min(world.ahead, world.order) < 0 or any(
            not (chip and key) for chip, key, _ in world.settings
        ):
            raise ValueError("settings are CHIP.KEY=VALUE, and time goes forward")
    except (KeyError, ValueError) as error:
        raise ValueError(f"{text!r} names no world: {error}") from None
    return world


def begin(board: Board, world: World) -> None:
    """Make a board, built and at instant 0, what it is in a world.

    Raises:
        ValueError: the board cannot be so; the message says why.
    """
    board.run_for(world.ahead)
    arm(board, world)


def arm(board: Board, world: World) -> None:
    """Break on a board what is broken in a world.

    Raises:
        ValueError: the board cannot be so; the message says why.
    """
    arming = world.arming()
    if arming is not None:
        name, target, when, until, parameters = arming
        board.faults.arm(name, target, when, until, **parameters)


# -- settings of chips ----------------------------------------------------------------------------


def extremes(file: BoardFile) -> list[tuple[str, str, tuple[Value, ...]]]:
    """Return the settings of a board's chips that silicon may differ in: chip, key, values.

    They are the rows of the chips' OPTIONS that name extremes. A setting the board file fixes
    stays as it is there.
    """
    return [
        (chip.name, option.name, option.extremes)
        for chip in file.chips
        for option in chip_class(chip.part).OPTIONS
        if option.extremes and option.name not in chip.settings
    ]


def possible(file: BoardFile, world: World) -> bool:
    """Tell whether the chips of a board may have the settings of a world."""
    values = {(chip, key): [str(value) for value in values] for chip, key, values in extremes(file)}
    return all(value in values.get((chip, key), ()) for chip, key, value in world.settings)


def of_world(file: BoardFile, source: Source, world: World) -> tuple[BoardFile, Source]:
    """Return a board file with the settings of a world.

    Raises:
        ConfigError: a chip has no section of its own in the file, the board is in real time, or the
            world is of a program's threads or link, which are no part of a board.
    """
    # A world is judged by a run that repeats.
    if world != REFERENCE and file.board.time == "realtime":
        raise ConfigError(
            f"{file.path}: in real time no two runs are alike; the board must be lockstep or slaved"
        )
    if world.of_host:
        raise ConfigError(f"{world}: {NO_TURNS if world.order else NO_LINK}")
    if not world.settings and not world.seed:
        return file, source
    return read_board_text(with_settings(source.text, world), file.path)


def with_settings(text: str, world: World) -> str:
    """Return a board file (text) with the settings of a world in it.

    Raises:
        ConfigError: a chip has no section of its own in the file.
    """
    lines = text.splitlines()
    # In at the top of each section, so the last one goes in first.
    for chip, key, value in reversed(world.settings):
        line = f"{key} = {_toml(value)}"
        place = section_line(lines, rf"chips\.[\"']?{re.escape(chip)}[\"']?")
        if not place:
            raise ConfigError(
                f"the board file has no section for {chip} into which {line} could go"
            )
        lines.insert(place, line)
    keys = {"seed": str(world.seed)} if world.seed else {}
    return with_keys("\n".join(lines) + "\n", "board", keys)


def _toml(value: str) -> str:
    return value if re.fullmatch(r"\d+|true|false", value) else f'"{value}"'


def section_line(lines: list[str], pattern: str) -> int:
    """Return the number of the line after a section's heading; 0 if it has none."""
    for number, line in enumerate(lines):
        if re.match(rf"\s*\[\s*{pattern}\s*\]", line):
            return number + 1
    return 0


def with_keys(text: str, section: str, keys: Mapping[str, str]) -> str:
    """Return a board file whose ``[section]`` has ``keys`` (TOML values) in place of its own."""
    if not keys:
        return text
    lines = text.splitlines()
    place = section_line(lines, re.escape(section))
    if not place:
        lines += ["", f"[{section}]"]
        place = len(lines)
    end = next((i for i in range(place, len(lines)) if lines[i].lstrip().startswith("[")), None)
    others = [
        line
        for line in lines[place:end]
        if (key := re.match(r"\s*[\"']?([\w-]+)[\"']?\s*=", line)) is None or key[1] not in keys
    ]
    lines[place:end] = [*(f"{key} = {value}" for key, value in keys.items()), *others]
    return "\n".join(lines) + "\n"


def longest_cycle(board: Board) -> int:
    """Return the longest cycle of the board's chips (ps), as after a reset; 0: none says it."""
    return max(
        (
            chip.clock.ps(int(clocks)) - chip.clock.ps(0)
            for chip in board.chips
            if not chip.CONNECTOR and (clocks := family_of(chip.part).object("cycle"))
        ),
        default=0,
    )
