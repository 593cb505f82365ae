"""The board file: TOML to frozen structs, or one error that names every mistake and its line."""

from pathlib import Path

from msgspec.structs import replace

from vbus.board.check import checks
from vbus.board.check.network_checks import check_zenoh
from vbus.boardfile import sections
from vbus.boardfile.source import Source
from vbus.boardfile.walker import Walker
from vbus.core.interpreter import collection_held


def read_board_file(path: str | Path) -> tuple[sections.BoardFile, Source]:
    """Read and check a board file.

    Returns:
        The file as structs, and its source, for those who find mistakes later.

    Raises:
        BoardFileError: the file cannot be read, is no TOML, or has mistakes: all are named.
    """
    return _read(Source.of_file(path))


def read_board_text(text: str, file: str = "board.toml") -> tuple[sections.BoardFile, Source]:
    """Check a board file that is already in memory; ``file`` is its name in messages."""
    return _read(Source(file, text))


@collection_held()
def _read(source: Source) -> tuple[sections.BoardFile, Source]:
    data = source.parsed()
    walker = Walker(source, data)
    found = walker.section(sections.BoardFile, (), data, path=source.file)
    if found is not None:
        checks.check(found, walker.known, source)
    walker.resolve()
    source.finish()
    assert found is not None, "a file without mistakes is read"
    if not found.board.name:
        board = replace(found.board, name=Path(source.file).stem)
        found = replace(found, board=board)
    return _with_card_buses(found), source


def read_zenoh_file(path: str | Path) -> sections.ZenohSection:
    """Read and check ``[zenoh]`` of a file, as a router wants it; nothing else is looked at.

    Raises:
        BoardFileError: as of :func:`read_board_file`.
    """
    source = Source.of_file(path)
    table = source.parsed().get("zenoh", {})
    section = Walker(source, {}).section(sections.ZenohSection, ("zenoh",), table)
    section = section or sections.ZenohSection()
    for where, message in check_zenoh(section):
        source.fail(where, message)
    source.finish()
    return section


def _with_card_buses(file: sections.BoardFile) -> sections.BoardFile:
    """Return a file in which every host that uses a card with a bus reaches the bus too."""
    buses = [card.name for card in file.cards if card.bus]
    chips = tuple(chip.name for chip in file.chips)
    hosts = [
        # Last: the chips keep the numbers that they have in the file.
        replace(host, chips=(*(host.chips or chips), host.card)) if host.card in buses else host
        for host in file.hosts
    ]
    return replace(file, hosts=tuple(hosts))
