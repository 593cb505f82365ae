"""The board file: TOML to frozen structs, or one error that names every mistake and its line."""

import re
import tomllib
from collections.abc import Callable, Iterable, Iterator, Mapping
from pathlib import Path as FilePath
from typing import Any, Final, TypeVar

import msgspec

from vbus import plugins
from vbus.board import checks
from vbus.board.network_checks import check_zenoh
from vbus.boardfile import sections
from vbus.boardfile.cards import NO_PORT, CardPortSection, CardRegisterSection, CardSection
from vbus.boardfile.key import NAMES, GlueSection, Section, rows
from vbus.boardfile.lines import Path
from vbus.boardfile.source import BoardFileError, Problem, Source
from vbus.collection import collection_held
from vbus.errors import PluginError
from vbus.file_kinds import foreign, no_text, unreadable
from vbus.options import Option
from vbus.signals.axis import SWITCHES
from vbus.values.settings import NAME_FORM, check_table, listed, quoted, suggestion

_Section = TypeVar("_Section", bound=Section)
_NAMED: Final = ("chips", "plants", "nets", "glue", "buses", "cards", "pinmaps", "nodes")
_SECTIONS: Final = ("board", "violations", *_NAMED, "hosts", "record", "waves", "zenoh", "metrics",
                    "scope", "faults")  # fmt: skip


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
        raise BoardFileError([Problem(str(path), 0, "", unreadable(path, error))]) from None
    except UnicodeDecodeError as error:
        line, reason = error.object.count(b"\n", 0, error.start) + 1, no_text(path, error.object)
        raise BoardFileError([Problem(str(path), line, "", reason)]) from None


@collection_held()
def read_board_text(text: str, file: str = "board.toml") -> tuple[sections.BoardFile, Source]:
    """Check a board file that is already in memory; ``file`` is its name in messages."""
    source = Source(file, text)
    return _TableReader(source, _parsed(file, text)).read(), source


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
    section = _TableReader(source, _parsed(name, text)).zenoh()
    check_zenoh(section, source)
    source.finish()
    return section


def _no_toml(file: str, text: str, reason: str) -> Problem:
    if other := foreign(file, text.encode()):
        return Problem(file, 0, "", f"this is no board file: {other}")
    match = re.fullmatch(r"(.*) \(at line (\d+), column (\d+)\)", reason, re.DOTALL)
    if match is None:
        end = re.fullmatch(r"(.*) \(at end of document\)", reason, re.DOTALL)
        line = text.count("\n") + 1 if end else 0
        return Problem(file, line, "", f"no TOML: {end[1] if end else reason}")
    return Problem(file, int(match[2]), "", f"no TOML: {match[1]} (column {match[3]})")


def _with_card_buses(file: sections.BoardFile) -> sections.BoardFile:
    """Return a file in which every host that uses a card with a bus reaches the bus too."""
    buses = [card.name for card in file.cards if card.bus]
    chips = tuple(chip.name for chip in file.chips)
    hosts = [
        msgspec.structs.replace(host, chips=(*(host.chips or chips), host.card))
        if host.card in buses
        else host
        for host in file.hosts
    ]
    return msgspec.structs.replace(file, hosts=tuple(hosts))


class _TableReader:
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
            chips=self._all("chips", self._chip),
            plants=self._all("plants", self._plant),
            nets=tuple(self._nets()),
            glue=self._all("glue", self._glue),
            buses=self._plain("buses", sections.BusSection),
            cards=self._all("cards", self._card),
            pinmaps=self._all("pinmaps", self._pin_map),
            hosts=tuple(self._hosts()),
            record=self._single("record", sections.RecordSection),
            waves=self._plain("waves", sections.WaveSection),
            nodes=self._plain("nodes", sections.NodeSection),
            zenoh=self.zenoh(),
            metrics=self._single("metrics", sections.MetricsSection),
            scope=self._single("scope", sections.ScopeSection),
            faults=tuple(self._faults()),
        )
        known = {kind: list(self._table((kind,), self._data) or ()) for kind in _NAMED}
        checks.check(file, known, self._source)
        self._source.finish()
        return _with_card_buses(file)

    # -- tables -------------------------------------------------------------------------------

    def _table(self, path: Path, parent: Mapping[str, Any]) -> dict[str, Any] | None:
        """Return the table at the end of ``path``; an absent one is empty, a wrong one None."""
        value = parent.get(str(path[-1]), {})
        if isinstance(value, dict):
            return value
        self._source.fail(path, f"found {quoted(value)}; this is a table of keys")
        return None

    def _named(self, path: Path, tables: Mapping[str, Any]) -> Iterator[tuple[str, dict[str, Any]]]:
        """Give the tables ``[KIND.NAME]`` whose name may stand in ``"name.pin"``."""
        section = self._table(path, tables) or {}
        for name in section:
            if not NAME_FORM.fullmatch(name):
                self._source.fail(
                    (*path, name),
                    "a name begins with a letter and goes on with letters, digits, - and _",
                )
                continue
            table = self._table((*path, name), section)
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
        options = list(rows(section))
        lists = {row.name for row in options if row.kind == NAMES}
        own = list(own)
        placeholders = [Option(name, "text", "", "") for name in (*sorted(lists), *nested)]
        single = [row for row in options if row.name not in lists]
        plain = {key: value for key, value in table.items() if key not in lists | {*nested}}
        wrong: list[str] = []

        def complain(key: str, message: str) -> None:
            wrong.append(key)
            self._source.fail((*path, key) if key else path, message)

        checked = check_table(plain, [*single, *own, *placeholders], complain)
        mine = {row.name for row in single}
        fields: dict[str, object] = {**extra, **{k: v for k, v in checked.items() if k in mine}}
        settings = {key: value for key, value in checked.items() if key not in mine}
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

    def _all(
        self, kind: str, read: Callable[[str, dict[str, Any]], _Section | None]
    ) -> tuple[_Section, ...]:
        """Return what could be read of the tables ``[kind.NAME]``."""
        found = [read(name, table) for name, table in self._named((kind,), self._data)]
        return tuple(one for one in found if one is not None)

    def _plain(self, kind: str, section: type[_Section]) -> tuple[_Section, ...]:
        """Read tables ``[kind.NAME]`` that have keys alone."""
        return self._all(
            kind, lambda name, table: self._keys(section, table, (kind, name), name=name)
        )

    def _single(
        self, kind: str, section: type[_Section], nested: tuple[str, ...] = (), **extra: object
    ) -> _Section:
        """Read the one table ``[kind]``; an absent or a wrong one has the defaults."""
        table = self._table((kind,), self._data) or {}
        return self._keys(section, table, (kind,), (), nested, **extra) or section()

    def _tables(self, path: Path, value: object) -> Iterator[tuple[Path, dict[str, Any] | None]]:
        """Give the tables of a list, each with its path; None in the place of what is none."""
        if not isinstance(value, list):
            self._source.fail(path, f"found {quoted(value)}; this is a list of tables")
            return
        for place, table in enumerate(value):
            if isinstance(table, dict):
                yield (*path, place), table
            else:
                self._source.fail((*path, place), f"found {quoted(table)}; this is a table")
                yield (*path, place), None

    def _array(self, section: type[_Section], path: Path, value: object) -> list[_Section | None]:
        """Read a list of tables; one that cannot be read leaves None in its place."""
        return [
            None if table is None else self._keys(section, table, where)
            for where, table in self._tables(path, value)
        ]

    # -- sections -----------------------------------------------------------------------------

    def _board(self) -> sections.BoardSection:
        read = self._single("board", sections.BoardSection)
        if not read.name:
            return msgspec.structs.replace(read, name=FilePath(self._source.file).stem)
        if not NAME_FORM.fullmatch(read.name):
            self._source.fail(
                ("board", "name"),
                f"found {quoted(read.name)}; a name begins with a letter and goes on with letters,"
                " digits, - and _",
            )
        return read

    def zenoh(self) -> sections.ZenohSection:
        """Read ``[zenoh]``."""
        table = self._table(("zenoh",), self._data) or {}
        if "allow" not in table:
            return self._single("zenoh", sections.ZenohSection)
        path = ("zenoh", "allow")
        rights = self._table(path, table) or {}
        allow = {name: self._names((*path, name), keys) or () for name, keys in rights.items()}
        return self._single("zenoh", sections.ZenohSection, ("allow",), allow=allow)

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

    def _chip(self, name: str, table: dict[str, Any]) -> sections.ChipSection | None:
        path = ("chips", name)
        options = self._options(path, "part", table)
        return None if options is None else self._keys(
            sections.ChipSection, table, path, options, name=name
        )  # fmt: skip

    def _options(self, path: Path, key: str, table: Mapping[str, Any]) -> tuple[Option, ...] | None:
        """Return the settings of the part or model a table names; None if nobody knows it."""
        named = table.get(key)
        find = plugins.chip_class if key == "part" else plugins.plant_class
        try:
            return find(named).OPTIONS if isinstance(named, str) else ()
        except PluginError as error:
            self._source.fail((*path, key), str(error))
            return None

    def _plant(self, name: str, table: dict[str, Any]) -> sections.PlantSection | None:
        path = ("plants", name)
        options = self._options(path, "model", table)
        if options is None:
            return None
        switches = {}
        section = self._table((*path, "switches"), table) or {}
        for switch in section:
            where = (*path, "switches", switch)
            if switch not in SWITCHES:
                hint = suggestion(switch, SWITCHES)
                self._source.fail(where, f"unknown switch; {hint}known are {listed(SWITCHES)}")
            keys = self._table(where, section)
            read = None if keys is None else self._keys(sections.SwitchSection, keys, where)
            if read is not None:
                switches[switch] = read
        return self._keys(
            sections.PlantSection, table, path, options, ("switches",), name=name, switches=switches
        )

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

    def _card(self, name: str, table: dict[str, Any]) -> CardSection | None:
        path = ("cards", name)
        rows = table.get("ports", [])
        ports = self._array(CardPortSection, (*path, "ports"), rows)
        known = tuple(port or NO_PORT for port in ports)
        pins, selects = self._wires(path, table), self._wires(path, table, "selects")
        registers = [
            self._register((*path, "registers", one), one, keys)
            for one, keys in self._named((*path, "registers"), table)
        ]
        read = self._keys(
            CardSection, table, path, (), ("ports", "pins", "selects", "registers"), name=name,
            ports=known, pins=pins or {}, selects=selects or {},
            registers=tuple(one for one in registers if one is not None),
        )  # fmt: skip
        return read if isinstance(rows, list) and pins is not None else None

    def _register(self, path: Path, name: str, table: dict[str, Any]) -> CardRegisterSection | None:
        pins = self._wires(path, table) or {}
        return self._keys(CardRegisterSection, table, path, (), ("pins",), name=name, pins=pins)

    def _wires(
        self, path: Path, table: dict[str, Any], key: str = "pins"
    ) -> dict[str, tuple[str, ...]] | None:
        """Read a table of names by name; one needs no list."""
        pins = self._table((*path, key), table) or {}
        wires = {
            bit: self._names((*path, key, bit), [value] if isinstance(value, str) else value)
            for bit, value in pins.items()
        }
        whole = {bit: targets for bit, targets in wires.items() if targets is not None}
        return whole if len(whole) == len(pins) else None

    def _pin_map(self, name: str, table: dict[str, Any]) -> sections.PinMapSection | None:
        path = ("pinmaps", name)
        pins = self._wires(path, table)
        read = self._keys(
            sections.PinMapSection, table, path, (), ("pins",), name=name, pins=pins or {}
        )
        return None if pins is None else read

    def _glue(self, name: str, table: dict[str, Any]) -> GlueSection | None:
        path = ("glue", name)
        pins = self._wires(path, table)
        equations = self._table((*path, "equations"), table) or {}
        for output, text in equations.items():
            if not isinstance(text, str):
                self._source.fail(
                    (*path, "equations", output),
                    f'found {quoted(text)}; write an equation in quotes, such as "A & !B"',
                )
        read = self._keys(
            GlueSection, table, path, (), ("pins", "equations"), name=name,
            pins=pins or {},
            equations={key: text for key, text in equations.items() if isinstance(text, str)},
        )  # fmt: skip
        return None if pins is None else read

    def _hosts(self) -> Iterator[sections.HostSection]:
        hosts = self._array(sections.HostSection, ("hosts",), self._data.get("hosts", []))
        return (host or sections.NO_HOST for host in hosts)

    def _faults(self) -> Iterator[sections.FaultSection]:
        value = self._data.get("faults", [])
        if not value:
            return
        from vbus.board.fault_checks import check_fault
        from vbus.faults.table import faults

        known = faults()
        for where, table in self._tables(("faults",), value):
            if table is None:
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
            read = self._keys(sections.FaultSection, table, where, own, place=where[-1])
            if read is not None and row is not None:
                check_fault(read, row, self._source, where)
                yield read
