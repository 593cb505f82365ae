"""Declarations, and what follows from them: saving, loading, comparing."""

from collections.abc import Callable, Iterable
from functools import partial
from operator import attrgetter
from typing import Any, ClassVar, Final

from vbus.errors import SnapshotError
from vbus.state.kinds import (
    FLAG,
    InPlace,
    Integer,
    Kind,
    Load,
    Octets,
    Real,
    Refused,
    Row,
    Several,
    Sorted,
)

Saved = dict[str, Any]
"""A saved part: its fields by name, and the version of their declaration."""

Names = tuple[str, ...]
"""``STATE``, ``WIRING`` or ``DERIVED`` of a class."""

VERSION: Final = "STATE_VERSION"
"""Where a saved part has the version of its declaration."""

UNDECLARED: Final[Names] = ("?",)
"""``STATE`` of a base class whose subclasses must declare theirs, or have their own save()."""


class Part(Kind):
    """Another part; None where there is none."""

    STAYS: ClassVar[bool] = True

    def save(self, value: Any) -> Any:
        """Return the value as it is kept."""
        return None if value is None else save(value)

    def take(self, saved: Any, now: Any, load: Load) -> Any:
        """Return the part as it is; its fields come with the others."""
        if now is None:
            if saved is not None:
                raise Refused("there is nothing here to load it into")
        else:
            check(now, saved, load)
        return now


PART: Final = Part("a part")


class Parts(Kind):
    """A list of parts."""

    STAYS: ClassVar[bool] = True

    def __init__(self, each: Kind) -> None:
        super().__init__("parts", tuple, list)
        self.each: Kind = each

    def save(self, value: Any) -> Any:
        """Return the value as it is kept."""
        each = self.each
        return tuple([each.save(one) for one in value])

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
    """What :func:`keep` gave of the part at attribute ``of``, or nothing."""

    def __init__(self, of: str) -> None:
        super().__init__("kept fields", dict)
        self.of: str = of

    def owner(self, name: str) -> str:
        """Return the attribute that says what the field may hold."""
        return self.of

    def take(self, saved: Any, now: Any, load: Load) -> Any:
        """Return the value for what was kept."""
        if saved != {}:
            check_fields(now, kept_layout(type(now)), saved, Load())
        return saved


# -- declarations -------------------------------------------------------------------------------

SIMPLE: Final[dict[str, Kind]] = {
    "i64": Kind("an integer of 64 bits", int), "bool": FLAG, "str": Kind("a text", str),
    "i64 | bool": Kind("an integer of 64 bits, true or false", int, bool),
    "int": Integer("an integer", int), "float": Real("a number", float, int),
    "bytes": Octets(True), "bytes[...]": Octets(False), "bytearray": InPlace(True),
    "bytearray[...]": InPlace(False),
    "part": PART, "part | None": PART, "parts": Parts(PART),
}  # fmt: skip
MAKERS: Final[dict[str, Callable[[Iterable[Any]], Any]]] = {
    "list": list, "tuple": tuple, "set": set, "heap": list,
}  # fmt: skip


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
        return Row([kind_of(one) for one in text[1:-1].split(",")])
    outer, _, inner = text.partition("[")
    if outer == "kept":
        return Kept(inner[:-1])
    if outer in MAKERS and inner.endswith("]"):
        each, _, more = inner[:-1].rpartition(", ...") if inner.endswith(", ...]") else (
            inner[:-1], "", "-"
        )  # fmt: skip
        if outer in ("set", "heap"):
            return Sorted(MAKERS[outer], kind_of(each), False)
        return Several(MAKERS[outer], kind_of(each), bool(more))
    raise ValueError(f"{text!r} is no kind of field")


class Layout:
    """The declaration of a class, read once.

    Attributes:
        names: its fields.
        fields: the same with what they hold.
        others: those whose values are not kept as they are.
        get: returns the values of all fields; None if there are none.
        version: of the declaration.
        own: it has a save() and load() of its own instead.
        prepares: it has a before_save().
        refreshes: it has an after_load().
    """

    __slots__ = ("fields", "get", "names", "others", "own", "prepares", "refreshes", "version")

    def __init__(self, cls: Any, declaration: str = "STATE") -> None:
        self.names: list[str] = []
        self.fields: list[tuple[str, Kind]] = []
        self.others: list[tuple[str, Kind]] = []
        self.get: Callable[[Any], tuple[Any, ...]] | None = None
        self.version: int = getattr(cls, "STATE_VERSION", 1)
        self.own: bool = False
        self.prepares: bool = hasattr(cls, "before_save")
        self.refreshes: bool = hasattr(cls, "after_load")
        for base in cls.__mro__:
            inside = vars(base)
            if "STATE" in inside:
                break
            self.own = self.own or "save" in inside or "load" in inside
        declared: Names = getattr(cls, declaration, UNDECLARED)
        if declared == UNDECLARED:
            if self.own:
                return
            raise NotImplementedError(f"{cls.__name__} declares no STATE and has no save()")
        for field in declared:
            name, colon, kind = field.partition(":")
            self.names.append(name)
            self.fields.append((name, kind_of(kind if colon else "i64")))
        self.others = [(name, kind) for name, kind in self.fields if not kind.plain]
        if self.names:
            # One name would come without a tuple: it comes twice, and zip() takes one.
            self.get = attrgetter(*self.names, *(self.names if len(self.names) == 1 else ()))

    def kind(self, name: str) -> Kind:
        """Return what a field holds."""
        return self.fields[self.names.index(name)][1]


_LAYOUTS: Final[dict[Any, Layout]] = {}


_KEPT: Final[dict[Any, Layout]] = {}


def kept_layout(cls: Any) -> Layout:
    """Return the declaration of what :func:`keep` saves of a class."""
    found = _KEPT.get(cls)
    if found is None:
        found = _KEPT[cls] = Layout(cls, "KEPT")
        found.prepares = False
    return found


def layout_of(cls: Any) -> Layout:
    """Return the declaration of a class."""
    found = _LAYOUTS.get(cls)
    if found is None:
        found = _LAYOUTS[cls] = Layout(cls)
    return found


def attributes(part: Any) -> set[str]:
    """Return the names of a part's attributes, compiled or not."""
    there: set[str] = set(getattr(part, "__dict__", ()))
    for base in type(part).__mro__:
        for names in (vars(base).get("__mypyc_attrs__", ()), vars(base).get("__slots__", ())):
            there.update((names,) if isinstance(names, str) else names)
    return there - {"__dict__", "__weakref__"}


def undeclared(part: Any) -> set[str]:
    """Return the attributes that a class without a save() of its own declares nowhere."""
    cls = type(part)
    if hasattr(cls, "save") and layout_of(cls).own:
        return set()
    told: set[str] = set()
    for base in cls.__mro__:
        inside = vars(base)
        for declaration in ("STATE", "WIRING", "DERIVED"):
            told.update(name.partition(":")[0] for name in inside.get(declaration, ()))
    if "*" in told and not hasattr(cls, "STATE"):
        return set()
    return attributes(part) - told


# -- saving, loading, comparing -----------------------------------------------------------------


def save(part: Any) -> Any:
    """Return the state of a part and of those inside: a map by name, or the tuple of its own."""
    layout = layout_of(type(part))
    return part.save() if layout.own else save_fields(part, layout)


def save_fields(part: Any, layout: Layout) -> Saved:
    """Return the fields that a part declares."""
    if layout.prepares:
        part.before_save()
    saved: Saved = {VERSION: layout.version}
    if layout.get is not None:
        saved.update(zip(layout.names, layout.get(part), strict=False))
    for name, kind in layout.others:
        saved[name] = kind.save(saved[name])
    return saved


def check(part: Any, saved: Any, load: Load) -> None:
    """Check a saved state against a part, and tell ``load`` what is to be done.

    Raises:
        Refused: it does not fit.
    """
    layout = layout_of(type(part))
    if layout.own:
        load.foreign = load.foreign or not type(part).__module__.startswith("vbus.")
        load.value(part, "", partial(part.load, saved))
    else:
        check_fields(part, layout, saved, load)


def check_fields(part: Any, layout: Layout, saved: Any, load: Load) -> None:
    """Check the fields that a part declares."""
    fields = _present(part, layout, saved)
    name = ""
    try:
        for name, kind in layout.fields:
            if kind.plain:
                load.value(part, name, kind.take(fields[name], None, load))
                continue
            value = kind.take(fields[name], getattr(part, kind.owner(name)), load)
            if not kind.STAYS:
                load.value(part, name, value)
    except KeyError:
        raise Refused("is missing", name) from None
    except Refused as refused:
        raise refused.below(name) from None
    if len(fields) > len(layout.names) + 1:
        unknown = sorted(fields.keys() - {VERSION, *layout.names})
        raise Refused(f"is no field of {type(part).__name__}", unknown[0])
    if layout.refreshes:
        load.hook(part.after_load)


def _present(part: Any, layout: Layout, saved: Any) -> Saved:
    """Return the fields as the present version declares them."""
    if type(saved) is not dict:
        raise Refused(f"wants the fields of {type(part).__name__} by name, not {saved!r:.60}")
    version = saved.get(VERSION)
    if type(version) is not int or not 1 <= version <= layout.version:
        raise Refused(
            f"version {version} of {type(part).__name__}: this vbus knows 1 to {layout.version}"
        )
    fields: Saved = saved
    if version < layout.version:
        fields = {VERSION: layout.version, **part.migrate(version, dict(saved))}
    return fields


def plan(part: Any, saved: Any, where: str) -> Load:
    """Check a saved state; return what loads it.

    Args:
        part: what it is of.
        saved: what :func:`save` gave.
        where: what to call the part in an error.

    Raises:
        SnapshotError: it does not fit: names part and field; nothing has been set.
    """
    layout = layout_of(type(part))
    if not layout.own:
        return plan_fields(part, saved, where, layout)
    found = Load()
    check(part, saved, found)
    return found


def plan_fields(part: Any, saved: Any, where: str, layout: Layout) -> Load:
    """Check the fields that a part declares; return what loads them."""
    found = Load()
    try:
        check_fields(part, layout, saved, found)
    except Refused as refused:
        place = f"{where}.{refused.place}" if refused.place else where
        raise SnapshotError(f"{place}: {refused.text}") from None
    return found


def load(part: Any, saved: Any, where: str = "state") -> None:
    """Take back what :func:`save` gave.

    Raises:
        SnapshotError: it does not fit; the part is as it was.
    """
    plan(part, saved, where).apply()


def keep(part: Any) -> Saved:
    """Return the fields that a part names in ``KEPT``, as they are, to be taken back soon."""
    return save_fields(part, kept_layout(type(part)))


def take_back(part: Any, saved: Saved) -> None:
    """Take back what :func:`keep` gave."""
    plan_fields(part, saved, "kept", kept_layout(type(part))).apply()


def differences(one: Any, other: Any, where: str = "") -> list[str]:
    """Return the fields in which two saved states differ, each with both values."""
    if isinstance(one, dict) and isinstance(other, dict):
        names = [*one, *(name for name in other if name not in one)]
        return [
            text
            for name in names
            for text in differences(one.get(name), other.get(name), f"{where}.{name}".lstrip("."))
        ]
    if isinstance(one, tuple) and isinstance(other, tuple) and len(one) == len(other):
        return [
            text
            for number, (a, b) in enumerate(zip(one, other, strict=True))
            for text in differences(a, b, f"{where}.{number}")
        ]
    return [] if one == other and type(one) is type(other) else [f"{where}: {one!r}, {other!r}"]
