"""What polls and waits cost, counted: faults and messages; and that nobody can tell."""

from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

import pytest

from tests.exec.conftest import PROGRAMS, compile_c
from tests.exec.test_programs import SERVO, execute, said
from vbus.record.format import Entry, JournalReader


class Run(NamedTuple):
    """What a run leaves behind; the journal ends with the hashes of state and trace."""

    lines: list[str]
    transcript: str
    journal: list[Entry]
    faults: int


Follow = Callable[..., Run]


@pytest.fixture
def follow(programs: Callable[[str, int], Path], bits: int, tmp_path: Path) -> Follow:
    """Run ``follows.c``, compiled with some flags."""

    def run(board: str, *flags: str) -> Run:
        program = compile_c(tmp_path / "follows", f"-m{bits}", *flags, PROGRAMS / "follows.c")
        transcript, journal = tmp_path / "bus.txt", tmp_path / "run.journal"
        done = execute(
            tmp_path, board, programs("counts", bits), "faults", program,
            options=("--transcript", transcript, "--journal", journal),
        )  # fmt: skip
        assert done.returncode == 0, done.stderr
        *lines, faults = done.stdout.splitlines()
        with journal.open("rb") as file:
            entries = list(JournalReader(file))
        return Run(lines, transcript.read_text(), entries, int(faults.split()[0]))

    return run


@pytest.mark.parametrize(
    ("policy", "card", "flags"),
    [
        ("lockstep", "base = 0x340", ("-O0",)),
        ("slaved", "base = 0x340", ("-O2",)),
        ("lockstep", "base = 0x40000000\nmemory = true", ("-O2", "-DMEMORY")),
    ],
    ids=["lockstep", "slaved", "memory"],
)
def test_a_loop_that_is_followed_makes_the_same_cycles_at_the_same_instants(
    follow: Follow, policy: str, card: str, flags: tuple[str, ...]
) -> None:
    """Signals, time-outs, clocks and faults of the program's own come at the same poll."""
    board = SERVO.replace("base = 0x340", card).format(time=policy, card="")
    followed, alone = follow(board, *flags), follow(board, *flags, "-DALONE")
    assert followed.lines == alone.lines
    assert followed.lines[-2:] == ["signal 11 at 10 after 1000", "fault: 1000"]
    assert followed.transcript == alone.transcript
    assert followed.journal == alone.journal
    assert followed.journal[-1].op == "end"
    assert followed.faults < alone.faults / 10


@pytest.mark.parametrize("policy", ["lockstep", "slaved"])
def test_waiting_for_an_interrupt_takes_no_message_per_sample(
    programs: Callable[[str, int], Path], tmp_path: Path, policy: str
) -> None:
    """A sample takes 256 us; the board says when the line may move next."""
    board = SERVO.format(time=policy, card="")
    counts, awaits = programs("counts", 64), programs("awaits", 64)
    short, long = (
        said(execute(tmp_path, board, counts, "messages", awaits, distance))
        for distance in ("10", "2000")
    )
    assert (short[0], long[0]) == ("0.1 s", "1.3 s")
    more = int(long[1].split()[0]) - int(short[1].split()[0])
    assert more < 1.2 / 256e-6 / 10
