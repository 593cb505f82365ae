"""What a declared field may hold, but for other parts."""

from collections.abc import Callable, Iterable
from functools import partial
from typing import Any, ClassVar, Final

MOST: Final = (1 << 63) - 1


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

    __slots__ = ("_hooks", "_values", "foreign")

    def __init__(self) -> None:
        self.foreign: bool = False
        """Whether a part of somebody else's is among it, which checks nothing before."""
        self._values: list[tuple[Any, str, Any]] = []
        self._hooks: list[Callable[[], None]] = []

    def value(self, part: Any, name: str, value: Any) -> None:
        """Set an attribute; "" calls ``value``."""
        self._values.append((part, name, value))

    def hook(self, call: Callable[[], None]) -> None:
        """Call this when all values are set."""
        self._hooks.append(call)

    def apply(self) -> None:
        """Do it."""
        for part, name, value in self._values:
            if name:
                setattr(part, name, value)
            else:
                value()
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
        self.types: tuple[type, ...] = types
        self.plain: bool = type(self) is Kind
        """Kept as it is, whatever the field holds now."""

    def owner(self, name: str) -> str:
        """Return the attribute that says what the field ``name`` may hold: that field."""
        return name

    def save(self, value: Any) -> Any:
        """Return the value as it is kept."""
        return value

    def take(self, saved: Any, now: Any, load: Load) -> Any:
        """Return the value for what was kept.

        Args:
            saved: what was kept.
            now: what the field holds now.
            load: takes what is to be done inside that.

        Raises:
            Refused: it is no such value.
        """
        kind = type(saved)
        if kind not in self.types or (kind is int and not -MOST - 1 <= saved <= MOST):
            raise self.refuse(saved)
        return saved

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
    """A number."""

    def save(self, value: Any) -> Any:
        """Return the value as it is kept."""
        return float(value)

    def take(self, saved: Any, now: Any, load: Load) -> Any:
        """Return the value for what was kept."""
        return float(super().take(saved, now, load))


class Octets(Kind):
    """Bytes."""

    def __init__(self, fixed: bool) -> None:
        super().__init__("bytes", bytes)
        self.fixed: bool = fixed

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
        load.value(now, "", partial(now.__setitem__, slice(None), saved))
        return now


class Several(Kind):
    """Several values of one kind."""

    def __init__(self, make: Callable[[Iterable[Any]], Any], each: Kind, fixed: bool) -> None:
        super().__init__("several values", tuple, list)
        self.make: Callable[[Iterable[Any]], Any] = make
        self.each: Kind = each
        self.fixed: bool = fixed

    def save(self, value: Any) -> Any:
        """Return the value as it is kept."""
        each = self.each
        return tuple([each.save(one) for one in value])

    def take(self, saved: Any, now: Any, load: Load) -> Any:
        """Return the value for what was kept."""
        super().take(saved, now, load)
        if self.fixed and len(saved) != len(now):
            raise Refused(f"wants {len(now)} values, not {len(saved)}")
        each = self.each
        return self.make([each.take(one, None, load) for one in saved])


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

    def save(self, value: Any) -> Any:
        """Return the value as it is kept."""
        return tuple([kind.save(one) for kind, one in zip(self.kinds, value, strict=True)])

    def take(self, saved: Any, now: Any, load: Load) -> Any:
        """Return the value for what was kept."""
        if len(super().take(saved, now, load)) != len(self.kinds):
            raise self.refuse(saved)
        return tuple(
            [kind.take(one, None, load) for kind, one in zip(self.kinds, saved, strict=True)]
        )


FLAG: Final = Kind("true or false", bool)
