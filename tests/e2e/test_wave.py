"""``vbus wave`` and waveforms of served boards."""

import json
import os
import resource
import signal
import subprocess
from pathlib import Path

import pytest

from tests.boards import BENCH
from tests.e2e.command import running, start, vbus
from tests.waiting import until
from vbus import connect
from vbus.client.lm628 import Lm628

BOARD = (
    BENCH
    + """\
[record]
journal = "{folder}/run.vbj"
[waves.late]
file = "{folder}/late.vcd"
trigger = "violation"
duration = "1 us"
profile = "sigrok"
"""
)


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv("VBUS_RUNTIME", str(tmp_path / "run"))
    (tmp_path / "bench.toml").write_text(BOARD.format(folder=tmp_path))
    return tmp_path


def drive(folder: Path) -> None:
    with connect(f"unix:{folder}/run/x") as bus:
        bus.chip("x").write(0, 0x02)
        bus.chip("x").write(0, 0x02)
        bus.delay("1ms")
        bus.chip("x").write(0, 0x1D)
        bus.now()


@pytest.mark.slow
def test_waveforms_of_the_board_file_and_of_the_command_line(folder: Path) -> None:
    with running(folder / "bench.toml", "--wave", folder / "all.vcd"):
        drive(folder)
    late = (folder / "late.vcd").read_text()
    assert " x_WR $end" in late
    assert "#20000\n" in late  # the second write, 2 us
    assert "sDFH" in (folder / "all.vcd").read_text()
    assert vbus("replay", folder / "run.vbj").stdout.startswith("no difference")


@pytest.mark.slow
def test_a_waveform_of_a_journal(folder: Path) -> None:
    with running(folder / "bench.toml"):
        drive(folder)
    done = vbus("wave", folder / "run.vbj", "-o", folder / "a.vcd", "--signals", "x./WR")
    assert (done.returncode, done.stderr) == (0, "")
    assert (folder / "a.vcd").read_text().count("\n1!") == 4
    done = vbus("wave", folder / "run.vbj", "-o", "-", "--trigger", "x.HI rises")
    assert (done.returncode, done.stdout) == (1, "")
    assert done.stderr == 'vbus: the trigger "x.HI rises" has not come\n'
    done = vbus("wave", folder / "run.vbj", "-o", folder / "b.vcd", "--json")
    assert json.loads(done.stdout) == {
        "source": str(folder / "run.vbj"), "file": str(folder / "b.vcd"),
        "bytes": (folder / "b.vcd").stat().st_size,
    }  # fmt: skip
    done = vbus("wave", folder / "run.vbj", "-o", "-", "--json")
    assert (done.returncode, done.stdout) == (2, "")
    done = vbus("wave", folder / "run.vbj", "-o", "/dev/full")
    assert done.returncode == 1
    assert "No space left on device" in done.stderr
    (folder / "cut.vbj").write_bytes((folder / "run.vbj").read_bytes()[:-3])
    done = vbus("wave", folder / "cut.vbj", "-o", folder / "c.vcd")
    assert done.stderr.startswith(f"vbus: {folder / 'cut.vbj'}: ")


@pytest.mark.slow
def test_a_waveform_of_a_running_board(folder: Path) -> None:
    with running(folder / "bench.toml"):
        process = start("wave", "bench", "-o", "-", "--trigger", "x./WR falls", "--duration", "3us")
        until(lambda: process.poll() is not None or drive(folder), "the end of the recording")
        out, err = process.communicate(timeout=60)
        assert (process.returncode, err) == (0, "")
        assert " /WR $end" in out
        assert out.count("\n#") >= 3
        # One that is given up half way leaves the board as it was.
        process = start("wave", "bench", "-o", folder / "b.vcd")
        assert process.stdout is not None
        started = folder / "b.vcd"
        until(lambda: (started.exists() and started.read_text()) or drive(folder), "its beginning")
        process.send_signal(signal.SIGINT)
        process.communicate(timeout=60)
        assert process.returncode == 0
        # What is refused leaves a file that was there as it was.
        (folder / "c.vcd").write_text("mine")
        done = vbus("wave", "bench", "-o", folder / "c.vcd", "--trigger", "now")
        assert done.returncode == 1
        assert (folder / "c.vcd").read_text() == "mine"
        done = vbus("wave", folder / "run.vbj", "-o", folder / "c.vcd", "--trigger", "now")
        assert done.returncode == 1
        assert (folder / "c.vcd").read_text() == "mine"
        assert 'vbus: trigger "now": no "now" at character 1; this board has x' in done.stderr
        (status,) = json.loads(vbus("ls", "--json").stdout)
        assert status["board"] == "bench"


@pytest.mark.slow
def test_a_full_disk_ends_the_waveform_and_not_the_board(folder: Path) -> None:
    done = vbus("run", folder / "bench.toml", "--wave", "/dev/full")
    why = "/dev/full: the waveform ends after 0 changes: No space left on device"
    assert (done.returncode, done.stderr) == (1, f"vbus: {why}\n")
    with running(folder / "bench.toml", "--wave", folder / "short.vcd") as (process, _):
        size = (folder / "short.vcd").stat().st_size
        resource.prlimit(process.pid, resource.RLIMIT_FSIZE, (size, size))
        drive(folder)
        drive(folder)
        assert process.poll() is None
        process.send_signal(signal.SIGINT)
        _, err = process.communicate(timeout=60)
    assert f"vbus: {folder}/short.vcd: the waveform ends after " in err
    assert f"vbus: not all is recorded: {folder}/short.vcd: the waveform ends after " in err
    assert process.returncode == 1
    assert "Traceback" not in err


def test_a_wrong_wave_stops_the_start_or_the_command(folder: Path) -> None:
    text = (folder / "bench.toml").read_text()
    (folder / "bad.toml").write_text(text.replace('"violation"', '"x.HO rises"'))
    done = vbus("run", folder / "bad.toml")
    assert done.returncode == 1
    assert 'trigger "x.HO rises": no "x.HO"' in done.stderr
    assert vbus("wave", "nobody", "-o", folder / "d.vcd").returncode == 4
    done = vbus("wave", "nobody", "-o", "x.vcd", "--before", "soon")
    assert done.returncode == 2
    assert "'soon' is no duration" in done.stderr


def ended(process: subprocess.Popen[str], folder: Path) -> str:
    """Drive the board until a recording has ended by itself; return what it complained of."""
    until(lambda: process.poll() is not None or drive(folder), "the end of the recording")
    return process.communicate(timeout=60)[1]


@pytest.mark.slow
def test_a_live_waveform_that_cannot_be_written_says_so_at_once(folder: Path) -> None:
    with running(folder / "bench.toml"):
        process = start("wave", "bench", "-o", "/dev/full")
        assert ended(process, folder) == "vbus: /dev/full: cannot be written: No space left on" \
            " device\n"  # fmt: skip
        assert process.returncode == 1
        process = start("wave", "bench", "-o", "-")
        assert process.stdout is not None
        process.stdout.close()
        process.stdout = None
        assert "standard output: cannot be written: Broken pipe" in ended(process, folder)
        assert process.returncode == 1
        drive(folder)


@pytest.mark.slow
def test_a_live_trigger_that_has_not_come_is_told(folder: Path) -> None:
    with running(folder / "bench.toml"):
        process = start("wave", "bench", "-o", folder / "a.vcd", "--trigger", "x.HI falls")
        until((folder / "a.vcd").exists, "the board has taken the trigger")
        drive(folder)
        process.send_signal(signal.SIGINT)
        _, err = process.communicate(timeout=60)
        assert (process.returncode, err) == (1, 'vbus: the trigger "x.HI falls" has not come\n')


@pytest.mark.slow
def test_a_pipe_of_the_board_file_that_is_closed_ends_the_waveform_and_not_the_board(
    folder: Path,
) -> None:
    os.mkfifo(folder / "late.vcd")
    text = BOARD.format(folder=folder).replace('trigger = "violation"\nduration = "1 us"\n', "")
    (folder / "bench.toml").write_text(text)
    reader = os.open(folder / "late.vcd", os.O_RDONLY | os.O_NONBLOCK)
    with running(folder / "bench.toml") as (process, _):
        drive(folder)
        os.close(reader)
        drive(folder)
        drive(folder)
        assert process.poll() is None
        process.send_signal(signal.SIGINT)
        _, err = process.communicate(timeout=60)
    assert err.startswith(f"vbus: {folder}/late.vcd: the waveform ends after ")
    assert err.endswith(": Broken pipe\n")


@pytest.mark.slow
@pytest.mark.parametrize(
    ("trigger", "first", "within"),
    [
        ("violation", 2_000_000, 1_000_000),
        ("violation lm628.busy-write", 2_000_000, 1_000_000),
        ("x./WR rises", 1_000_000, 1_000_000),
        ("command RSTI", 0, 0),
        ("x.HI falls", 0, 0),
        ("x.real > 100", 0, 0),
        ("x.real < -100", -1, 0),
    ],
)
def test_every_trigger_of_the_board_file(
    folder: Path, trigger: str, first: int, within: int
) -> None:
    (folder / "bench.toml").write_text(
        MOVING.format(folder=folder, trigger=trigger, more="") + 'before = "500 ns"\n'
    )
    with running(folder / "bench.toml"), connect(f"unix:{folder}/run/x") as bus:
        bus.chip("x").write(0, 0x02)
        bus.chip("x").write(0, 0x02)
        axis = Lm628(bus)
        axis.load_filter(kp=300, kd=2000)
        axis.rsti(0)
        axis.move(300, acc=40, vel=2 << 16)
    text = (folder / "wave.vcd").read_text()
    times = [int(line[1:]) * 100 for line in text.splitlines() if line.startswith("#")]
    if first < 0:
        assert times == []
        return
    assert times[-1] - times[0] == 500_000 + 1_000_000_000
    if first:
        assert times[0] == first - 500_000


MOVING = """\
[board]
name = "bench"
time = "lockstep"
power_on = "done"
[chips.x]
part = "LM629N-8"
clock = "8 MHz"
plant = "m"
[plants.m]
model = "dc_motor"
[[hosts]]
transport = "unix:$VBUS_RUNTIME/x"
[waves.one]
file = "{folder}/wave.vcd"
trigger = "{trigger}"
duration = "1 ms"
"""
