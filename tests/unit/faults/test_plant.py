"""What stands between a chip and its plant, looked at by itself; and a shaft that is changed."""

import pytest

from tests.unit.faults.bench import DC, MCP, SAMPLE, Lm, Mcp, build, settle
from vbus.core.kernel import MS
from vbus.faults.plant import STUCK_A, STUCK_B, FaultyPlant
from vbus.plant.ideal import IdealPlant


def follower() -> FaultyPlant:
    plant = FaultyPlant(IdealPlant())
    plant.prepare(1e-3)
    plant.drive(0.0, 10)
    return plant


def test_a_frozen_plant_stands_through_the_whole_period() -> None:
    plant = follower()
    plant.frozen = True
    plant.take_hold()
    assert plant.drive(1.0, 50) == 10
    assert [plant.count_at(fraction) for fraction in (0.0, 0.5, 1.0)] == [10, 10, 10]
    assert plant.fraction_at(10) == 0.0
    assert plant.inner.count == 10


def test_after_a_change_it_does_not_rest_until_a_period_has_passed() -> None:
    plant = follower()
    plant.drive(0.0, 0)
    assert plant.resting()
    plant.jump(5)
    assert not plant.resting()
    plant.drive(0.0, 0)
    assert plant.resting()


@pytest.mark.parametrize(
    ("mode", "level", "seen"),
    [
        (STUCK_A, 1, [0, 1, 1, 0]),
        (STUCK_A, 0, [0, -1, -1, 0]),
        (STUCK_B, 0, [1, 1, 0, 0]),
        (STUCK_B, 1, [-1, -1, 0, 0]),
    ],
)
def test_a_stuck_channel_leaves_the_decoder_between_two_states(
    mode: int, level: int, seen: list[int]
) -> None:
    plant = FaultyPlant(IdealPlant())
    plant.take_hold()
    plant.mode, plant.level = mode, level
    assert [plant.drive(0.0, 1) for _ in range(12)] == 3 * seen


@pytest.mark.parametrize("step", [1, -1])
def test_every_second_step_is_lost_one_by_one(step: int) -> None:
    plant = FaultyPlant(IdealPlant())
    plant.lose_every = 2
    assert [plant.pulses(step) for _ in range(4)] == [10 * step, 10 * step, 20 * step, 20 * step]


@pytest.mark.parametrize("share", [1 << 20, -(1 << 20), 1 << 19])
def test_a_count_is_reached_when_it_is_first_shown(share: int) -> None:
    plant = follower()
    plant.take_hold()
    plant.share = share
    end = plant.drive(0.0, 1000)
    for count in (10, (10 + end) // 2, end):
        fraction = plant.fraction_at(count)
        assert plant.count_at(fraction) == count
        assert fraction == 0.0 or plant.count_at(fraction - 1e-6) != count


def test_a_jam_takes_the_speed_away() -> None:
    board = build()
    Lm(board).spin()
    settle(board, 50)
    assert board.plants[0].velocity > 0
    board.faults.arm("jam")
    assert board.plants[0].velocity == 0.0


@pytest.mark.parametrize(
    ("name", "parameters"),
    [("jam", {}), ("friction", {"coulomb": 5.0}), ("overheated", {"torque": 0.0})],
)
def test_the_period_under_way_keeps_its_course(name: str, parameters: dict) -> None:
    courses = []
    for armed in (False, True):
        board = build()
        Lm(board).spin()
        settle(board, 50)
        board.run_for(SAMPLE // 2)
        if armed:
            board.faults.arm(name, **parameters)
        courses.append([board.plants[0].count_at(part / 16) for part in range(17)])
    assert courses[0] == courses[1]
    assert len(set(courses[0])) > 2


def test_a_resting_shaft_feels_a_load_at_once() -> None:
    board = build()
    settle(board, 20)
    assert board.plants[0].resting()
    board.faults.arm("load_step", torque=0.05)
    assert not board.plants[0].resting()
    settle(board, 20)
    assert board.plants[0].count < -10


def test_a_lease_that_was_given_is_kept_before_a_fault_is_armed() -> None:
    board = build()
    host = Lm(board)
    host.port.write(0, 0x1E)
    host.status()
    lease = host.port.lease(0)
    assert lease is not None
    board.faults.arm("jam")
    assert board.now == lease[2]
    assert board.faults.log[0].when == lease[2]


def test_flipped_bytes_leave_addresses_alone_however_long_it_lasts() -> None:
    board = build(MCP, DC)
    host = Mcp(board)
    settle(board, 2)
    fault = board.faults.arm("byte_flipped", mask=0x0F, cycles="write", until="cleared")
    for value in (0x10, 0x20):
        host.write(0x26, value)
        settle(board, 1)
    board.faults.clear(fault)
    assert host.read(0x26) == 0x2F


def test_the_trace_hash_covers_what_a_fault_changed() -> None:
    hashes = set()
    for counts in (1, 2):
        board = build()
        board.start_trace()
        board.faults.arm("offset_jump", when=MS, counts=counts)
        settle(board, 2)
        hashes.add(board.trace_hash())
    assert len(hashes) == 2
