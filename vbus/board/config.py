"""The board file: TOML to frozen structs, or one error that names every mistake and its line."""

import re
import tomllib
from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path as FilePath
from typing import Any, Final, TypeVar

import msgspec

from vbus.board import checks, plugins, sections
from vbus.board.fault_checks import check_fault
from vbus.board.network_checks import check_zenoh
from vbus.board.settings import check_table, listed, quoted, suggestion
from vbus.board.source import BoardFileError, Problem, Source
from vbus.board.toml_lines import Path
from vbus.errors import PluginError
from vbus.faults.table import faults
from vbus.options import Option, Value
from vbus.signals.axis import SWITCHES

_Section = TypeVar("_Section", bound=sections.Section)
_NAME: Final = re.compile(r"[A-Za-z_][A-Za-z0-9_-]*")
_NAMED: Final = ("chips", "plants", "nets", "buses", "cards", "pinmaps", "nodes")
_SECTIONS: Final = ("board", "violations", *_NAMED, "hosts", "record", "waves", "zenoh", "metrics",
                    "faults")  # fmt: skip


def read_board_file(path: str | FilePath) -> tuple[sections.BoardFile, Source]:
    """Read and check a board file.

    Returns:
        The file as structs, and its source, for those who find mistakes later.

    Raises:
        BoardFileError: the file cannot be read, is no TOML, or has mistakes: all are named.
    """
    return read_board_text(_text_of(path), str(path))


def _text_of(path: str | FilePath) -> str:
    try:
        return FilePath(path).read_bytes().decode()
    except OSError as error:
        raise BoardFileError(
            [Problem(str(path), 0, "", f"cannot be read: {error.strerror}")]
        ) from None
    except UnicodeDecodeError as error:
        line = error.object.count(b"\n", 0, error.start) + 1
        raise BoardFileError([Problem(str(path), line, "", "this is no UTF-8 text")]) from None


def read_board_text(text: str, file: str = "board.toml") -> tuple[sections.BoardFile, Source]:
    """Check a board file that is already in memory; ``file`` is its name in messages."""
    data = _parsed(file, text)
    source = Source(file, text)
    return _Reader(source, data).read(), source


def _parsed(file: str, text: str) -> dict[str, Any]:
    try:
        return tomllib.loads(text)
    except RecursionError:
        raise BoardFileError([Problem(file, 0, "", "nested too deeply")]) from None
    except ValueError as error:
        raise BoardFileError([_no_toml(file, text, str(error))]) from None


def read_zenoh_file(path: str | FilePath) -> sections.ZenohSection:
    """Read and check ``[zenoh]`` of a file, as a router wants it; nothing else is looked at.

    Raises:
        BoardFileError: as of :func:`read_board_file`.
    """
    text, name = _text_of(path), str(path)
    source = Source(name, text)
    section = _Reader(source, _parsed(name, text)).zenoh()
    check_zenoh(section, source)
    source.finish()
    return section


def _no_toml(file: str, text: str, reason: str) -> Problem:
    match = re.fullmatch(r"(.*) \(at line (\d+), column (\d+)\)", reason, re.DOTALL)
    if match is None:
        end = re.fullmatch(r"(.*) \(at end of document\)", reason, re.DOTALL)
        line = text.count("\n") + 1 if end else 0
        return Problem(file, line, "", f"no TOML: {end[1] if end else reason}")
    return Problem(file, int(match[2]), "", f"no TOML: {match[1]} (column {match[3]})")


class _Reader:
    """Turns the tables of one file into structs; what is wrong goes to ``source``."""

    def __init__(self, source: Source, data: dict[str, Any]) -> None:
        self._source: Source = source
        self._data: dict[str, Any] = data

    def read(self) -> sections.BoardFile:
        fail = self._source.fail
        for key in self._data:
            if key not in _SECTIONS:
                hint = suggestion(key, _SECTIONS)
                fail((key,), f"unknown section; {hint}allowed are {listed(_SECTIONS)}")
        file = sections.BoardFile(
            path=self._source.file,
            board=self._board(),
            violations=dict(self._violations()),
            chips=tuple(self._chips()),
            plants=tuple(self._plants()),
            nets=tuple(self._nets()),
            buses=tuple(self._plain("buses", sections.BusSection)),
            cards=tuple(self._cards()),
            pinmaps=tuple(self._pin_maps()),
            hosts=tuple(self._hosts()),
            record=self._record(),
            waves=tuple(self._plain("waves", sections.WaveSection)),
            nodes=tuple(self._plain("nodes", sections.NodeSection)),
            zenoh=self.zenoh(),
            metrics=self._metrics(),
            faults=tuple(self._faults()),
        )
        known = {kind: list(self._table((kind,), self._data) or ()) for kind in _NAMED}
        checks.check(file, known, self._source)
        self._source.finish()
        return file

    # -- tables -------------------------------------------------------------------------------

    def _table(self, path: Path, parent: Mapping[str, Any]) -> dict[str, Any] | None:
        """Return the table at the end of ``path``; an absent one is empty, a wrong one None."""
        value = parent.get(str(path[-1]), {})
        if isinstance(value, dict):
            return value
        self._source.fail(path, f"found {quoted(value)}; this is a table of keys")
        return None

    def _named(self, kind: str) -> Iterator[tuple[str, dict[str, Any]]]:
        """Give the tables ``[kind.NAME]`` whose name may stand in ``"name.pin"``."""
        section = self._table((kind,), self._data) or {}
        for name in section:
            if not _NAME.fullmatch(name):
                self._source.fail(
                    (kind, name),
                    "a name begins with a letter and goes on with letters, digits, - and _",
                )
                continue
            table = self._table((kind, name), section)
            if table is not None:
                yield name, table

    def _keys(
        self,
        section: type[_Section],
        table: Mapping[str, Any],
        path: Path,
        own: Iterable[Option] = (),
        nested: tuple[str, ...] = (),
        **extra: object,
    ) -> _Section | None:
        """Check one table; return its struct, or None if a key it cannot do without is wrong.

        Args:
            section: the struct.
            table: what the file has.
            path: where it stands.
            own: keys that a part adds; they go to the field ``settings``.
            nested: keys that hold tables, read by the caller and given in ``extra``.
            extra: further fields of the struct.
        """
        options = list(sections.rows(section))
        lists = {row.name for row in options if row.kind == sections.NAMES}
        own = list(own)
        placeholders = [Option(name, "text", "", "") for name in (*sorted(lists), *nested)]
        single = [row for row in options if row.name not in lists]
        plain = {key: value for key, value in table.items() if key not in lists | {*nested}}
        wrong: list[str] = []

        def complain(key: str, message: str) -> None:
            wrong.append(key)
            self._source.fail((*path, key) if key else path, message)

        checked = check_table(plain, [*single, *own, *placeholders], complain)
        fields: dict[str, object] = dict(extra)
        settings: dict[str, Value] = {}
        mine = {row.name for row in single}
        for key, value in checked.items():
            if key in mine:
                fields[key] = value
            else:
                settings[key] = value
        if settings:
            fields["settings"] = settings
        for row in options:
            if row.name in lists and row.name in table:
                names = self._names((*path, row.name), table[row.name])
                if names is None:
                    wrong.append(row.name)
                else:
                    fields[row.name] = names
            elif row.name in lists and row.default is None:
                complain("", f'key "{row.name}" is missing: {row.title}')
        try:
            return msgspec.convert(fields, section)
        except msgspec.ValidationError:
            if not wrong:
                raise
            return None

    def _names(self, path: Path, value: object) -> tuple[str, ...] | None:
        if isinstance(value, list) and all(isinstance(item, str) for item in value):
            names: list[str] = []
            for place, item in enumerate(value):
                if item not in names or item == sections.NO_PLANT:
                    names.append(item)
                else:
                    self._source.fail((*path, place), f'"{item}" stands in the list twice')
            return tuple(names)
        self._source.fail(path, f'found {quoted(value)}; write a list of names, such as ["x"]')
        return None

    def _plain(self, kind: str, section: type[_Section]) -> Iterator[_Section]:
        for name, table in self._named(kind):
            read = self._keys(section, table, (kind, name), name=name)
            if read is not None:
                yield read

    # -- sections -----------------------------------------------------------------------------

    def _board(self) -> sections.BoardSection:
        table = self._table(("board",), self._data) or {}
        read = self._keys(sections.BoardSection, table, ("board",)) or sections.BoardSection()
        if not read.name:
            return msgspec.structs.replace(read, name=FilePath(self._source.file).stem)
        if not _NAME.fullmatch(read.name):
            self._source.fail(
                ("board", "name"),
                f"found {quoted(read.name)}; a name begins with a letter and goes on with letters,"
                " digits, - and _",
            )
        return read

    def _record(self) -> sections.RecordSection:
        table = self._table(("record",), self._data) or {}
        read = self._keys(sections.RecordSection, table, ("record",))
        return read or sections.RecordSection()

    def _metrics(self) -> sections.MetricsSection:
        table = self._table(("metrics",), self._data) or {}
        read = self._keys(sections.MetricsSection, table, ("metrics",))
        return read or sections.MetricsSection()

    def zenoh(self) -> sections.ZenohSection:
        """Read ``[zenoh]``."""
        path = ("zenoh",)
        table = self._table(path, self._data) or {}
        extra: dict[str, object] = {}
        if "allow" in table:
            rights = self._table((*path, "allow"), table) or {}
            lists = {name: self._names((*path, "allow", name), rights[name]) for name in rights}
            extra["allow"] = {name: keys or () for name, keys in lists.items()}
        read = self._keys(sections.ZenohSection, table, path, (), ("allow",), **extra)
        return read or sections.ZenohSection()

    def _violations(self) -> Iterator[tuple[str, str]]:
        """Give rule or family and level; an unquoted dotted rule arrives as a table in a table."""
        pending: list[tuple[Path, object]] = [
            (("violations", key), value)
            for key, value in (self._table(("violations",), self._data) or {}).items()
        ]
        while pending:
            path, value = pending.pop(0)
            if isinstance(value, dict):
                pending.extend(((*path, key), item) for key, item in value.items())
            elif value in sections.LEVELS:
                yield ".".join(str(key) for key in path[1:]), str(value)
            else:
                levels = listed(quoted(level) for level in sections.LEVELS)
                hint = suggestion(str(value), sections.LEVELS)
                self._source.fail(path, f"found {quoted(value)}; {hint}allowed are {levels}")

    def _chips(self) -> Iterator[sections.ChipSection]:
        for name, table in self._named("chips"):
            path = ("chips", name)
            options: tuple[Option, ...] | None = ()
            part = table.get("part")
            if isinstance(part, str):
                options = self._options(path, "part", part)
            if options is not None:
                read = self._keys(sections.ChipSection, table, path, options, name=name)
                if read is not None:
                    yield read

    def _options(self, path: Path, key: str, value: str) -> tuple[Option, ...] | None:
        """Return the settings of a part or model; None if nobody knows it."""
        try:
            if key == "part":
                return plugins.chip_class(value).OPTIONS
            return plugins.plant_class(value).OPTIONS
        except PluginError as error:
            self._source.fail((*path, key), str(error))
            return None

    def _plants(self) -> Iterator[sections.PlantSection]:
        for name, table in self._named("plants"):
            path = ("plants", name)
            options: tuple[Option, ...] | None = ()
            model = table.get("model")
            if isinstance(model, str):
                options = self._options(path, "model", model)
            if options is None:
                continue
            switches = {}
            section = self._table((*path, "switches"), table) or {}
            for switch in section:
                where = (*path, "switches", switch)
                if switch not in SWITCHES:
                    hint = suggestion(switch, SWITCHES)
                    self._source.fail(where, f"unknown switch; {hint}known are {listed(SWITCHES)}")
                keys = self._table(where, section)
                if keys is not None:
                    switches[switch] = self._keys(sections.SwitchSection, keys, where)
            extra = {key: value for key, value in switches.items() if value is not None}
            read = self._keys(
                sections.PlantSection,
                table,
                path,
                options,
                ("switches",),
                name=name,
                switches=extra,
            )
            if read is not None:
                yield read

    def _nets(self) -> Iterator[sections.NetSection]:
        section = self._table(("nets",), self._data) or {}
        for name, value in section.items():
            path = ("nets", name)
            if isinstance(value, dict):
                read = self._keys(sections.NetSection, value, path, name=name)
                if read is not None:
                    yield read
            else:
                pins = self._names(path, value)
                if pins is not None:
                    yield sections.NetSection(name=name, pins=pins)

    def _array(self, section: type[_Section], path: Path, value: object) -> list[_Section | None]:
        """Read a list of tables; one that cannot be read leaves None in its place."""
        if not isinstance(value, list):
            self._source.fail(path, f"found {quoted(value)}; this is a list of tables")
            return []
        read: list[_Section | None] = []
        for place, table in enumerate(value):
            where: Path = (*path, place)
            if isinstance(table, dict):
                read.append(self._keys(section, table, where))
            else:
                self._source.fail(where, f"found {quoted(table)}; this is a table")
                read.append(None)
        return read

    def _cards(self) -> Iterator[sections.CardSection]:
        for name, table in self._named("cards"):
            path = ("cards", name)
            rows = table.get("ports", [])
            ports = self._array(sections.CardPortSection, (*path, "ports"), rows)
            known = tuple(port or sections.NO_PORT for port in ports)
            read = self._keys(
                sections.CardSection, table, path, (), ("ports",), name=name, ports=known
            )
            if read is not None and isinstance(rows, list):
                yield read

    def _pin_maps(self) -> Iterator[sections.PinMapSection]:
        for name, table in self._named("pinmaps"):
            path = ("pinmaps", name)
            wires: dict[str, tuple[str, ...]] = {}
            pins = self._table((*path, "pins"), table) or {}
            for bit, value in pins.items():
                targets = self._names(
                    (*path, "pins", bit), [value] if isinstance(value, str) else value
                )
                if targets is not None:
                    wires[bit] = targets
            read = self._keys(
                sections.PinMapSection, table, path, (), ("pins",), name=name, pins=wires
            )
            if read is not None and len(wires) == len(pins):
                yield read

    def _hosts(self) -> Iterator[sections.HostSection]:
        hosts = self._array(sections.HostSection, ("hosts",), self._data.get("hosts", []))
        return (host or sections.NO_HOST for host in hosts)

    def _faults(self) -> Iterator[sections.FaultSection]:
        value = self._data.get("faults", [])
        if not isinstance(value, list):
            self._source.fail(("faults",), f"found {quoted(value)}; this is a list of tables")
            return
        known = faults() if value else {}
        for place, table in enumerate(value):
            where: Path = ("faults", place)
            if not isinstance(table, dict):
                self._source.fail(where, f"found {quoted(table)}; this is a table")
                continue
            name = table.get("fault", "")
            row = known.get(name) if isinstance(name, str) else None
            if row is None and isinstance(name, str) and name:
                self._source.fail(
                    (*where, "fault"),
                    f"there is no fault {quoted(name)}; {suggestion(name, known)}known are"
                    f" {listed(known)}",
                )
                continue
            own = row.parameters if row is not None else ()
            read = self._keys(sections.FaultSection, table, where, own)
            if read is not None and row is not None:
                check_fault(read, row, self._source, where)
                yield read
