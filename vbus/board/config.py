"""The board file: TOML to frozen structs, or one error that names every mistake and its line."""

import re
import tomllib
from pathlib import Path as FilePath
from typing import Any

from msgspec.structs import replace

from vbus.board import checks
from vbus.board.network_checks import check_zenoh
from vbus.boardfile import sections
from vbus.boardfile.source import BoardFileError, Problem, Source
from vbus.boardfile.walker import Walker
from vbus.collection import collection_held
from vbus.file_kinds import foreign, no_text, unreadable


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
    data = _parsed(file, text)
    walker = Walker(source, data)
    found = walker.section(sections.BoardFile, (), data, path=file)
    if found is not None:
        checks.check(found, walker.known, source)
    walker.resolve()
    source.finish()
    assert found is not None, "a file without mistakes is read"
    if not found.board.name:
        board = replace(found.board, name=FilePath(file).stem)
        found = replace(found, board=board)
    return _with_card_buses(found), source


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
    table = _parsed(name, text).get("zenoh", {})
    section = Walker(source, {}).section(sections.ZenohSection, ("zenoh",), table)
    section = section or sections.ZenohSection()
    for path_, message in check_zenoh(section):
        source.fail(path_, message)
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
        replace(host, chips=(*(host.chips or chips), host.card)) if host.card in buses else host
        for host in file.hosts
    ]
    return replace(file, hosts=tuple(hosts))
