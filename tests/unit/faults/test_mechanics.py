"""Each fault of mechanics, encoder and switches, by what a host sees of it."""

import pytest

from tests.probe import probe
from tests.unit.faults.bench import (
    DC,
    IDEAL,
    LIMIT,
    MC,
    MCP,
    SAMPLE,
    STEPPER,
    Lm,
    Mc,
    Mcp,
    build,
    settle,
    telemetry,
)
from vbus.board.board import Board
from vbus.core.kernel import MS, US

POSITION_ERROR = 0x20
MOTOR_OFF = 0x80


def running() -> tuple[Board, Lm]:
    board = build()
    host = Lm(board)
    host.spin()
    settle(board, 60)
    return board, host


def lag(board: Board) -> int:
    return int(telemetry(board)["error"])


@pytest.mark.spec("LM-POS-6")
def test_a_jam_ends_in_a_stop_on_position_error() -> None:
    board, host = running()
    host.stop_on_error(60)
    assert not host.status() & (POSITION_ERROR | MOTOR_OFF)
    board.faults.arm("jam", until="for 50 ms")
    while not host.status() & POSITION_ERROR:
        board.run_for(10 * US)
    shown = telemetry(board)
    assert host.status() & MOTOR_OFF
    assert shown["output"] == 0.0
    assert shown["real_velocity"] == 0


def test_a_jammed_shaft_stands_from_the_next_sample_on_and_goes_on_afterwards() -> None:
    board, host = running()
    board.faults.arm("jam", until="for 5 ms")
    board.run_for(2 * SAMPLE)
    stands = host.position()
    board.run_for(10 * SAMPLE)
    assert host.position() == stands
    settle(board, 100)
    assert host.position() > stands + 1000


def test_a_slipping_encoder_shows_half_of_the_way() -> None:
    """The loop keeps what the encoder shows at its speed, so the shaft turns twice as fast."""
    board, host = running()
    board.faults.arm("slip", share=0.5)
    settle(board, 50)
    plant = board.plants[0]
    start, shown = plant.count, host.position()
    settle(board, 50)
    assert plant.count - start == pytest.approx(2 * (host.position() - shown), abs=10)


def test_two_slips_lose_a_share_of_what_the_other_leaves() -> None:
    board, host = running()
    board.faults.arm("slip", share=0.5)
    second = board.faults.arm("slip", share=0.2)
    settle(board, 50)
    plant = board.plants[0]
    start, shown = plant.count, host.position()
    settle(board, 50)
    # Half of it, and four fifths of that.
    assert 0.4 * (plant.count - start) == pytest.approx(host.position() - shown, abs=10)
    board.faults.clear(second)
    settle(board, 50)
    start, shown = plant.count, host.position()
    settle(board, 50)
    assert 0.5 * (plant.count - start) == pytest.approx(host.position() - shown, abs=10)


def test_after_a_broken_coupling_the_encoder_stands_and_the_motor_runs() -> None:
    board, host = running()
    host.stop_on_error(100)
    board.faults.arm("coupling_break")
    board.run_for(SAMPLE)
    stands, turned = host.position(), board.plants[0].count
    settle(board, 50)
    assert host.position() == stands
    assert board.plants[0].count > turned + 100
    assert host.status() & MOTOR_OFF


@pytest.mark.parametrize(
    ("name", "parameters"),
    [
        ("load_step", {"torque": 0.02}),
        ("friction", {"coulomb": 0.02}),
        ("friction", {"coulomb": 0.0, "viscous": 1e-4}),
        ("overheated", {"torque": 0.3}),
    ],
)
def test_what_hinders_the_motor_makes_it_fall_behind(name: str, parameters: dict) -> None:
    board, _ = running()
    before = lag(board)
    board.faults.arm(name, **parameters)
    settle(board, 20)
    assert lag(board) > before + 5


def test_backlash_hides_motion_until_the_play_is_used_up() -> None:
    board, host = running()
    shaft, shown = board.plants[0].count, host.position()
    board.faults.arm("backlash", gap=100)
    while board.plants[0].count < shaft + 50:
        board.run_for(SAMPLE)
        board.catch_up()
    assert host.position() <= shown + 8
    settle(board, 50)
    assert host.position() == pytest.approx(board.plants[0].count - 100, abs=8)


def test_cleared_mechanics_are_as_new() -> None:
    """Two boards that part for a while come together again: the numbers are those of before."""
    board, _ = running()
    shaft = board.plants[0]
    before = (shaft.load, shaft.coulomb, shaft.static, shaft.viscous)
    first = board.faults.arm("friction", coulomb=0.01, viscous=1e-5)
    board.faults.arm("load_step", torque=0.001)
    assert (shaft.load, shaft.coulomb, shaft.static, shaft.viscous) != before
    board.faults.clear(first)
    board.faults.clear("load_step")
    assert (shaft.load, shaft.coulomb, shaft.static, shaft.viscous) == before


@pytest.mark.parametrize("ahead", [150, 0])
def test_an_end_stop_is_hit_where_it_was_put(ahead: int) -> None:
    board, host = running()
    here = board.plants[0].count
    board.faults.arm("end_stop", ahead=ahead)
    settle(board, 100)
    assert host.position() == here + ahead
    board.faults.clear()
    settle(board, 100)
    assert host.position() > here + 500


def test_a_reversed_motor_runs_away() -> None:
    board, host = running()
    here = host.position()
    board.faults.arm("motor_reversed")
    settle(board, 50)
    assert host.position() < here - 100
    assert telemetry(board)["output"] > 0.9


def test_a_motor_reversed_twice_runs_as_it_did() -> None:
    (board, host), (whole, other) = running(), running()
    board.faults.arm("motor_reversed")
    board.faults.arm("motor_reversed")
    for one in (board, whole):
        settle(one, 50)
    assert host.position() == other.position()
    board.faults.arm("motor_reversed")
    here = host.position()
    settle(board, 50)
    assert host.position() < here - 100


def test_a_sagging_supply_limits_the_speed() -> None:
    board, host = running()
    host.stop_on_error(2000)
    board.faults.arm("supply_sag", supply=0.3)
    settle(board, 30)
    start = host.position()
    settle(board, 30)
    assert host.position() - start < 4 * 30 * MS // SAMPLE // 2


@pytest.mark.parametrize("plant", ["stepper", "ideal"])
def test_a_sagging_supply_needs_a_motor_that_has_one(plant: str) -> None:
    board = build(MCP, f'[plants.m]\nmodel = "{plant}"\n')
    with pytest.raises(ValueError, match=r"supply_sag needs a plant|supply_sag needs a dc_motor"):
        board.faults.arm("supply_sag")


def test_without_amplifier_the_motor_coasts_to_a_stop() -> None:
    board, host = running()
    board.faults.arm("amplifier_off")
    settle(board, 1500)
    here = host.position()
    settle(board, 50)
    assert host.position() == here


def test_a_stepper_that_loses_steps_is_behind_by_so_many() -> None:
    board = build(MCP, IDEAL)
    chip = board.chips[0]
    board.faults.arm("lost_steps", every=10)
    plant = probe(chip).plant
    for _ in range(10):
        plant.pulses(20)
    assert plant.count == 180 * plant.inner.encoder.counts // plant.inner._steps_per_rev


def test_a_plant_that_takes_pulses_besides_a_drive_may_lose_them() -> None:
    build(MCP, IDEAL).faults.arm("lost_steps")


def test_lost_steps_need_a_stepper() -> None:
    with pytest.raises(ValueError, match=r"lost_steps needs a stepper; x\.1 has DcMotor"):
        build().faults.arm("lost_steps")


@pytest.mark.parametrize("name", ["a_stuck", "b_stuck", "a_open", "b_open"])
def test_with_a_channel_stuck_the_count_only_trembles(name: str) -> None:
    board, host = running()
    host.stop_on_error(100)
    board.faults.arm(name)
    board.run_for(2 * SAMPLE)
    seen = set()
    for _ in range(100):
        board.run_for(SAMPLE)
        seen.add(host.position())
    assert max(seen) - min(seen) <= 1
    assert host.status() & POSITION_ERROR


def test_swapped_channels_count_backwards() -> None:
    board, host = running()
    board.faults.arm("ab_swapped")
    board.run_for(2 * SAMPLE)
    start, turned = host.position(), board.plants[0].count
    settle(board, 5)
    assert board.plants[0].count > turned
    assert host.position() < start


@pytest.mark.parametrize(("width", "off"), [(999_000, 0), (1_000_000, 1)])
def test_a_pulse_counts_if_it_is_as_long_as_the_filter(width: int, off: int) -> None:
    """At 8 MHz a state of A and B must stand for eight clocks."""
    board = build()
    host = Lm(board)
    assert host.position() == 0
    board.faults.arm("glitch", until="for 3 ms", width=width)
    board.run_for(2 * SAMPLE)
    assert host.position() == off
    settle(board, 4)
    assert host.position() == 0


def captured(board: Board, host: Lm) -> int | None:
    """Ask for an index; return its position, or None if none comes in two turns."""
    host.command(0x1D, 0)  # RSTI
    host.command(0x03)  # SIP
    for _ in range(1100):
        board.run_for(SAMPLE)
        if host.status() & 0x08:
            return host.ask(0x09, 2)
    return None


@pytest.mark.spec("LM-POS-3")
def test_an_index_may_be_missing_or_come_twice() -> None:
    board, host = running()
    index = captured(board, host)
    assert index is not None
    assert index % 2000 == 0
    missing = board.faults.arm("index_missing")
    assert captured(board, host) is None
    board.faults.clear(missing)
    board.faults.arm("index_double", distance=400)
    found = {value % 2000 for value in (captured(board, host), captured(board, host))}
    assert found == {0, 400}


def test_a_jump_of_the_count_stays() -> None:
    board = build()
    host = Lm(board)
    board.faults.arm("offset_jump", counts=-123)
    board.run_for(2 * SAMPLE)
    assert host.position() == -123
    assert board.plants[0].count == 0


@pytest.mark.spec("PMD-LIM-1")
def test_a_limit_switch_stuck_closed_stops_an_mc1241a() -> None:
    board = build(MC, STEPPER)
    host = Mc(board)
    assert not host.status() & 0x20
    host.spin()
    settle(board, 20)
    assert telemetry(board)["velocity 1"] > 0
    board.faults.arm("limit_stuck", "x", switch="limit+")
    settle(board, 2)
    assert host.status() & 0x20
    assert telemetry(board)["velocity 1"] == 0


def test_a_limit_switch_stuck_closed_is_seen_by_an_mcp1200() -> None:
    board = build(MCP, DC)
    host = Mcp(board)
    settle(board, 2)
    assert host.read(0x07) & 0x80
    board.faults.arm("limit_stuck", until="for 1 ms")
    board.run_for(100 * US)
    assert not host.read(0x07) & 0x80
    assert board.chips[0].pins["/LIMIT"].value == 0
    settle(board, 2)
    assert board.chips[0].pins["/LIMIT"].value == 1


def test_a_limit_switch_stuck_open_lets_the_axis_pass() -> None:
    board = build(MCP, DC, LIMIT)
    host = Mcp(board)
    host.spin()
    board.faults.arm("limit_stuck", state="open")
    settle(board, 200)
    assert board.plants[0].count > 600
    assert host.read(0x07) & 0x80


def test_a_fault_of_one_switch_leaves_the_others_alone() -> None:
    home = "[plants.m.switches.home]\nfirst = 300\nlast = 400\n"
    board = build(MCP, DC, LIMIT + home)
    board.faults.arm("limit_stuck", state="open", switch="limit+")
    switches = board.plants[0].switches
    assert [switches[name].level(count) for name, count in (("home", 350), ("limit+", 600))] == [
        switches["home"].active, not switches["limit+"].active,
    ]  # fmt: skip


def test_a_bouncing_limit_switch_closes_again_and_again() -> None:
    board = build(MCP, DC)
    pin = board.chips[0].pins["/LIMIT"]
    board.faults.arm("limit_bouncing", period=MS, until="for 5 ms")
    levels = []
    for _ in range(12):
        board.run_for(MS // 2 - US)
        levels.append(pin.value)
        board.run_for(US)
    assert levels == [0, 1] * 5 + [1, 1]


def test_a_home_switch_that_never_closes_is_never_found() -> None:
    home = "[plants.m.switches.home]\nfirst = 300\nlast = 400\n"
    for broken in (False, True):
        board = build(MCP, DC, home)
        host = Mcp(board)
        if broken:
            board.faults.arm("home_never")
        host.spin()
        settle(board, 200)
        assert bool(host.read(0x07) & 0x40) == broken
