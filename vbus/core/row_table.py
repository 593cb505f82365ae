"""A table whose rows are found by name and by code; a row that stands in it twice is refused."""

from collections.abc import Iterable, Iterator
from typing import Any, Generic, TypeVar

Row = TypeVar("Row", bound=Any)


class RowTable(Generic[Row]):
    """Rows that have a ``name``, and ``codes`` each of which leads to one row at most."""

    __slots__ = ("_by_code", "_by_name", "rows")

    def __init__(self, *rows: Row) -> None:
        self.rows: tuple[Row, ...] = rows
        self._by_name: dict[str, Row] = {}
        self._by_code: dict[int, Row] = {}
        for row in rows:
            # A slip of the pen is found when the table is imported, not when a host uses the row.
            if row.name in self._by_name:
                raise ValueError(f"{row.name} stands in the table twice")
            self._by_name[row.name] = row
            codes: Iterable[int] = row.codes
            for code in codes:
                if code in self._by_code:
                    raise ValueError(f"{code:02X}H is {row.name} and {self._by_code[code].name}")
                self._by_code[code] = row

    def __iter__(self) -> Iterator[Row]:
        return iter(self.rows)

    def __len__(self) -> int:
        return len(self.rows)

    def __getitem__(self, name: str) -> Row:
        return self._by_name[name]

    def at(self, code: int) -> Row | None:
        """Return the row with this code, or None."""
        return self._by_code.get(code)
