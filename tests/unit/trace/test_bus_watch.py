"""Edges of the control lines to bus cycles, each family's own ways to end one."""

import pytest

from vbus.chips.bus_watch import BusWatch
from vbus.chips.lm628.bus import Lm628Watch
from vbus.chips.mc1241a.bus import Mc1241aWatch
from vbus.chips.mcp1200.bus import Mcp1200Watch
from vbus.chips.packets import Cycle

Levels = tuple[int, int, int, int]


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
    assert cycles(Lm628Watch(), *course, (after, 0x5B)) == [Cycle(3, False, port, 0x5B)]
    # Once only, however the other line follows.
    assert cycles(Lm628Watch(), *course, (after, 0x5B), ((1, port, 1, 1), 0)) == [
        Cycle(3, False, port, 0x5B)
    ]


@pytest.mark.spec("LM-BUS-1", "LM-BUS-2")
@pytest.mark.parametrize("end", [(0, 1, 1), (1, 1, 0), (1, 1, 1)], ids=["/WR", "/CS", "both"])
def test_an_lm628_write_ends_with_its_strobe_or_with_cs(end: tuple[int, ...]) -> None:
    cs, rd, wr = end
    course = [((1, 1, 1, 1), 0), ((0, 1, 1, 0), 0x12), ((0, 1, 1, 0), 0x34)]
    assert cycles(Lm628Watch(), *course, ((cs, 0, rd, wr), 0x56)) == [Cycle(3, True, 1, 0x34)]


@pytest.mark.spec("PMD-BUS-2", "PMD-BUS-3")
@pytest.mark.parametrize("end", [(0, 1, 1), (1, 0, 1), (1, 1, 1)])
def test_an_mc1241a_read_ends_with_its_strobe_or_with_the_select(end: tuple[int, ...]) -> None:
    select, read, write = end
    course = [((1, 0, 1, 1), 0), ((0, 0, 0, 1), 0x5A)]
    after = (select, 0, read, write)
    assert cycles(Mc1241aWatch(), *course, (after, 0x5B)) == [Cycle(2, False, 0, 0x5B)]
    course = [((1, 1, 1, 1), 0), ((0, 1, 0, 1), 0x5A)]
    assert cycles(Mc1241aWatch(), *course, ((select, 1, read, write), 0x5B)) == []


@pytest.mark.spec("PMD-BUS-2", "PMD-BUS-3")
@pytest.mark.parametrize("end", [(0, 1, 1), (1, 1, 0), (1, 1, 1)])
@pytest.mark.parametrize("command", [0, 1])
def test_an_mc1241a_write_ends_with_its_strobe_or_with_the_select(
    end: tuple[int, ...], command: int
) -> None:
    select, read, write = end
    course = [((1, command, 1, 1), 0), ((0, command, 1, 0), 0x5A)]
    after = (select, command, read, write)
    assert cycles(Mc1241aWatch(), *course, (after, 0x5B)) == [Cycle(2, True, command, 0x5A)]


@pytest.mark.spec("MCP-BUS-2", "MCP-BUS-4", "MCP-BUS-1")
@pytest.mark.parametrize("address", [0x05, 0x85])
def test_an_mcp1200_address_has_seven_bits_whatever_db7_is(address: int) -> None:
    """DB7 is a data line only: what stands there when the address is latched is nobody's."""
    latch = [((1, 1, 1, 0), 0), ((0, 1, 1, 0), address), ((1, 1, 1, 0), address)]
    write = [((1, 0, 1, 0), 0x83), ((1, 1, 1, 0), 0x83)]
    assert cycles(Mcp1200Watch(), *latch, *write) == [Cycle(4, True, 0x05, 0x83)]
    # Overlapped: /CS falls while /ALE is low, and closes the latch.
    overlapped = [((1, 1, 1, 0), 0), ((0, 1, 1, 0), address), ((0, 0, 1, 0), address)]
    end = [((1, 0, 1, 0), 0x83), ((1, 1, 1, 0), 0x83)]
    assert cycles(Mcp1200Watch(), *overlapped, *end) == [Cycle(4, True, 0x05, 0x83)]
    # What stands there while the latch is open is nobody's.
    early = [((1, 1, 1, 1), 0), ((0, 1, 1, 1), 0x33), ((0, 1, 1, 0), address)]
    assert cycles(Mcp1200Watch(), *early, ((1, 1, 1, 0), address), *write) == [
        Cycle(5, True, 0x05, 0x83)
    ]
    read = [((1, 1, 1, 1), 0), ((1, 0, 0, 1), 0), ((1, 1, 0, 1), 0x99), ((1, 1, 1, 1), 0x99)]
    assert cycles(Mcp1200Watch(), *latch, *read) == [Cycle(6, False, 0x05, 0x99)]
