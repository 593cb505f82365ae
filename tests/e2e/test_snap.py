"""``vbus snap`` and ``vbus run --from``: a running board as a file, and back."""

import json
from pathlib import Path
from time import monotonic

import pytest

from tests.e2e.command import running, vbus
from vbus import connect
from vbus.board import snapshot
from vbus.board.build import load_board_text
from vbus.core import exit_codes
from vbus.core.kernel import END, MS, SECOND
from vbus.serve.time.pacer import DAY

BOARD = """\
[board]
name = "bench"
time = "{time}"
power_on = "done"
[chips.x]
part = "LM629N-8"
clock = "8 MHz"
plant = "none"
[[hosts]]
transport = "unix:$VBUS_RUNTIME/x"
"""
RDSIGS = 0x0C


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv("VBUS_RUNTIME", str(tmp_path / "run"))
    for time in ("lockstep", "realtime"):
        (tmp_path / f"{time}.toml").write_text(BOARD.format(time=time))
    return tmp_path


def test_a_snapshot_brings_a_running_board_back_with_its_host_attached(folder: Path) -> None:
    snap = folder / "a.snap"
    with running(folder / "lockstep.toml"), connect(f"unix:{folder}/run/x") as bus:
        bus.write(0, RDSIGS)
        bus.wait("1ms")
        bus.read(1)
        before = bus.now()
        done = vbus("snap", "save", "bench", snap)
        assert done.stdout.startswith(f"{snap}: bench at 0.0000")
        low = bus.read(1)
        bus.delay("1s")
        assert bus.read(0) == 0x84

        done = vbus("snap", "load", "bench", snap)
        assert (done.returncode, done.stderr) == (0, "")
        assert bus.now() == before
        assert bus.read(1) == low


def test_a_run_goes_on_from_a_snapshot(folder: Path) -> None:
    snap = folder / "a.snap"
    with running(folder / "lockstep.toml"), connect(f"unix:{folder}/run/x") as bus:
        bus.delay("3s")
        bus.now()
        vbus("snap", "save", "bench", snap)
    going_on = running(folder / "lockstep.toml", "--from", snap)
    with going_on, connect(f"unix:{folder}/run/x") as bus:
        assert bus.now() == 3 * 10**12

    told = json.loads(vbus("snap", "info", "--json", snap).stdout)
    assert (told["board"], told["when_ps"]) == ("bench", 3 * 10**12)
    assert told["chips"] == {"x": "LM629N-8"}
    assert told["hosts"] == ["host0 to x"]
    text = vbus("snap", "info", "--board-file", snap).stdout
    assert text == BOARD.format(time="lockstep")
    assert "chip x: LM629N-8" in vbus("snap", "info", snap).stdout


def test_in_real_time_the_clock_goes_on_from_the_snapshot(folder: Path) -> None:
    snap = folder / "a.snap"
    with running(folder / "realtime.toml"), connect(f"unix:{folder}/run/x") as bus:
        vbus("snap", "save", "bench", snap)
        when = json.loads(vbus("snap", "info", "--json", snap).stdout)["when_ps"]
        bus.delay("0.5s")
        assert bus.now() >= when + 10**12 // 2
        begun = monotonic()
        vbus("snap", "load", "bench", snap)
        assert when <= bus.now() < when + int((monotonic() - begun + 0.25) * 1e12)
        bus.delay("10ms")
        assert bus.read(0) == 0x84


def test_what_cannot_be_loaded_is_refused_with_the_reason(folder: Path) -> None:
    snap = folder / "a.snap"
    with running(folder / "lockstep.toml"):
        vbus("snap", "save", "bench", snap)
    cut = folder / "cut.snap"
    cut.write_bytes(snap.read_bytes()[:-5])

    with running(folder / "realtime.toml"):
        done = vbus("snap", "load", "bench", snap)
        assert done.returncode == 1
        assert "another version of the board file" in done.stderr
        done = vbus("snap", "load", "bench", cut)
        assert f"{cut}: cut short or damaged" in done.stderr
        done = vbus("snap", "load", "bench", folder / "none.snap")
        assert "cannot be read: No such file" in done.stderr
    with running(folder / "lockstep.toml", "--journal", folder / "run.vbj"):
        done = vbus("snap", "load", "bench", snap)
        assert "writes a journal" in done.stderr
    done = vbus("snap", "save", "bench", snap)
    assert 'no board called "bench" takes orders' in done.stderr
    done = vbus("run", folder / "lockstep.toml", "--from", snap, "--journal", folder / "j.vbj")
    assert "a journal begins at power-on" in done.stderr


def test_in_real_time_a_board_ends_in_order_where_time_does(folder: Path) -> None:
    text = (folder / "realtime.toml").read_text()
    board = load_board_text(text, str(folder / "realtime.toml"))
    board.run_until(END - 10 * MS)
    snap = folder / "late.snap"
    snap.write_bytes(snapshot.write(snapshot.take(board)))

    done = vbus("run", folder / "realtime.toml", "--from", snap)

    assert done.returncode == exit_codes.TIME_ENDED == 7
    told, ended = done.stderr.splitlines()
    assert "106 days after power-on; less than a day is left" in told
    assert ended == f"vbus: board bench has ended: chip time ends at {END} ps, and it is there"
    assert not (folder / "run" / "x").exists()


def test_a_board_on_its_last_day_is_listed_as_such(folder: Path) -> None:
    with running(folder / "lockstep.toml"), connect(f"unix:{folder}/run/x") as bus:
        bus.delay(END - DAY)
        assert "ends in" not in vbus("ls").stdout
        bus.delay(DAY - 90 * SECOND)
        assert "  chip time ends in 90.000 s\n" in vbus("ls").stdout
        (listed,) = json.loads(vbus("ls", "--json").stdout)
        assert listed["time_left_ps"] == 90 * SECOND


def test_the_call_at_which_something_began_as_json(folder: Path) -> None:
    journal, snap = folder / "run.vbj", folder / "before.snap"
    with (
        running(folder / "lockstep.toml", "--journal", journal),
        connect(f"unix:{folder}/run/x") as bus,
    ):
        bus.write(0, RDSIGS)
        bus.write(0, RDSIGS)  # busy
        bus.now()
    found = vbus("snap", "bisect", journal, "lm628.busy-write", "--save", snap, "--json")
    never = vbus("snap", "bisect", journal, "lm628.T14", "--json")

    told = json.loads(found.stdout)
    plain = vbus("snap", "bisect", journal, "lm628.busy-write").stdout
    assert f"{told['text']}\n" == plain
    assert told["text"].startswith(f"{told['entry']}: ")
    assert (told["snapshot"], told["bytes"]) == (str(snap), snap.stat().st_size)
    assert never.returncode == exit_codes.FAILURE
    assert json.loads(never.stdout)["entry"] is None
