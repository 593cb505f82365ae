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

    __slots__ = ("_hooks", "_values")

    def __init__(self) -> None:
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
    """What a field holds."""

    TEXT: ClassVar[str] = "an integer of 64 bits"
    STAYS: ClassVar[bool] = False
    """The field keeps its object; what is inside takes other values."""

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
        if type(saved) is int and -MOST - 1 <= saved <= MOST:
            return saved
        raise self.refuse(saved)

    def refuse(self, saved: Any) -> Refused:
        """Return the exception that says what was wanted."""
        text = repr(saved)
        return Refused(f"wants {self.TEXT}, not {text if len(text) < 60 else text[:56] + ' ...'}")


class Integer(Kind):
    """An integer of any size; beyond 64 bits it is kept as a decimal text."""

    TEXT: ClassVar[str] = "an integer"

    def save(self, value: Any) -> Any:
        """Return the value as it is kept."""
        return value if -MOST - 1 <= value <= MOST else str(value)

    def take(self, saved: Any, now: Any, load: Load) -> Any:
        """Return the value for what was kept."""
        if type(saved) is int:
            return saved
        if type(saved) is str and saved.lstrip("-").isdecimal():
            return int(saved)
        raise self.refuse(saved)


class Flag(Kind):
    """True or False."""

    TEXT: ClassVar[str] = "true or false"

    def take(self, saved: Any, now: Any, load: Load) -> Any:
        """Return the value for what was kept."""
        if type(saved) is bool:
            return saved
        raise self.refuse(saved)


class Mixed(Kind):
    """An integer of 64 bits, or True or False."""

    TEXT: ClassVar[str] = "an integer of 64 bits, true or false"

    def take(self, saved: Any, now: Any, load: Load) -> Any:
        """Return the value for what was kept."""
        return saved if type(saved) is bool else super().take(saved, now, load)


class Real(Kind):
    """A number."""

    TEXT: ClassVar[str] = "a number"

    def save(self, value: Any) -> Any:
        """Return the value as it is kept."""
        return float(value)

    def take(self, saved: Any, now: Any, load: Load) -> Any:
        """Return the value for what was kept."""
        if type(saved) is float or type(saved) is int:
            return float(saved)
        raise self.refuse(saved)


class Text(Kind):
    """A text."""

    TEXT: ClassVar[str] = "a text"

    def take(self, saved: Any, now: Any, load: Load) -> Any:
        """Return the value for what was kept."""
        if type(saved) is str:
            return saved
        raise self.refuse(saved)


class Octets(Kind):
    """Bytes."""

    TEXT: ClassVar[str] = "bytes"

    def __init__(self, fixed: bool) -> None:
        self.fixed: bool = fixed

    def save(self, value: Any) -> Any:
        """Return the value as it is kept."""
        return bytes(value)

    def take(self, saved: Any, now: Any, load: Load) -> Any:
        """Return the value for what was kept."""
        if type(saved) is not bytes:
            raise self.refuse(saved)
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
        self.make: Callable[[Iterable[Any]], Any] = make
        self.each: Kind = each
        self.fixed: bool = fixed

    def save(self, value: Any) -> Any:
        """Return the value as it is kept."""
        each = self.each
        return tuple([each.save(one) for one in value])

    def take(self, saved: Any, now: Any, load: Load) -> Any:
        """Return the value for what was kept."""
        if type(saved) not in (tuple, list):
            raise Refused(f"wants several values, not {saved!r}")
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
        self.kinds: list[Kind] = kinds

    def save(self, value: Any) -> Any:
        """Return the value as it is kept."""
        return tuple([kind.save(one) for kind, one in zip(self.kinds, value, strict=True)])

    def take(self, saved: Any, now: Any, load: Load) -> Any:
        """Return the value for what was kept."""
        if type(saved) not in (tuple, list) or len(saved) != len(self.kinds):
            raise Refused(f"wants {len(self.kinds)} values in a row, not {saved!r}")
        return tuple(
            [kind.take(one, None, load) for kind, one in zip(self.kinds, saved, strict=True)]
        )
