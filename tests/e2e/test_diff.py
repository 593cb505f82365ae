"""``vbus diff`` as a process: what it prints, and its exit code."""

import json
from pathlib import Path

import pytest

from tests.e2e.command import vbus
from tests.unit.views.conftest import LM629, record
from tests.unit.views.test_runs import mover


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    whole = record(LM629, mover())
    journals = {
        "a": whole,
        "same": whole,
        "softer": record(LM629, mover(kp=40)),
        "poll": record(LM629, mover(polls=7)),
        "slow": record(LM629.replace("8 MHz", "6 MHz"), mover()),
        "open": record(LM629, mover(), close=False),
        "cut": whole[:-9],
        "damaged": whole[:-9] + bytes(9),
        "text": b"something else",
    }
    for name, data in journals.items():
        (tmp_path / f"{name}.vbj").write_bytes(data)
    return tmp_path


def test_equal_runs_end_with_0(folder: Path) -> None:
    done = vbus("diff", "a.vbj", "same.vbj")
    assert (done.returncode, done.stderr) == (0, "")
    assert done.stdout == (
        "a.vbj: packets 10, bus cycles 256, moves 1, chip time 300.256 ms\n"
        "same.vbj: packets 10, bus cycles 256, moves 1, chip time 300.256 ms\n"
        "no difference\n"
    )


def test_other_runs_end_with_1_and_the_first_differences(folder: Path) -> None:
    done = vbus("diff", "a.vbj", "softer.vbj")
    assert (done.returncode, done.stderr) == (1, "")
    lines = done.stdout.splitlines()
    assert lines[2:5] == [
        "host: packet 2",
        "  first:  53.000001us x LFIL kp=300 kd=2000 ds=1 samples  [LM-CMD-19]",
        "  second: 53.000001us x LFIL kp=40 kd=2000 ds=1 samples  [LM-CMD-19]",
    ]
    assert "motor: x.1: peak error" in lines


def test_the_same_for_programs(folder: Path) -> None:
    done = vbus("diff", "--json", "a.vbj", "poll.vbj")
    assert done.returncode == 1
    value = json.loads(done.stdout)
    assert value["equal"] is False
    assert value["runs"][0] == {
        "journal": "a.vbj", "packets": 10, "cycles": 256, "duration_ps": 300_256_000_001,
        "moves": {"x.1": [{"begin_ps": 10**10, "duration_ps": 134 * 10**9, "begins_at": 2,
                           "ends_at": 499, "overshoot": 0}]},
    }  # fmt: skip
    assert value["differences"][-2:] == [
        {"part": "cost", "what": "bus cycles", "was": 256, "now": 263, "unit": "",
         "was_ps": None, "now_ps": None},
        {"part": "cost", "what": "chip time", "was": 300_256_000_001, "now": 300_263_000_001,
         "unit": "ps", "was_ps": None, "now_ps": None},
    ]  # fmt: skip


def test_tolerances_are_options(folder: Path) -> None:
    near = ["--counts", "1", "--time", "1", "--cycles", "3"]
    assert vbus("diff", "a.vbj", "poll.vbj", *near).returncode == 0
    assert vbus("diff", "a.vbj", "poll.vbj", *near[:-1], "2").returncode == 1


@pytest.mark.parametrize(
    ("other", "sentence"),
    [
        ("slow", "a.vbj and slow.vbj were recorded on different boards: chips.x.clock = '8 MHz' in"
                 " one and '6 MHz' in the other"),
        ("open", "open.vbj: it was not closed (its end is missing)"),
        ("cut", "cut.vbj: it was not closed (cut in the block at byte "),
        ("damaged", "damaged.vbj: the block at byte "),
        ("text", "text.vbj is no journal of version 1"),
        ("none", "none.vbj: cannot be read: No such file or directory"),
    ],
)  # fmt: skip
def test_what_cannot_be_compared_ends_with_2_and_says_why(
    folder: Path, other: str, sentence: str
) -> None:
    done = vbus("diff", "a.vbj", f"{other}.vbj")
    assert (done.returncode, done.stdout) == (2, "")
    assert done.stderr.startswith(f"vbus: {sentence}")
