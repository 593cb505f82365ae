"""Changing modes under way: what counts is what has become of the flags (MCP-MOD-8, NOTES 7)."""

from itertools import permutations

import pytest

from tests.conformance.mcp1200.conftest import Bench

F0, F3, F4, F5 = 0, 3, 4, 5
PRIORITY = (F0, F4, F3, F5)
"""Which mode runs if several flags are set: the first (MCP-MOD-8)."""
CHANGES = list(permutations(PRIORITY, 2))


def running(bench: Bench, code: int, samples: int = 20) -> int:
    """Run a mode at its velocity; return the command position.

    Velocities are 20 counts a sample in integral velocity, 10 in a profile, 6.25 in velocity
    interpolation; the acceleration is 1.5.
    """
    for name, value in (
        ("VELOCITY_COMMAND", 20), ("PROFILE_VELOCITY", 10), ("VELOCITY", 0x000640),
        ("ACCELERATION", 0x0180), ("FINAL_POSITION", 50_000),
        ("INTERPOLATOR_PRESET", 6 if code == F3 else 2),
    ):  # fmt: skip
        bench.put(name, value)
    bench.write(0x00, 8 | code)
    bench.control()
    bench.samples(samples)
    return bench.seen("COMMAND_POSITION")


@pytest.mark.spec("MCP-MOD-8", "MCP-TRP-1")
@pytest.mark.parametrize("codes", [(0x08, 0x05), (0x05, 0x08)], ids=["set first", "clear first"])
def test_a_velocity_goes_on_as_a_trapezoid(bench: Bench, codes: tuple[int, int]) -> None:
    assert running(bench, F5) == 276
    for code in codes:
        bench.write(0x00, code)
    # From 276.5, at 20 counts a sample, to the 10 of the profile: 1.5 less in each.
    course = [295, 312, 327, 341, 354, 365, 375, 385, 395]
    assert bench.trace("COMMAND_POSITION", 9) == course
    assert (bench.seen("FLAG"), bench.seen("PHASE")) == (0x05, 4)


@pytest.mark.spec("MCP-MOD-8", "MCP-VEL-3")
def test_after_a_sample_without_a_flag_a_trapezoid_begins_at_rest(bench: Bench) -> None:
    assert running(bench, F5) == 276
    bench.write(0x00, 0x05)
    assert bench.trace("COMMAND_POSITION", 1) == [276]
    bench.write(0x00, 0x08)
    assert bench.trace("COMMAND_POSITION", 3) == [277, 280, 285]


def changed(order: str, old: int, new: int) -> tuple[list[int], int]:
    """Change from one mode to another; return the course of the command and the flags at the end.

    Args:
        order: what is written before one sample's start: ``"set clear"`` or ``"clear set"``; or
            ``"apart"``: both flags are set for a sample.
        old: flag of the mode that runs.
        new: flag of the mode that follows it.
    """
    bench = Bench()
    running(bench, old)
    codes = {"set": 8 | new, "clear": old}
    # Of two flags that of the stronger mode counts: its write is the one that changes the mode.
    first = "set" if PRIORITY.index(new) < PRIORITY.index(old) else "clear"
    if order == "apart":
        bench.write(0x00, codes["set"])
        course = bench.trace("COMMAND_POSITION", 1)
        bench.write(0x00, codes["clear"])
    else:
        course = [] if first == "set" else bench.trace("COMMAND_POSITION", 1)
        for name in order.split():
            bench.write(0x00, codes[name])
    course += bench.trace("COMMAND_POSITION", 24 - len(course))
    return course, bench.seen("FLAG")


@pytest.mark.spec("MCP-MOD-8", "MCP-VEL-3", "MCP-INT-6", "MCP-TRP-3")
@pytest.mark.parametrize(("old", "new"), CHANGES)
def test_the_order_in_which_flags_are_written_does_not_matter(old: int, new: int) -> None:
    apart, flags = changed("apart", old, new)
    assert flags & ~4 == 1 << new
    assert changed("set clear", old, new) == (apart, flags)
    assert changed("clear set", old, new) == (apart, flags)


@pytest.mark.spec("MCP-MOD-8", "MCP-SMP-5")
@pytest.mark.parametrize(("old", "new"), CHANGES)
def test_a_flag_cleared_while_the_core_is_busy_is_no_different(old: int, new: int) -> None:
    courses = []
    for busy in (0, 1):
        bench = Bench()
        running(bench, old)
        bench.until(bench.sample_start() + (20 if busy else 2450))
        assert bench.pin("BUSY") == busy
        bench.write(0x00, old)
        if busy:
            bench.wait(2450)
        bench.write(0x00, 8 | new)
        courses.append((bench.trace("COMMAND_POSITION", 20), bench.seen("FLAG")))
    assert courses[0] == courses[1]


@pytest.mark.spec("MCP-MOD-8")
@pytest.mark.parametrize(("mode", "other"), CHANGES)
def test_a_flag_set_and_cleared_again_has_not_been_there(mode: int, other: int) -> None:
    benches = [Bench(), Bench()]
    for bench in benches:
        running(bench, mode)
    benches[0].write(0x00, 8 | other)
    benches[0].write(0x00, other)
    benches[1].wait(16)
    assert benches[0].trace("COMMAND_POSITION", 4) == benches[1].trace("COMMAND_POSITION", 4)
    assert benches[0].seen("FLAG") == benches[1].seen("FLAG")


@pytest.mark.spec("MCP-VEL-3", "MCP-INT-6", "MCP-TRP-3", "MCP-MOD-8")
@pytest.mark.parametrize(
    ("mode", "steps"),
    [
        # From rest: by 1.5 a sample; a segment of eight samples; a ramp of eight to 6.25.
        (F0, [1, 4, 9]), (F5, [1, 4, 9]), (F4, [0, 2, 4, 7, 11, 16, 21, 28]),
    ],
)  # fmt: skip
@pytest.mark.parametrize("sample", [0, 1])
def test_a_mode_s_own_flag_cleared_and_set_again_begins_it_anew(
    bench: Bench, mode: int, steps: list[int], sample: int
) -> None:
    here = running(bench, mode)
    bench.write(0x00, mode)
    if sample:
        assert bench.trace("COMMAND_POSITION", 1) == [here]
    bench.write(0x00, 8 | mode)
    assert bench.trace("COMMAND_POSITION", len(steps)) == [here + step for step in steps]


@pytest.mark.spec("MCP-INT-6", "MCP-MOD-8")
def test_position_interpolation_begun_anew_lays_its_segment_from_where_it_is(bench: Bench) -> None:
    bench.put("INTERPOLATOR_PRESET", 1)
    bench.put("FINAL_POSITION", 80)
    bench.write(0x00, 0x0B)
    bench.control()
    assert bench.trace("COMMAND_POSITION", 2) == [20, 40]
    bench.write(0x00, 0x03)
    bench.write(0x00, 0x0B)
    assert bench.trace("COMMAND_POSITION", 5) == [50, 60, 70, 80, 80]


@pytest.mark.spec("MCP-MOD-8", "MCP-TRP-3")
def test_a_mode_after_a_move_that_is_over_begins_at_rest(bench: Bench) -> None:
    bench.put("FINAL_POSITION", 100)
    bench.put("PROFILE_VELOCITY", 10)
    bench.put("ACCELERATION", 0x0180)
    bench.put("VELOCITY_COMMAND", 20)
    bench.write(0x00, 0x0D)
    bench.write(0x00, 0x08)
    bench.control()
    bench.samples(16)
    assert (bench.seen("COMMAND_POSITION"), bench.seen("FLAG") & ~4) == (100, 0x20)
    assert bench.trace("COMMAND_POSITION", 3) == [101, 104, 109]
