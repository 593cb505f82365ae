"""What a declared field may hold, but for other parts."""

from collections.abc import Callable, Iterable
from functools import cache, cached_property, reduce
from operator import or_
from sys import float_info
from types import GenericAlias
from typing import Annotated, Any, ClassVar, Final

MOST: Final = (1 << 63) - 1
NUMBERS: Final[frozenset[type]] = frozenset((int, bool, float))
"""Types of numbers and flags."""
ALL: Final = slice(None)


@cache
def schemas() -> dict[type, Any]:
    """Return types for msgspec, which checks many values at once.

    It is imported at the first load of a list: hosts, which load none, save 20 ms at their start.
    """
    from msgspec import Meta

    return {
        int: Annotated[int, Meta(ge=-MOST - 1, le=MOST)], bool: bool, str: str,
        float: Annotated[float, Meta(ge=-float_info.max, le=float_info.max)],
    }  # fmt: skip


class Refused(Exception):
    """A value is not what its field can hold.

    Attributes:
        place: the field, below the part that is loaded.
        text: what is wrong with it.
    """

    def __init__(self, text: str, place: str = "") -> None:
        super().__init__(text)
        self.text: str = text
        self.place: str = place

    def below(self, name: str) -> "Refused":
        """Return the same, seen from the part that has it in the field ``name``."""
        return Refused(self.text, f"{name}.{self.place}" if self.place else name)


class Load:
    """What loading does once everything has been checked."""

    __slots__ = ("hooks", "steps")

    def __init__(self) -> None:
        self.steps: list[tuple[Callable[[Any, Any], object], Any, Any]] = []
        self.hooks: list[Callable[[], None]] = []

    def put(self, call: Callable[[Any, Any], object], what: Any, value: Any) -> None:
        """Call this in its turn, with both."""
        self.steps.append((call, what, value))

    def apply(self) -> None:
        """Do it."""
        for call, what, value in self.steps:
            call(what, value)
        for hook in self.hooks:
            hook()


class Kind:
    """What a field holds: a value of one of some types, with integers of 64 bits.

    Args:
        text: what that is, for an error.
        types: the types.
    """

    STAYS: ClassVar[bool] = False
    """The field keeps its object; what is inside takes other values."""

    def __init__(self, text: str, *types: type) -> None:
        self.text: str = text
        self.types: frozenset[type] = frozenset(types)
        self.plain: bool = type(self) is Kind
        """Whether a value is saved unchanged, whatever the field holds now."""
        self.usual: type | None = types[0] if types and types[0] in NUMBERS else None
        """Type of a number or flag that needs no other check than that of its size."""

    def schema(self) -> Any:
        """Return the type of such values for msgspec; None: it cannot check them."""
        known = schemas()
        if not self.plain or not self.types <= known.keys():
            return None
        return reduce(or_, [known[one] for one in self.types])

    def owner(self, name: str) -> str:
        """Return the attribute that says what the field ``name`` may hold, "" if none does."""
        return ""

    def save(self, value: Any) -> Any:
        """Return the value as it is saved."""
        return value

    def save_all(self, values: Iterable[Any]) -> tuple[Any, ...]:
        """Return several values as they are saved."""
        if self.plain:
            return tuple(values)
        save = self.save
        return tuple([save(value) for value in values])

    def take(self, saved: Any, now: Any, load: Load) -> Any:
        """Return the value for what was saved.

        Args:
            saved: what was saved.
            now: what the :meth:`owner` is now.
            load: takes what is to be done inside that.

        Raises:
            Refused: it is no such value.
        """
        kind = type(saved)
        # type(), not isinstance(): True is an int in Python.
        if kind not in self.types or (kind is int and not -MOST - 1 <= saved <= MOST):
            raise self.refuse(saved)
        return saved

    def refuse(self, saved: Any) -> Refused:
        """Return the exception that says what was wanted."""
        text = repr(saved)
        return Refused(f"wants {self.text}, not {text if len(text) < 60 else text[:56] + ' ...'}")


class Integer(Kind):
    """An integer of any size; beyond 64 bits it is saved as a decimal text."""

    def save(self, value: Any) -> Any:
        """Return the value as it is saved."""
        # msgpack, which snapshots are written in, has integers of 64 bits.
        return value if -MOST - 1 <= value <= MOST else str(value)

    def take(self, saved: Any, now: Any, load: Load) -> Any:
        """Return the value for what was saved."""
        if type(saved) is str and saved.lstrip("-").isdecimal():
            return int(saved)
        if type(saved) is not int:
            raise self.refuse(saved)
        return saved


class Real(Kind):
    """A finite number."""

    def __init__(self) -> None:
        super().__init__("a number", float, int)

    def schema(self) -> Any:
        """Return the type of such values for msgspec."""
        return schemas()[float]

    def save(self, value: Any) -> Any:
        """Return the value as it is saved."""
        return float(value)

    def take(self, saved: Any, now: Any, load: Load) -> Any:
        """Return the value for what was saved."""
        number = float(super().take(saved, now, load))
        # Not finite: inf - inf and nan - nan are nan.
        if number - number != 0.0:
            raise self.refuse(saved)
        return number


class Octets(Kind):
    """Bytes: so many, or any number of them."""

    def __init__(self, count: int | None = None) -> None:
        super().__init__("bytes", bytes)
        self.count: int | None = count

    def save(self, value: Any) -> Any:
        """Return the value as it is saved."""
        return bytes(value)

    def take(self, saved: Any, now: Any, load: Load) -> Any:
        """Return the value for what was saved."""
        super().take(saved, now, load)
        if self.count is not None and len(saved) != self.count:
            raise Refused(f"wants {self.count} bytes, not {len(saved)}")
        return saved


class InPlace(Octets):
    """Bytes others look at too, so that they stay where they are."""

    STAYS: ClassVar[bool] = True

    def __init__(self, fixed: bool) -> None:
        super().__init__()
        self.fixed: bool = fixed

    def take(self, saved: Any, now: Any, load: Load) -> Any:
        """Return the array as it is; its content comes with the others."""
        super().take(saved, now, load)
        if self.fixed and len(saved) != len(now):
            raise Refused(f"wants {len(now)} bytes, not {len(saved)}")
        # Later: nothing is set before all of the state has been checked.
        load.put(now.__setitem__, ALL, saved)
        return now


class Repeated(Kind):
    """Several values of one kind: as many as ``like`` has, or ``"..."``, as the field has now."""

    def __init__(self, make: type, each: Kind, like: str = "...") -> None:
        super().__init__("several values", tuple, list)
        self.make: type = make
        self.each: Kind = each
        self.like: str = like

    def schema(self) -> Any:
        """Return the type of such values for msgspec; None: it cannot check them."""
        each = self.each.schema()
        more = (...,) if self.make is tuple else ()
        return each and GenericAlias(self.make, (each, *more))

    @cached_property
    def _many(self) -> Callable[[Any], Any] | None:
        """The function that checks and makes all values at once; None: msgspec has no type."""
        schema = self.schema()
        if schema is None:
            return None
        from msgspec import convert, defstruct

        # The type is that of a field: msgspec looks only once at a struct.
        values: Any = defstruct("Values", [("values", schema)])
        return lambda saved: convert({"values": saved}, values).values

    def owner(self, name: str) -> str:
        """Return the attribute that says how many there are."""
        return "" if self.like == "..." else self.like or name

    def save(self, value: Any) -> Any:
        """Return the value as it is saved."""
        return self.each.save_all(value)

    def take(self, saved: Any, now: Any, load: Load) -> Any:
        """Return the value for what was saved."""
        if type(saved) not in self.types:
            raise self.refuse(saved)
        if self.like != "..." and len(saved) != len(now):
            raise Refused(f"wants {len(now)} values, not {len(saved)}")
        many = self._many
        if many is not None:
            try:
                return many(saved)
            except ValueError:
                # One of them is none, or wants to be converted: they are taken one by one.
                pass
        take = self.each.take
        return self.make([take(value, None, load) for value in saved])


class Sorted(Repeated):
    """Several values whose order says nothing."""

    def save(self, value: Any) -> Any:
        """Return the value as it is saved."""
        # Two equal states must be equal bytes.
        return super().save(sorted(value))


class Row(Kind):
    """A tuple of one value of each kind."""

    def __init__(self, kinds: list[Kind]) -> None:
        super().__init__(f"{len(kinds)} values in a row", tuple, list)
        self.kinds: list[Kind] = kinds
        self.unchanged: bool = all(kind.plain for kind in kinds)
        """Whether a row is saved unchanged."""

    def schema(self) -> Any:
        """Return the type of such values for msgspec; None: it cannot check them."""
        each = [kind.schema() for kind in self.kinds]
        return None if None in each else GenericAlias(tuple, tuple(each))

    def save(self, value: Any) -> Any:
        """Return the value as it is saved."""
        if self.unchanged:
            return tuple(value)
        return tuple([kind.save(one) for kind, one in zip(self.kinds, value, strict=True)])

    def take(self, saved: Any, now: Any, load: Load) -> Any:
        """Return the value for what was saved."""
        if len(super().take(saved, now, load)) != len(self.kinds):
            raise self.refuse(saved)
        return tuple(
            [kind.take(one, None, load) for kind, one in zip(self.kinds, saved, strict=True)]
        )


FLAG: Final = Kind("true or false", bool)
