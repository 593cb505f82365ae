"""Saving and loading a class, written out: that takes a third of the time of a loop over names.

It is not compiled: functions made by ``exec()`` in a compiled module find their names more slowly.
"""

from collections.abc import Callable
from typing import Any, Final

from vbus.core.state.kinds import MOST, Kind, Load, Refused

CHECKS: Final[dict[type | None, str]] = {
    bool: "type({0}) is bool", float: "type({0}) is float and {0} - {0} == 0.0",
    int: f"type({{0}}) is int and {-MOST - 1} <= {{0}} <= {MOST}",
}  # fmt: skip
"""What a value of a usual type must be."""

FUNCTIONS: Final = """
def get(part):
    {before_save}
    return {{{state}}}

def fit(part, saved, load):
    if type(saved) is not dict or {strange}:
        saved = present(part, saved)
    try:
        {read}
    except KeyError as missing:
        raise Refused("is missing", missing.args[0])
    if not ({fits}):
        ({numbers}) = one_by_one(usual, saved, load)
    place = ""
    try:
        {others}
        load.steps.append((put, part, ({values})))
        {parts}
    except Refused as refused:
        raise refused.below(place) from None
    {after_load}

def put(part, values):
    ({attributes}) = values
"""


def written(
    kinds: dict[str, Kind],
    places: dict[str, str],
    version: int,
    prepares: bool,
    refreshes: bool,
    present: Callable[[Any, Any], dict[str, Any]],
) -> tuple[Callable[[Any], Any], Callable[[Any, Any, Load], None]]:
    """Return what gets the fields of a part, and what checks fields and notes what sets them.

    Args:
        kinds: what the fields hold, by name.
        places: the attribute that has each field, by its name.
        version: of the declaration.
        prepares: the class has a before_save().
        refreshes: it has an after_load().
        present: returns the fields as this version declares them.
    """
    # Numbers and flags are checked in one expression; only what else there is calls a kind.
    usual = {name: kind for name, kind in kinds.items() if kind.usual is not None}
    parts = [name for name, kind in kinds.items() if kind.STAYS]
    others = [name for name in kinds if name not in {*usual, *parts}]
    known: dict[str, Any] = {
        "present": present, "usual": usual, "one_by_one": _one_by_one, "Refused": Refused,
    }  # fmt: skip
    state = []
    for name, kind in kinds.items():
        known[f"save_{name}"], known[f"take_{name}"] = kind.save, kind.take
        now = f"part.{places[name]}"
        state.append(f"{name!r}: {now if kind.plain else f'save_{name}({now})'}")
    # One field more or less says that it is of another version, or is looked at more closely.
    strange = f"len(saved) != {len(kinds) + (version > 1)}"
    if version > 1:
        state.append(f"'STATE_VERSION': {version}")
        strange += f" or saved.get('STATE_VERSION') != {version}"
    settable = [*usual, *others]
    checks = [CHECKS[kind.usual].format(f"f_{name}") for name, kind in usual.items()]
    text = FUNCTIONS.format(
        before_save="part.before_save()" if prepares else "pass",
        state=", ".join(state),
        strange=strange,
        read="; ".join(f"f_{name} = saved[{name!r}]" for name in kinds) or "pass",
        fits=" and ".join(checks) or "True",
        numbers="".join(f"f_{name}, " for name in usual),
        others="; ".join(_taking(name, kinds[name], places) for name in others) or "pass",
        values="".join(f"f_{name}, " for name in settable),
        parts="; ".join(_taking(name, kinds[name], places) for name in parts) or "pass",
        after_load="load.hooks.append(part.after_load)" if refreshes else "pass",
        attributes="".join(f"part.{places[name]}, " for name in settable),
    )
    # Text made of names that the class declares: nothing of a snapshot is in it.
    exec(text, known)
    return known["get"], known["fit"]


def _taking(name: str, kind: Kind, places: dict[str, str]) -> str:
    """Return what checks one of the other fields."""
    owner = kind.owner(name) or (name if kind.STAYS else "")
    now = f"part.{places.get(owner, owner)}" if owner else "None"
    return f"place = {name!r}; f_{name} = take_{name}(f_{name}, {now}, load)"


def _one_by_one(usual: dict[str, Kind], saved: dict[str, Any], load: Load) -> list[Any]:
    """Return the usual fields: one of them may be none, or want to be converted."""
    values = []
    for name, kind in usual.items():
        try:
            values.append(kind.take(saved[name], None, load))
        except Refused as refused:
            raise refused.below(name) from None
    return values
