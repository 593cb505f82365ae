"""The firmware of this project on a virtual machine."""

import pytest

from vbus.board import snapshot
from vbus.testing import connect_in_process

MOTOR_OFF = 0x80
OK, BUSY, RESET, STALLED, LATE = range(5)

pytestmark = pytest.mark.vbus(board="../board.toml")


@pytest.fixture
def firmware(vbus_exec, vbus_clock):
    """Run the firmware, out of reset, with one position to go to."""
    vbus_clock.advance("2 ms")
    return lambda position: vbus_exec(
        "../src/main_pc.c", str(position), sources=["../src/axis.c"], flags="-I../src -Wall"
    )


@pytest.mark.parametrize("position", [2000, -700])
def test_a_move_ends_where_it_should(firmware, vbus_board, position):
    done = firmware(position)
    assert done.code == OK
    assert int(done.output) == pytest.approx(position, abs=6)
    assert vbus_board.axes["x.1"].count == pytest.approx(position, abs=6)


@pytest.mark.vbus(strict=True)
def test_the_driver_keeps_the_datasheet(firmware):
    assert firmware(300).code == OK


def test_stall_is_reported(firmware, vbus_board):
    vbus_board.faults.arm("jam", when="at 60 ms")
    assert firmware(20000).code == STALLED
    with connect_in_process(vbus_board) as bus:
        assert bus.read(0) & MOTOR_OFF
    assert [evidence.name for evidence in vbus_board.faults.log][:1] == ["jam"]


def test_a_chip_that_fails_its_reset_is_refused(vbus_exec):
    # No time for the reset: the status is still 00h.
    done = vbus_exec("../src/main_pc.c", "10", sources=["../src/axis.c"], flags="-I../src")
    assert done.code == RESET


def test_what_follows_a_snapshot_is_what_would_have_followed(firmware, vbus_board):
    firmware(1000)
    taken = snapshot.take(vbus_board)
    twin = snapshot.fork(vbus_board)
    vbus_board.run_for(10**12)
    twin.run_for(10**12)
    assert twin.state_hash() == vbus_board.state_hash()
    snapshot.restore(vbus_board, taken)
    assert vbus_board.now == taken.when
