"""Cycles that had no effect are counted by kind."""

import pytest

from vbus.chips.packets import (
    CUT,
    IGNORED,
    STATUS,
    UNEXPECTED,
    UNKNOWN,
    WHOLE,
    Cycle,
    Packet,
)
from vbus.views.findings.report import NoEffect

READ = Cycle(1, False, 0, 0)
WRITE = Cycle(2, True, 1, 0)


@pytest.mark.parametrize(
    ("kind", "clause", "cycles", "text"),
    [
        (WHOLE, "LM-CMD-3", [WRITE], ""),
        (STATUS, "LM-BUS-7", [READ], ""),
        (IGNORED, "", [WRITE], "1 write not taken"),
        (IGNORED, "", [READ], "1 read not taken"),
        (CUT, "", [WRITE, READ], "1 packet cut short"),
        (UNEXPECTED, "", [READ, READ], "2 reads of nothing"),
        (UNKNOWN, "LM-BUS-13", [WRITE], "1 write of nothing"),
        (UNKNOWN, "", [WRITE], ""),
    ],
)
def test_each_kind_of_packet_is_counted(
    kind: str, clause: str, cycles: list[Cycle], text: str
) -> None:
    found = NoEffect()
    found.add(Packet(kind, "it", "", clause, tuple(cycles)))
    assert found.text() == text


def test_several_are_told_in_one_line() -> None:
    found = NoEffect()
    for kind, cycle in ((IGNORED, WRITE), (CUT, READ), (IGNORED, WRITE), (CUT, WRITE)):
        found.add(Packet(kind, "it", "", "", (cycle,)))
    assert found.text() == "2 packets cut short, 2 writes not taken"
