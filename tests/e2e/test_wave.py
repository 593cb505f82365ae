"""``vbus wave`` and waveforms of served boards."""

import json
import signal
import threading
import time
from pathlib import Path

import pytest

from tests.e2e.command import running, start, vbus
from vbus import connect

BOARD = """\
[board]
name = "bench"
time = "lockstep"
power_on = "done"
[chips.x]
part = "LM629N-8"
clock = "8 MHz"
plant = "none"
[[hosts]]
transport = "unix:$VBUS_RUNTIME/x"
[record]
journal = "{folder}/run.vbj"
[waves.late]
file = "{folder}/late.vcd"
trigger = "violation"
duration = "1 us"
profile = "sigrok"
"""


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
    done = vbus("wave", folder / "run.vbj", "-o", "/dev/full")
    assert done.returncode == 1
    assert "No space left on device" in done.stderr


@pytest.mark.slow
def test_a_waveform_of_a_running_board(folder: Path) -> None:
    with running(folder / "bench.toml"):
        process = start("wave", "bench", "-o", "-", "--trigger", "x./WR falls", "--duration", "3us")
        for _ in range(1000):
            if process.poll() is not None:
                break
            drive(folder)
            time.sleep(0.02)
        out, err = process.communicate(timeout=30)
        assert (process.returncode, err) == (0, "")
        assert " /WR $end" in out
        assert out.count("\n#") >= 3
        # One that is given up half way leaves the board as it was.
        process = start("wave", "bench", "-o", folder / "b.vcd")
        assert process.stdout is not None
        timer = threading.Timer(1.0, lambda: process.send_signal(signal.SIGINT))
        timer.start()
        drive(folder)
        process.communicate(timeout=30)
        assert process.returncode == 0
        done = vbus("wave", "bench", "-o", folder / "c.vcd", "--trigger", "now")
        assert done.returncode == 1
        assert 'vbus: trigger "now": write one of: violation;' in done.stderr
        (status,) = json.loads(vbus("ls", "--json").stdout)
        assert status["board"] == "bench"


@pytest.mark.slow
def test_a_full_disk_ends_the_waveform_and_not_the_board(folder: Path) -> None:
    with running(folder / "bench.toml", "--wave", "/dev/full") as (process, _):
        drive(folder)
        drive(folder)
        assert process.poll() is None
        process.send_signal(signal.SIGINT)
        _, err = process.communicate(timeout=60)
    assert "vbus: the waveform ends after 0 changes: No space left on device" in err
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
