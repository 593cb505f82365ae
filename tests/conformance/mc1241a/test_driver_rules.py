"""Rules for what a driver does: each with its mistake, and with what looks like it and is right."""

import pytest

from tests.conformance.mc1241a.conftest import Bench
from vbus.core.kernel import MS
from vbus.core.signals import Watcher

spec = pytest.mark.spec

COMPLETE, COMMAND_ERROR = 0x01, 0x80


def found(bench: Bench) -> list[tuple[str, str]]:
    """Return the rules broken so far, each with its severity."""
    bench.chip.advance()
    return [(v.rule.partition(".")[2], v.severity) for v in bench.violations]


def left(bench: Bench, besides: str = "checksum-unread") -> list[tuple[str, str]]:
    """Return what a run that ended now would leave."""
    every = [(rule.name.partition(".")[2], text) for rule, text in bench.chip.left_over()]
    return [one for one in every if one[0] != besides]


@pytest.fixture
def moved(bench: Bench) -> Bench:
    """An axis that has ended a move, which interrupts."""
    bench.send("SET_INTRPT_MASK", COMPLETE)
    bench.send("SET_MTR_CMD", 1000)
    bench.send("SET_BUF_MTR_CMD", 1000)
    bench.move(pos=10, vel=0x10000, acc=0x1000)
    bench.run_for(40 * MS)
    assert bench.send("GET_INTRPT") & COMPLETE
    return bench


# -- interrupts -----------------------------------------------------------------------------------


@spec("PMD-INT-3")
@pytest.mark.parametrize("word", [0x0001, 0xFFFF, 0x00FF])
def test_an_acknowledgement_that_leaves_what_interrupts_is_found(moved: Bench, word: int) -> None:
    moved.send("RST_INTRPT", word)
    assert found(moved) == [("keeps-interrupt", "warning")]
    assert moved.violations[0].detail == (
        f"RST_INTRPT {word:04X}H leaves 0001H of axis 1: it interrupts again at once"
    )
    moved.next_cycle(2)
    assert moved.level("~HostIntrpt") == 0


@spec("PMD-INT-3")
@pytest.mark.parametrize("word", [0x0000, 0xFFFE, 0x0080])
def test_an_acknowledgement_of_what_interrupts_is_right(moved: Bench, word: int) -> None:
    moved.send("RST_INTRPT", word)
    moved.send("RST_INTRPT", 0xFFFF)  # nothing interrupts
    assert found(moved) == []


@spec("PMD-INT-3")
def test_two_events_may_be_acknowledged_one_by_one(moved: Bench) -> None:
    moved.send("SET_INTRPT_MASK", COMPLETE | COMMAND_ERROR)
    moved.move(pos=1000)
    moved.next_cycle(4)
    moved.move(acc=0x2000)  # refused in motion
    moved.run_for(2 * MS)
    moved.send("RST_INTRPT", 0xFFFF & ~COMPLETE)
    moved.send("RST_INTRPT", 0xFFFF & ~COMMAND_ERROR)
    assert [one for one in found(moved) if one[0] == "keeps-interrupt"] == []


# -- updates --------------------------------------------------------------------------------------


@spec("PMD-UPD-1")
def test_an_update_that_changes_nothing_is_noted(moved: Bench) -> None:
    moved.send("UPDATE")
    assert found(moved) == [("idle-update", "note")]
    moved.next_cycle()
    moved.send("MULTI_UPDATE", 3)
    assert found(moved) == [("idle-update", "note")] * 3


@spec("PMD-UPD-1", "PMD-TRJ-12")
def test_updates_that_look_idle_and_are_not(moved: Bench) -> None:
    moved.move(pos=10)  # the same destination: motion is complete anew
    moved.next_cycle(2)
    moved.move(pos=5000)
    moved.next_cycle(5)
    moved.send("STOP")
    moved.send("UPDATE")
    moved.next_cycle(2)
    moved.send("UPDATE")  # it goes on to where it was going
    moved.next_cycle(5)
    assert moved.status() & 0x400
    moved.send("MTR_OFF")
    moved.send("UPDATE")
    moved.send("MTR_ON")
    moved.send("UPDATE")  # so it does after MTR_ON
    moved.next_cycle(3)
    moved.send("SET_BUF_MTR_CMD", 1000)
    moved.send("UPDATE")
    assert found(moved) == []


# -- the encoder ----------------------------------------------------------------------------------


@spec("PMD-STL-1", "PMD-CMD-53")
def test_a_step_ratio_of_0_is_noted(bench: Bench) -> None:
    bench.send("SET_STEP_RATIO", 256)
    assert found(bench) == []
    bench.send("SET_STEP_RATIO", 0)
    assert found(bench) == [("no-step-ratio", "note")]


# -- the end of a run -----------------------------------------------------------------------------


@spec("PMD-PKT-2")
def test_checksums_never_read_are_noted_at_the_end(bench: Bench) -> None:
    assert left(bench, "") == []
    bench.send("SET_POS", 0)
    bench.send("GET_POS")
    assert left(bench, "") == [("checksum-unread", "no checksum of 2 packets was read")]
    bench.checksum()
    bench.send("GET_POS")
    assert left(bench, "") == [], "one that reads some knows of checksums"


@spec("PMD-UPD-1")
def test_what_no_update_has_taken_is_noted_at_the_end(moved: Bench) -> None:
    assert left(moved) == []
    text = "axis 1: what is loaded last no update has taken"
    for name, value in (("SET_VEL", 5), ("STOP", 0), ("SET_BUF_MTR_CMD", 7)):
        moved.send(name, value)
        assert left(moved) == [("left-loaded", text)]
        moved.send("UPDATE")
        moved.next_cycle(2)
        assert left(moved) == []


@spec("PMD-INT-1")
def test_an_interrupt_that_stands_at_the_end_is_noted_where_it_is_wired(moved: Bench) -> None:
    assert left(moved) == []
    moved.chip.pins["~HostIntrpt"].net.watch(Watcher(moved.kernel, lambda: None))
    assert left(moved) == [("interrupt-stands", "~HostIntrpt is low at the end, for axis 1")]
    moved.send("RST_INTRPT", 0)
    assert left(moved) == []


@spec("PMD-STA-1")
def test_errors_that_stand_at_the_end_are_noted(moved: Bench) -> None:
    moved.move(pos=1000)
    moved.next_cycle(4)
    moved.move(acc=0x2000)
    moved.next_cycle(2)
    assert ("errors-stand", "axis 1 at the end: command error") in left(moved)
    moved.send("CLR_STATUS")
    assert "errors-stand" not in dict(left(moved))


@pytest.fixture
def refused(moved: Bench) -> Bench:
    """An axis that has refused an acceleration in motion."""
    moved.move(pos=1000)
    moved.next_cycle(4)
    moved.move(acc=0x2000)
    moved.next_cycle(2)
    return moved


@spec("PMD-STA-2")
@pytest.mark.parametrize("clear", ["CLR_STATUS", "RST_STATUS", "RST_INTRPT"])
def test_an_error_that_is_cleared_unread_is_noted(refused: Bench, clear: str) -> None:
    text = "axis 1: command error, and no status word has shown it to the host"
    assert ("error-unread", text) in left(refused)
    if clear == "RST_INTRPT":
        refused.send("SET_INTRPT_MASK", COMMAND_ERROR)
        refused.next_cycle()
        refused.send(clear, 0)
    else:
        refused.send(clear, *([0] if clear == "RST_STATUS" else []))
    assert ("error-unread", "note") in found(refused)
    assert "error-unread" not in dict(left(refused))


@spec("PMD-STA-2")
@pytest.mark.parametrize("way", ["GET_STATUS", "GET_INTRPT", "SET_1"])
def test_an_error_that_a_status_word_has_shown_is_right(refused: Bench, way: str) -> None:
    refused.send(way)
    assert "error-unread" not in dict(left(refused))
    refused.send("CLR_STATUS")
    assert ("error-unread", "note") not in found(refused)


@spec("PMD-STA-2")
def test_the_status_word_of_the_other_axis_shows_nothing(refused: Bench) -> None:
    refused.send("SET_2")
    refused.send("GET_STATUS")
    assert "error-unread" in dict(left(refused))


@spec("PMD-TRJ-12")
@pytest.mark.parametrize("rates", [{"vel": 0, "acc": 0x1000}, {"vel": 0x10000, "acc": 0}])
def test_a_move_without_a_rate_is_noted(bench: Bench, rates: dict[str, int]) -> None:
    bench.move(pos=10, **rates)
    bench.next_cycle(2)
    assert ("no-rate", "note") in found(bench)


@spec("PMD-TRJ-12")
def test_a_move_with_the_rates_of_the_one_before_is_right(moved: Bench) -> None:
    moved.move(pos=20)
    moved.next_cycle(2)
    moved.move(pos=20, vel=0)
    moved.next_cycle(2)
    assert ("no-rate", "note") not in found(moved)


@spec("PMD-UPD-1")
def test_an_update_of_a_run_that_ends_before_the_cycle_has_taken_what_was_loaded(
    moved: Bench,
) -> None:
    moved.send("SET_VEL", 5)
    moved.send("UPDATE")
    assert "left-loaded" not in dict(left(moved))
    moved.send("SET_VEL", 6)
    assert "left-loaded" in dict(left(moved))


# -- breakpoints and profiles ---------------------------------------------------------------------


@spec("PMD-CMD-35", "PMD-UPD-2")
def test_a_compare_value_given_after_its_breakpoint_is_found(bench: Bench) -> None:
    bench.send("SET_BRK_PNT", 100)
    bench.send("SET_POS_BRK")
    bench.send("SET_BRK_PNT", 200)
    assert found(bench) == [("late-value", "warning")]
    assert "axis 1" in bench.violations[0].detail


@spec("PMD-CMD-35", "PMD-UPD-2")
def test_a_compare_value_given_first_or_beside_a_breakpoint_without_one_is_right(
    bench: Bench,
) -> None:
    bench.send("SET_BRK_PNT", 0)
    bench.send("SET_POS_BRK")
    bench.next_cycle(2)
    bench.send("SET_EXT_BRK")
    bench.send("SET_BRK_PNT", 200)
    assert found(bench) == []


@spec("PMD-CMD-14")
@pytest.mark.parametrize(
    ("velocity", "rules"), [(0x8000, [("start-velocity", "warning")]), (0x10000, []), (0, [])]
)
def test_a_starting_velocity_above_the_velocity_is_found(
    bench: Bench, velocity: int, rules: list[tuple[str, str]]
) -> None:
    bench.send("SET_MTR_CMD", 1000)
    bench.send("SET_BUF_MTR_CMD", 1000)
    bench.send("SET_START_VEL", 0x10000)
    bench.send("SET_VEL", velocity)
    bench.send("SET_ACC", 0x1000)
    bench.send("UPDATE")
    assert found(bench) == rules


@spec("PMD-CMD-10", "PMD-CMD-11")
@pytest.mark.parametrize(
    ("mode", "load", "noted"),
    [
        ("SET_PRFL_S_CRV", "SET_ACC", "S-curve profile does not use acceleration"),
        ("SET_PRFL_TRAP", "SET_MAX_ACC", "trapezoidal profile does not use max acceleration"),
        ("SET_PRFL_VEL", "SET_JERK", "velocity profile does not use jerk"),
        ("SET_PRFL_VEL", "SET_POS", ""),
        ("SET_PRFL_S_CRV", "SET_MAX_ACC", ""),
        ("SET_PRFL_TRAP", "SET_ACC", ""),
    ],
)
def test_what_the_profile_mode_does_not_use_is_noted(
    bench: Bench, mode: str, load: str, noted: str
) -> None:
    bench.send(mode)
    bench.send(load, 0x100)
    bench.send("UPDATE")
    bench.next_cycle(2)
    details = [v.detail for v in bench.violations if v.rule == "mc1241a.other-profile"]
    assert details == ([f"axis 1: the {noted}"] if noted else [])


@spec("PMD-TRJ-9")
@pytest.mark.parametrize(
    ("stop", "velocity", "rules"),
    [
        ("STOP", 0x40000, [("abrupt-stop", "note")]),
        ("SMOOTH_STOP", 0x40000, []),
        ("STOP", 0x8000, []),
    ],
)
def test_a_stop_at_speed_is_noted(
    bench: Bench, stop: str, velocity: int, rules: list[tuple[str, str]]
) -> None:
    bench.send("SET_BUF_MTR_CMD", 1000)
    bench.move(pos=100000, vel=velocity, acc=0x10000)
    bench.next_cycle(10)
    bench.send(stop)
    bench.send("UPDATE")
    assert found(bench) == rules
