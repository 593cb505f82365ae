"""Rules for what a driver does: each with its mistake, and with what looks like it and is right."""

from unittest.mock import ANY

import pytest

from tests.conformance.mc1241a.conftest import Bench
from vbus.chips.mc1241a import datasheet as ds
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
    return [one for one in every if one[0] not in (besides, "waveform")]


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


@spec("PMD-STL-1", "PMD-CMD-57")
@pytest.mark.parametrize(
    ("limit", "ratios", "rules"),
    [(60, (), ["limit-unwatched"]), (60, (40, 0), ["no-step-ratio"]), (32767, (), [])],
)
def test_an_error_limit_that_is_never_compared_is_found(bench, limit, ratios, rules) -> None:
    bench.send("SET_POS_ERR", limit)
    for ratio in ratios:
        bench.send("SET_STEP_RATIO", ratio)
    bench.send("SET_BUF_MTR_CMD", 1000)
    bench.send("UPDATE")  # no motion begins
    bench.move(pos=10, vel=0x10000, acc=0x1000)
    assert [rule for rule, _ in found(bench)] == rules


@spec("PMD-CMD-46")
@pytest.mark.parametrize(
    ("words", "rules"),
    [((0x00FF,), [("keeps-status", "warning")]), ((0xFFFF,), [("keeps-status", "warning")]),
     ((0x00FE, 0x00FF), []), ((0x0001,), [])],
)  # fmt: skip
def test_a_reset_of_events_that_leaves_all_of_them_is_found(moved, words, rules) -> None:
    for word in words:
        moved.send("RST_STATUS", word)
    assert found(moved) == rules


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
    for name, value, rule in (
        ("SET_VEL", 5, "left-loaded"), ("STOP", 0, "left-loaded"),
        ("SET_BUF_MTR_CMD", 7, "current-left"),
    ):  # fmt: skip
        moved.send(name, value)
        assert left(moved) == [(rule, text)]
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
    assert found(bench) == [("met-at-once", "note")]


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


# -- breakpoints ----------------------------------------------------------------------------------


@spec("PMD-CMD-32")
@pytest.mark.parametrize("clear", [False, True])
def test_a_breakpoint_on_a_motion_that_is_complete_is_found(moved: Bench, clear: bool) -> None:
    if clear:
        moved.send("CLR_STATUS")
    moved.send("SET_MTN_CMPLT_BRK")
    assert found(moved) == ([] if clear else [("stale-complete", "warning")])


@spec("PMD-UPD-2")
@pytest.mark.parametrize(
    ("command", "value", "noted"),
    [
        ("SET_POS_BRK", 10, True),
        ("SET_POS_BRK", 11, False),
        ("SET_NEG_BRK", 10, True),
        ("SET_NEG_BRK", 9, False),
        ("SET_ACTL_POS_BRK", -1, True),
        ("SET_ACTL_NEG_BRK", -1, False),
    ],
)
def test_a_breakpoint_that_is_met_as_it_is_set_is_noted(
    moved: Bench, command: str, value: int, noted: bool
) -> None:
    moved.send("SET_BRK_PNT", value)
    moved.send(command)
    assert found(moved) == ([("met-at-once", "note")] if noted else [])


@spec("PMD-UPD-2", "PMD-CMD-33")
@pytest.mark.parametrize("level", [0, 1])
def test_an_external_breakpoint_at_the_home_switch_is_noted(moved: Bench, level: int) -> None:
    moved.drive("~Home1", level)
    moved.run_for(MS)
    moved.send("SET_EXT_BRK")
    assert found(moved) == ([] if level else [("met-at-once", "note")])


@spec("PMD-CMD-27")
@pytest.mark.parametrize(("ahead", "right"), [(-5, False), (20, True), (1 << 30, True)])
def test_a_time_breakpoint_that_has_passed_is_found(moved: Bench, ahead: int, right: bool) -> None:
    moved.send("SET_BRK_PNT", moved.send("GET_TIME") + ahead)
    moved.send("SET_TIME_BRK")
    assert found(moved) == ([] if right else [("time-passed", "warning")])


# -- motors ---------------------------------------------------------------------------------------


@spec("PMD-MTR-2")
@pytest.mark.parametrize(
    ("mode", "loads", "right"),
    [
        ("SET_PRFL_TRAP", {"SET_POS": 500}, False),
        ("SET_PRFL_S_CRV", {"SET_POS": 500}, False),
        ("SET_PRFL_TRAP", {"SET_POS": 10}, True),
        ("SET_PRFL_TRAP", {"SET_VEL": 0x20000}, True),
        ("SET_PRFL_VEL", {"SET_ACC": -0x1000}, False),
        ("SET_PRFL_VEL", {"SET_ACC": 0}, True),
        ("SET_PRFL_TRAP", {"SET_POS": 500, "STOP": None}, True),
    ],
)
def test_a_motion_that_is_started_while_the_motor_is_off_is_found(
    moved: Bench, mode: str, loads: dict[str, int | None], right: bool
) -> None:
    moved.send("MTR_OFF")
    moved.send(mode)
    for name, value in loads.items():
        moved.send(name, *([] if value is None else [value]))
    moved.send("UPDATE")
    assert found(moved) == ([] if right else [("motor-off", "warning")])


@spec("PMD-MTR-2", "PMD-MTR-1")
def test_a_motion_after_mtr_on_is_right(moved: Bench) -> None:
    moved.send("MTR_OFF")
    moved.send("MTR_ON")
    moved.send("SET_POS", 500)
    moved.send("UPDATE")
    assert found(moved) == []


@spec("PMD-UPD-1", "PMD-CMD-64")
@pytest.mark.parametrize("wait", [False, True])
def test_a_motor_command_that_the_update_under_way_replaces_is_noted(
    bench: Bench, wait: bool
) -> None:
    bench.next_cycle()
    bench.send("SET_BUF_MTR_CMD", 24000)
    bench.next_cycle()
    bench.send("UPDATE")
    if wait:
        bench.next_cycle(2)
    bench.send("SET_MTR_CMD", 8000)
    bench.next_cycle(2)
    assert found(bench) == ([] if wait else [("motor-command-lost", "note")])
    assert bench.send("GET_MTR_CMD") == (8000 if wait else 24000)


# -- events ---------------------------------------------------------------------------------------


@spec("PMD-INT-3", "PMD-CMD-43")
@pytest.mark.parametrize(("word", "right"), [(0xFFFE, False), (0x0000, False), (0xFFFF, True)])
def test_events_that_are_to_be_cleared_as_interrupts_and_are_none_are_found(
    bench: Bench, word: int, right: bool
) -> None:
    bench.send("SET_MTR_CMD", 1000)
    bench.send("SET_BUF_MTR_CMD", 1000)
    bench.move(pos=10, vel=0x10000, acc=0x1000)
    bench.run_for(40 * MS)
    bench.send("RST_INTRPT", word)
    assert found(bench) == ([] if right else [("no-interrupt", "note")])
    assert bench.send("GET_STATUS") & COMPLETE


@spec("PMD-CMD-72", "PMD-CMD-73")
@pytest.mark.parametrize("on_switch", [False, True])
def test_limit_switches_that_stay_off_after_a_hit_are_noted_at_the_end(
    moved: Bench, on_switch: bool
) -> None:
    if on_switch:
        moved.drive("PosLimit1", 1)
        moved.next_cycle(2)
    moved.send("LMTS_OFF")
    text = "LMTS_OFF was given on a limit switch, and no LMTS_ON since"
    stands = [("limits-off", text)] if on_switch else []
    assert left(moved, "interrupt-stands") == [("checksum-unread", ANY), *stands]
    moved.send("LMTS_ON")
    assert left(moved) == []


@spec("PMD-STA-2")
@pytest.mark.parametrize(("clears", "word"), [("CLR_STATUS", None), ("RST_STATUS", 0xFFFE)])
@pytest.mark.parametrize("milliseconds", [0, 3])
def test_motion_complete_that_is_cleared_after_the_start_is_noted(
    moved: Bench, clears: str, word: int | None, milliseconds: int
) -> None:
    moved.move(pos=5000)
    moved.run_for(milliseconds * MS)
    moved.send(clears, *([] if word is None else [word]))
    assert found(moved)[-1:] == [("cleared-late", "note")]
    assert moved.violations[-1].detail == (
        "axis 1: motion complete is cleared while a move is under way"
    )


@spec("PMD-STA-2")
def test_motion_complete_that_is_cleared_before_the_start_or_kept_is_not_noted(
    moved: Bench,
) -> None:
    moved.send("RST_STATUS", 0xFFFE)
    moved.move(pos=5000)
    moved.send("CLR_STATUS")
    moved.next_cycle(3)
    moved.send("RST_STATUS", 0xFF00)
    assert "cleared-late" not in dict(found(moved))


@spec("PMD-STA-2", "PMD-CMD-32")
def test_motion_complete_of_the_move_before_a_breakpoint_is_cleared_later(moved: Bench) -> None:
    moved.send("CLR_STATUS")
    moved.move(pos=100)
    moved.next_cycle(2)
    moved.send("SET_MTN_CMPLT_BRK")
    moved.send("SET_POS", 5000)
    moved.run_for(60 * MS)
    moved.send("CLR_STATUS")
    assert "cleared-late" not in dict(found(moved))


@spec("PMD-STL-1")
@pytest.mark.parametrize("stop", [False, True])
def test_a_profile_that_runs_on_after_a_motion_error_is_noted(bench: Bench, stop: bool) -> None:
    bench.send("SET_STEP_RATIO", 256)
    bench.send("SET_POS_ERR", 5)
    bench.send("SET_AUTO_STOP_ON" if stop else "SET_AUTO_STOP_OFF")
    bench.send("SET_MTR_CMD", 1000)
    bench.send("SET_BUF_MTR_CMD", 1000)
    bench.move(pos=100, vel=0x10000, acc=0x1000)
    bench.next_cycle(200)
    assert bench.send("GET_STATUS") & 0x10
    assert found(bench) == ([] if stop else [("runs-on", "note")])
    if not stop:
        assert bench.violations[0].detail == (
            "axis 1: the profile has run to its end after a motion error: auto stop is off"
        )


@spec("PMD-CMD-66")
def test_a_motor_command_that_waits_with_something_else_is_only_noted_at_the_end(
    moved: Bench,
) -> None:
    assert {one.name: one.severity for one in ds.RULES}["mc1241a.current-left"] == "warning"
    moved.send("SET_BUF_MTR_CMD", 500)
    assert [rule for rule, _ in left(moved)] == ["current-left"]
    moved.send("SET_POS", 500)
    assert [rule for rule, _ in left(moved)] == ["left-loaded"], "of the next move"
    moved.send("UPDATE")
    moved.next_cycle(3)
    moved.send("SET_BUF_MTR_CMD", 400)
    assert [rule for rule, _ in left(moved)] == ["left-loaded"], "for the end of the motion"
    moved.run_for(900 * MS)
    assert [rule for rule, _ in left(moved, "interrupt-stands")][-1:] == ["current-left"]
    moved.send("SET_BRK_PNT", 9000)
    moved.send("SET_POS_BRK")
    assert [rule for rule, _ in left(moved, "interrupt-stands")][-1:] == ["left-loaded"]
