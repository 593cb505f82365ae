"""The journal of one node, in one process: what hosts do to it and what reaches it."""

from io import BytesIO

import pytest
from msgspec.structs import replace

from vbus.board.config import read_board_text
from vbus.circuit.orders import READ, WRITE, Order
from vbus.core.kernel import END, MS, US
from vbus.nodes.machine import board_of, node_of
from vbus.nodes.node import Node
from vbus.protocols.port import NotYet
from vbus.record.format import Entry, JournalReader
from vbus.record.journal import Journal
from vbus.record.replay import Divergence, Replay

BOARD = """\
[board]
name = "pair"
time = "lockstep"
power_on = "done"

[nodes.left]

[nodes.right]

[chips.x]
part = "LM629N-8"
clock = "8 MHz"
plant = "none"
node = "left"

[chips.y]
part = "LM629N-8"
clock = "8 MHz"
plant = "none"
node = "right"

[nets]
"DONE" = { pins = ["y.HI", "x./IN"], delay = "1 ms" }
"""


class Journalled:
    """The node on the left, and its journal."""

    def __init__(self) -> None:
        file, source = read_board_text(BOARD)
        self.node: Node = node_of(file, source, "left")
        self.data = BytesIO()
        self._journal = Journal(self.node.board, self.data, BOARD, "b.toml")
        self.node.board.limit = END
        self.port = self.node.board.open_port("host", ["x"])

    def entries(self) -> list[Entry]:
        """End the journal; return what is in it, if a replay finds no difference."""
        self._journal.close()
        found = list(JournalReader(BytesIO(self.data.getvalue())))
        reader = JournalReader(BytesIO(self.data.getvalue()))
        outcome = Replay(board_of(reader.header, "run"), reader, reader.header.families).run()
        assert outcome.divergence is None
        return found


def test_edges_that_a_host_watches_stand_in_the_journal_when_it_takes_them() -> None:
    made = Journalled()
    port = made.port
    port.events(0b111)
    assert port.take_events() == []
    made.node.accept([(5 * MS, 1, 0, 0, 0, False)])
    port.delay(10 * MS)
    for address, byte in ((0, 0x1C), (1, 0), (1, 0x02), (1, 0x55)):  # MSKI; a command error
        port.write(address, byte)
        port.delay(100 * US)
    seen = port.take_events()
    assert seen
    entries = made.entries()
    assert [entry.reply for entry in entries if entry.op == "edges"] == [seen]
    assert [entry.op for entry in entries].count("arrive") == 1


def test_a_call_that_is_answered_at_once_has_no_limit_and_one_that_waits_has() -> None:
    made = Journalled()
    made.port.write(0, 0)
    made.node.board.limit = made.node.board.now + 10
    with pytest.raises(NotYet):
        made.port.read(0)
    made.node.board.limit = END
    made.port.read(0)
    rows = [(entry.op, entry.limit >= 0, entry.error) for entry in made.entries()]
    assert rows[:4] == [
        ("open", False, 0), ("write", False, 0), ("read", True, 0x10000),
        ("read", False, 0),
    ]  # fmt: skip


def test_orders_from_beyond_are_replayed_for_whom_they_were_given() -> None:
    made = Journalled()
    made.node.orders_of("boss")
    made.node.order("boss", Order(3 * MS, ("x",), WRITE, 0, 0x06))
    made.port.delay(5 * MS)
    entries = made.entries()
    assert [entry.op for entry in entries if entry.op.startswith("order")] == ["orders", "order"]
    (order,) = [entry for entry in entries if entry.op == "order"]
    assert order.args[:3] == ("boss", 3 * MS, ["x"])
    again = board_of(JournalReader(BytesIO(made.data.getvalue())).header, "run").beyond
    assert again is not None
    with pytest.raises(ValueError, match="no chip called 'z'"):
        again.replay("order", ("boss", 3 * MS, ["z"], WRITE, 0, 6, ""))


def replayed_with(entries: list[Entry], data: bytes) -> Divergence | None:
    """Return what a replay finds of these entries, numbered anew."""
    header = JournalReader(BytesIO(data)).header
    numbered = [replace(entry, number=number) for number, entry in enumerate(entries)]
    end = numbered[-1]
    numbered[-1] = replace(end, args=(end.number, *end.args[1:]))
    return Replay(board_of(header, "run"), numbered, header.families).run().divergence


def test_an_ordered_cycle_that_differs_is_told_with_both_cycles() -> None:
    made = Journalled()
    made.node.order("boss", Order(3 * MS, ("x",), WRITE, 0, 0x05))
    made.node.order("boss", Order(4 * MS, ("x",), READ, 0))
    made.port.delay(5 * MS)
    entries = made.entries()
    data = made.data.getvalue()
    first, second = (n for n, entry in enumerate(entries) if entry.op == "made")
    when, *rest, _ = entries[first].args
    other = [*entries]
    other[first] = replace(other[first], args=(when, *rest, 0x07))
    found = replayed_with(other, data)
    assert found is not None
    assert (found.what, found.where) == ("reply", "boss, x: ordered cycle")
    assert (found.recorded, found.now) == (
        f"w 0 07 at {3 * MS} ps", f"w 0 05 at {3 * MS} ps",
    )  # fmt: skip
    found = replayed_with([*entries[:second], *entries[second + 1 :]], data)
    assert found is not None
    assert (found.what, found.when) == ("missing", 4 * MS)
    assert (found.recorded, found.now[:4]) == ("nothing", "r 0 ")
