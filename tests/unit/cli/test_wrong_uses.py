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
    return tmp_path


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
        ("attach tcp:127.0.0.1:1", 4, "no process listens there; is the board running?"),
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
        ("run bench.toml --metrics foo", '--metrics: found "foo"; write "HOST:PORT"'),
        ("run bench.toml --metrics 0.0.0.0:0", "lets other computers in; write"),
        ("run bench.toml --report x.foo", "x.foo: a report's name ends in .txt, .json"),
        ("run bench.toml --coverage x.foo", "x.foo: a coverage file's name ends in one of"),
        ("run bench.toml --durable machine", "durable is what a journal survives"),
        ("run bench.toml --rate 2", "a rate makes sense in real time only"),
        ("run bench.toml --rate x", '"x" is no rate; write a number from 0.001 up'),
        ("run bench.toml --cpu 4000", "--cpu 4000: this process may run on processors"),
        ("run bench.toml --scope foo", '--scope: found "foo"; write "HOST:PORT"'),
        ("run bench.toml --node x", "--node is for boards with nodes; bench.toml has none"),
        ("run bench.toml --listen foo", '"foo" is no endpoint; write "tcp/HOST:PORT"'),
        ("exec --board bench.toml --report x.foo -- true", "x.foo: a report's name ends in"),
        ("exec --board bench.toml --metrics foo -- true", '--metrics: found "foo"; write'),
        ("exec --board bench.toml --pinmap q -- true", "there is no [pinmaps.q]"),
        ("exec --link foo -- true", "--link: 'foo' is no link; allowed are pty:PATH"),
        ("scope run.vbj --listen foo", '--listen: found "foo"; write "HOST:PORT"'),
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
