"""Travel limit switches (PMD-LIM)."""

import pytest

from tests.conformance.mc1241a.conftest import CYCLE, Bench
from vbus.core.signals import Switch, Z
from vbus.plant.ideal import IdealPlant

spec = pytest.mark.spec

BITS = {"PosLimit1": 0x0020, "NegLimit1": 0x0040}


def speed(bench: Bench) -> float:
    return bench.probe.profile_velocity / 2**32


def cruise(bench: Bench, sign: int = 1, mode: str = "VEL") -> None:
    bench.send("SET_PRFL_" + mode)
    bench.move(pos=100_000 * sign, vel=4 << 16, acc=sign * 4 << 16 if mode == "VEL" else 4 << 16)
    bench.next_cycle(3)


@spec("PMD-LIM-1", "PMD-TRJ-12", "PMD-CMD-70")
@pytest.mark.parametrize("switch", BITS)
@pytest.mark.parametrize("sign", [1, -1])
@pytest.mark.parametrize("active_low", [False, True])
def test_a_switch_that_becomes_active_stops_the_axis_whichever_way_it_goes(
    bench: Bench, switch: str, sign: int, active_low: bool
) -> None:
    if active_low:
        bench.drive("PosLimit1", 1)
        bench.drive("NegLimit1", 1)
        bench.send("SET_LMT_SENSE", 0x0003)
        bench.next_cycle()
        bench.send("CLR_STATUS")
        bench.next_cycle()
    cruise(bench, sign)
    bench.drive(switch, 0 if active_low else 1)
    bench.run_until((bench.now // CYCLE + 1) * CYCLE - 1)
    assert speed(bench) == 4 * sign
    bench.run_for(1)
    assert speed(bench) == 0
    assert bench.seen("status") == 0x0301 | BITS[switch]
    bench.next_cycle(5)
    assert speed(bench) == 0


@spec("PMD-LIM-1")
def test_an_axis_rests_on_a_switch_whose_event_is_cleared(chip: Bench) -> None:
    cruise(chip)
    chip.drive("PosLimit1", 1)
    chip.next_cycle()
    chip.send("CLR_STATUS")
    chip.next_cycle(2)
    assert chip.chip.resting()


@spec("PMD-LIM-1")
def test_the_profile_stays_halted_until_the_next_update(chip: Bench) -> None:
    cruise(chip)
    chip.drive("PosLimit1", 1)
    chip.next_cycle()
    chip.drive("PosLimit1", 0)
    chip.send("CLR_STATUS")
    chip.next_cycle(5)
    assert speed(chip) == 0
    chip.send("UPDATE")
    chip.next_cycle()
    assert speed(chip) == chip.chip.telemetry()["velocity 1"] == 4


@spec("PMD-LIM-1")
def test_a_hit_halts_a_geared_axis_too(chip: Bench) -> None:
    chip.send("SET_PRFL_GEAR")
    chip.move(ratio=1 << 16)
    chip.drive("NegLimit1", 1)
    chip.next_cycle()
    assert chip.status() == 0x0341
    chip.drive("QuadA1", 1)
    chip.next_cycle(2)
    assert chip.seen("target") == 0


@spec("PMD-LIM-2")
def test_the_detector_needs_an_open_switch_and_a_cleared_bit_to_re_arm(chip: Bench) -> None:
    def hits() -> bool:
        """Whether a new edge of the positive switch is seen."""
        chip.drive("PosLimit1", 1)
        chip.next_cycle()
        return bool(chip.seen("status") & 0x0020)

    assert hits()
    chip.send("CLR_STATUS")  # cleared, but the switch is still active
    chip.next_cycle(2)
    assert chip.seen("status") == 0x0300
    assert not hits()
    chip.drive("PosLimit1", 0)
    chip.next_cycle()
    assert hits()
    chip.drive("PosLimit1", 0)  # open, but not cleared
    chip.next_cycle()
    assert not chip.probe.limits_armed
    chip.send("CLR_STATUS")
    chip.next_cycle()
    assert chip.probe.limits_armed


@spec("PMD-LIM-2")
def test_after_a_hit_the_other_switch_is_not_seen_until_the_detector_is_armed(
    chip: Bench,
) -> None:
    chip.drive("NegLimit1", 1)
    chip.next_cycle()
    chip.send("CLR_STATUS")
    chip.drive("PosLimit1", 1)
    chip.next_cycle(3)
    assert chip.status() == 0x0300
    chip.drive("NegLimit1", 0)
    chip.next_cycle()
    assert chip.status() == 0x0321  # now it is


@spec("PMD-LIM-2")
def test_of_two_switches_at_once_only_one_is_processed(chip: Bench) -> None:
    chip.drive("NegLimit1", 1)
    chip.drive("PosLimit1", 1)
    chip.next_cycle()
    assert chip.status() == 0x0321


@spec("PMD-LIM-2")
def test_each_axis_has_its_own_detector(chip: Bench) -> None:
    chip.drive("PosLimit1", 1)
    chip.drive("NegLimit2", 1)
    chip.next_cycle()
    assert (chip.seen("status", 1), chip.seen("status", 2)) == (0x0321, 0x1341)


@spec("PMD-LIM-3")
def test_a_move_away_from_the_switch_is_carried_out(chip: Bench) -> None:
    cruise(chip, mode="TRAP")
    chip.drive("PosLimit1", 1)
    chip.next_cycle()
    chip.send("CLR_STATUS")
    chip.move(pos=-40)
    chip.next_cycle()
    assert speed(chip) == -4
    chip.drive("PosLimit1", 0)
    chip.next_cycle(30)
    assert chip.status() == 0x0301
    assert chip.seen("target") == -40


@spec("PMD-CMD-72", "PMD-CMD-73")
def test_sensing_off_sets_no_bits_and_leaves_those_that_are_set(chip: Bench) -> None:
    chip.drive("PosLimit1", 1)
    chip.next_cycle()
    chip.send("LMTS_OFF")
    assert chip.status() == 0x0321
    assert chip.send("GET_LMT_SWTCH") == 1
    chip.send("CLR_STATUS")
    chip.drive("PosLimit1", 0)
    chip.next_cycle(2)
    chip.drive("PosLimit1", 1)
    chip.drive("NegLimit1", 1)
    chip.next_cycle(2)
    assert chip.status() == 0x0300


@spec("PMD-CMD-72", "PMD-CMD-73")
@pytest.mark.parametrize("axis", [1, 2])
def test_sensing_is_switched_for_all_axes_whichever_is_selected(chip: Bench, axis: int) -> None:
    chip.send(f"SET_{axis}")
    chip.send("LMTS_OFF")
    for switch in ("PosLimit1", "NegLimit2"):
        chip.drive(switch, 1)
    chip.next_cycle(2)
    assert (chip.seen("status", 1), chip.seen("status", 2)) == (0x0300, 0x1300)
    chip.send("LMTS_ON")
    chip.next_cycle()
    assert (chip.seen("status", 1), chip.seen("status", 2)) == (0x0321, 0x1341)


@spec("PMD-LIM-4", "PMD-CMD-72")
@pytest.mark.parametrize(("switch", "status"), [("PosLimit1", 0x0321), ("NegLimit1", 0x0341)])
def test_lmts_on_with_an_active_switch_is_a_hit(chip: Bench, switch: str, status: int) -> None:
    chip.send("LMTS_OFF")
    chip.drive(switch, 1)
    chip.next_cycle(2)
    assert chip.status() == 0x0300
    chip.send("LMTS_ON")
    chip.next_cycle()
    assert chip.status() == status


@spec("PMD-LIM-1")
def test_limits_move_with_the_plant_s_switches(chip: Bench) -> None:
    plant = IdealPlant({"encoder_lines": 3200, "index": False})
    plant.switches["limit+"] = Switch(300, 10_000, 1)
    plant.switches["limit-"] = Switch(-10_000, -200, 1)
    bench = Bench()
    bench.chip.connect(0, plant)
    bench.load(buf_mtr_cmd=0x7FFF)
    bench.send("SET_PHASE_2")
    bench.move(pos=1000, vel=4 << 16, acc=4 << 16)
    bench.next_cycle(150)
    # The rotor gets to 300 in the cycle whose target is 300 or more; the next one sees it.
    assert bench.status() == 0x0321
    assert bench.seen("target") == 300
    assert bench.send("GET_LMT_SWTCH") == 1
    bench.send("CLR_STATUS")
    bench.move(pos=-1000)
    bench.next_cycle(250)
    assert bench.status() == 0x0341
    assert bench.seen("target") in range(-204, -199)


@spec("PMD-LIM-1")
@pytest.mark.parametrize(
    ("pin", "name", "bit"), [("PosLimit1", "limit+", 1), ("NegLimit1", "limit-", 2)]
)
def test_a_driven_pin_outranks_the_plant_s_switch(pin: str, name: str, bit: int) -> None:
    plant = IdealPlant({"encoder_lines": 3200})
    plant.switches[name] = Switch(-5, 5, 1)
    bench = Bench()
    bench.chip.connect(0, plant)
    assert bench.send("GET_LMT_SWTCH") == bit
    bench.drive(pin, 1)
    bench.drive(pin, 0)
    assert bench.send("GET_LMT_SWTCH") == 0
    bench.drive(pin, 1)
    bench.drive(pin, Z)
    assert bench.send("GET_LMT_SWTCH") == bit


@spec("PMD-LIM-1", "PMD-ERR-3")
@pytest.mark.parametrize(("beyond", "refused"), [(1, True), (0, False), (-1, False)])
def test_a_move_of_the_smallest_fraction_toward_an_active_switch_is_refused(
    chip: Bench, beyond: int, refused: bool
) -> None:
    chip.load(pos=5, vel=1 << 16, acc=1 << 16)
    chip.drive("NegLimit1", 1)
    chip.next_cycle(2)
    chip.send("CLR_STATUS")
    chip.probe.profile_position = (5 << 32) + beyond
    chip.send("UPDATE")
    chip.next_cycle(2)
    assert {*chip.rules()} - {"without-current"} == ({"command-error"} if refused else set())
