"""What drivers of the real chips do, good and bad, by a real program on port I/O.

Two chips written by one strobe, strobes that float, and data that changes while the strobe is low
are habits of microcontrollers: see ``tests/shims`` and ``tests/avr``.
"""

from collections.abc import Callable
from pathlib import Path

import pytest

from tests.boards import ALONE
from tests.e2e.command import vbus
from tests.exec.conftest import compile_c

BOARD = f"""{ALONE}
[cards.slot]
base = 0x340
decode = "direct"
chips = ["x"]
[[hosts]]
transport = "unix:$VBUS_RUNTIME/x.sock"
card = "slot"
"""
CLOCK = 'clock = "8 MHz"'
PMD = (("LM629N-8", "MC1141A"), ("8 MHz", "25 MHz"), ("direct", "byte"))
BIG_ENDIAN = (
    ("LM629N-8", "MCP-1200"),
    ("base = 0x340", "base = 0x40000000\nmemory = true\nbig_endian = true"),
)

Habit = Callable[..., tuple[list[str], list[str]]]


@pytest.fixture(scope="module")
def program(tmp_path_factory: pytest.TempPathFactory) -> Path:
    output = tmp_path_factory.mktemp("habits") / "driver_habits"
    return compile_c(output, "-O2", Path(__file__).parent / "driver_habits.c")


@pytest.fixture
def habit(program: Path, tmp_path: Path) -> Habit:
    """Run a part of the program on a changed board: its lines, and the rules it broke."""

    def run(part: str, *changes: tuple[str, str]) -> tuple[list[str], list[str]]:
        text = BOARD
        for before, after in changes:
            assert before in text
            text = text.replace(before, after)
        board = tmp_path / "board.toml"
        board.write_text(text)
        done = vbus("exec", "--board", board, "--", program, part)
        assert done.returncode == 0, done.stderr
        said = [line.split(": ") for line in done.stderr.splitlines()]
        broken = [line[3].split(" ")[0] for line in said if line[1] != "hint"]
        return done.stdout.splitlines(), broken

    return run


# -- LM629 -----------------------------------------------------------------------------------------


def test_a_limit_of_30_polls_is_enough_on_a_healthy_board(habit: Habit) -> None:
    assert habit("limit") == (["within 30 polls", "status 80"], [])


def test_a_limit_of_30_polls_shows_a_chip_that_is_slow(habit: Habit) -> None:
    """Its last poll finds it busy, and what it writes all the same is lost."""
    said, broken = habit("limit", (CLOCK, CLOCK + '\nbusy = "worst"'))
    assert said[0] == "busy after 30 polls"
    assert "lm628.busy-write" in broken


@pytest.mark.spec("LM-BUS-8")
def test_busy_is_low_between_the_bytes_of_a_word(habit: Habit) -> None:
    assert habit("between") == (["polls 15 1 15, status 80"], [])


@pytest.mark.parametrize("turn", [1, 2])
def test_calibrated_delay_loops_are_enough_in_real_time(habit: Habit, turn: int) -> None:
    """A filter is loaded and the signals are read without one look at the busy bit."""
    said, broken = habit("delays", ("lockstep", "realtime"))
    assert said == ["signals 8184, status 84"]
    assert broken == []


@pytest.mark.parametrize("first", ["84", "C4"])
def test_a_reset_loop_that_retries_for_ever_ends(habit: Habit, first: str) -> None:
    """The computer is up before the card is: its first resets come to nothing."""
    reset = (CLOCK, f'{CLOCK}\nreset_status = "{first}"')
    after = "80" if first == "84" else "C0"
    assert habit("retry", reset, ('"done"', '"reset"')) == (
        [f"after several tries, {first}, {after}"],
        ["lm628.reset-write"],
    )


@pytest.mark.spec("LM-BUS-12")
def test_a_packet_that_is_too_long_is_a_command_error_and_nothing_more(habit: Habit) -> None:
    assert habit("long") == (
        [
            "complete 80",
            "too long 82",
            "cleared 80, desired position 00000000",
            "read too far 0000",
            "status 82",
            "cleared 80",
        ],
        ["lm628.wrong-way", "lm628.left-loaded", "lm628.desired-alone"],
    )


@pytest.mark.spec("LM-BUS-11")
def test_a_packet_that_is_cut_short_leaves_the_chip_responsive(habit: Habit) -> None:
    said, broken = habit("short")
    assert said[0] == "desired position 00000000, status 80"
    assert said[1].endswith(", status 80")
    assert broken == ["lm628.cut-packet", "lm628.left-loaded", "lm628.desired-alone"]


@pytest.mark.spec("LM-BUS-11")
def test_replies_that_nobody_reads_do_not_reach_the_next_command(habit: Habit) -> None:
    assert habit("unread") == (
        ["high word 0000", "desired position 00000000, status 80"],
        ["lm628.cut-packet"],
    )


# -- MC1241A ---------------------------------------------------------------------------------------


@pytest.mark.spec("PMD-PKT-3")
def test_a_new_command_discards_what_was_not_read(habit: Habit) -> None:
    said, broken = habit("pmd-unread", *PMD)
    assert said == ["version 4210", "position 00012345, checksum 2390"]
    assert broken == ["mc1241a.left-loaded"]


@pytest.mark.spec("PMD-BUS-10", "PMD-BUS-11")
def test_packets_of_a_wrong_length_do_no_harm(habit: Habit) -> None:
    """The checksum is the same on each further read; a word too many is in no checksum."""
    said, broken = habit("pmd-lengths", *PMD)
    assert said == ["position 00010000", "checksum 014C", "read too far 427C", "status 0300"]
    assert broken == ["mc1241a.aborted", "mc1241a.unexpected-write", "mc1241a.left-loaded"]


@pytest.mark.spec("PMD-BUS-6", "PMD-PKT-4")
def test_host_ready_is_high_between_bytes_and_comes_back_after_nonsense(habit: Habit) -> None:
    said, broken = habit("pmd-ready", *PMD)
    assert said == [
        "between 1, after some",
        "unknown: checksum 0000, ready again",
        "version 4210",
    ]
    assert broken == ["mc1241a.illegal-command"]


# -- big-endian computers --------------------------------------------------------------------------


def test_a_structure_of_a_big_endian_computer_lies_over_the_registers(habit: Habit) -> None:
    """A word written to R0C and R0D has its high byte in R0C, as on a 68000."""
    said, broken = habit("big-endian", *BIG_ENDIAN)
    assert said == ["low 56, high 1234", "bytes 12 34"]
    assert broken == []
