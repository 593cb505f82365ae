"""Every verb with every kind of wrong file: a sentence that names the file and says what to do."""

import io
import socket
import struct
import zipfile
from pathlib import Path

import pytest

from vbus.board.build import load_board_text
from vbus.cli import cli
from vbus.core import exit_codes
from vbus.record.journal import Journal
from vbus.serve.output_file import write_file

BOARD = """\
[board]
name = "wrong"
time = "slaved"
[chips.x]
part = "LM629N-8"
clock = "8 MHz"
plant = "m"
[plants.m]
model = "ideal"
[pinmaps.avr.pins]
PB0 = "/RD"
PB1 = "/WR"
PB2 = "/CS"
PB3 = "/PS"
PD0 = "D0"
PD1 = "D1"
PD2 = "D2"
PD3 = "D3"
PD4 = "D4"
PD5 = "D5"
PD6 = "D6"
PD7 = "D7"
[[hosts]]
transport = "unix:$VBUS_RUNTIME/wrong"
"""
VCD = "$timescale 1 ns $end\n$scope module m $end\n$enddefinitions $end\n"
KINDS = {
    "missing": "",
    "folder": "directory",
    "empty": "empty",
    "garbage.bin": "binary data",
    "text.txt": "text",
    "wave.vcd": "VCD",
    "prog.elf": "ELF",
    "board.toml": "board file",
    "cap.pcap": "pcap",
    "cap.sr": "sigrok",
    "snap.vbs": "snapshot",
    "run.vbj": "journal",
}
"""Wrong files, and the word by which a message says what each looks like."""
VERBS: dict[str, tuple[int, tuple[str, ...]]] = {
    "check @": (3, ("board.toml",)),
    "conform LM629N-8 @ --clock 8MHz": (6, ("wave.vcd", "cap.sr")),
    "conform LM629N-8 wave.vcd --board @": (3, ("board.toml",)),
    "coverage @": (1, ("run.vbj",)),
    "diff @ run.vbj": (2, ("run.vbj",)),
    "diff run.vbj @": (2, ("run.vbj",)),
    "exec --board @ -- true": (3, ("board.toml",)),
    "exec --board board.toml -- ./@": (126, ("prog.elf",)),
    "exec --board board.toml --avr mmcu=atmega328p,f=16000000 @": (126, ()),
    "explain @": (1, ("run.vbj",)),
    "explain @:1": (1, ("run.vbj",)),
    "plot @ -o out.svg": (1, ("run.vbj",)),
    "replay @": (1, ("run.vbj",)),
    "report @": (1, ("run.vbj",)),
    "report run.vbj --suppress @": (1, ("empty",)),
    "router @": (3, ("board.toml", "empty")),
    "run @": (3, ("board.toml",)),
    "run board.toml --from @": (1, ("snap.vbs",)),
    "scope @": (1, ("run.vbj",)),
    "scope @ -o out.html": (1, ("run.vbj",)),
    "scope @ --control": (1, ("run.vbj",)),
    "snap bisect @ x.HI=1": (1, ("run.vbj",)),
    "snap info @": (1, ("snap.vbs",)),
    "snap load nobody @": (1, ("snap.vbs",)),
    "trace @": (1, ()),
    "up @": (3, ("board.toml",)),
    "wave @ -o out.vcd": (1, ("run.vbj",)),
}
"""Each verb with a file, ``@``; its exit code for a wrong one; those that are right."""
assert {code for code, _ in VERBS.values()} <= {*exit_codes.MEANINGS}
OF_BOARDS = ("scope", "wave")
"""Verbs for which what is no file is the name of a board."""


def without_file(verb: str, kind: str, code: int) -> int:
    """Return the exit code for what is no file at all."""
    if "exec" in verb and code == 126:
        return 127 if kind == "missing" else 126
    if verb.startswith("explain") or "-o out.html" in verb:
        return exit_codes.USAGE
    return exit_codes.NO_LINK if verb.startswith(OF_BOARDS) else code


def tolerated(verb: str, kind: str) -> bool:
    """Whether it is said what is wrong in the file, in place of what the file is."""
    toml = VERBS[verb][0] == 3 or "--suppress" in verb
    return toml and kind in ("empty", "text.txt", "board.toml")


@pytest.fixture(scope="module")
def journal() -> bytes:
    file = io.BytesIO()
    Journal(load_board_text(BOARD), file, BOARD).close()
    return file.getvalue()


@pytest.fixture
def files(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, journal: bytes) -> Path:
    """Make one file of each kind, in the current directory."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("VBUS_RUNTIME", str(tmp_path / "run"))
    made: dict[str, bytes] = {
        "empty": b"",
        "garbage.bin": bytes(range(200, 256)) + bytes(range(256)),
        "text.txt": b"hello, this is text\n",
        "wave.vcd": VCD.encode(),
        "prog.elf": b"\x7fELF\x02\x01\x01" + bytes(11) + b"\x3e\0" + bytes(200),
        "board.toml": BOARD.encode(),
        "cap.pcap": struct.pack("<IHHiIII", 0xA1B2C3D4, 2, 4, 0, 0, 65535, 1),
        "snap.vbs": b"vbus snapshot\n" + bytes(64),
        "run.vbj": journal,
    }
    for name, data in made.items():
        write_file(tmp_path / name, data)
    with zipfile.ZipFile(tmp_path / "cap.sr", "w") as archive:
        archive.writestr("version", "2")
    (tmp_path / "folder").mkdir()
    return tmp_path


@pytest.mark.parametrize("verb", VERBS)
def test_a_wrong_file_is_named_with_what_to_do(
    verb: str, files: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    code, others = VERBS[verb]
    mistakes = []
    for kind, looks in KINDS.items():
        if kind in others:
            continue
        words = verb.replace("@", kind).split()
        wanted = code if (files / kind).is_file() else without_file(verb, kind, code)
        found = cli._run(words)
        said = " ".join(capsys.readouterr().err.replace("│", " ").split())
        problems = [
            f"exit code {found}, not {wanted}" if found != wanted else "",
            "a traceback" if "Traceback" in said else "",
            "the file is not named" if kind not in said else "",
            f"does not say {looks!r}" if looks not in said and not tolerated(verb, kind) else "",
        ]
        if any(problems):
            mistakes.append(f"{' '.join(words)}: {'; '.join(filter(None, problems))}: {said}")
    assert not mistakes, "\n".join(mistakes)


@pytest.mark.parametrize(
    ("wrong", "likely"),
    [("LM692N-8", "LM629N-8"), ("lm629n-8", "LM629N-8"), ("MC1214A", "MC1241A"),
     ("MPC-1200", "MCP-1200")],
)  # fmt: skip
def test_a_part_that_is_not_known_has_the_numbers_close_to_it(
    wrong: str, likely: str, files: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (files / "part.toml").write_text(BOARD.replace("LM629N-8", wrong))
    assert cli._run(["check", "part.toml"]) == exit_codes.BAD_BOARD
    assert f'unknown part "{wrong}"; did you mean "{likely}"' in capsys.readouterr().err


@pytest.mark.parametrize(
    "verb",
    [
        "run board.toml --metrics 127.0.0.1:{}",
        "run tcp.toml",
        "run board.toml --scope 127.0.0.1:{}",
        "exec --board board.toml --scope 127.0.0.1:{} -- true",
        "scope empty.vbj --listen 127.0.0.1:{}",
    ],
)
def test_a_port_in_use_is_named_with_what_to_do(
    verb: str, files: Path, journal: bytes, capfd: pytest.CaptureFixture[str]
) -> None:
    (files / "empty.vbj").write_bytes(journal)
    with socket.create_server(("127.0.0.1", 0)) as taken:
        port = taken.getsockname()[1]
        (files / "tcp.toml").write_text(BOARD.replace("unix:$VBUS_RUNTIME/wrong", f"tcp:{port}"))
        assert cli._run(verb.format(port).split()) == exit_codes.NO_LINK
    said = capfd.readouterr().err
    assert f":{port}" in said
    assert "in use" in said
    assert "0 is any free one" in said


@pytest.mark.parametrize(
    "verb",
    ["monitor nobody", "scope nobody", "snap save nobody a.vbs", "stop nobody", "ls nobody",
     "wait nobody --timeout 0", "fault list nobody", "logs nobody", "wave nobody -o a.vcd",
     "exec --join nobody -- true", "exec --link unix:nobody -- true"],
)  # fmt: skip
def test_a_board_that_is_not_there_is_named_with_what_to_do(
    verb: str, files: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert cli._run(verb.split()) in (exit_codes.FAILURE, exit_codes.NO_LINK)
    said = capsys.readouterr().err
    assert "nobody" in said
    assert "vbus " in said.partition("nobody")[2], said
