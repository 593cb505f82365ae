"""One of the variants of a test: another part, clock or time policy, and the world it runs in."""

import re
from dataclasses import dataclass

from vbus.boardfile.sections import BoardFile
from vbus.boardfile.source import Source
from vbus.campaign.world import REFERENCE, World, of_world, with_keys
from vbus.core.errors import ConfigError


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
                f"{file.path}: hostile: a board in real time does no run twice; leave rate out"
            )
        return of_world(file, source, self.world)
