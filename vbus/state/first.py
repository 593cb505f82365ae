"""The first version of saved states: nested tuples by place, made from the declared fields.

Journals name the hash of such a tuple, and the first format of snapshots holds it; chips, plants
and wire formats of others were written against it. A tuple has the fields in the order in which
``STATE`` names them. Where a class had it otherwise, its package's ``state_1.py`` says so in
``LAYOUTS``, by the name of the class: a tuple of

===========  =====================================================================================
``"name"``   the field
``"+name"``  a bool as 0 or 1
``"*name"``  a part or several values, spliced in
a tuple      the same, one level down
===========  =====================================================================================

or one name for the field alone, :data:`BITS` for all fields in order with every bool as 0 or 1, or
an :class:`Adapter`.
"""

from collections.abc import Callable
from importlib import import_module
from importlib.util import find_spec
from typing import Any, Final

from vbus.errors import SnapshotError
from vbus.state.fields import Kept, Part, Parts, Saved, layout_of, plan_with
from vbus.state.kinds import FLAG, Integer, Kind

BITS: Final = ("+",)
"""Every bool as 0 or 1."""


class Adapter:
    """A class that no row of names can tell.

    Args:
        save: returns the tuple for the part and its saved fields.
        load: returns the saved fields for the part and the tuple.
    """

    def __init__(
        self, save: Callable[[Any, Saved], Any], load: Callable[[Any, Any], Saved]
    ) -> None:
        self.save = save
        self.load = load


_FOUND: Final[dict[tuple[type, str], Any]] = {}


def _layout(cls: type, more: str = "") -> Any:
    """Return what a class' package says of its tuple: a row of names, or an Adapter."""
    found = _FOUND.get((cls, more))
    if found is None:
        found = _FOUND[cls, more] = _find(cls, more)
    return found


def _find(cls: type, more: str) -> Any:
    declared = layout_of(cls)
    found: Any = ()
    for base in cls.__mro__:
        home = f"{base.__module__.rpartition('.')[0]}.state_1"
        if home.startswith("vbus.") and find_spec(home) is not None:
            found = import_module(home).LAYOUTS.get(base.__name__ + more, ())
        if found or "STATE" in vars(base):
            break
    if found == BITS:
        flags = {name for name in declared.names if declared.kinds[name] is FLAG}
        return tuple("+" + name if name in flags else name for name in declared.names)
    return found or tuple(declared.names)


def to_tuple(part: Any, saved: Any) -> Any:
    """Return the first version's tuple for what :func:`vbus.state.save` gave of a part."""
    return saved if layout_of(type(part)).own else _to_tuple(part, saved)


def _to_tuple(part: Any, saved: Saved) -> Any:
    layout = _layout(type(part))
    if isinstance(layout, Adapter):
        return layout.save(part, saved)
    return row(part, saved, (layout,))[0] if isinstance(layout, str) else row(part, saved, layout)


def row(part: Any, saved: Saved, layout: tuple[Any, ...]) -> tuple[Any, ...]:
    """Return the tuple that a row of names tells of."""
    declared = layout_of(type(part))
    values: list[Any] = []
    for entry in layout:
        if not isinstance(entry, str):
            values.append(row(part, saved, entry))
            continue
        name = entry.lstrip("+*")
        kind = declared.kinds[name]
        value = _old(kind, getattr(part, kind.owner(name) or name), saved[name])
        if entry[0] == "*":
            values.extend(value)
        else:
            values.append(int(value) if entry[0] == "+" else value)
    return tuple(values)


def _old(kind: Kind, now: Any, saved: Any) -> Any:
    """Return a field's value as it was kept."""
    if isinstance(kind, Parts):
        return tuple(
            None if one is None else _old(kind.each, one, kept)
            for one, kept in zip(now, saved, strict=True)
        )
    if isinstance(kind, Part):
        return () if now is None else to_tuple(now, saved)
    if isinstance(kind, Kept):
        return row(now, saved, _layout(type(now), ".KEPT")) if saved else ()
    return int(saved) if isinstance(kind, Integer) else saved


def from_tuple(part: Any, old: Any, where: str = "state") -> Any:
    """Return what :func:`vbus.state.save` would have given, for the first version's tuple.

    Raises:
        SnapshotError: the tuple is not one of such a part.
    """
    return old if layout_of(type(part)).own else _from_tuple(part, old, where)


def _from_tuple(part: Any, old: Any, where: str) -> Saved:
    try:
        layout = _layout(type(part))
        if isinstance(layout, Adapter):
            saved = layout.load(part, old)
        elif isinstance(layout, str):
            saved = fields(part, (old,), (layout,))
        else:
            saved = fields(part, old, layout)
    except (TypeError, ValueError, IndexError, KeyError, AttributeError) as error:
        raise SnapshotError(f"{where}: no state of {type(part).__name__}: {error}") from None
    # What the first version did not keep stays as it is.
    declared = layout_of(type(part))
    for name in declared.names:
        if name not in saved:
            saved[name] = declared.kinds[name].save(getattr(part, name))
    return saved


def fields(part: Any, old: Any, layout: tuple[Any, ...]) -> Saved:
    """Return the fields in a tuple that a row of names tells of."""
    declared = layout_of(type(part))
    saved: Saved = {}
    at = 0
    for entry in layout:
        if not isinstance(entry, str):
            saved |= fields(part, old[at], entry)
            at += 1
            continue
        name = entry.lstrip("+*")
        kind = declared.kinds[name]
        now = getattr(part, kind.owner(name) or name)
        if entry[0] == "*":
            after = len(old) - at
            width = after if entry == layout[-1] else len(_old(kind, now, kind.save(now)))
            saved[name] = _new(kind, now, old[at : at + width])
            at += width
        else:
            saved[name] = old[at] != 0 if entry[0] == "+" else _new(kind, now, old[at])
            at += 1
    if at != len(old):
        raise ValueError(f"{len(old)} values, not {at}")
    return saved


def _new(kind: Kind, now: Any, old: Any) -> Any:
    """Return a field's value as it is kept now."""
    if isinstance(kind, Parts):
        return tuple(_new(kind.each, one, kept) for one, kept in zip(now, old, strict=True))
    if isinstance(kind, Part):
        return None if now is None else from_tuple(now, old, type(now).__name__)
    if isinstance(kind, Kept):
        return fields(now, old, _layout(type(now), ".KEPT")) if old else {}
    return kind.save(old) if isinstance(kind, Integer) else old


# -- what plug-ins add to -----------------------------------------------------------------------


def save_tuple(part: Any) -> Any:
    """Return the tuple of what a part declares, whatever save() its class has."""
    return _to_tuple(part, layout_of(type(part)).get(part))


def load_tuple(part: Any, old: Any) -> None:
    """Take back what :func:`save_tuple` gave.

    Raises:
        SnapshotError: it does not fit; the part is as it was.
    """
    name = type(part).__name__
    plan_with(layout_of(type(part)).fit, part, _from_tuple(part, old, name), name).apply()
