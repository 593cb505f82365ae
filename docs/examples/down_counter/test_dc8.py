"""The DC-8, tested as its datasheet has it."""

from vbus.board.build import load_board
from vbus.core.kernel import US
from vbus.testing import check_chip


def test_it_keeps_the_contract():
    check_chip(lambda: load_board("counter.toml"))


def test_it_counts_down_and_rests_at_zero():
    board = load_board("counter.toml")
    port = board.open_port("host")
    port.write(0, 3)  # taken in cycle 1 of CLK; a cycle is 1 us
    board.run_until(30 * US)
    assert port.read(1) == 2
    board.run_until(49 * US - 1)
    board.catch_up()  # chips are lazy: this one looks at itself when asked
    assert board.find_pin("x.DONE").value == 0
    board.run_until(49 * US)
    board.catch_up()
    assert board.find_pin("x.DONE").value == 1


def test_a_write_while_it_counts_is_a_violation():
    board = load_board("counter.toml")
    port = board.open_port("host")
    port.write(0, 9)
    port.write(0, 9)
    assert [found.rule for found in board.violations] == ["dc8.running"]


def test_a_stopped_clock_holds_the_count():
    board = load_board("counter.toml")
    port = board.open_port("host")
    port.write(0, 9)
    board.faults.arm("clock_stopped")
    board.run_for(10**12)
    assert port.read(1) == 9


def test_a_shorted_data_line_is_seen_from_the_command_on():
    board = load_board("counter.toml")
    port = board.open_port("host")
    port.write(0, 2)
    board.faults.arm("bit_stuck", when="command LOAD", bit=0, level=1)
    board.run_for(10**9)
    port.write(0, 4)
    assert port.read(0) == 5


def test_a_driver_reads_what_it_wrote(vbus_dc8):
    vbus_dc8.host.write_load(200)
    assert vbus_dc8.host.read_load() == 200
    assert vbus_dc8.host.read_count() == 200
