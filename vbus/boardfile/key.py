"""A section of a board file: what each key means, and what tables stand below it."""

from collections.abc import Callable, Iterable, Iterator
from functools import cache
from types import NoneType
from typing import Annotated, Any, ClassVar, Final, NamedTuple, Self, get_args, get_origin

import msgspec
from msgspec import Meta, Struct

from vbus.core.options import Option, Value

NAMES: Final = "names"
"""Kind of a key that has a list of names."""
NAME: Final = "name"
"""Kind of a key that has a name as sections have it."""
Names = tuple[str, ...]
Wires = dict[str, Names]
"""Names by name; one needs no list."""

_KINDS: Final = {str: "text", bool: "flag", int: "count", float: "ratio", Names: NAMES}


def row(
    title: str,
    kind: str = "",
    choices: Iterable[str] = (),
    low: float | None = None,
    high: float | None = None,
    ref: str = "",
    needs: str = "",
) -> Meta:
    """Return what a key means.

    Args:
        title: what it does, for messages and documentation.
        kind: as of :class:`~vbus.core.options.Option`; follows from the type of the field if empty.
        choices: the texts it may be.
        low: least number.
        high: greatest number.
        ref: the section or the group of entry points whose names it may be; words that are
            allowed instead stand behind it: ``"plants|none"``.
        needs: the keys beside it without which it means nothing, with blanks between; or the value
            that one must have, ``"kind=latch"``.
    """
    kind = kind or ("choice" if choices else "")
    wants = tuple(needs.split())
    option = Option("", kind, "", title, tuple(choices), low, high, ref=ref, needs=wants)
    return Meta(extra={"row": option})


Further = tuple[str, Iterable[str], Iterable[Option]]
"""A pattern for the values of a key, examples of them, and the keys that they bring with them."""


class Kinds(NamedTuple):
    """Which keys a section has beside its own, by one of them: ``Section.KINDS``.

    Attributes:
        key: the key that decides.
        find: returns the further keys of one value; raises an error that names the known ones.
        known: gives all of them.
    """

    key: str
    find: Callable[[str], Iterable[Option]]
    known: Callable[[], Iterator[Further]]


class Section(Struct, frozen=True, kw_only=True):
    """Base of all sections.

    A field with a :func:`row` is a key of the file. Other fields hold what stands below: a section
    (``[kind]``), a tuple of them (``[kind.NAME]`` if they have a name, else ``[[kind]]``), or a
    dictionary of names, texts or sections. ``settings`` takes keys that a part or model adds.

    Attributes:
        KINDS: which keys those are.
        SHORT: the key that a value means which is no table.
        ANY_NAME: its names need not be such as stand in ``"name.pin"``.
    """

    KINDS: ClassVar[Kinds | None] = None
    SHORT: ClassVar[str] = ""
    ANY_NAME: ClassVar[bool] = False

    @classmethod
    def blank(cls) -> Self:
        """Return a section without its required keys: it stands for one that cannot be read."""
        return cls(
            **{
                row.name: "" if row.kind in ("text", "choice") else 0
                for row in rows(cls)
                if row.default is None
            }
        )


class Below(NamedTuple):
    """What a field holds that is no key.

    Attributes:
        name: of the field, and of the key in the file.
        shape: ``None`` for one table, ``tuple`` for tables by name or in a list, ``dict``.
        of: the section of each; in a dictionary also the row of a text, or :data:`Names`.
        row: the title, the allowed names of a dictionary that has them, and what it needs.
    """

    name: str
    shape: type | None
    of: Any
    row: Option | None

    @property
    def named(self) -> bool:
        """Whether it is ``[kind.NAME]``."""
        return self.shape is tuple and "name" in self.of.__struct_fields__


# Asked for each table of each file.
@cache
def fields(section: type[Section]) -> tuple[Option | Below, ...]:
    """Return the keys of a section and what stands below it; required keys have no default."""
    found: list[Option | Below] = []
    for field in msgspec.structs.fields(section):
        kind, option = _unwrapped(field.type)
        if NoneType in get_args(kind):
            kind = get_args(kind)[0]
        shape, args = get_origin(kind), get_args(kind)
        if isinstance(kind, type) and issubclass(kind, Section):
            found.append(Below(field.name, None, kind, option))
        elif shape is dict and args[1] is not Value:
            of, inner = _unwrapped(args[1])
            found.append(Below(field.name, dict, inner or of, option))
        elif shape is tuple and issubclass(args[0], Section):
            found.append(Below(field.name, tuple, args[0], option))
        elif option is not None:
            default = None if field.required else field.default
            found.append(option._replace(name=field.name, default=default))
    return tuple(found)


def _unwrapped(kind: Any) -> tuple[Any, Option | None]:
    """Return a type without its note, and the row of the note."""
    if get_origin(kind) is not Annotated:
        return kind, None
    option = next(meta.extra["row"] for meta in kind.__metadata__)
    return kind.__origin__, option._replace(kind=option.kind or _KINDS.get(kind.__origin__, ""))


def rows(section: type[Section]) -> tuple[Option, ...]:
    """Return the keys of a section."""
    return tuple(field for field in fields(section) if isinstance(field, Option))


def below(section: type[Section]) -> tuple[Below, ...]:
    """Return what stands below a section."""
    return tuple(field for field in fields(section) if isinstance(field, Below))
