"""``vbus conform`` as its users meet it: captures as files, options, exit codes, messages."""

import json
from pathlib import Path

import pytest

from tests.e2e.command import vbus
from tests.unit.views.captures import Shot

CLOCK = ("--clock", "8 MHz")


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Captures: a good one in each spelling, and a spoiled one."""
    folder = tmp_path_factory.mktemp("captures")
    shot = Shot("lm628")
    (folder / "good.vcd").write_text(shot.text())
    (folder / "good.csv").write_text(shot.table())
    numbered = shot.table().splitlines()
    numbered[0] = ",".join(["Time [s]", *(f"CH{n}" for n in range(len(shot.channels)))])
    (folder / "numbered.csv").write_text("\n".join(numbered))
    pins = {f"D{n}": f"CH{shot.wiring.data[n]}" for n in range(8)}
    pins |= {name: f"CH{shot.bit(name)}" for name in ("/CS", "/PS", "/RD", "/WR")}
    (folder / "map.toml").write_text(
        "[channels]\n" + "".join(f'"{pin}" = "{channel}"\n' for pin, channel in pins.items())
    )
    (folder / "map.txt").write_text(",".join(f"{pin}={channel}" for pin, channel in pins.items()))
    begin, end = shot.pulses("/RD")[-1]
    shot.change(begin, end, flip=1 << shot.wiring.data[5])
    (folder / "bad.vcd").write_text(shot.text())
    return folder


@pytest.mark.slow
def test_a_good_capture_and_a_bad_one(folder: Path) -> None:
    done = vbus("conform", "LM629N-8", folder / "good.vcd", *CLOCK)
    assert (done.returncode, done.stderr) == (0, "")
    first, second = done.stdout.splitlines()
    assert first.endswith("good.vcd: compared from the RESET command at 2us; 1 cycles before that"
                          " are not compared (--from)")  # fmt: skip
    assert second.startswith("no difference in ")

    done = vbus("conform", "lm629n-8", folder / "bad.vcd", *CLOCK)
    assert done.returncode == 1
    lines = done.stdout.splitlines()
    assert lines[1].startswith("first difference at ")
    assert lines[1].endswith(" bus cycles that match: read at address 0H  [LM-CMD-23]")
    assert lines[2] == "  silicon: 20H in RDSTAT 20H POSITION_ERROR"
    assert lines[3] == "  model:   00H in RDSTAT 00H -"
    assert next(line for line in lines if line.startswith("  >   ")).endswith(
        " x r 0 20  <- the model gives 00"
    )

    told = json.loads(vbus("conform", "LM629N-8", folder / "bad.vcd", *CLOCK, "--json").stdout)
    assert told["conforms"] is False
    assert told["mismatch"]["clause"] == "LM-CMD-23"
    done = vbus("conform", "LM629N-8", folder / "bad.vcd", *CLOCK, "--ignore", "0:20")
    assert (done.returncode, "1 differences ignored" in done.stdout) == (0, True)


@pytest.mark.slow
def test_channels_may_be_mapped_by_name_in_a_file_or_on_the_line(folder: Path) -> None:
    for wanted in (folder / "map.toml", (folder / "map.txt").read_text()):
        done = vbus("conform", "LM629N-8", folder / "numbered.csv", *CLOCK, "--map", wanted)
        assert (done.returncode, done.stderr) == (0, "")
    done = vbus("conform", "LM629N-8", folder / "numbered.csv", *CLOCK)
    assert done.returncode == 6
    assert "the capture has no channel for D0" in done.stderr
    assert "--map PIN=CHANNEL" in done.stderr


@pytest.mark.slow
def test_the_model_may_be_described_by_options_or_by_a_board_file(folder: Path) -> None:
    board = folder / "board.toml"
    board.write_text(
        '[board]\nname = "two"\npower_on = "done"\n[chips.a]\npart = "MC1241A"\nclock = "25 MHz"\n'
        'plants = ["none"]\n[chips.x]\npart = "LM629N-8"\nclock = "8 MHz"\nplant = "none"\n'
    )
    done = vbus("conform", "x", folder / "good.csv", "--board", board)
    assert (done.returncode, done.stderr) == (0, "")
    done = vbus("conform", "y", folder / "good.csv", "--board", board)
    assert (done.returncode, done.stderr) == (
        1, 'vbus: "y" is not one chip of the board; it has a (MC1241A), x (LM629N-8)\n',
    )  # fmt: skip
    slow = ("--option", "reset_time=1.2 ms")
    done = vbus("conform", "LM629N-8", folder / "good.csv", *CLOCK, *slow)
    assert done.returncode == 1
    assert "bus cycles that match: HI" in done.stdout
    with_motor = ("--plant", "dc_motor,supply=24 V", "--violations")
    done = vbus("conform", "LM629N-8", folder / "good.csv", *CLOCK, *with_motor)
    assert done.stdout.splitlines()[-1].endswith("violations by the host") or done.returncode == 1


@pytest.mark.parametrize(
    ("arguments", "code", "message"),
    [
        (("LM629N-8", "none.vcd", *CLOCK), 6, "none.vcd: cannot be read: No such file"),
        (("LM629N-8", "good.txt", *CLOCK), 6, "cannot be read: No such file"),
        (("LM629N-8", "good.vcd"), 2, "say at which clock the chip runs"),
        (("LM629N-8", "good.vcd", "--clock", "fast"), 2, "--clock: "),
        (("LM629", "good.vcd", *CLOCK), 2, 'CHIP: found "LM629"'),
        (("ZX81", "good.vcd", *CLOCK), 2, "ZX81"),
        (("LM629N-8", "good.vcd", *CLOCK, "--from", "soon"), 2, "'soon' is no duration"),
        (("LM629N-8", "good.vcd", *CLOCK, "--from", "9s"), 6, "never idle from there on"),
        (("LM629N-8", "good.vcd", *CLOCK, "--map", "D0"), 1, "D0: cannot be read"),
        (("LM629N-8", "good.vcd", *CLOCK, "--map", "D0="), 2, "write PIN=CHANNEL"),
        (("LM629N-8", "good.vcd", *CLOCK, "--ignore", "0:zz"), 2, "ADDRESS:MASK in hexadecimal"),
        (("LM629N-8", "good.vcd", *CLOCK, "--option", "speed"), 2, "write KEY=VALUE"),
        (("LM629N-8", "good.vcd", *CLOCK, "--option", "sped=1"), 2, "--option sped: "),
        (("LM629N-8", "good.csv", *CLOCK, "--samplerate", "fast"), 2, "is no frequency"),
    ],
)
def test_what_cannot_be_compared_is_said_in_a_sentence(
    folder: Path, arguments: tuple[str, ...], code: int, message: str
) -> None:
    part, capture, *rest = arguments
    done = vbus("conform", part, folder / capture, *rest)
    assert (done.returncode, done.stdout) == (code, "")
    assert message in done.stderr
