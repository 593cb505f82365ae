"""Board files as tests want them: found, put together from a part number, and adapted."""

import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path

from vbus import plugins
from vbus.board.config import read_board_text
from vbus.boardfile.sections import BoardFile
from vbus.boardfile.source import Source
from vbus.campaign.world import REFERENCE, World, of_world, with_keys
from vbus.chips.family import Family
from vbus.core.errors import ConfigError
from vbus.core.kernel import Clock, Kernel
from vbus.core.values.units import parse


def default_part() -> str:
    """Return the part on a board of which nothing is said."""
    return typical_part(plugins.families()[0])


def typical_part(family: Family, start: str = "") -> str:
    """Return a part of a family, by the beginning of its number."""
    parts = (*family.typical, *plugins.chip_of(family).PARTS)
    return next((part for part in parts if part.startswith(start)), start)


def of_part(part: str, plant: str = "", clock: str = "") -> str:
    """Return a board file with one chip, called ``x``; see :func:`of_parts`."""
    return of_parts([part], plant, clock)


def of_parts(parts: Sequence[str], plant: str = "", clock: str = "") -> str:
    """Return a board file with these chips, called ``x``, ``y``, ``z``, ``x4`` and so on.

    Args:
        parts: part numbers as ordered.
        plant: plant model on each axis; "" for the usual one of the family.
        clock: frequency at CLK; "" for the usual one.

    Raises:
        ConfigError: no such part.
    """
    text = f'[board]\nname = "{"-".join(parts).lower()}"\n'
    for number, part in enumerate(parts):
        name = "xyz"[number] if number < len("xyz") else f"x{number + 1}"
        motor = f"{name}_motor" if number else "motor"
        family = plugins.family_of(part)
        axes = _axes(family, part)
        names = [f"{motor}{axis + 1}" for axis in range(axes)] if axes > 1 else [motor] * axes
        fitted = (
            f"plants = {names}".replace("'", '"') if axes > 1 else f'plant = "{motor}"\n' * axes
        )
        model = plant or family.plant
        motors = "".join(f'\n[plants.{one}]\nmodel = "{model}"\n' for one in names)
        text += (
            f'\n[chips.{name}]\npart = "{part}"\n'
            f'clock = "{clock or family.clock}"\n{fitted.rstrip()}\n{motors}'
        )
    return text


def _axes(family: Family, part: str) -> int:
    """Return how many axes a part has; a part that does not exist has those of its family."""
    chip = plugins.chip_of(family)
    try:
        return chip("x", part, Kernel(), Clock(int(parse(family.clock, "Hz")))).axis_count
    except ValueError:
        return chip.AXES


def board_text(
    board: str | Path, near: Iterable[Path], plant: str = "", clock: str = ""
) -> tuple[str, str]:
    """Return a board file's text and its name.

    Args:
        board: path of a board file, its text, or a part number.
        near: folders a relative path is looked for in.
        plant: with a part number: the plant model.
        clock: with a part number: the clock.

    Raises:
        ConfigError: there is no such file or part.
    """
    named = str(board)
    if "\n" in named:
        return named, "board.toml"
    if isinstance(board, str) and not named.endswith(".toml"):
        return of_part(named, plant, clock), f"{named.lower()}.toml"
    folders = list(near)
    found = next((path for folder in folders if (path := folder / named).is_file()), None)
    if found is None:
        looked = ", ".join(map(str, folders))
        raise ConfigError(f"{named}: there is no such board file; looked for it in {looked}")
    return found.read_text(), str(found)


def for_test(
    text: str, name: str, seed: int | None = None, rate: float | None = None, strict: bool = False
) -> tuple[BoardFile, Source]:
    """Return a board file as a test runs it: repeatable, unless it wants real time.

    Args:
        text: the file.
        name: its name.
        seed: replaces the file's; None keeps it.
        rate: chip seconds per second of wall time; None makes real time lockstep.
        strict: let a bus cycle that breaks a datasheet be lost.

    Raises:
        ConfigError: the file has mistakes; their lines are those of the file.
    """
    file, source = read_board_text(text, name)
    keys: dict[str, str] = {}
    if rate is not None:
        keys |= {"time": '"realtime"', "rate": str(rate)}
    elif file.board.time == "realtime":
        keys["time"] = '"lockstep"'
    if seed is not None and seed != file.board.seed:
        keys["seed"] = str(seed)
    changed = with_keys(text, "board", keys)
    if strict:
        changed = with_keys(changed, "violations", {"default": '"strict"'})
    return (file, source) if changed == text else read_board_text(changed, name)


@dataclass(frozen=True, slots=True)
class Variant:
    """What is otherwise on the board of a test, in this variant of it.

    Attributes:
        part: part number of the chips; "" for those of the test.
        clock: frequency at CLK; "" for that of the test.
        time: time policy; "" for that of the test.
        seed: of the board; None for that of the test.
        hostile: how many specimens are tried.
        world: what else is otherwise.
    """

    part: str = ""
    clock: str = ""
    time: str = ""
    seed: int | None = None
    hostile: int = 0
    world: World = REFERENCE

    def of_board(self, text: str, name: str) -> str:
        """Return a board file with this part, clock and time policy.

        Raises:
            ConfigError: it has no section for a chip.
        """
        keys = {
            key: f'"{value}"'
            for key, value in (("part", self.part), ("clock", self.clock))
            if value
        }
        sections = re.findall(r"^\s*\[\s*(chips\.[\w-]+)\s*\]", text, re.MULTILINE)
        if keys and not sections:
            raise ConfigError(f"{name}: it has no section [chips.NAME] for {', '.join(keys)}")
        for section in sections:
            text = with_keys(text, section, keys)
        return with_keys(text, "board", {"time": f'"{self.time}"'} if self.time else {})

    def in_world(self, file: BoardFile, source: Source) -> tuple[BoardFile, Source]:
        """Return a board file as it is in the world of this variant.

        Raises:
            ConfigError: it is in real time, where no run repeats.
        """
        if self.hostile and file.board.time == "realtime":
            raise ConfigError(
                f"{file.path}: hostile: a board in real time never repeats a run; leave rate out"
            )
        return of_world(file, source, self.world)
