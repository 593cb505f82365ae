"""What a declared field may hold, but for other parts."""

from collections.abc import Callable, Iterable, Sequence
from typing import Any, ClassVar, Final

MOST: Final = (1 << 63) - 1
NUMBERS: Final[frozenset[type]] = frozenset((int, bool, float))
"""Types whose values can be compared with each other, to check many at once."""


def small(numbers: Sequence[Any]) -> bool:
    """Tell whether all numbers and flags lie within 64 bits."""
    return not numbers or bool(min(numbers) >= -MOST - 1 and max(numbers) <= MOST)


ALL: Final = slice(None)


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

    __slots__ = ("_hooks", "_steps", "foreign")

    def __init__(self) -> None:
        self.foreign: bool = False
        """Whether a part of somebody else's is among it, which checks nothing before."""
        self._steps: list[tuple[Callable[[Any, Any], object], Any, Any]] = []
        self._hooks: list[Callable[[], None]] = []

    def put(self, call: Callable[[Any, Any], object], what: Any, value: Any) -> None:
        """Call this in its turn, with both."""
        self._steps.append((call, what, value))

    def hook(self, call: Callable[[], None]) -> None:
        """Call this when all values are set."""
        self._hooks.append(call)

    def apply(self) -> None:
        """Do it."""
        for call, what, value in self._steps:
            call(what, value)
        for hook in self._hooks:
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
        """Kept as it is, whatever the field holds now."""
        self.usual: type | None = types[0] if types and types[0] in NUMBERS else None
        """Type of a number or flag that needs no other check than that of its size."""

    def owner(self, name: str) -> str:
        """Return the attribute that says what the field ``name`` may hold, "" if none does."""
        return ""

    def save(self, value: Any) -> Any:
        """Return the value as it is kept."""
        return value

    def save_all(self, values: Iterable[Any]) -> tuple[Any, ...]:
        """Return several values as they are kept."""
        if self.plain:
            return tuple(values)
        save = self.save
        return tuple([save(value) for value in values])

    def take(self, saved: Any, now: Any, load: Load) -> Any:
        """Return the value for what was kept.

        Args:
            saved: what was kept.
            now: what the :meth:`owner` is now.
            load: takes what is to be done inside that.

        Raises:
            Refused: it is no such value.
        """
        kind = type(saved)
        if kind not in self.types or (kind is int and not -MOST - 1 <= saved <= MOST):
            raise self.refuse(saved)
        return saved

    def take_all(self, saved: Sequence[Any], load: Load) -> Sequence[Any]:
        """Return the values for several that were kept."""
        if self.usual is not None and {self.usual}.issuperset(map(type, saved)) and small(saved):
            return saved
        take = self.take
        return [take(value, None, load) for value in saved]

    def refuse(self, saved: Any) -> Refused:
        """Return the exception that says what was wanted."""
        text = repr(saved)
        return Refused(f"wants {self.text}, not {text if len(text) < 60 else text[:56] + ' ...'}")


class Integer(Kind):
    """An integer of any size; beyond 64 bits it is kept as a decimal text."""

    def save(self, value: Any) -> Any:
        """Return the value as it is kept."""
        return value if -MOST - 1 <= value <= MOST else str(value)

    def take(self, saved: Any, now: Any, load: Load) -> Any:
        """Return the value for what was kept."""
        if type(saved) is str and saved.lstrip("-").isdecimal():
            return int(saved)
        if type(saved) is not int:
            raise self.refuse(saved)
        return saved


class Real(Kind):
    """A finite number."""

    def save(self, value: Any) -> Any:
        """Return the value as it is kept."""
        return float(value)

    def take(self, saved: Any, now: Any, load: Load) -> Any:
        """Return the value for what was kept."""
        number = float(super().take(saved, now, load))
        if number - number != 0.0:
            raise self.refuse(saved)
        return number

    def take_all(self, saved: Sequence[Any], load: Load) -> Sequence[Any]:
        """Return the values for several that were kept."""
        numbers = super().take_all(saved, load)
        total = sum(numbers)
        if total - total != 0:
            raise self.refuse(saved)
        return numbers


class Octets(Kind):
    """Bytes."""

    def __init__(self, fixed: bool) -> None:
        super().__init__("bytes", bytes)
        self.fixed: bool = fixed

    def owner(self, name: str) -> str:
        """Return the attribute that says how many there are."""
        return name if self.fixed or self.STAYS else ""

    def save(self, value: Any) -> Any:
        """Return the value as it is kept."""
        return bytes(value)

    def take(self, saved: Any, now: Any, load: Load) -> Any:
        """Return the value for what was kept."""
        super().take(saved, now, load)
        if self.fixed and len(saved) != len(now):
            raise Refused(f"wants {len(now)} bytes, not {len(saved)}")
        return saved


class InPlace(Octets):
    """Bytes others look at too, so that they stay where they are."""

    STAYS: ClassVar[bool] = True

    def take(self, saved: Any, now: Any, load: Load) -> Any:
        """Return the array as it is; its content comes with the others."""
        super().take(saved, now, load)
        load.put(now.__setitem__, ALL, saved)
        return now


class Several(Kind):
    """Several values of one kind."""

    def __init__(self, make: Callable[[Iterable[Any]], Any], each: Kind, fixed: bool) -> None:
        super().__init__("several values", tuple, list)
        self.make: Callable[[Iterable[Any]], Any] = make
        self.each: Kind = each
        self.fixed: bool = fixed

    def owner(self, name: str) -> str:
        """Return the attribute that says how many there are."""
        return name if self.fixed else ""

    def save(self, value: Any) -> Any:
        """Return the value as it is kept."""
        return self.each.save_all(value)

    def take(self, saved: Any, now: Any, load: Load) -> Any:
        """Return the value for what was kept."""
        if type(saved) not in self.types:
            raise self.refuse(saved)
        if self.fixed and len(saved) != len(now):
            raise Refused(f"wants {len(now)} values, not {len(saved)}")
        return self.make(self.each.take_all(saved, load))


class Sorted(Several):
    """Several values whose order says nothing."""

    def save(self, value: Any) -> Any:
        """Return the value as it is kept."""
        return super().save(sorted(value))


class Row(Kind):
    """A tuple of one value of each kind."""

    def __init__(self, kinds: list[Kind]) -> None:
        super().__init__(f"{len(kinds)} values in a row", tuple, list)
        self.kinds: list[Kind] = kinds
        self.kept: bool = all(kind.plain for kind in kinds)
        """Kept as it is."""

    def save(self, value: Any) -> Any:
        """Return the value as it is kept."""
        if self.kept:
            return tuple(value)
        return tuple([kind.save(one) for kind, one in zip(self.kinds, value, strict=True)])

    def take(self, saved: Any, now: Any, load: Load) -> Any:
        """Return the value for what was kept."""
        if len(super().take(saved, now, load)) != len(self.kinds):
            raise self.refuse(saved)
        return tuple(
            [kind.take(one, None, load) for kind, one in zip(self.kinds, saved, strict=True)]
        )

    def take_all(self, saved: Sequence[Any], load: Load) -> Sequence[Any]:
        """Return the rows for several that were kept, column by column."""
        shaped = self.types.issuperset(map(type, saved))
        if not saved or not shaped or {*map(len, saved)} != {len(self.kinds)}:
            return super().take_all(saved, load)
        columns = zip(self.kinds, zip(*saved, strict=True), strict=True)
        return list(zip(*[kind.take_all(each, load) for kind, each in columns], strict=True))


FLAG: Final = Kind("true or false", bool)
