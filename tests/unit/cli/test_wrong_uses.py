"""What a newcomer types wrong, and the sentence that says what was wrong, where, and what to do."""

from pathlib import Path

import pytest

from tests.boards import BENCH
from vbus.board.build import load_board_text
from vbus.cli.cli import main
from vbus.core import exit_codes
from vbus.record.journal import Journal


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("VBUS_RUNTIME", str(tmp_path / "run"))
    boards = tmp_path / "run" / "boards"
    boards.mkdir(parents=True, mode=0o700)
    (tmp_path / "bench.toml").write_text(BENCH)
    (tmp_path / "dir").mkdir()
    board = load_board_text(BENCH, "bench.toml")
    with (tmp_path / "run.vbj").open("wb", buffering=0) as file:
        Journal(board, file, BENCH, "bench.toml").close()
    later = (tmp_path / "run.vbj").read_bytes().replace(b"journal 1", b"journal 2", 1)
    (tmp_path / "later.vbj").write_bytes(later)
    (tmp_path / "f.py").write_text("def move(bus): ...\n")
    for name, more in BOARDS.items():
        (tmp_path / f"{name}.toml").write_text(f"{BENCH}\n{more}\n")
    return tmp_path


BOARDS = {
    "port": '[[hosts]]\ntransport = "tcp:70000"',
    "wave": '[waves.a]\nfile = "x.fst"',
    "unit": '[chips.n]\npart = "LM629N-8"\nplant = "none"\nclock = 8 MHz',
    "when": '[[faults]]\nfault = "jam"\nwhen = "5 ms"',
    "report": '[record]\nreport = "x.pdf"',
    "serial": '[[hosts]]\ntransport = "serial:/dev/nothing"',
}
"""What newcomers add to a board file."""


@pytest.mark.parametrize(
    ("words", "code", "said"),
    [
        ("run bench.toml --journal dir", 1, "dir: cannot be written: Is a directory; name a file"),
        ("run bench.toml --journal no/x.vbj", 1, "there is no folder no: make it first"),
        ("wave run.vbj -o dir", 1, "name a file in it, such as dir/FILE"),
        ("wave rum.vbj -o x.vcd", 4, "there is no file rum.vbj, and no board called"),
        ("scope rum.vbj", 4, "there is no file rum.vbj, and no board called"),
        ("monitor bench.toml", 4, "can be watched; bench.toml is a file;"),
        ("monitor bench", 4, 'no board called "bench" can be watched; "vbus ls" shows'),
        ("stop bench", 4, 'no board called "bench" runs; "vbus ls" shows which run'),
        ("logs bench", 4, "without it a board tells its own terminal"),
        ("wait bench --timeout 0", 4, '"vbus logs" shows what one in the background says'),
        ("exec --join bench -- true", 4, 'runs on this machine; "vbus ls" shows which run'),
        (
            "explain rum.vbj:3",
            2,
            "rum.vbj: cannot be read: No such file or directory; did you mean",
        ),
        ("explain lm692 00", 2, '"lm692" is no chip; did you mean "lm628"? bytes and words'),
        ("explain lm692", 2, 'did you mean "lm628"?'),
        ("plot run.vbj -o x.svg", 1, "nothing to draw: no chip time passed in this run"),
        ("coverage run.vbj --covers GO", 1, '"vbus coverage --all" lists all there is'),
        ("fmu bench.toml -o x.zip", 2, "-o x.zip: a unit's name ends in .fmu"),
        ("fmu none.toml -o x.fmu", 3, "none.toml: cannot be read: No such file or directory"),
        ("attach tcp:127.0.0.1:1", 4, "no process listens there; is the board running?"),
        ("--journal x.vbj run bench.toml", 2, "stands behind its name: vbus COMMAND --journal"),
        ("run bench.toml --time lockstep", 2, '"time" is a key of [board] in the board file'),
        ("run bench.toml --transport tcp:1", 2, '"transport" is a key of [[hosts]] in the board'),
        ("run bench.toml --metrics 9100", 2, "write HOST:PORT with a port of 0 to 65535, such"),
        ("run bench.toml --scope 127.0.0.1:70000", 2, "write HOST:PORT with a port of 0 to 65535"),
        ("run bench.toml --report x.pdf", 2, "a report's name ends in .txt, .json, .xml, .sarif"),
        ("run bench.toml --coverage x.pdf", 2, "a coverage file's name ends in one of .txt,"),
        ("run bench.toml --wave x.fst", 2, "x.fst: a waveform is a VCD file; its name ends in"),
        ("wave run.vbj -o x.fst", 2, "x.fst: a waveform is a VCD file; its name ends in .vcd"),
        ("scope a b --sigrok 127.0.0.1:0", 2, "--sigrok is for one board, and these are 2"),
        ("scope run.vbj run.vbj --control", 2, "--control is for one board, and these are 2"),
        ("scope run.vbj -o x.pdf", 2, "a page ends in .html, Foxglove's file in .mcap"),
        ("campaign --board bench.toml --host no.py:f", 2, "no file no.py; write FILE.py:FUNCTION"),
        ("campaign --board bench.toml --host f.py:mov", 2, 'did you mean "move"? it has move'),
        ("fault jam", 2, 'there is no command "jam"; did you mean "arm"? there are arm, clear,'),
        ("snap bench", 2, 'there is no command "bench"; there are bisect, info, load, save'),
        ("conform bench.toml x.csv", 5, 'unknown part "BENCH.TOML"; known are LM628N-6,'),
        ("explain LFIL", 2, 'a command is told by its bytes: "vbus explain CHIP BYTE..."'),
        ("replay later.vbj", 1, "is a journal of version 2, and this vbus reads version 1: use"),
        ("check port.toml", 3, '"tcp:70000": write "tcp:PORT" or "tcp:HOST:PORT" with a port of'),
        ("check wave.toml", 3, "waves.a.file: x.fst: a waveform is a VCD file"),
        ("check unit.toml", 3, 'a text stands in quotes: clock = "8 MHz"'),
        ("check when.toml", 3, 'faults[1].when: an instant is written "at 5 ms"'),
        ("run report.toml", 3, "report.toml: record.report: x.pdf: a report's name ends in .txt,"),
        ("run serial.toml", 4, "plug the device in, or write the name that it has in /dev"),
    ],
)
def test_a_wrong_use_is_answered(
    folder: Path, capsys: pytest.CaptureFixture[str], words: str, code: int, said: str
) -> None:
    with pytest.raises(SystemExit) as ended:
        main(words.split())
    assert said in capsys.readouterr().err
    assert ended.value.code == code


@pytest.mark.parametrize(
    ("words", "said"),
    [
        ("run bench.toml --metrics 0.0.0.0:0", "lets other computers in; write"),
        ("run bench.toml --durable machine", "durable is what a journal survives"),
        ("run bench.toml --rate 2", "a rate makes sense in real time only"),
        ("run bench.toml --rate x", '"x" is no rate; write a number from 0.001 up'),
        ("run bench.toml --cpu 4000", "--cpu 4000: this process may run on processors"),
        ("run bench.toml --scope foo", '--scope: found "foo"; write HOST:PORT'),
        ("run bench.toml --node x", "--node is for boards with nodes; bench.toml has none"),
        ("run bench.toml --listen foo", '"foo" is no endpoint; write "tcp/HOST:PORT"'),
        ("exec --board bench.toml --report x.foo -- true", "x.foo: a report's name ends in"),
        ("exec --board bench.toml --metrics foo -- true", 'found "foo"; write HOST:PORT with'),
        ("exec --board bench.toml --pinmap q -- true", "there is no [pinmaps.q]"),
        ("exec --link foo -- true", "--link: 'foo' is no link; allowed are pty:PATH"),
        ("scope run.vbj --listen foo", '--listen: found "foo"; write HOST:PORT'),
        ("scope run.vbj --key x", "--certificate and --key belong together"),
        ("report run.vbj --compatibility foo", 'no chip of this run stands in for the part "foo"'),
        ("wave run.vbj -o x.vcd --before 1ms", "--before counts from a trigger; give one with"),
        ("router --listen foo", '"foo" is no endpoint; write "tcp/HOST:PORT"'),
        ("up bench.toml --router foo", '"foo" is no endpoint; write "tcp/HOST:PORT"'),
        ("run bench.toml --journal x.vbj --from x.vbs", "a journal begins at power-on"),
    ],
)
def test_an_option_that_makes_no_sense_ends_with_the_code_of_a_wrong_command_line(
    folder: Path, capsys: pytest.CaptureFixture[str], words: str, said: str
) -> None:
    """By itself, beside others, or for this board."""
    with pytest.raises(SystemExit) as ended:
        main(words.split())
    assert said in capsys.readouterr().err
    assert ended.value.code == exit_codes.USAGE


def test_a_name_that_is_nearly_that_of_a_board_is_guessed(
    folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (folder / "run" / "boards" / "bench.sock").touch()
    with pytest.raises(SystemExit):
        main(["monitor", "bnech"])
    assert 'did you mean "bench"?' in capsys.readouterr().err
