"""Edges of the control lines to bus cycles, each family's own ways to end one."""

import pytest

from vbus import plugins
from vbus.chips.bus_watch import BusWatch, watch_by
from vbus.chips.lm628.datasheet import BUS as LM628
from vbus.chips.mc1241a.datasheet import BUS as MC1241A
from vbus.chips.mcp1200.datasheet import BUS as MCP1200
from vbus.chips.packets import Cycle

Levels = tuple[int, int, int, int]
TABLES = {"lm628": LM628, "mc1241a": MC1241A, "mcp1200": MCP1200}


def cycles(watch: BusWatch, *course: tuple[Levels, int]) -> list[Cycle]:
    """Feed levels and bytes, one pair a unit of time."""
    seen = []
    for when, (levels, data) in enumerate(course):
        seen += watch.change(when, levels, data)
    return seen


@pytest.mark.spec("LM-BUS-2", "LM-BUS-3")
@pytest.mark.parametrize("port", [0, 1])
@pytest.mark.parametrize("end", [(0, 1, 1), (1, 0, 1), (1, 1, 1)], ids=["/RD", "/CS", "both"])
def test_an_lm628_read_ends_with_its_strobe_or_with_cs(port: int, end: tuple[int, ...]) -> None:
    cs, rd, wr = end
    course = [((1, port, 1, 1), 0), ((0, port, 1, 1), 0), ((0, port, 0, 1), 0x5A)]
    after = (cs, port, rd, wr)
    assert cycles(watch_by(LM628), *course, (after, 0x5B)) == [Cycle(3, False, port, 0x5B)]
    # Once only, however the other line follows.
    assert cycles(watch_by(LM628), *course, (after, 0x5B), ((1, port, 1, 1), 0)) == [
        Cycle(3, False, port, 0x5B)
    ]


@pytest.mark.spec("LM-BUS-1", "LM-BUS-2")
@pytest.mark.parametrize("end", [(0, 1, 1), (1, 1, 0), (1, 1, 1)], ids=["/WR", "/CS", "both"])
def test_an_lm628_write_ends_with_its_strobe_or_with_cs(end: tuple[int, ...]) -> None:
    cs, rd, wr = end
    course = [((1, 1, 1, 1), 0), ((0, 1, 1, 0), 0x12), ((0, 1, 1, 0), 0x34)]
    assert cycles(watch_by(LM628), *course, ((cs, 0, rd, wr), 0x56)) == [Cycle(3, True, 1, 0x34)]


@pytest.mark.spec("PMD-BUS-2", "PMD-BUS-3")
@pytest.mark.parametrize("end", [(0, 1, 1), (1, 0, 1), (1, 1, 1)])
def test_an_mc1241a_read_ends_with_its_strobe_or_with_the_select(end: tuple[int, ...]) -> None:
    select, read, write = end
    course = [((1, 0, 1, 1), 0), ((0, 0, 0, 1), 0x5A)]
    after = (select, 0, read, write)
    assert cycles(watch_by(MC1241A), *course, (after, 0x5B)) == [Cycle(2, False, 0, 0x5B)]
    course = [((1, 1, 1, 1), 0), ((0, 1, 0, 1), 0x5A)]
    assert cycles(watch_by(MC1241A), *course, ((select, 1, read, write), 0x5B)) == []


@pytest.mark.spec("PMD-BUS-2", "PMD-BUS-3")
@pytest.mark.parametrize("end", [(0, 1, 1), (1, 1, 0), (1, 1, 1)])
@pytest.mark.parametrize("command", [0, 1])
def test_an_mc1241a_write_ends_with_its_strobe_or_with_the_select(
    end: tuple[int, ...], command: int
) -> None:
    select, read, write = end
    course = [((1, command, 1, 1), 0), ((0, command, 1, 0), 0x5A)]
    after = (select, command, read, write)
    assert cycles(watch_by(MC1241A), *course, (after, 0x5B)) == [Cycle(2, True, command, 0x5A)]


@pytest.mark.spec("MCP-BUS-2", "MCP-BUS-4", "MCP-BUS-1")
@pytest.mark.parametrize("address", [0x05, 0x85])
def test_an_mcp1200_address_has_seven_bits_whatever_db7_is(address: int) -> None:
    """DB7 is a data line only: what stands there when the address is latched is nobody's."""
    latch = [((1, 1, 1, 0), 0), ((0, 1, 1, 0), address), ((1, 1, 1, 0), address)]
    write = [((1, 0, 1, 0), 0x83), ((1, 1, 1, 0), 0x83)]
    assert cycles(watch_by(MCP1200), *latch, *write) == [Cycle(4, True, 0x05, 0x83)]
    # Overlapped: /CS falls while /ALE is low, and closes the latch.
    overlapped = [((1, 1, 1, 0), 0), ((0, 1, 1, 0), address), ((0, 0, 1, 0), address)]
    end = [((1, 0, 1, 0), 0x83), ((1, 1, 1, 0), 0x83)]
    assert cycles(watch_by(MCP1200), *overlapped, *end) == [Cycle(4, True, 0x05, 0x83)]
    # What stands there while the latch is open is nobody's.
    early = [((1, 1, 1, 1), 0), ((0, 1, 1, 1), 0x33), ((0, 1, 1, 0), address)]
    assert cycles(watch_by(MCP1200), *early, ((1, 1, 1, 0), address), *write) == [
        Cycle(5, True, 0x05, 0x83)
    ]
    read = [((1, 1, 1, 1), 0), ((1, 0, 0, 1), 0), ((1, 1, 0, 1), 0x99), ((1, 1, 1, 1), 0x99)]
    assert cycles(watch_by(MCP1200), *latch, *read) == [Cycle(6, False, 0x05, 0x99)]


@pytest.mark.spec("MCP-BUS-6", "MCP-BUS-7")
def test_an_mcp1200_read_whose_cs_and_oe_rise_together_is_a_read_of_its_own_address() -> None:
    latch = [((1, 1, 1, 1), 0), ((0, 1, 1, 1), 0x05), ((1, 1, 1, 1), 0x05)]
    again = [((0, 1, 1, 1), 0x07), ((1, 1, 1, 1), 0x07)]
    read = [((1, 0, 0, 1), 0x99), ((1, 1, 1, 1), 0x99)]
    assert cycles(watch_by(MCP1200), *latch, *read, *again, *read) == [
        Cycle(4, False, 0x05, 0x99), Cycle(8, False, 0x07, 0x99),
    ]  # fmt: skip


@pytest.mark.parametrize("family", ["lm628", "mc1241a", "mcp1200"])
def test_a_whole_cycle_seen_by_its_own_table_is_that_cycle(family: str) -> None:
    """The edges that a table gives for a cycle come to that cycle by the rows of the same table."""
    table = TABLES[family]
    for write in (False, True):
        watch, data = watch_by(table), 0
        levels = dict.fromkeys(table.lines, 1)
        seen = watch.change(-(10**9), tuple(levels.values()), data)
        for offset, pin, level in table.edges(write, 0, 0x5A):
            if pin in levels:
                levels[pin] = level if level >= 0 else 1
            elif level >= 0:
                data = level
            seen += watch.change(offset, tuple(levels.values()), data)
        assert [(cycle.write, cycle.address) for cycle in seen] == [(write, 0)]
        assert not write or seen[0].data == 0x5A
        assert watch.idle(tuple(levels.values()))


@pytest.mark.parametrize("family", ["lm628", "mc1241a", "mcp1200"])
def test_a_table_and_the_pins_name_the_same_control_lines(family: str) -> None:
    tables = plugins.family(family).tables
    assert tables is not None
    assert {row.name for row in tables.PINS if row.strobe} == set(TABLES[family].lines)
    assert next(row.width for row in tables.PINS if row.name == TABLES[family].data) == 8
