"""``vbus demo``: a board, a terminal line, a host in another process, and an honest verdict."""

import json
import os
import pty
import re
import signal
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import click
import pytest

from tests.e2e.command import start, vbus
from vbus.chips.lm628 import demo as lm629
from vbus.cli.run import demo
from vbus.client.demo import demos

pytestmark = pytest.mark.slow

SLOW = "more moves than this machine can follow"


def mistakes(told: str) -> str:
    """Return what is told but that the machine is too slow now, which says nothing of a demo."""
    return "".join(line for line in told.splitlines(keepends=True) if SLOW not in line)


@pytest.mark.parametrize("name", demos())
def test_a_demo_moves_its_motors_from_another_process_and_says_so(name: str, runtime: Path) -> None:
    done = vbus("demo", name, "--headless")
    assert (done.returncode, mistakes(done.stderr)) == (0, "")
    first, link, *said, numbers, last = done.stdout.splitlines()
    board, host = re.findall(r"process (\d+)", first)
    assert board != host
    assert re.fullmatch(rf"link pty:{runtime}/demo-{name}-\d+", link)
    assert sum(line.startswith("  ok") for line in said) >= 5
    assert not any(line.startswith("  NOT") for line in said)
    assert re.match(r"\d{3,} bus cycles in \d+\.\d\d s of chip time, .* 0 violations", numbers)
    assert last == "ok: every move ended where it should"
    assert [path.name for path in runtime.iterdir()] == ["boards"]


def test_a_demo_gives_its_summary_as_json() -> None:
    done = vbus("demo", "--json")
    assert done.returncode == 0
    told = json.loads(done.stdout)
    assert told["demo"] == "lm629"
    assert told["ok"] is True
    assert told["reasons"] == []
    assert told["board_process"] != told["host_process"]
    moves = [result for result in told["results"] if result["what"] == "real position"]
    assert [move["expected"] for move in moves] == [10_000, -4000, 0]
    assert all(abs(move["found"] - move["expected"]) <= 2 for move in moves)
    assert told["encoders"] == pytest.approx([0], abs=2)


def test_a_demo_on_a_terminal_shows_what_happens_while_it_happens() -> None:
    master, slave = pty.openpty()
    environment = {**os.environ, "TERM": "xterm", "LINES": "24", "COLUMNS": "80"}
    command = [sys.executable, "-m", "vbus", "demo"]
    process = subprocess.Popen(command, stdin=slave, stdout=slave, stderr=slave, env=environment)
    os.close(slave)
    seen = b""
    while True:
        try:
            data = os.read(master, 65536)
        except OSError:
            break
        seen += data
    os.close(master)
    assert process.wait(timeout=60) == 0
    text = re.sub(r"\x1b\[[\d;?]*[A-Za-z]", "", seen.decode())
    assert len(re.findall(r"chip time \d+\.\d\d s", text)) > 10
    for shown in ("real position (counts)", "motor output (%)", "STT"):
        assert shown in text
    assert "\x1b[1m●BREAKPOINT" in seen.decode()
    assert text.rstrip().endswith("ok: every move ended where it should")


def test_a_motor_that_cannot_get_there_fails_the_demo_with_the_reason(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    board = lm629.DEMO.board + "stop_low = -9000\nstop_high = 3000\n"
    monkeypatch.setattr(lm629, "DEMO", replace(lm629.DEMO, board=board))
    assert demo.command.main(["lm629", "--headless"], standalone_mode=False) == 1
    out, err = capsys.readouterr()
    assert out.splitlines()[-1] == "FAILED"
    assert re.match(
        r"vbus: demo lm629: move 5 turns forward, 6 turns/s at most:"
        r" NOT real position 3000 \(expected 10000 ±2\) after ",
        mistakes(err),
    )


def test_a_host_that_gives_up_fails_the_demo_with_its_words(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    board = lm629.DEMO.board.replace("[plants", "reset_fail = 3\n[plants")
    monkeypatch.setattr(lm629, "DEMO", replace(lm629.DEMO, board=board))
    assert demo.command.main(["lm629", "--headless"], standalone_mode=False) == 1
    assert mistakes(capsys.readouterr().err) == (
        "vbus: demo lm629: the host gave up: status 00h for 10ms; after a reset it is 84h or"
        " C4h: a chip that was in use needs reset() first\n"
    )


def test_a_host_that_never_ends_is_given_up(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(demo, "LONGEST", 0.5)
    assert demo.command.main(["--headless"], standalone_mode=False) == 1
    told = mistakes(capsys.readouterr().err)
    assert told == "vbus: demo lm629: the host has not finished within 0.5 s\n"


def test_ctrl_c_ends_a_demo_and_its_host(runtime: Path) -> None:
    process = start("demo", "--headless")
    while not list(runtime.glob("demo-*")):
        os.sched_yield()
    process.send_signal(signal.SIGINT)
    out, err = process.communicate(timeout=60)
    assert (process.returncode, out) == (130, "")
    assert "Traceback" not in err
    assert [path.name for path in runtime.iterdir()] == ["boards"]


def test_an_unknown_demo_is_answered_with_the_known_ones() -> None:
    with pytest.raises(click.BadParameter) as caught:
        demo.command.main(["lm692"], standalone_mode=False)
    assert caught.value.message == (
        f'there is no demo "lm692"; did you mean "lm629"? there are {", ".join(demos())}'
    )
