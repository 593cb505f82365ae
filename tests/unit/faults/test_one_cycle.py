"""Faults of one bus cycle: an answer that is late, lines that keep nothing, busy for once."""

import pytest

from tests.unit.faults.bench import Lm, build, settle
from vbus.core.kernel import US


def test_an_answer_that_is_late_leaves_what_the_lines_have_shown() -> None:
    board = build()
    host = Lm(board)
    host.port.write(0, 0x00)
    settle(board, 3)
    assert host.status() != 0xAB
    board.faults.arm("answer_late", when="cycle 2")
    host.port.write(1, 0xAB)
    assert host.port.read(0) == 0xAB
    assert host.port.read(0) != 0xAB


def test_lines_that_are_pulled_keep_nothing() -> None:
    board = build()
    net = board.chips[0].bus_net
    rest = net.rest
    fault = board.faults.arm("bus_pulled", level=0)
    assert net.rest == 0
    board.faults.clear(fault)
    assert net.rest == rest


@pytest.mark.spec("LM-BUS-8")
def test_one_cycle_alone_keeps_the_chip_busy_for_as_long_as_it_may() -> None:
    board = build()
    host = Lm(board)
    board.faults.arm("busy_longest", when="cycle 1")
    for longest in (True, False):
        host.port.write(0, 0x1E)
        board.run_for(90 * US)
        assert host.status() & 1 == longest
        board.run_for(10 * US)
        host.port.write(0, 0x00)
        settle(board, 3)
