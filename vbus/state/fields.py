"""Declarations, and what follows from them: saving, loading, comparing."""

from collections.abc import Callable, Iterable
from typing import Any, ClassVar, Final

from vbus.errors import SnapshotError
from vbus.state.kinds import (
    FLAG,
    MOST,
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
"""Where a saved part has the version of its declaration; one without is of version 1."""

UNDECLARED: Final[Names] = ("?",)
"""``STATE`` of a base class whose subclasses must declare theirs, or have their own save()."""


class Part(Kind):
    """Another part; None where there is none."""

    STAYS: ClassVar[bool] = True

    def save(self, value: Any) -> Any:
        """Return the value as it is kept."""
        if value is None:
            return None
        layout = _LAYOUTS.get(type(value)) or layout_of(type(value))
        return value.save() if layout.own else save_fields(value, layout)

    def take(self, saved: Any, now: Any, load: Load) -> Any:
        """Return the part as it is; its fields come with the others."""
        if now is not None:
            layout = _LAYOUTS.get(type(now)) or layout_of(type(now))
            if layout.own:
                load.foreign = load.foreign or not type(now).__module__.startswith("vbus.")
                load.put(_load_own, now, saved)
            else:
                check_fields(now, layout, saved, load)
        elif saved is not None:
            raise Refused("there is nothing here to load it into")
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
    "value": Kind("a number, a text, true or false", int, float, str, bool),
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
        return Row([kind_of(one) for one in _split(text[1:-1])])
    outer, _, inner = text.partition("[")
    if outer == "kept":
        return Kept(inner[:-1])
    if outer in MAKERS and inner.endswith("]"):
        each = inner.removesuffix("]").removesuffix(", ...")
        if outer in ("set", "heap"):
            return Sorted(MAKERS[outer], kind_of(each), False)
        return Several(MAKERS[outer], kind_of(each), not inner.endswith(", ...]"))
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


CHECKS: Final[dict[type, str]] = {
    bool: "type({0}) is bool", float: "type({0}) is float and {0} - {0} == 0.0",
    int: "type({0}) is int and LEAST <= {0} <= MOST",
}  # fmt: skip
"""What a value of a usual type must be."""


class Layout:
    """The declaration of a class, read once.

    Attributes:
        names: its fields.
        kinds: what they hold, by name.
        usual: the fields that are numbers and flags of 64 bits.
        others: the other fields, with what they hold, and what says what they may hold.
        parts: fields that keep their objects.
        get: returns the fields of a part, as they are kept.
        pick: returns those of :attr:`usual` from what was saved; None if one may be none.
        put: sets those and the others.
        version: of the declaration.
        own: it has a save() and load() of its own instead.
        prepares: it has a before_save().
        refreshes: it has an after_load().
    """

    __slots__ = (
        "get", "kinds", "names", "others", "own", "parts", "pick", "prepares", "put", "refreshes",
        "usual", "version",
    )  # fmt: skip

    def __init__(self, cls: Any, declaration: str = "STATE") -> None:
        self.names: list[str] = []
        self.kinds: dict[str, Kind] = {}
        self.usual: list[str] = []
        self.others: list[tuple[str, Kind, str]] = []
        self.parts: list[tuple[str, Kind]] = []
        self.get: Callable[[Any], Saved] = dict
        self.pick: Callable[[Saved], tuple[Any, ...] | None] = tuple
        self.put: Callable[[Any, tuple[Any, ...]], None] = _put_nothing
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
            name, colon, text = field.partition(":")
            kind = kind_of(text if colon else "i64")
            self.kinds[name] = kind
            if kind.STAYS:
                self.parts.append((name, kind))
            elif kind.usual is None:
                self.others.append((name, kind, kind.owner(name)))
            else:
                self.usual.append(name)
        self.names = list(self.kinds)
        self._compile()

    def _compile(self) -> None:
        """Write out what saving and loading do: it takes a third of the time of names in a loop."""
        known: dict[str, Any] = {
            "LEAST": -MOST - 1, "MOST": MOST,
            **{f"keep_{name}": kind.save for name, kind in self.kinds.items()},
        }  # fmt: skip
        kept = [
            f"{name!r}: part.{name}" if kind.plain else f"{name!r}: keep_{name}(part.{name})"
            for name, kind in self.kinds.items()
        ]
        if self.version > 1:
            kept.append(f"{VERSION!r}: {self.version}")
        usual = [
            CHECKS[kind.usual].format(name, kind.usual.__name__)
            for name, kind in self.kinds.items()
            if kind.usual is not None
        ]
        taken = "".join(f"{name} = saved[{name!r}]; " for name in self.usual)
        names = "".join(f"{name}, " for name in self.usual)
        settable = [*self.usual, *(name for name, _, _ in self.others)]
        attributes = "".join(f"part.{name}, " for name in settable) or "_"
        exec(
            f"def get(part): return {{{', '.join(kept)}}}\n"
            f"def pick(saved): {taken}return ({names}) if {' and '.join(usual) or True} else None\n"
            f"def put(part, values): {attributes} = values\n",
            known,
        )
        self.get, self.pick, self.put = known["get"], known["pick"], known["put"]


def _put_nothing(_part: Any, _values: tuple[Any, ...]) -> None:
    pass


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
    declared: set[str] = set()
    for base in cls.__mro__:
        inside = vars(base)
        for declaration in ("STATE", "WIRING", "DERIVED"):
            declared.update(name.partition(":")[0] for name in inside.get(declaration, ()))
    if "*" in declared and not hasattr(cls, "STATE"):
        return set()
    return attributes(part) - declared


# -- saving, loading, comparing -----------------------------------------------------------------


def save(part: Any) -> Any:
    """Return the state of a part and of those inside: a map by name, or the tuple of its own."""
    return PART.save(part)


def save_fields(part: Any, layout: Layout) -> Saved:
    """Return the fields that a part declares."""
    if layout.prepares:
        part.before_save()
    return layout.get(part)


def _load_own(part: Any, saved: Any) -> None:
    part.load(saved)


def check_fields(part: Any, layout: Layout, saved: Any, load: Load) -> None:
    """Check the fields that a part declares."""
    fields = saved
    if type(saved) is not dict or len(saved) != len(layout.names) or layout.version > 1:
        fields = _present(part, layout, saved)
    name = ""
    try:
        values = layout.pick(fields)
        if values is None:
            values = ()
            for name in layout.usual:
                values += (layout.kinds[name].take(fields[name], None, load),)
        for name, kind, owner in layout.others:
            values += (kind.take(fields[name], getattr(part, owner) if owner else None, load),)
        if values:
            load.put(layout.put, part, values)
        for name, kind in layout.parts:
            kind.take(fields[name], getattr(part, name), load)
    except KeyError as missing:
        raise Refused("is missing", str(missing.args[0])) from None
    except Refused as refused:
        raise refused.below(name) from None
    if layout.refreshes:
        load.hook(part.after_load)


def _present(part: Any, layout: Layout, saved: Any) -> Saved:
    """Return the fields as the present version declares them."""
    cls = type(part).__name__
    if type(saved) is not dict:
        raise Refused(f"wants the fields of {cls} by name, not {saved!r:.60}")
    fields: Saved = saved
    version = fields.get(VERSION, 1)
    if type(version) is not int or not 1 <= version <= layout.version:
        raise Refused(f"version {version} of {cls}: this vbus knows 1 to {layout.version}")
    if version < layout.version:
        fields = part.migrate(version, dict(saved))
    unknown = sorted(fields.keys() - {VERSION, *layout.names})
    if unknown:
        raise Refused(f"is no field of {cls}", unknown[0])
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
    PART.take(saved, part, found)
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
