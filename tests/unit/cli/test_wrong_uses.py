"""What a newcomer types wrong, and the sentence that says what was wrong, where, and what to do."""

from pathlib import Path

import pytest

from tests.boards import BENCH
from vbus.board.build import load_board_text
from vbus.cli.cli import main
from vbus.record.journal import Journal
from vbus.serve.in_process import connect_in_process


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
    (tmp_path / "bad.py").write_text("\nnothing\n")
    (tmp_path / "bom.toml").write_bytes(b"\xef\xbb\xbf" + BENCH.encode())
    for name, more in BOARDS.items():
        (tmp_path / f"{name}.toml").write_text(f"{BENCH}\n{more}\n")
    return tmp_path


BOARDS = {
    "accepts": '[record]\nsuppress = "no.toml"',
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
        ("run bench.toml --journal f.py", 1, "f.py: it is a file of another kind, and is not repl"),
        ("coverage run.vbj --output bench.toml", 1, "bench.toml: it looks like a board file (TOML"),
        ("run bench.toml --suppress no.toml", 2, "a report, and none is written; give its file as"),
        ("exec --board bench.toml --suppress no.toml -- true", 2, "give its file as report"),
        ("exec --join bench --no-summary -- true", 2, "--summary goes with --board"),
        ("check accepts.toml", 3, "record.suppress: suppress accepts violations in a report, and"),
        ("explain run.vbj:40-17", 2, "run.vbj:40-17: entries go from the lower number to the high"),
        ("ls --zenoh nosuch", 2, '"nosuch" is no endpoint; write "tcp/HOST:PORT"'),
        ("wave run.vbj -o x.vcd --sample 0s", 2, "it is no time at all; write one above 0"),
        ("wave run.vbj -o x.vcd --profile sigrok --sample 1ms", 2, "--sample is of the chips' val"),
        ("scope run.vbj -o x.html --control", 2, "--control is of what is served, and -o writes a"),
        ("scope run.vbj -o x.html --at 1ms", 2, "--at is of what is served, and -o writes a file"),
        ("scope run.vbj -o x.html --sigrok", 2, "--sigrok is of what is served, and -o writes a"),
        ("scope run.vbj -o x.html --key a.pem", 2, "--key is of what is served, and -o writes a"),
        ("scope run.vbj --stay 3", 2, "--stay is for boards that run, and run.vbj is a journal"),
        ("scope run.vbj --chip x", 2, "--chip goes with --sigrok"),
        ("scope bench --strobes", 2, "--strobes is for journals, and bench is none"),
        ("scope bench --sigrok --foxglove", 2, "--sigrok and --foxglove are two servers"),
        ("scope bench --sigrok --control", 2, "--control is of the page; --foxglove and --sigrok"),
        ("scope bench --sigrok --key a.pem", 2, "--key is for TLS, which --sigrok has none of"),
        ("conform x a.vcd --board bench.toml --clock 8MHz", 2, "--clock is for a chip alone; --bo"),
        ("conform lm629 a.vcd --clock 8MHz --samplerate 1MHz", 2, "a.vcd has times of its own"),
        ("fit bench.toml run.vbj --period 1ms", 2, "--period is of captures and tables, and run.v"),
        ("fit bench.toml a.vcd --period 0s", 2, "it is no time at all; write one above 0"),
        ("campaign --board bench.toml --for 0s -- true", 2, "no run ends in no time; write one su"),
        ("campaign --board bench.toml --only cycle --phases 4 -- true", 2, "which --only leaves o"),
        ("campaign --board bench.toml --world cycle:x.1:lost --all -- true", 2, "--all goes with"),
        ("campaign --board bench.toml --world cycle:x.1:flip9 -- true", 2, "there is no D9; write"),
        ("campaign --board bench.toml --host f.py", 2, "it names no function; write FILE.py:FUNCT"),
        ("campaign --board bench.toml --host bad.py:move", 1, "NameError: name 'nothing' is not d"),
        ("wave run.vbj -o dir", 1, "name a file in it, such as dir/FILE"),
        ("wave rum.vbj -o x.vcd", 4, "there is no file rum.vbj, and no board called"),
        ("scope rum.vbj", 4, "there is no file rum.vbj, and no board called"),
        ("monitor bench.toml", 4, "can be watched; bench.toml is a file;"),
        ("monitor bench", 4, 'no board called "bench" can be watched; "vbus ls" shows'),
        ("stop bench", 4, 'no board called "bench" runs; "vbus ls" shows which run'),
        ("logs bench", 4, "without it a board tells its own terminal"),
        ("wait bench --timeout 0", 4, '"vbus logs" shows what one in the background says'),
        ("exec --join bench -- true", 4, 'runs on this machine; "vbus ls" shows which run'),
        ("explain rum.vbj:3", 2, "rum.vbj: cannot be read: No such file or directory; did you mea"),
        ("explain dir:3", 2, "dir is a directory; name a journal in it"),
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
        ("up bench.toml --write x.yaml", 2, "For containers and systemd copy docker/compose.yaml"),
        ("campaign --board bench.toml --for 5 -- true", 2, "with ps, ns, us, ms, s, m, min or h"),
        ("wave run.vbj -o x.vcd --before 5m", 2, "write a number with ps, ns, us, ms or s"),
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
        ("conform bench.toml x.csv", 2, 'unknown part "BENCH.TOML"; known are LM628N-6,'),
        ("explain LFIL", 2, 'a command is told by its bytes: "vbus explain CHIP BYTE..."'),
        ("replay later.vbj", 1, "is a journal of version 2, and this vbus reads version 1: use"),
        ("check port.toml", 3, '"tcp:70000": write "tcp:PORT" or "tcp:HOST:PORT" with a port of'),
        ("check wave.toml", 3, "waves.a.file: x.fst: a waveform is a VCD file"),
        ("check unit.toml", 3, 'a text stands in quotes: clock = "8 MHz"'),
        ("check when.toml", 3, 'faults[1].when: found "5 ms"; an instant is written "at 5 ms"'),
        ("run report.toml", 3, "report.toml: record.report: x.pdf: a report's name ends in .txt,"),
        ("run serial.toml", 4, "plug the device in, or write the name that it has in /dev"),
        ("check --map", 2, "--map is of board files: name one"),
        ("exec --board bench.toml --avr atmega328p --cpu stm32f103 x", 2, "--avr or --cpu, not bo"),
        ("wave run.vbj -o - --json", 2, '"-o -" prints the waveform: with --json name a file'),
        ("wave run.vbj rum.vbj -o x.vcd --duration 1ms", 2, "are for one journal: each node has"),
        ("wave run.vbj rum.vbj -o x.vcd", 1, "run.vbj: it is of a board without nodes; record it"),
        ("wave rum.vbj run.vbj -o x.vcd", 1, "rum.vbj: no such journal; a running board is recor"),
        ("plot run.vbj -o x.svg --from 2ms --to 1ms", 1, "between 2000us and 1000us: the end must"),
        ("scope run.vbj --sigrok", 2, 'run.vbj write a file with "vbus wave --profile sigrok"'),
        ("coverage run.vbj --diff --covers STT", 2, "each show something else; take one"),
        ("coverage run.vbj --diff", 2, "--diff compares two files; 1 are given"),
        ("coverage run.vbj --covers STT --format json", 2, "and --test are shown as text only"),
        ("fmu bench.toml -o x.fmu --step 0s", 2, "--step: steps are 1 ps long at least"),
        ("campaign --board bench.toml", 2, "name either a PROGRAM or a function with --host"),
        ("campaign --board bench.toml --host f.py:move -- true", 2, "name either a PROGRAM or a"),
        ("campaign --host f.py:move -- pytest", 2, "--host does not go with pytest; its tests say"),
        ("campaign --for 1s --worlds 3 -- pytest", 2, "with pytest write either --for or --worlds"),
        ("attach zenoh:/x --detach", 2, "give the one here a name with --pty NAME or --unix NAME"),
        ("run bench.toml --metrics 0.0.0.0:0", 2, "lets other computers in; write"),
        ("run bench.toml --durable machine", 2, "durable is what a journal survives"),
        ("run bench.toml --rate 2", 2, "a rate makes sense in real time only"),
        ("run bench.toml --rate x", 2, '"x" is no rate; write a number from 0.001 up'),
        ("run bench.toml --cpu 4000", 2, "--cpu 4000: this process may run on processors"),
        ("run bench.toml --scope foo", 2, '--scope: found "foo"; write HOST:PORT'),
        ("run bench.toml --node x", 2, "--node is for boards with nodes; bench.toml has none"),
        ("run bench.toml --listen foo", 2, '"foo" is no endpoint; write "tcp/HOST:PORT"'),
        ("exec --board bench.toml --report x.foo -- true", 2, "x.foo: a report's name ends in"),
        ("exec --board bench.toml --metrics foo -- true", 2, 'found "foo"; write HOST:PORT with'),
        ("exec --board bench.toml --pinmap q -- true", 2, "there is no [pinmaps.q]"),
        ("exec --link foo -- true", 2, "--link: 'foo' is no link; allowed are pty:PATH"),
        ("scope run.vbj --listen foo", 2, '--listen: found "foo"; write HOST:PORT'),
        ("scope run.vbj --key x", 2, "--certificate and --key belong together"),
        ("report run.vbj --compatibility foo", 2, 'no chip of this run stands in for the part "fo'),
        ("wave run.vbj -o x.vcd --before 1ms", 2, "--before counts from a trigger; give one with"),
        ("router --listen foo", 2, '"foo" is no endpoint; write "tcp/HOST:PORT"'),
        ("up bench.toml --router foo", 2, '"foo" is no endpoint; write "tcp/HOST:PORT"'),
        ("run bench.toml --journal x.vbj --from x.vbs", 2, "a journal begins at power-on"),
        ("order b.toml", 2, "from Python, order() of vbus.serve.nodes.ordering"),
        ("scope run.vbj --remote", 2, "--remote: no other computer reaches 127.0.0.1:0; write an"),
        ("router --remote", 2, "no other computer comes in without a certificate at tcp/127"),
        ("attach --protocol bytes unix:x", 2, 'found "bytes"; did you mean "byte"?'),
        ("conform LM692N-8 x.csv --clock 8MHz", 2, 'unknown part "LM692N-8"; did you mean'),
        ("conform LM629N-8 x.csv --clock 8Mz", 2, '--clock: found "8Mz"; unknown unit "Mz"'),
        ("conform LM629N-8 x.csv --clock 8MHz --plant foo", 2, "--plant model: unknown plant"),
        ("conform LM629N-8 x.csv --clock 8MHz --option foo=3", 2, "--option foo: unknown key"),
        ("conform LM629N-8 x.csv --clock 8MHz --ignore RDRQ", 2, 'output "RDRQ"; did you mean "RD'),
    ],
)
def test_a_wrong_use_is_answered(
    folder: Path, capsys: pytest.CaptureFixture[str], words: str, code: int, said: str
) -> None:
    with pytest.raises(SystemExit) as ended:
        main(words.split())
    assert said in capsys.readouterr().err
    assert ended.value.code == code


@pytest.mark.parametrize("verb", ["report", "coverage"])
def test_what_is_said_of_a_journal_that_was_cut_says_so(
    folder: Path, capsys: pytest.CaptureFixture[str], verb: str
) -> None:
    board = load_board_text(BENCH, "bench.toml")
    with (folder / "cut.vbj").open("wb", buffering=0) as file:
        journal = Journal(board, file, BENCH, "bench.toml")
        connect_in_process(board).read(0)
        journal.close()
    whole = (folder / "cut.vbj").read_bytes()
    for size, said in ((len(whole) - 3, "vbus: cut.vbj: cut in the block at byte "), (None, "")):
        (folder / "cut.vbj").write_bytes(whole[:size])
        with pytest.raises(SystemExit):
            main([verb, "cut.vbj"])
        assert capsys.readouterr().err[: len(said) or None] == said


def test_coverage_is_written_in_the_format_that_the_name_says(folder: Path) -> None:
    for name, begins in (("c.html", "<!doctype html>"), ("c.json", "{"), ("c.txt", "lm628: ")):
        with pytest.raises(SystemExit):
            main(["coverage", "run.vbj", "--output", name])
        assert (folder / name).read_text().startswith(begins)


def test_a_world_in_which_nothing_came_to_be_broken_is_told(
    folder: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    words = "campaign --board bench.toml --world cycle:x.9:lost -- true"
    with pytest.raises(SystemExit):
        main(words.split())
    assert "nothing was broken: the run ended before cycle 9\n" in capfd.readouterr().err


def test_a_function_that_fails_with_nothing_broken_is_told_with_its_line(
    folder: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    (folder / "g.py").write_text("def move(bus):\n    bus.read(0)\n    raise OSError('no')\n")
    for more in (["--worlds", "1"], ["--world", "cycle:x.1:lost"]):
        with pytest.raises(SystemExit) as ended:
            main(["campaign", "--board", "bench.toml", "--host", "g.py:move", *more])
        assert ended.value.code == 1
        first, last = capfd.readouterr().err.splitlines()
        assert (first, last) == (
            "OSError: no (g.py, line 3)",
            "vbus: the reference run, with nothing broken, fails: it ends with exit code 1",
        )


def test_a_board_file_may_begin_with_a_mark_of_the_byte_order(
    folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    with pytest.raises(SystemExit):
        main(["check", "bom.toml"])
    assert capsys.readouterr().out.startswith("bom.toml: ok: x (LM629N-8)")


@pytest.mark.parametrize("words", ["report bench", "replay bench", "plot bench -o x.svg"])
def test_a_board_that_runs_is_no_journal(
    folder: Path, capsys: pytest.CaptureFixture[str], words: str
) -> None:
    (folder / "run" / "boards" / "bench.sock").touch()
    with pytest.raises(SystemExit):
        main(words.split())
    assert '"bench" is a board that runs, and no journal: "vbus run --j' in capsys.readouterr().err


def test_a_name_that_is_nearly_that_of_a_board_is_guessed(
    folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (folder / "run" / "boards" / "bench.sock").touch()
    with pytest.raises(SystemExit):
        main(["monitor", "bnech"])
    assert 'did you mean "bench"?' in capsys.readouterr().err


@pytest.mark.parametrize(
    ("program", "code"),
    [("./none", 127), ("./bench.toml", 126)],
)
def test_a_program_that_is_not_there_and_one_that_does_not_run_end_with_codes_of_their_own(
    folder: Path, program: str, code: int
) -> None:
    with pytest.raises(SystemExit) as ended:
        main(["exec", "--board", "bench.toml", "--", program])
    assert ended.value.code == code
