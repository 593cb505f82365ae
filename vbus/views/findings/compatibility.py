"""What a driver written for another part does that this one takes differently."""

from collections.abc import Iterator, Mapping
from typing import ClassVar

from vbus.chips.family import Family
from vbus.circuit.stream import PacketReader
from vbus.core.errors import ConfigError
from vbus.core.signals import Rule, Violation
from vbus.views.findings.report import Report


class Uses:
    """The bus cycles of one chip, seen with the eyes of a driver for another part."""

    RULES: ClassVar[tuple[Rule, ...]] = ()
    """What it may find, each with the clause of the part that is there."""

    def cycle(self, write: bool, address: int, data: int) -> Iterator[tuple[Rule, str]]:
        """Give what the cycle means on the other part: rule, and a sentence."""
        raise NotImplementedError


class Compatibility(PacketReader):
    """Files a note for each use of a chip that another part takes differently.

    Args:
        other: the other part, such as ``"hctl-1100"``.
        families: the families of the chips, by name of chip.
        report: takes the notes; it reads each bus cycle before.

    Raises:
        ConfigError: no chip is compatible with such a part; says with what they are.
    """

    def __init__(self, other: str, families: Mapping[str, Family], report: Report) -> None:
        self._report: Report = report
        self._uses: dict[str, Uses] = {}
        for chip, family in families.items():
            if other in family.compatibility:
                self._uses[chip] = family.compatible_with(other, Uses)()
        if not self._uses:
            parts = {name for family in families.values() for name in family.compatibility}
            known = ", ".join(sorted(parts)) or "none"
            raise ConfigError(f'no chip of this run stands in for "{other}"; known are {known}')
        for uses in {type(uses): uses for uses in self._uses.values()}.values():
            report.rules = [*report.rules, *uses.RULES]

    def bus_cycle(
        self, when: int, host: str, chip: str, write: bool, address: int, data: int
    ) -> None:
        """Look at a bus cycle."""
        uses = self._uses.get(chip)
        if uses is None:
            return
        for rule, detail in uses.cycle(write, address, data):
            self._report.violation(
                Violation(when, chip, rule.name, rule.clause, rule.severity, 0, 0, detail)
            )
