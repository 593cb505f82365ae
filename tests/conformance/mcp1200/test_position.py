"""Position control (MCP-POS), backlash, deadband, position error (MCP-ERR)."""

import pytest

from tests.conformance.mcp1200.conftest import Bench, Follower


def errors(bench: Bench, commands: list[int]) -> list[int]:
    """Give one command position per sample; return the position errors, actual position 0."""
    seen = []
    for command in commands:
        bench.put("COMMAND_POSITION", command & 0xFFFFFF)
        bench.samples(1)
        seen.append(bench.seen("POSITION_ERROR"))
    return seen


@pytest.mark.spec("MCP-POS-1")
@pytest.mark.parametrize(("step", "total"), [(0x01, 3), (0x7F, 381), (0xFF, -3), (0x80, -384)])
def test_increments_add_up(bench: Bench, step: int, total: int) -> None:
    bench.control()
    for _ in range(3):
        bench.write(0x0B, step)
        bench.samples(1)
    assert bench.seen("COMMAND_POSITION") == total


@pytest.mark.spec("MCP-POS-1")
def test_an_increment_waits_while_another_mode_runs(bench: Bench) -> None:
    bench.control()
    bench.write(0x00, 0x0D)
    bench.write(0x0B, 0x05)
    bench.samples(3)
    assert (bench.seen("COMMAND_POSITION"), bench.read(0x0B)) == (0, 5)
    bench.write(0x00, 0x05)
    bench.samples(1)
    assert (bench.seen("COMMAND_POSITION"), bench.read(0x0B)) == (5, 0)


@pytest.mark.spec("MCP-ERR-1", "MCP-STA-4")
def test_no_backlash_in_idle_mode_forgets_what_was_made_up_for(bench: Bench) -> None:
    bench.extended()
    bench.put("BACKLASH", 10)
    bench.control()
    assert errors(bench, [0, 5, 2]) == [0, 5, -8]
    bench.write(0x05, 0x01)
    bench.put("BACKLASH", 0)
    bench.put("COMMAND_POSITION", 0)
    bench.samples(2)
    assert bench.read(0x07) == 0xFC
    bench.put("BACKLASH", 10)
    bench.samples(1)
    assert bench.read(0x07) == 0xFC
    bench.control()
    assert errors(bench, [0, 3]) == [0, 13]


@pytest.mark.spec("MCP-POS-1", "MCP-EXC-2", "MCP-EXC-5")
@pytest.mark.parametrize("action", [2, 3])
def test_an_increment_waits_while_an_exception_stops_the_axis(bench: Bench, action: int) -> None:
    bench.put("COMMAND_POSITION", 100)
    bench.control()
    bench.samples(1)
    bench.extended()
    bench.write(0x46, action)
    bench.write(0x0B, 0x05)
    bench.samples(2)
    assert (bench.seen("COMMAND_POSITION"), bench.read(0x0B)) == (0, 5)
    bench.write(0x46, 0)
    bench.samples(1)
    assert (bench.seen("COMMAND_POSITION"), bench.read(0x0B)) == (5, 0)


@pytest.mark.spec("MCP-POS-1", "MCP-REG-12")
def test_an_increment_written_while_busy_is_kept_for_the_next_sample(bench: Bench) -> None:
    bench.control()
    bench.samples(1)
    bench.write(0x0B, 0x05)
    bench.until(bench.sample_start() + 100)
    bench.write(0x0B, 0x07)
    bench.until(bench.sample_start() - 1)
    assert (bench.seen("COMMAND_POSITION"), bench.read(0x0B)) == (5, 7)
    bench.samples(1)
    assert (bench.seen("COMMAND_POSITION"), bench.read(0x0B)) == (12, 0)


@pytest.mark.spec("MCP-POS-1", "MCP-REG-13")
def test_a_command_written_while_busy_is_not_lost_to_an_increment(bench: Bench) -> None:
    bench.control()
    bench.samples(1)
    bench.write(0x0B, 0x05)
    bench.until(bench.sample_start() + 100)
    bench.put("COMMAND_POSITION", 70)
    bench.until(bench.sample_start() - 1)
    assert (bench.seen("COMMAND_POSITION"), bench.seen("POSITION_ERROR")) == (70, 5)
    bench.samples(1)
    assert (bench.seen("COMMAND_POSITION"), bench.seen("POSITION_ERROR")) == (70, 70)


@pytest.mark.spec("MCP-POS-2")
def test_positions_wrap_and_their_difference_is_the_short_way(bench: Bench) -> None:
    bench.put("COMMAND_POSITION", 0x800003)
    bench.probe.set_position(0x7FFFFE, bench.cycle)
    bench.control()
    bench.samples(1)
    assert bench.seen("POSITION_ERROR") == 5
    bench.put("COMMAND_POSITION", 0x7FFFFF)
    bench.write(0x0B, 0x02)
    bench.samples(1)
    assert bench.seen("COMMAND_POSITION") == -0x7FFFFF
    bench.probe.set_position(-0x7FFFFF, bench.cycle)
    bench.samples(1)
    assert bench.seen("POSITION_ERROR") == 0


@pytest.mark.spec("MCP-POS-2")
def test_the_counter_wraps_at_24_bits() -> None:
    follower = Follower()
    bench = Bench(plant=follower)
    bench.probe.set_position(0x7FFFFF, bench.cycle)
    bench.put("COMMAND_POSITION", 0x800001)
    bench.control()
    bench.samples(2)
    assert bench.position == -0x7FFFFF


@pytest.mark.spec("MCP-ERR-1")
def test_backlash_is_added_on_each_change_of_direction_but_not_on_the_first_move(
    bench: Bench,
) -> None:
    bench.extended()
    bench.put("BACKLASH", 10)
    bench.control()
    assert errors(bench, [0, 5, 7, 7, 6, 2, 2, 3, 1]) == [0, 5, 7, 7, -4, -8, -8, 3, -9]
    assert bench.seen("COMMAND_POSITION") == 1


@pytest.mark.spec("MCP-ERR-1")
def test_zero_backlash_clears_the_hidden_offset(bench: Bench) -> None:
    bench.extended()
    bench.put("BACKLASH", 10)
    bench.control()
    assert errors(bench, [0, 5, 4]) == [0, 5, -6]
    bench.put("BACKLASH", 0)
    assert errors(bench, [4, 5, 3]) == [4, 5, 3]
    bench.put("BACKLASH", 10)
    assert errors(bench, [2, 3]) == [2, 13]


@pytest.mark.spec("MCP-ERR-1")
def test_backlash_entered_after_it_was_taken_out_acts_on_the_first_change_of_direction(
    bench: Bench,
) -> None:
    bench.extended()
    bench.control()
    assert errors(bench, [0, 50]) == [0, 50]
    bench.put("BACKLASH", 10)
    assert errors(bench, [50, 60, 59]) == [50, 60, 49]


@pytest.mark.spec("MCP-ERR-1")
def test_backlash_acts_in_every_control_mode(bench: Bench) -> None:
    bench.extended()
    bench.put("BACKLASH", 20)
    bench.put("VELOCITY_COMMAND", 1)
    bench.put("ACCELERATION", 0x7F00)
    bench.control()
    bench.write(0x00, 0x0D)
    bench.samples(3)
    assert bench.seen("POSITION_ERROR") == 3
    bench.put("VELOCITY_COMMAND", 0xFF)
    bench.samples(1)
    assert (bench.seen("COMMAND_POSITION"), bench.seen("POSITION_ERROR")) == (2, -18)


@pytest.mark.spec("MCP-ERR-2", "MCP-AMB-6")
@pytest.mark.parametrize(
    ("error", "fault"), [(100, False), (101, True), (-100, False), (-101, True)]
)
def test_the_maximum_error_is_compared_with_the_magnitude(
    bench: Bench, error: int, fault: bool
) -> None:
    bench.extended()
    bench.put("MAX_ERROR", 100)
    bench.put("COMMAND_POSITION", error & 0xFFFFFF)
    bench.control()
    bench.samples(1)
    assert bool(bench.seen("STATUS") & 0x10) != fault
    assert bench.seen("STATUS") & 0xE8 == 0xE8
    if fault:
        bench.put("COMMAND_POSITION", 0)
        bench.samples(1)
        assert not bench.seen("STATUS") & 0x10
        bench.write(0x07, 0)
        bench.samples(1)
        assert bench.seen("STATUS") & 0x10


@pytest.mark.spec("MCP-ERR-2")
@pytest.mark.parametrize(("limit", "fault"), [(0xFFFF, False), (0xFFFE, True)])
def test_an_error_beyond_16_bits_counts_as_ffffh(bench: Bench, limit: int, fault: bool) -> None:
    bench.extended()
    bench.put("MAX_ERROR", limit)
    bench.put("COMMAND_POSITION", 0x200000)
    bench.control()
    bench.samples(1)
    assert bool(bench.seen("STATUS") & 0x10) != fault


@pytest.mark.spec("MCP-ERR-3", "MCP-AMB-17", "MCP-T-16")
@pytest.mark.parametrize(
    ("actual", "driven"),
    [(996, True), (997, True), (998, False), (999, False), (1000, False), (1001, False),
     (1002, False), (1003, True), (1004, True)],
)  # fmt: skip
def test_inside_the_deadband_the_motor_is_off(bench: Bench, actual: int, driven: bool) -> None:
    bench.extended()
    bench.put("DEADBAND", 2)
    bench.put("COMMAND_POSITION", 1000)
    bench.probe.set_position(actual, bench.cycle)
    bench.control()
    bench.samples(1)
    assert bench.seen("POSITION_ERROR") == (1000 - actual if driven else 0)
    assert (bench.seen("PWM_COMMAND") != 0) == driven
    assert bool(bench.seen("STATUS") & 4) == (997 <= actual <= 1003)


@pytest.mark.spec("MCP-ERR-3", "MCP-ERR-2")
def test_the_deadband_does_not_hide_an_error_from_the_maximum(bench: Bench) -> None:
    bench.extended()
    bench.put("DEADBAND", 50)
    bench.put("MAX_ERROR", 20)
    bench.put("COMMAND_POSITION", 30)
    bench.control()
    bench.samples(1)
    assert bench.seen("POSITION_ERROR") == 0
    assert not bench.seen("STATUS") & 0x10


@pytest.mark.spec("MCP-ERR-4", "MCP-REG-28")
@pytest.mark.parametrize(
    ("error", "shown"),
    [(32767, 32767), (32768, 32767), (-32768, -32768), (-32769, -32768), (16385, 16385),
     (-16385, -16385)],
)  # fmt: skip
def test_the_position_error_register_saturates_at_16_bits(
    bench: Bench, error: int, shown: int
) -> None:
    bench.put("COMMAND_POSITION", error & 0xFFFFFF)
    bench.control()
    bench.samples(1)
    assert bench.get("POSITION_ERROR") == shown


@pytest.mark.spec("MCP-POS-1")
def test_the_loop_drives_a_following_plant_to_the_command() -> None:
    follower = Follower()
    bench = Bench(plant=follower)
    bench.control()
    bench.put("COMMAND_POSITION", 500)
    bench.samples(1)
    assert bench.seen("POSITION_ERROR") == 500
    bench.samples(1)
    assert (bench.seen("POSITION_ERROR"), bench.position) == (0, 500)
    assert bench.get("ACTUAL_POSITION") == 500
