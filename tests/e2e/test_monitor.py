"""``vbus monitor`` beside a running board, and what it leaves behind."""

import io
import json
import signal
import subprocess
from pathlib import Path

import pytest
from rich.console import Console

from tests.boards import BENCH
from tests.e2e.command import running, start, vbus
from vbus import connect
from vbus.cli.look.monitor import View, screen
from vbus.client.bus import Bus


@pytest.fixture
def board(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv("VBUS_RUNTIME", str(tmp_path / "run"))
    path = tmp_path / "bench.toml"
    path.write_text(BENCH)
    return path


def watch(*options: str) -> subprocess.Popen[str]:
    process = start("monitor", "bench", *options)
    assert process.stdout is not None
    assert process.stdout.readline() == "watching bench\n"
    return process


def careless(folder: Path) -> None:
    with connect(f"unix:{folder}/run/x") as bus:
        chip = bus.chip("x")
        chip.read(0)
        chip.write(0, 0x1D)
        chip.write(0, 0x1D)  # busy: ignored
        bus.delay("1ms")
        chip.writes(1, bytes((0x00, 0x3B)))
        bus.delay("1ms")
        chip.write(0, 0x3F)
        bus.now()


@pytest.mark.slow
def test_packets_and_violations_are_shown_as_they_happen(board: Path, tmp_path: Path) -> None:
    with running(board):
        process = watch("--count", "3")
        careless(tmp_path)
        out, err = process.communicate(timeout=60)
        assert (process.returncode, err) == (0, "")
    texts = [line.split(" ", 1)[1] for line in out.splitlines()]
    assert texts == [
        "x ! lm628.busy-write: command 1DH written while busy",
        "x write of 1DH at address 0H not taken: lm628.busy-write",
        "x RSTI resets BREAKPOINT TRAJECTORY_COMPLETE  [LM-CMD-18]",
        "x undefined command 3FH  [LM-BUS-13]",
    ]


@pytest.mark.slow
def test_they_are_shown_as_json(board: Path, tmp_path: Path) -> None:
    with running(board):
        process = start("monitor", "bench", "--count", "2", "--json")
        assert process.stdout is not None
        assert json.loads(process.stdout.readline()) == {"board": "bench"}
        careless(tmp_path)
        out, err = process.communicate(timeout=60)
        assert (process.returncode, err) == (0, "")
    violation, ignored, packet = map(json.loads, out.splitlines())
    assert (violation["chip"], violation["rule"]) == ("x", "lm628.busy-write")
    assert ignored["bytes"] == [0x1D]
    assert (packet["kind"], packet["bytes"]) == ("packet", [0x1D, 0x00, 0x3B])
    assert packet["text"] == "RSTI resets BREAKPOINT TRAJECTORY_COMPLETE"
    assert packet["when_ps"] > violation["when_ps"] > 0


@pytest.mark.slow
def test_a_watcher_that_leaves_or_hangs_does_not_disturb_the_board(
    board: Path, tmp_path: Path
) -> None:
    with running(board):
        first = watch("--status")
        hangs = watch()
        first.kill()
        first.communicate()
        hangs.send_signal(signal.SIGSTOP)
        with connect(f"unix:{tmp_path}/run/x") as bus:
            for _ in range(300):  # more than its socket and the server keep for it
                bus.chip("x").reads(0, 250)
        assert vbus("ls", "bench").returncode == 0
        hangs.kill()
        hangs.communicate()


@pytest.mark.slow
def test_a_monitor_ends_with_its_board(board: Path, tmp_path: Path) -> None:
    with running(board):
        process = watch()
    assert process.communicate(timeout=60)[1] == ""
    assert process.returncode == 0
    assert not list((tmp_path / "run" / "boards").glob("*.sock"))


@pytest.mark.slow
def test_a_monitor_ends_when_a_condition_holds(board: Path, tmp_path: Path) -> None:
    with running(board):
        process = watch("--until", "x.command == RSTI and not x.status.BREAKPOINT")
        careless(tmp_path)
        out, err = process.communicate(timeout=60)
        assert (process.returncode, err) == (0, "")
        packet, met = (line for line in out.splitlines() if "RSTI" in line)
        assert "x RSTI resets BREAKPOINT" in packet
        assert met == f"x.command == RSTI and not x.status.BREAKPOINT: at {packet.split(' x ')[0]}"
        done = vbus("monitor", "bench", "--until", "x.reel > 3")
        assert done.returncode == 1
        assert done.stderr.startswith('vbus: condition "x.reel > 3": no "x.reel" at character 1; ')
        process = watch("--until", "x.real > 1000")
    _, err = process.communicate(timeout=60)
    assert (process.returncode, err) == (
        1,
        'vbus: the condition "x.real > 1000" has not come to hold\n',
    )


def test_a_board_that_does_not_run_is_named(board: Path) -> None:
    done = vbus("monitor", "nobody")
    assert done.returncode == 4
    assert done.stderr.startswith('vbus: no board called "nobody" can be watched; "vbus ls"')


def test_the_screen_has_packets_axes_violations_and_what_was_too_fast() -> None:
    view = View({"chips": [{"name": "x", "family": "lm628", "bus_settings": {}}]}, status=False)
    for item in (
        ["c", 10, "h", "x", False, 0, 0x84],
        ["c", 20, "h", "x", True, 0, 0x02],
        ["c", 30, "h", "x", True, 0, 0x02],
        ["v", 30, "x", "lm628.T9", "LM-TIM-9", "error", 1, 2, "too short"],
        ["t", 2_000_000, {"x": {"real": 12, "output": 0.40039, "status": 0x84}}],
        ["lost", 7],
    ):
        view.take(item)  # type: ignore[arg-type]
    console = Console(width=100, record=True, file=io.StringIO())
    console.print(screen({"board": "bench"}, view))
    text = console.export_text()
    assert "x DFH  [LM-CMD-3]  x2" in text
    shown = [" ".join(line.strip("│ ").split()) for line in text.splitlines()]
    assert "real 12 counts output 40.04 %" in shown
    assert (
        "status 84H ●MOTOR_OFF ○BREAKPOINT ○POSITION_ERROR ○WRAPAROUND ○INDEX ●TRAJECTORY_COMPLETE"
        in shown
    )
    assert "lm628.T9 x1" in text
    assert "2us   3 bus cycles, 2 packets, 1 polls not shown, 7 cycles too fast" in text


@pytest.mark.slow
def test_a_host_that_moves_the_strobes_is_shown_like_any_other(board: Path, tmp_path: Path) -> None:
    def write(bus: Bus, port: int, byte: int) -> None:
        bus.lines({"x./PS": port, "x./CS": 0})
        bus.drive(byte)
        bus.delay("200ns")
        bus.lines({"x./WR": 0})
        bus.delay("200ns")
        bus.lines({"x./WR": 1})
        bus.delay("200ns")
        bus.release()
        bus.delay("1ms")

    board.write_text(BENCH + f'[record]\njournal = "{tmp_path}/s.vbj"\n')
    with running(board):
        process = watch("--count", "2")
        with connect(f"unix:{tmp_path}/run/x") as bus:
            for port, byte in ((0, 0x1D), (1, 0x00), (1, 0x3B), (0, 0x3F)):
                write(bus, port, byte)
            bus.now()
        out, err = process.communicate(timeout=60)
    assert (process.returncode, err) == (0, "")
    assert [line.partition(" ")[2] for line in out.splitlines()] == [
        "x RSTI resets BREAKPOINT TRAJECTORY_COMPLETE  [LM-CMD-18]",
        "x undefined command 3FH  [LM-BUS-13]",
    ]
    explained = vbus("explain", tmp_path / "s.vbj").stdout
    assert " x RSTI resets BREAKPOINT TRAJECTORY_COMPLETE  [LM-CMD-18]" in explained
    replayed = vbus("replay", tmp_path / "s.vbj")
    assert replayed.stdout.endswith(" entries, 4 bus cycles\n")
