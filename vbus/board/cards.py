"""Card adapters: how addresses on a plug-in card select a chip and its ports."""

from collections.abc import Mapping


class Card:
    """Address decoding of a card, as data.

    Args:
        name: for messages.
        base: address of the card's first port.
        rows: offset from ``base`` to (number of the chip in its session, address at that chip).
    """

    __slots__ = ("_rows", "base", "name")

    def __init__(self, name: str, base: int, rows: Mapping[int, tuple[int, int]]) -> None:
        self.name: str = name
        self.base: int = base
        self._rows: dict[int, tuple[int, int]] = dict(rows)

    def decode(self, address: int) -> tuple[int, int] | None:
        """Return (chip number, chip address) behind ``address``; None if nobody answers."""
        return self._rows.get(address - self.base)

    def offsets(self) -> list[int]:
        """Return every decoded offset, in rising order."""
        return sorted(self._rows)
