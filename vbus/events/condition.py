"""A condition that fits a board, and whether it holds as time goes on."""

from collections.abc import Callable, Iterable
from operator import eq, ge, gt, le, lt, ne
from typing import Any, Final

from msgspec import Struct, field

from vbus.circuit.circuit import Circuit
from vbus.core.kernel import NEVER
from vbus.core.signals import Reading
from vbus.core.values.lexer import ConditionError
from vbus.core.values.settings import rule_names, suggestion
from vbus.core.values.units import UnitError, parse
from vbus.events.grammar import (
    Compare,
    EventForm,
    Form,
    Function,
    Name,
    Not,
    Number,
    Several,
    Stable,
    Sum,
    is_word,
    read,
)
from vbus.events.names import COUNTS, PER_SAMPLE, PER_SECOND, Level, Names

COMMAND: Final = "command"
VIOLATION: Final = "violation"
TIME: Final = ("time",)
"""The name of chip time."""

_TRUTH: Final = "a truth"
_AMOUNT: Final = "a number"
_WORDS: Final = "a text"
_INSTANT: Final = "a time"
_COMPARE: Final[dict[str, Callable[[Any, Any], bool]]] = {
    "<=": le, ">=": ge, "==": eq, "!=": ne, "<": lt, ">": gt,
}  # fmt: skip


class Course(Struct, eq=False):
    """What has been seen of a board so far, for one condition.

    Attributes:
        now: the instant that is looked at (ps).
        due: the next instant at which a look is needed though nothing has changed; NEVER if none.
        values: the levels, by key.
        rose: levels that have risen since the last look.
        fell: levels that have fallen.
        happened: what else has: kind, chip and text.
        broken: how often each rule has been broken.
        memory: what parts of the condition remember.
    """

    now: int = 0
    due: int = NEVER
    values: dict[str, Reading] = field(default_factory=dict)
    rose: set[str] = field(default_factory=set)
    fell: set[str] = field(default_factory=set)
    happened: list[tuple[str, str, str]] = field(default_factory=list)
    broken: dict[str, int] = field(default_factory=dict)
    memory: dict[int, Any] = field(default_factory=dict)

    def change(self, key: str, value: Reading) -> None:
        """Take down the value that a level has now."""
        before = self.values.get(key, value)
        self.values[key] = value
        if isinstance(before, str) or isinstance(value, str):
            if before != value:
                self.rose.add(key)
                self.fell.add(key)
        elif value > before:
            self.rose.add(key)
        elif value < before:
            self.fell.add(key)

    def happen(self, kind: str, chip: str, text: str) -> None:
        """Take down an event."""
        self.happened.append((kind, chip, text))
        if kind == VIOLATION:
            self.broken[text] = self.broken.get(text, 0) + 1


class _Bound(Struct, frozen=True):
    """A part of a condition: what it gives, of which kind and unit."""

    give: Callable[[Course], Any]
    kind: str
    unit: str = ""
    level: Level | None = None
    constant: Any = None


class Condition:
    """A condition that has been found to make sense on a board.

    Args:
        text: the condition.
        board: the board.
        what: what it is called in messages: ``"trigger"``.

    Raises:
        ConditionError: it is none, or names what the board does not have.
    """

    def __init__(self, text: str, board: Circuit, what: str = "condition") -> None:
        self.text: str = text
        self.levels: dict[str, Level] = {}
        """What it looks at, by key."""
        self.events: set[str] = set()
        """The kinds of events it waits for."""
        self.commands: list[tuple[str, str]] = []
        """The commands it waits for, each with its chip; "" is any."""
        self.remembers: bool = False
        """Whether it needs more than what the board is at two looks."""
        self._what = what
        self._names = Names(board)
        self._slots = 0
        bound = self._bind(read(text, what))
        self._holds: Callable[[Course], bool] = self._truth(bound, 0)

    def holds(self, course: Course, now: int) -> bool:
        """Tell whether it holds at instant ``now`` (ps); ask again at ``course.due``.

        What has happened until now is over with this.
        """
        course.now, course.due = now, NEVER
        found = bool(self._holds(course))
        course.rose.clear()
        course.fell.clear()
        course.happened.clear()
        return found

    def look(self, course: Course) -> None:
        """Take down what every level is now."""
        for key, level in self.levels.items():
            course.change(key, level.value())

    def chips(self) -> list[str]:
        """Return the chips it looks into."""
        found = (level.chip for level in self.levels.values())
        return list(dict.fromkeys(chip.name for chip in found if chip is not None))

    # -- from trees to functions ----------------------------------------------------------------

    def _error(self, node: Form, problem: str, more: str = "") -> ConditionError:
        return ConditionError(self._what, self.text, node.at, problem, more)

    def _truth(self, bound: _Bound, at: int) -> Callable[[Course], bool]:
        if bound.kind in (_TRUTH, _AMOUNT):
            return bound.give
        raise self._error(
            Form(at=at), f"{bound.kind} does not hold or not: a comparison is missing"
        )

    def _bind(self, node: Form) -> _Bound:
        match node:
            case Several(word, parts):
                # All of them, always: each may have something to remember.
                gives = [self._truth(self._bind(part), part.at) for part in parts]
                join: Callable[[Iterable[object]], bool] = all if word == "and" else any
                return _Bound(lambda course: join([give(course) for give in gives]), _TRUTH)
            case Not(of):
                give = self._truth(self._bind(of), of.at)
                return _Bound(lambda course: not give(course), _TRUTH)
            case Stable(of, span):
                return self._stable(self._truth(self._bind(of), of.at), span)
            case EventForm():
                return self._event(node)
            case Compare():
                return self._compare(node)
            case Sum(terms):
                return self._sum(terms)
            case Function():
                return self._function(node)
            case Number():
                return self._number(node)
            case Name():
                return self._name(node)
        raise TypeError(f"{node!r} is no part of a condition")

    def _slot(self) -> int:
        self._slots += 1
        self.remembers = True
        return self._slots

    def _stable(self, give: Callable[[Course], bool], span: int) -> _Bound:
        slot = self._slot()

        def stable(course: Course) -> bool:
            if not give(course):
                course.memory.pop(slot, None)
                return False
            end = course.memory.setdefault(slot, course.now) + span
            if course.now < end:
                course.due = min(course.due, end)
            return bool(course.now >= end)

        return _Bound(stable, _TRUTH)

    def _event(self, node: EventForm) -> _Bound:
        wanted = node.text
        if node.kind == VIOLATION:
            known = rule_names(self._names.rules)
            if wanted and wanted not in known:
                hint = suggestion(wanted, sorted(known))
                raise self._error(
                    node, f'no rule "{wanted}"', f"{hint}there are {', '.join(sorted(known))}"
                )
            return self._happens(
                VIOLATION, "", lambda text: wanted in ("", text, text.partition(".")[0])
            )
        return self._command(node, wanted, "")

    def _command(self, node: Form, wanted: str, chip: str) -> _Bound:
        known = self._names.mnemonics(chip)
        if known and wanted.replace("_", "").isalnum() and wanted.isupper() and wanted not in known:
            hint = suggestion(wanted, known)
            raise self._error(node, f'no command "{wanted}"', f"{hint}there are {', '.join(known)}")
        self.commands.append((chip, wanted))
        starts = (f"{wanted} ", f"write {wanted} ")
        return self._happens(COMMAND, chip, lambda text: f"{text} ".startswith(starts))

    def _happens(self, kind: str, chip: str, fits: Callable[[str], bool]) -> _Bound:
        self.events.add(kind)
        return _Bound(
            lambda course: any(
                seen == kind and chip in ("", of) and fits(text)
                for seen, of, text in course.happened
            ),
            _TRUTH,
        )

    def _compare(self, node: Compare) -> _Bound:
        for name, word in ((node.left, node.right), (node.right, node.left)):
            command = self._command_of(name, word) if node.sign == "==" else None
            if command is not None:
                return command
        left, right = self._side(node.left, node.right), self._side(node.right, node.left)
        kinds = {_AMOUNT if side.kind == _TRUTH else side.kind for side in (left, right)}
        if len(kinds) > 1:
            raise self._error(node.right, f"{left.kind} is compared with {right.kind}")
        compare = _COMPARE[node.sign]
        one, other = left.give, right.give
        if left.kind == _INSTANT:
            ends = [side.constant for side in (left, right) if side.constant is not None]

            def in_time(course: Course) -> bool:
                for end in ends:
                    if end >= course.now:
                        course.due = min(course.due, max(end, course.now + 1))
                return compare(one(course), other(course))

            return _Bound(in_time, _TRUTH)
        return _Bound(lambda course: compare(one(course), other(course)), _TRUTH)

    def _command_of(self, name: Form, word: Form) -> _Bound | None:
        """Return what ``x.command == STT`` means."""
        if not isinstance(name, Name) or not isinstance(word, Name) or not is_word(word):
            return None
        if len(name.parts) != 2 or name.parts[1] != COMMAND:
            return None
        chip, wanted = name.parts[0], word.text
        return self._command(word, wanted, chip) if self._names.has_chip(chip) else None

    def _side(self, node: Form, other: Form) -> _Bound:
        """Return one side of a comparison; beside a text a word is a text."""
        if isinstance(node, Name) and is_word(node) and isinstance(other, Name):
            level = self._names.find(other.parts)
            if level is not None and level.text:
                return _Bound(lambda _: node.text, _WORDS)
        bound = self._bind(node)
        if isinstance(node, Number) and bound.unit:
            return self._in_unit_of(bound, node, other)
        return bound

    def _in_unit_of(self, bound: _Bound, node: Number, other: Form) -> _Bound:
        """Return a number with a unit as the other side of its comparison counts it."""
        unit, level = self._unit_of(other)
        factor = 1.0
        if bound.unit == PER_SECOND and unit == PER_SAMPLE and level is not None:
            chip = level.chip
            if chip is None or not chip.PERIOD_CLK:
                raise self._error(node, "the sample of this chip may be set otherwise", PER_SAMPLE)
            factor = chip.PERIOD_CLK / chip.clock.hz
        elif bound.unit != unit:
            allowed = {PER_SAMPLE: f"{PER_SAMPLE} or {PER_SECOND}"}.get(unit, unit or "none")
            raise self._error(node, f'the unit here is not "{bound.unit}"', f"allowed: {allowed}")
        value = bound.constant * factor
        return _Bound(lambda _: value, _AMOUNT, constant=value)

    def _unit_of(self, node: Form) -> tuple[str, Level | None]:
        """Return the unit of a side of a comparison, and a level of it."""
        match node:
            case Name(parts):
                level = self._names.find(parts)
                return (level.unit, level) if level is not None else ("", None)
            case Function(_, of):
                return self._unit_of(of)
            case Sum(terms):
                return self._unit_of(terms[0][1])
        return "", None

    def _sum(self, terms: tuple[tuple[bool, Form], ...]) -> _Bound:
        gives = []
        for minus, term in terms:
            bound = self._bind(term)
            if bound.kind not in (_AMOUNT, _TRUTH) or (bound.constant is not None and bound.unit):
                raise self._error(term, "only plain numbers are added, not what stands")
            gives.append((-1 if minus else 1, bound.give))
        return _Bound(lambda course: sum(sign * give(course) for sign, give in gives), _AMOUNT)

    def _function(self, node: Function) -> _Bound:
        bound = self._bind(node.of)
        if bound.kind not in (_AMOUNT, _TRUTH) and not (
            bound.kind == _WORDS and node.name in ("changed", "previous")
        ):
            raise self._error(node.of, f"{node.name}() is not of {bound.kind}, as it stands")
        give = bound.give
        if node.name == "abs":
            return _Bound(lambda course: abs(give(course)), _AMOUNT)
        if node.name == "previous":
            slot = self._slot()

            def previous(course: Course) -> Any:
                value = give(course)
                latest, before = course.memory.get(slot, (value, value))
                if value != latest:
                    latest, before = value, latest
                course.memory[slot] = latest, before
                return before

            return _Bound(previous, bound.kind)
        level = bound.level
        if level is not None and level.bit < 0:
            key, name = level.key, node.name
            return _Bound(
                lambda course: (
                    (name != "falling" and key in course.rose)
                    or (name != "rising" and key in course.fell)
                ),
                _TRUTH,
            )

        place = self._slot()

        def moved(course: Course) -> bool:
            value = give(course)
            before = course.memory.get(place, value)
            course.memory[place] = value
            if node.name == "changed":
                return bool(value != before)
            return bool(value > before if node.name == "rising" else value < before)

        return _Bound(moved, _TRUTH)

    def _number(self, node: Number) -> _Bound:
        value: int | float = node.value
        if not node.unit or node.unit in (COUNTS, PER_SAMPLE, PER_SECOND):
            return _Bound(lambda _: value, _AMOUNT, node.unit, constant=value)
        try:
            instant = int(parse(f"{value} {node.unit}", "s"))
        except UnitError as error:
            more = f"{error}; or {COUNTS}, {PER_SAMPLE}, {PER_SECOND}"
            raise self._error(node, f'no unit "{node.unit}" of the number', more) from None
        return _Bound(lambda _: instant, _INSTANT, constant=instant)

    def _name(self, node: Name) -> _Bound:
        level = self._names.find(node.parts)
        if level is not None:
            self.levels.setdefault(level.key, level)
            key, bit = level.key, level.bit
            if bit >= 0:
                return _Bound(lambda course: int(course.values[key]) >> bit & 1, _AMOUNT)
            kind = _WORDS if level.text else _AMOUNT
            return _Bound(lambda course: course.values[key], kind, level.unit, level)
        if node.text in self._names.rules:
            rule = node.text
            self.events.add(VIOLATION)
            return _Bound(lambda course: course.broken.get(rule, 0) > 0, _TRUTH)
        if node.parts == TIME:
            return _Bound(lambda course: course.now, _INSTANT)
        raise self._error(node, f'no "{node.text}"', self._names.help(node.parts))
