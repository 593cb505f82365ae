"""The one walk through a board file: tables to sections, and every mistake at its line."""

from collections.abc import Iterable, Mapping
from typing import Any, Final, TypeVar

from vbus import plugins
from vbus.boardfile.key import NAMES, Below, Names, Section, below, rows
from vbus.boardfile.lines import Path
from vbus.boardfile.source import Source, absent, key_text
from vbus.core.errors import VbusError
from vbus.core.options import Option
from vbus.core.values.settings import A_NAME, NAME_FORM, allowed, among, check_value, quoted

_Section = TypeVar("_Section", bound=Section)

WITHDRAWN: Final = {"substeps": "motors are solved exactly; leave substeps out"}
"""Keys of earlier versions, and what to do about each."""


class Walker:
    """Reads tables as their sections say; what is wrong goes to ``source``.

    Args:
        source: takes the mistakes.
        data: the whole file.
    """

    def __init__(self, source: Source, data: Mapping[str, Any]) -> None:
        self._source: Source = source
        self._data: Mapping[str, Any] = data
        self._references: list[tuple[Path, str, str]] = []

    def known(self, kind: str) -> list[str]:
        """Return every name of a section, those included that could not be read."""
        tables = self._data.get(kind)
        return list(tables) if isinstance(tables, dict) else []

    def section(
        self, of: type[_Section], path: Path, table: Any, /, **extra: Any
    ) -> _Section | None:
        """Read one table.

        Args:
            of: its section.
            path: where it stands.
            table: what the file has there.
            extra: fields of the section that are no keys.

        Returns:
            The section; None if a key it cannot do without is missing or wrong.
        """
        mine = {row.name: row for row in rows(of)}
        if of.SHORT and not isinstance(table, dict):
            value = self._value(mine[of.SHORT], path, table)
            return None if value is None else of(**extra, **{of.SHORT: value})
        if not isinstance(table, dict):
            a_table = "a table" if isinstance(path[-1], int) else f"the table [{key_text(path)}]"
            self._source.fail(path, f"found {quoted(table)}; this is {a_table}")
            return None
        own: Iterable[Option] = ()
        if of.KINDS and isinstance(named := table.get(of.KINDS.key), str):
            try:
                own = of.KINDS.find(named)
            except VbusError as error:
                self._source.fail((*path, of.KINDS.key), str(error))
                return None
        options = mine | {row.name: row for row in own}
        tables = {one.name: one for one in below(of)}
        settings: dict[str, Any] = {}
        whole = True
        for name, value in table.items():
            where = (*path, name)
            if name in tables:
                read = self._below(tables[name], where, value)
                if read is not None:
                    extra[name] = read
                # At the top the other sections are read and checked all the same.
                elif path:
                    whole = False
            elif name not in options:
                self._unknown(where, name, [*options, *tables])
            elif (read := self._value(options[name], where, value)) is not None:
                (extra if name in mine else settings)[name] = read
        for row in options.values():
            if row.default is None and row.name not in table:
                self._source.fail(path, f'key "{row.name}" is missing: {row.title}; {allowed(row)}')
            whole = whole and (row.default is not None or row.name in extra or row.name in settings)
        values = {n: extra.get(n) if n in table else row.default for n, row in mine.items()}
        for name, needed in (mine | {one.name: one.row for one in below(of) if one.row}).items():
            lacking = [
                f'{key} = "{wanted}"' if wanted else f'"{key}" ({mine[key].title})'
                for key, _, wanted in (need.partition("=") for need in needed.needs)
                if (values[key] not in (wanted, None)
                    if wanted else values[key] == mine[key].default)
            ]  # fmt: skip
            if lacking and name in table:
                self._source.fail((*path, name), f'"{name}" needs {", ".join(lacking)}')
        if settings:
            extra["settings"] = settings
        return of(**extra) if whole else None

    def _unknown(self, path: Path, name: str, known: list[str]) -> None:
        what, known = ("key", sorted(known)) if path[1:] else ("section", known)
        hint = f"unknown {what}; {among(name, known, 'allowed are')}"
        if not path[1:] and not isinstance(self._data[name], dict | list):
            hint = f"a key stands below a section, such as [board]; {hint}"
        self._source.fail(path, WITHDRAWN.get(name, hint))

    # -- values -------------------------------------------------------------------------------

    def _value(self, row: Option, path: Path, value: object) -> Any:
        """Return the value of a key; None if it is wrong."""
        if row.kind == NAMES:
            return self._names(path, value, row.ref)
        try:
            checked = check_value(value, row)
        except ValueError as error:
            self._source.fail(path, f"found {quoted(value)}; {error}")
            return None
        if row.ref and isinstance(checked, str) and checked:
            self._references.append((path, row.ref, checked))
        return checked

    def _names(self, path: Path, value: object, ref: str = "") -> Names | None:
        if not isinstance(value, list) or not all(isinstance(item, str) for item in value):
            self._source.fail(path, f'found {quoted(value)}; write a list of names, such as ["x"]')
            return None
        for place, item in enumerate(value):
            # A word such as "none" may stand for several axes.
            if item in value[:place] and item not in ref.split("|"):
                self._source.fail((*path, place), f'"{item}" stands in the list twice')
            if ref:
                self._references.append(((*path, place), ref, item))
        return tuple(value if "|" in ref else dict.fromkeys(value))

    # -- what stands below --------------------------------------------------------------------

    def _below(self, field: Below, path: Path, value: Any) -> Any:
        """Return what a field holds that is no key; None if the section cannot do without it."""
        if field.shape is None:
            return self.section(field.of, path, value) or field.of()
        if field.shape is tuple and not field.named:
            return self._list(field.of, path, value)
        if not isinstance(value, dict):
            a_table = f"tables [{key_text(path)}.NAME]" if field.named else "a table of keys"
            self._source.fail(path, f"found {quoted(value)}; write {a_table}")
            return None
        found = {}
        for name, item in value.items():
            where = (*path, name)
            if field.named:
                if not field.of.ANY_NAME and not NAME_FORM.fullmatch(name):
                    self._source.fail(where, A_NAME)
                else:
                    found[name] = self.section(field.of, where, item, name=name)
            elif field.of == Names:
                found[name] = self._names(where, [item] if isinstance(item, str) else item)
                if found[name] is None:
                    return None
            elif isinstance(field.of, Option):
                found |= self._texts(field.of, len(path), where, item)
            else:
                if field.row and name not in field.row.choices:
                    known = among(name, field.row.choices, "known are")
                    self._source.fail(where, f"unknown {field.row.title}; {known}")
                found[name] = self.section(field.of, where, item)
        whole = {name: one for name, one in found.items() if one is not None}
        return tuple(whole.values()) if field.named else whole

    def _list(self, of: type[_Section], path: Path, value: Any) -> tuple[_Section, ...] | None:
        """Read ``[[kind]]``; a blank stands for one that cannot be read, if places count."""
        if not isinstance(value, list):
            lists = f"this is a list of tables: [[{key_text(path)}]]"
            self._source.fail(path, f"found {quoted(value)}; {lists}")
            return None
        found = []
        knows_place = "place" in of.__struct_fields__
        for place, table in enumerate(value):
            extra = {"place": place} if knows_place else {}
            read = self.section(of, (*path, place), table, **extra)
            if read is not None or not knows_place:
                found.append(read or of.blank())
        return tuple(found)

    def _texts(self, row: Option, depth: int, path: Path, value: Any) -> dict[str, Any]:
        """Return texts by name; an unquoted dotted name arrives as a table in a table."""
        if isinstance(value, dict) and row.kind == "choice":
            inner = [self._texts(row, depth, (*path, name), item) for name, item in value.items()]
            return {name: text for one in inner for name, text in one.items()}
        try:
            return {".".join(map(str, path[depth:])): check_value(value, row)}
        except ValueError as error:
            self._source.fail(path, f"found {quoted(value)}; {row.title or error}")
            return {}

    # -- references ---------------------------------------------------------------------------

    def resolve(self) -> None:
        """Complain of every name that stands for nothing."""
        for path, ref, name in self._references:
            kind, *words = ref.split("|")
            if "." in kind:
                if name not in plugins.names(kind):
                    self._source.fail(path, f"found {quoted(name)}; {plugins.known(kind, name)}")
            elif name not in (*words, *self.known(kind)):
                self._source.fail(path, absent(kind, name, self.known(kind)))
