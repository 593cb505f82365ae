"""The recorder of a port, and the fast one beside it: both write the same bytes."""

import io
from collections.abc import Callable

import pytest
from msgspec.structs import replace

from tests.frozen.frozen import RUNS, board_of, read_journal
from tests.unit.views.conftest import LM629
from tests.unit.views.plain_recorder import recorded
from vbus.board.build import load_board_text
from vbus.board.host_bus import HostBus
from vbus.core.kernel import END, MS
from vbus.protocols.port import NotYet, PortError
from vbus.record.format import NOT_YET, Entry
from vbus.record.journal import Journal
from vbus.record.player import FINDINGS, Player
from vbus.record.recorded_bus import RecordedBus

Port = Callable[..., HostBus]


def recorded_again(name: str, port: Port) -> bytes:
    """Return the journal of a board that a frozen run is played on again."""
    header, entries = read_journal((RUNS / f"{name}.vbj").read_bytes())
    player = Player(board_of(header))
    file = io.BytesIO()
    journal = Journal(player.board, file, header.text, header.file, port=port)
    for entry in entries:
        player.play(entry)
    journal.close()
    return file.getvalue()


@pytest.mark.parametrize(
    "name",
    [
        "board-two-hosts-claim",
        "board-wired-lines",
        "faults-mcp1200",
        "lm628-random-strobed-126",
        "lm629-strobed-too-fast",
        "lm629-violations-strict",
        "mc1241a-random-strobed-102",
        "mc1241a-slaved",
        "mcp1200-encoder-pins",
        "mcp1200-random-cycles-104",
        "mcp1200-realtime",
    ],
)
def test_the_fast_recorder_writes_the_bytes_of_the_plain_one(name: str) -> None:
    data = recorded_again(name, RecordedBus)
    assert data == recorded_again(name, recorded(HostBus))
    assert calls(data) == calls((RUNS / f"{name}.vbj").read_bytes())


def calls(data: bytes) -> list[Entry]:
    """Return what hosts did; what is found of it depends on rules and rulings made since."""
    found = (replace(entry, number=0) for entry in read_journal(data)[1])
    return [entry for entry in found if entry.op not in FINDINGS]


def refused_and_unfinished(port: Port, granted: bool) -> bytes:
    board = load_board_text(LM629.replace("lockstep", "slaved"))
    board.granted = granted
    file = io.BytesIO()
    journal = Journal(board, file, LM629, port=port)
    host = board.open_port("h")
    calls: list[tuple[str, list[int]]] = [
        ("read", [0]), ("at", [MS]), ("read", [0]), ("write", [1, 0x155]), ("lines", [1, 0]),
        ("pin", [99, 1]), ("getpin", [99]), ("delay", [1 << 62]), ("delay", [MS]), ("at", [0]),
        ("events", [7]), ("take_events", []), ("select", [0]), ("drive", [1]), ("sample", []),
        ("release", []), ("claim", []), ("unclaim", []), ("sync", []), ("now", []),
        ("at", [8 * MS]), ("read", [0]), ("lines", [1, 0]), ("write", [0, 0]),
    ]  # fmt: skip
    board.limit = 5 * MS
    for name, args in calls:
        try:
            getattr(host, name)(*args)
        except (NotYet, PortError):
            continue
    board.limit = END
    host.claim()
    host.close()
    host.close()
    journal.close()
    return file.getvalue()


@pytest.mark.parametrize("granted", [False, True])
def test_refused_and_unfinished_calls_and_the_end_are_the_same_bytes(granted: bool) -> None:
    data = refused_and_unfinished(RecordedBus, granted)
    assert data == refused_and_unfinished(recorded(HostBus), granted)
    entries = read_journal(data)[1]
    assert [entry.op for entry in entries].count("close") == 1
    assert entries[-2].op == "close"
    assert any(entry.error for entry in entries)
    assert any(entry.limit >= 0 for entry in entries)
    assert any(entry.error == NOT_YET for entry in entries) is granted
