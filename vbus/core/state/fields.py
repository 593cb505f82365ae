"""Declarations, and what follows from them: saving and loading."""

from collections.abc import Callable
from functools import cache
from typing import Any, ClassVar, Final

from vbus.core.errors import SnapshotError
from vbus.core.state.functions import written
from vbus.core.state.kinds import (
    FLAG,
    InPlace,
    Integer,
    Kind,
    Load,
    Octets,
    Real,
    Refused,
    Repeated,
    Row,
    Sorted,
)

Saved = dict[str, Any]
"""A saved part: its fields by name, and the version of their declaration."""

Names = tuple[str, ...]
"""``STATE``, ``WIRING`` or ``DERIVED`` of a class."""

VERSION: Final = "STATE_VERSION"
"""Where a saved part has the version of its declaration; one without is of version 1."""

UNDECLARED: Final[Names] = ("?",)
"""``STATE`` of a base class whose subclasses must declare theirs."""


class Part(Kind):
    """Another part; None where there is none."""

    STAYS: ClassVar[bool] = True

    def save(self, value: Any) -> Any:
        """Return the value as it is saved."""
        return layout_of(type(value)).save(value)

    def take(self, saved: Any, now: Any, load: Load) -> Any:
        """Return the part as it is; its fields come with the others."""
        layout_of(type(now)).check(now, saved, load)
        return now


PART: Final = Part("a part")


class Parts(Kind):
    """A list of parts."""

    STAYS: ClassVar[bool] = True

    def __init__(self, each: Kind) -> None:
        super().__init__("parts", tuple, list)
        self.each: Kind = each

    def save(self, value: Any) -> Any:
        """Return the value as it is saved."""
        return self.each.save_all(value)

    def take(self, saved: Any, now: Any, load: Load) -> Any:
        """Return the parts as they are."""
        if len(super().take(saved, now, load)) != len(now):
            raise Refused(f"wants {len(now)} parts, not {len(saved)}")
        for number, (one, part) in enumerate(zip(saved, now, strict=True)):
            try:
                self.each.take(one, part, load)
            except Refused as refused:
                raise refused.below(getattr(part, "name", str(number))) from None
        return now


class Kept(Kind):
    """What :func:`checkpoint` or :func:`save` gave of the part at attribute ``of``, or nothing."""

    def __init__(self, of: str, whole: bool) -> None:
        super().__init__("kept fields", dict)
        self.of: str = of
        self.whole: bool = whole
        """Whether :func:`save` gave it."""

    def owner(self, name: str) -> str:
        """Return the attribute that says what the field may hold."""
        return self.of

    def take(self, saved: Any, now: Any, load: Load) -> Any:
        """Return the value for what was saved."""
        # Empty: nothing was kept when the state was saved.
        if saved != {}:
            declaration = "STATE" if self.whole else "CHECKPOINT"
            layout_of(type(now), declaration).check(now, saved, Load())
        return saved


# -- declarations -------------------------------------------------------------------------------

SIMPLE: Final[dict[str, Kind]] = {
    "i64": Kind("an integer of 64 bits", int), "bool": FLAG, "str": Kind("a text", str),
    "i64 | bool": Kind("an integer of 64 bits, true or false", int, bool),
    "value": Kind("a number, a text, true or false", int, float, str, bool),
    "int": Integer("an integer", int), "float": Real(),
    "bytes[...]": Octets(), "bytearray": InPlace(True), "bytearray[...]": InPlace(False),
    "part": PART, "part | None": PART, "parts": Parts(PART),
}  # fmt: skip
MAKERS: Final[dict[str, type]] = {"list": list, "tuple": tuple, "set": set, "heap": list}


def kind_of(text: str) -> Kind:
    """Return the kind written so.

    Raises:
        ValueError: there is none.
    """
    text = text.strip()
    found = SIMPLE.get(text)
    if found is not None:
        return found
    if text.startswith("(") and text.endswith(")"):
        return Row([kind_of(one) for one in _split(text[1:-1])])
    outer, _, inner = text.partition("[")
    if outer in ("checkpoint", "saved"):
        return Kept(inner[:-1], outer == "saved")
    if outer == "bytes" and inner.removesuffix("]").isdecimal():
        return Octets(int(inner[:-1]))
    if outer in MAKERS and inner.endswith("]"):
        each, *like = _split(inner[:-1])
        if outer in ("set", "heap"):
            return Sorted(MAKERS[outer], kind_of(each))
        return Repeated(MAKERS[outer], kind_of(each), "".join(like).strip())
    raise ValueError(f"{text!r} is no kind of field")


def _split(text: str) -> list[str]:
    """Return the kinds of a row: what stands between commas that are in no bracket."""
    kinds = [""]
    depth = 0
    for letter in text:
        depth += (letter in "([") - (letter in ")]")
        if letter == "," and depth == 0:
            kinds.append("")
        else:
            kinds[-1] += letter
    return kinds


class Layout:
    """The declaration of a class, read once.

    Attributes:
        names: its fields.
        kinds: what they hold, by name.
        places: the attribute that has each field, by its name.
        version: of the declaration.
        save: returns the fields of a part, as they are saved.
        check: checks fields that were saved, and adds what sets them to a :class:`Load`.
    """

    __slots__ = ("check", "kinds", "names", "places", "save", "version")

    def __init__(self, cls: Any, declaration: str = "STATE") -> None:
        self.names: list[str] = []
        self.kinds: dict[str, Kind] = {}
        self.places: dict[str, str] = {}
        self.version: int = getattr(cls, "STATE_VERSION", 1)
        self.save: Callable[[Any], Any] = _save_none
        self.check: Callable[[Any, Any, Load], None] = _check_none
        if cls is type(None):
            return
        declared: Names = getattr(cls, declaration, UNDECLARED)
        if declared == UNDECLARED:
            raise NotImplementedError(
                f"{cls.__name__} declares no {declaration}: name the fields that decide all that"
                f' follows, as in {declaration} = ("place", "speed: float")'
            )
        for field in declared:
            place, colon, text = field.partition(":")
            name, _, elsewhere = place.partition(" = ")
            self.places[name] = elsewhere or name
            self.kinds[name] = kind_of(text if colon else "i64")
        self.names = list(self.kinds)
        whole = declaration == "STATE"
        self.save, self.check = written(
            self.kinds, self.places, self.version, whole and hasattr(cls, "before_save"),
            hasattr(cls, "after_load"), self._present,
        )  # fmt: skip

    def _present(self, part: Any, saved: Any) -> Saved:
        """Return the fields as the present version declares them."""
        cls = type(part).__name__
        if type(saved) is not dict:
            raise Refused(f"wants the fields of {cls} by name, not {saved!r:.60}")
        fields: Saved = saved
        version = fields.get(VERSION, 1)
        # A later vbus may have meant anything by its fields.
        if type(version) is not int or not 1 <= version <= self.version:
            raise Refused(f"version {version} of {cls}: this vbus knows 1 to {self.version}")
        # A copy: migrate() may change what it is given.
        if version < self.version:
            fields = part.migrate(version, dict(saved))
        unknown = sorted(fields.keys() - {VERSION, *self.names})
        if unknown:
            raise Refused(f"is no field of {cls}", unknown[0])
        return fields


def _save_none(_part: None) -> None:
    return None


def _check_none(_part: None, saved: Any, _load: Load) -> None:
    if saved is not None:
        raise Refused("there is nothing here to load it into")


# A rack has thousands of parts of some forty classes.
layout_of: Final[Callable[..., Layout]] = cache(Layout)
"""Returns the declaration of a class, read once: ``STATE``, or ``CHECKPOINT``."""


# -- saving and loading ------------------------------------------------------------------------


def save(part: Any) -> Any:
    """Return the state of a part and of those inside, as maps by name."""
    return PART.save(part)


def validate(part: Any, saved: Any, where: str) -> Load:
    """Check a saved state; return what loads it.

    Args:
        part: what it is of.
        saved: what :func:`save` gave.
        where: what to call the part in an error.

    Raises:
        SnapshotError: it does not fit: names part and field; nothing has been set.
    """
    return validate_with(layout_of(type(part)).check, part, saved, where)


def validate_with(
    check: Callable[[Any, Any, Load], None], part: Any, saved: Any, where: str
) -> Load:
    """Check a saved state so; return what loads it."""
    found = Load()
    try:
        # All is checked before anything is set: a state that does not fit leaves the board as it
        # is.
        check(part, saved, found)
    except Refused as refused:
        place = f"{where}.{refused.place}" if refused.place else where
        raise SnapshotError(f"{place}: {refused.text}") from None
    return found


def load(part: Any, saved: Any, where: str = "state") -> None:
    """Take back what :func:`save` gave.

    Raises:
        SnapshotError: it does not fit; the part is as it was.
    """
    validate(part, saved, where).apply()


def checkpoint(part: Any) -> Saved:
    """Return the fields that a part names in ``CHECKPOINT``: it may go back to them."""
    fields: Saved = layout_of(type(part), "CHECKPOINT").save(part)
    return fields


def rollback(part: Any, saved: Saved) -> None:
    """Go back to what :func:`checkpoint` gave."""
    validate_with(layout_of(type(part), "CHECKPOINT").check, part, saved, "checkpoint").apply()
