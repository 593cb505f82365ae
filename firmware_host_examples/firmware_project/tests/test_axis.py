"""The firmware of this project on a virtual machine."""

import pytest

from vbus.board import snapshot
from vbus.testing import connect_in_process

MOTOR_OFF = 0x80
OK, BUSY, RESET, STALLED, LATE = range(5)

pytestmark = pytest.mark.vbus(board="../board.toml", budget={"cycles": 20_000, "chip_time": "5 s"})


@pytest.fixture
def program(vbus_exec, request):
    """Run the firmware with one position to go to."""
    driver = request.config.getoption("--driver")
    return lambda position: vbus_exec(
        "../src/main_pc.c",
        str(position),
        sources=[f"../src/{driver}"],
        flags=f"-I{request.config.rootpath}/src -Wall",
    )


@pytest.fixture
def firmware(program, vbus_clock):
    """Run it on a chip that has come out of its reset."""
    vbus_clock.advance("2 ms")
    return program


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


def test_a_chip_that_fails_its_reset_is_refused(program):
    # No time for the reset: the status is still 00h.
    assert program(10).code == RESET


@pytest.mark.vbus_matrix(part=["LM629N-8", "LM629N-6 @ 6 MHz"], hostile=8)
def test_every_chip_that_the_manual_allows_is_moved(firmware):
    assert firmware(100).code == OK


def test_the_course_of_a_move_is_what_it_was(firmware, vbus_golden):
    assert firmware(300).code == OK


def test_what_follows_a_snapshot_is_what_would_have_followed(firmware, vbus_board):
    firmware(1000)
    taken = snapshot.take(vbus_board)
    twin = snapshot.fork(vbus_board)
    vbus_board.run_for(10**12)
    twin.run_for(10**12)
    assert twin.state_hash() == vbus_board.state_hash()
    snapshot.restore(vbus_board, taken)
    assert vbus_board.now == taken.when
