"""A section of a board file: keys with titles, units and ranges, as rows for their readers."""

from functools import cache
from typing import Annotated, Final

import msgspec
from msgspec import Meta, Struct

from vbus.options import Option

NAMES: Final = "names"
"""A list of names: the one kind of key that :class:`~vbus.options.Option` does not know."""


def key(
    kind: str,
    title: str,
    choices: tuple[str, ...] = (),
    low: float | None = None,
    high: float | None = None,
) -> Meta:
    """Return what a key means: kind of its value, title, choices, least and greatest number."""
    return Meta(description=title, extra={"rest": (choices, low, high), "kind": kind})


@cache
def rows(section: type[Struct]) -> tuple[Option, ...]:
    """Return the keys of a section that have a title; a row without default is required."""
    found = []
    for field in msgspec.structs.fields(section):
        for meta in getattr(field.type, "__metadata__", ()):
            default = field.default
            if default is msgspec.NODEFAULT:
                default = None if field.default_factory is msgspec.NODEFAULT else ""
            choices, low, high = meta.extra["rest"]
            found.append(
                Option(
                    field.name, meta.extra["kind"], default, meta.description, choices, low, high
                )
            )
    return tuple(found)


class Section(Struct, frozen=True, kw_only=True):
    """Base of all sections."""


class GlueSection(Section, frozen=True, kw_only=True):
    """``[glue.NAME]``: one part; ``pins`` and ``equations`` say what its pins are wired to."""

    name: str
    part: Annotated[
        str, key("text", 'part number without package, such as "74HC138"; "PLD": equations')
    ]
    delay: Annotated[
        int, key("s", "how long its outputs take to follow its inputs", low=0, high=10**15)
    ] = 0
    low: Annotated[tuple[str, ...], key(NAMES, "its inputs that are tied to ground")] = ()
    high: Annotated[tuple[str, ...], key(NAMES, "its inputs that are tied to the supply")] = ()
    hosts: Annotated[
        tuple[str, ...], key(NAMES, 'its pins that hosts drive or see, as side pins "NAME.pin"')
    ] = ()
    pins: dict[str, tuple[str, ...]] = {}
    equations: dict[str, str] = {}
