"""When a fault begins and when it ends, as text and as numbers."""

from typing import Final

from msgspec import Struct

from vbus.core.kernel import END, SECOND
from vbus.core.values.lexer import ConditionError
from vbus.core.values.settings import quoted, suggestion
from vbus.core.values.units import UnitError, parse
from vbus.events.grammar import is_word, read
from vbus.faults.row import LASTS, ONCE, Fault

NOW: Final = "now"
AT: Final = "at"
CYCLE: Final = "cycle"
POSITION: Final = "position"
COMMAND: Final = "command"
EDGE: Final = "edge"
RATE: Final = "rate"
CONDITION: Final = "condition"

CLEARED: Final = "cleared"
FOR: Final = "for"

WHEN_FORMS: Final = (
    '"now", "at 5 ms", "cycle 12", "position 1000", "command LTRJ" (or a register\'s name),'
    ' "edge x./RST low", "rate 10 Hz" or a condition such as "x.real > 400 and x.HI == 1"'
)
UNTIL_FORMS: Final = '"once", "for 5 ms" or "cleared"'


class When(Struct, frozen=True):
    """A trigger.

    Attributes:
        kind: :data:`NOW` to :data:`CONDITION`.
        number: instant (ps), ordinal of a bus cycle, position (counts), level of the edge, or
            mean interval (ps).
        name: command, register, pin or condition.
        text: as it was written.
    """

    kind: str
    number: int
    name: str
    text: str


class Until(Struct, frozen=True):
    """An end.

    Attributes:
        kind: :data:`~vbus.faults.row.ONCE`, :data:`FOR` or :data:`CLEARED`.
        span: how long (ps).
        text: as it was written.
    """

    kind: str
    span: int
    text: str


def read_when(value: object) -> When:
    """Return the trigger that ``value`` says: a text, an instant in ps, or None for now.

    Raises:
        ValueError: it says none; the message lists the forms.
    """
    if value is None:
        return When(NOW, 0, "", NOW)
    if isinstance(value, int) and not isinstance(value, bool) and value >= 0:
        return When(AT, _before_the_end(value), "", f"at {value} ps")
    if not isinstance(value, str):
        raise ValueError(f"when = {quoted(value)}: write {WHEN_FORMS}")
    text = value.strip()
    kind, _, rest = text.partition(" ")
    rest = rest.strip()
    try:
        if kind == NOW and not rest:
            return When(NOW, 0, "", text)
        if kind == AT:
            return When(AT, int(parse(rest, "s")), "", text)
        if kind == CYCLE:
            return When(CYCLE, _ordinal(rest), "", text)
        if kind == POSITION:
            return When(POSITION, int(rest, 0), "", text)
        if kind == COMMAND and rest and len(rest.split()) == 1:
            return When(COMMAND, 0, rest, text)
        if kind == EDGE:
            pin, _, level = rest.rpartition(" ")
            if pin and level in ("low", "high"):
                return When(EDGE, int(level == "high"), pin.strip(), text)
        if kind == RATE:
            hertz = int(parse(rest, "Hz"))
            if hertz > 0:
                return When(RATE, 10**12 // hertz, "", text)
        if not kind.strip("0123456789."):
            raise ValueError(f'an instant is written "at {text}"')
    except (UnitError, ValueError) as error:
        raise ValueError(f"when = {quoted(text)}: {error}") from None
    if kind not in (NOW, AT, CYCLE, POSITION, EDGE, RATE):
        try:
            if not is_word(read(text, "when =")):
                return When(CONDITION, 0, text, text)
        except ConditionError as error:
            if "." in text:
                raise ValueError(str(error)) from None
    kinds = (NOW, AT, CYCLE, POSITION, COMMAND, EDGE, RATE)
    hint = "" if kind in kinds else suggestion(kind, kinds)
    raise ValueError(f"when = {quoted(text)}: {hint}write {WHEN_FORMS}")


def _before_the_end(ps: int) -> int:
    if ps > END:
        raise ValueError(f"{ps} ps: time ends at {END // SECOND} s; nothing takes longer")
    return ps


def _ordinal(text: str) -> int:
    if not text.isdecimal() or int(text) < 1:
        raise ValueError("a bus cycle's number is 1 or more, counted from arming")
    return int(text)


def read_until(value: object, when: When, fault: Fault) -> Until:
    """Return the end that ``value`` says: a text, a duration in ps, or None for the usual one.

    Raises:
        ValueError: it says none, or one this fault or its trigger does not have.
    """
    until = _until(value, fault)
    if until.kind == ONCE and fault.acts == LASTS:
        raise ValueError(f'until = "once": {fault.name} lasts; write "for 5 ms", or "cleared"')
    if when.kind == RATE and fault.acts == LASTS and until.kind == CLEARED:
        raise ValueError(
            f'when = "{when.text}": {fault.name} lasts; with a rate, say how long each time, such'
            ' as until = "for 5 ms"'
        )
    if until.kind == FOR and fault.acts == ONCE and when.kind != RATE:
        raise ValueError(f'until = "{until.text}": {fault.name} is over at once; leave the end out')
    return until


def _until(value: object, fault: Fault) -> Until:
    if value is None:
        return Until(ONCE, 0, ONCE) if fault.acts != LASTS else Until(CLEARED, 0, CLEARED)
    if isinstance(value, int) and not isinstance(value, bool) and value > 0:
        return Until(FOR, _before_the_end(value), f"for {value} ps")
    text = value.strip() if isinstance(value, str) else ""
    if text in (ONCE, CLEARED):
        return Until(text, 0, text)
    kind, _, rest = text.partition(" ")
    if kind == FOR:
        try:
            span = int(parse(rest.strip(), "s"))
        except UnitError as error:
            raise ValueError(f"until = {quoted(text)}: {error}") from None
        if span > 0:
            return Until(FOR, span, text)
        raise ValueError(f"until = {quoted(text)}: a fault lasts longer than that")
    hint = suggestion(text, (ONCE, FOR, CLEARED))
    raise ValueError(f"until = {quoted(value)}: {hint}write {UNTIL_FORMS}")
