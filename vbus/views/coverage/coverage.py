"""Which parts of a datasheet a host has exercised, in one run or in many."""

from collections.abc import Iterable
from dataclasses import dataclass, field
from typing import Final

import msgspec

from vbus.chips.base import CONNECTOR_FAMILY
from vbus.chips.packets import Packet
from vbus.circuit.stream import PacketReader
from vbus.core.errors import VbusError
from vbus.core.signals import Violation
from vbus.core.values.settings import suggestion
from vbus.views.coverage.tables import COUNTED, Item, Key, exercised, items

FORMAT: Final = "vbus coverage"
VERSION: Final = 1


@dataclass(slots=True)
class Coverage:
    """How often each thing a host can do to a chip family has been done.

    Attributes:
        runs: what went into it, for people.
        counts: by family, then by group and name.
        tests: what each test of a suite has exercised, by its name, then by family.
    """

    runs: list[str] = field(default_factory=list)
    counts: dict[str, dict[Key, int]] = field(default_factory=dict)
    tests: dict[str, dict[str, set[Key]]] = field(default_factory=dict)

    def add(self, family: str, key: Key, number: int = 1) -> None:
        """Count something as done ``number`` times."""
        counts = self.counts.setdefault(family, {})
        counts[key] = counts.get(key, 0) + number

    def merge(self, other: "Coverage") -> None:
        """Add everything another coverage has."""
        self.runs += other.runs
        for family, counts in other.counts.items():
            self.counts.setdefault(family, {})
            for key, number in counts.items():
                self.add(family, key, number)
        for test, found in other.tests.items():
            mine = self.tests.setdefault(test, {})
            for family, keys in found.items():
                mine.setdefault(family, set()).update(keys)

    def of_test(self, test: str) -> "Coverage":
        """Return what a test exercises, each thing as often as it is known to: once.

        Raises:
            VbusError: there is no such test.
        """
        if test not in self.tests:
            hint = suggestion(test, self.tests)
            sentence = f"there is no test {test!r} in this coverage, which has {len(self.tests)}"
            raise VbusError(f"{sentence}; {hint}".rstrip("; "))
        found = self.tests[test]
        return Coverage([test], {family: dict.fromkeys(keys, 1) for family, keys in found.items()})

    def tests_of(self, family: str, item: Item) -> list[str]:
        """Return the tests that exercise ``item``, in alphabetical order."""
        found = self.tests.items()
        return sorted(test for test, keys in found if item.key in keys.get(family, ()))

    def count(self, family: str, item: Item) -> int:
        """Return how often ``item`` was exercised."""
        return self.counts.get(family, {}).get(item.key, 0)

    def families(self) -> list[str]:
        """Return the chip families that took part, in alphabetical order."""
        return sorted(self.counts)

    def groups(self, family: str) -> dict[str, list[tuple[Item, int]]]:
        """Return the items of each group, in the order of the manual, with their counts."""
        found: dict[str, list[tuple[Item, int]]] = {}
        for item in items(family):
            found.setdefault(item.group, []).append((item, self.count(family, item)))
        return found

    def share(self, family: str | None = None) -> tuple[int, int]:
        """Return how many items were exercised, and of how many; of all families if None."""
        done = total = 0
        for one in self.families() if family is None else [family]:
            for item in items(one):
                if item.group in COUNTED:
                    total += 1
                    done += self.count(one, item) > 0
        return done, total

    def percent(self) -> float:
        """Return the part exercised in percent; 100 if there is nothing to exercise."""
        done, total = self.share()
        # A family without tables cannot fail a limit on coverage.
        return 100.0 * done / total if total else 100.0

    def shown(self, family: str | None = None) -> str:
        """Return the part exercised as people read it, rounded down: what falls short shows so."""
        done, total = self.share(family)
        # Rounded down: 99.96 % must not read as all.
        return f"{1000 * done // total / 10:.1f}%" if total else "-"

    def missing_from(self, other: "Coverage") -> list[tuple[str, Item]]:
        """Return what this one exercises and ``other`` does not."""
        return [
            (family, item)
            for family in self.families()
            for item in items(family)
            if self.count(family, item) and not other.count(family, item)
        ]

    # -- as a file ----------------------------------------------------------------------------

    def to_json(self) -> bytes:
        """Return it as a JSON document that :func:`from_json` reads."""
        percent, tests = round(self.percent(), 2), self.tests
        document = _Document(
            format=FORMAT, version=VERSION, percent=percent, runs=self.runs, families={},
            tests={test: _by_group(tests[test]) for test in sorted(tests)},
        )  # fmt: skip
        for family in self.families():
            made = document.families[family] = _FamilyCounts(*self.share(family))
            for name, found in self.groups(family).items():
                made.groups[name] = {item.name: count for item, count in found}
        return msgspec.json.format(msgspec.json.encode(document), indent=1) + b"\n"


def _by_group(found: dict[str, set[Key]]) -> dict[str, dict[str, list[str]]]:
    families: dict[str, dict[str, list[str]]] = {}
    for family, keys in sorted(found.items()):
        groups = families.setdefault(family, {})
        for group, name in sorted(keys):
            groups.setdefault(group, []).append(name)
    return families


class _FamilyCounts(msgspec.Struct):
    exercised: int = 0
    of: int = 0
    groups: dict[str, dict[str, int]] = {}


class _Document(msgspec.Struct, kw_only=True, omit_defaults=True):
    format: str
    version: int
    percent: float = -1.0
    runs: list[str]
    families: dict[str, _FamilyCounts]
    tests: dict[str, dict[str, dict[str, list[str]]]] = {}


def from_json(text: bytes, name: str) -> Coverage:
    """Read what :meth:`Coverage.to_json` made.

    What the tables of this version do not have any more is left out.

    Args:
        text: the document.
        name: what to call it in an error.

    Raises:
        VbusError: it is no such document, or of a later version.
    """
    try:
        document = msgspec.json.decode(text, type=_Document)
    except msgspec.MsgspecError as error:
        raise VbusError(f"{name}: neither a journal nor a coverage file: {error}") from None
    if document.format != FORMAT:
        raise VbusError(f'{name}: its format is "{document.format}", not "{FORMAT}"')
    # Earlier ones lack keys that have defaults; a later one may mean the same key otherwise.
    if document.version > VERSION:
        raise VbusError(
            f"{name}: coverage of version {document.version}; this vbus reads up to {VERSION}"
        )
    coverage = Coverage(list(document.runs))
    for family, found in document.families.items():
        known = {item.key for item in items(family)}
        coverage.counts[family] = {
            (group, item): count
            for group, counts in found.groups.items()
            for item, count in counts.items()
            # A row that the tables lost would count above 100 %.
            if count > 0 and (group, item) in known
        }
    for test, families in document.tests.items():
        coverage.tests[test] = {
            family: {(group, name) for group, names in groups.items() for name in names}
            & {item.key for item in items(family)}
            for family, groups in families.items()
        }
    return coverage


class CoverageObserver(PacketReader):
    """Fills a :class:`Coverage` while it sees a board run, or a journal afterwards.

    Args:
        families: chip families by name of chip.
        run: what to call the run.
    """

    def __init__(self, families: dict[str, str], run: str) -> None:
        # The connector of a card has no table: its chips are counted by themselves.
        chips = [family for family in families.values() if family != CONNECTOR_FAMILY]
        self.coverage: Coverage = Coverage([run], {family: {} for family in chips})
        self._families: dict[str, str] = families
        self._rules: dict[str, Key] = {
            item.name: item.key
            for family in set(families.values())
            for item in items(family)
            if item.group not in COUNTED
        }

    def packet(self, chip: str, packet: Packet) -> None:
        """Count what a packet exercises."""
        family = self._families[chip]
        for key in exercised(family, packet):
            self.coverage.add(family, key)

    def violation(self, violation: Violation) -> None:
        """Count a broken rule."""
        family = self._families.get(violation.chip)
        key = self._rules.get(violation.rule)
        if family is not None and key is not None:
            self.coverage.add(family, key)


def merged(parts: Iterable[Coverage]) -> Coverage:
    """Return several coverages as one."""
    whole = Coverage()
    for part in parts:
        whole.merge(part)
    return whole
