"""What verbs write: one writer each, all or nothing, and an exit code that says so."""

import ast
import fcntl
import os
import re
import resource
import signal
import subprocess
import sys
from collections.abc import Callable, Iterator
from pathlib import Path

import click
import pytest

import vbus as package
from tests.boards import BENCH
from tests.e2e.command import running, vbus
from vbus import connect
from vbus.cli.cli import cli

BOARD = BENCH.replace('"bench"', '"{name}"').replace("/x", "/{name}")
MACHINE = """\
[board]
name = "machine"
time = "lockstep"
power_on = "done"
[nodes.a]
[nodes.b]
[chips.x]
part = "LM629N-8"
clock = "8 MHz"
plant = "none"
node = "a"
[chips.y]
part = "LM629N-8"
clock = "8 MHz"
plant = "none"
node = "b"
[nets]
"HI" = {{ pins = ["x.HI", "y./IN"], delay = "250 us" }}
""".replace("{{", "{").replace("}}", "}")
SCENARIO = "".join(f"{500 * n}us x w 0 02\n" for n in range(1, 30)) + "end 20ms\n"
PROGRAM = (
    "import os; from vbus import connect\n"
    "with connect(os.environ['VBUS_LINK']) as bus:\n"
    "    bus.chip('x').write(0, 2)\n"
    "    for n in range(99): bus.chip('x').write(0, n); bus.delay('1 ms')\n"
)
LIMIT = 200
"""Bytes of a file that a process may write which is to find the disk full."""

Make = Callable[[Path], list[str | Path]]


def _exec(option: str) -> Make:
    return lambda path: [
        "exec", "--board", "other.toml", option, path, "--", sys.executable, "-c", PROGRAM,
    ]  # fmt: skip


def _run(option: str) -> Make:
    return lambda path: ["run", "other.toml", option, path]


def _machine(verb: str, option: str) -> Make:
    return lambda path: [verb, "machine.toml", "--scenario", "scenario", option, path]


def _campaign(option: str) -> Make:
    return lambda path: [
        "campaign", "--board", "other.toml", "--only", "cycle", "--worlds", "4", "-j", "1", option,
        path, "--", sys.executable, "-c", PROGRAM,
    ]  # fmt: skip


def _world(path: Path) -> list[str | Path]:
    return [
        "campaign", "--board", "other.toml", "--world", "cycle:x.1:flip0", "--journal", path, "--",
        sys.executable, "-c", PROGRAM,
    ]  # fmt: skip


OUTPUTS: dict[tuple[str, str], tuple[str, Make]] = {
    ("campaign", "--journal"): ("w.vbj", _world),
    ("campaign", "--json"): ("c.json", _campaign("--json")),
    ("campaign", "--junit"): ("c.xml", _campaign("--junit")),
    ("campaign", "--page"): ("c.html", _campaign("--page")),
    ("coverage", "--output"): ("c.json", lambda p: [
        "coverage", "run.vbj", "--format", "json", "--output", p,
    ]),
    ("fmu", "--output"): ("b.fmu", lambda p: ["fmu", "other.toml", "-o", p]),
    ("plot", "--output"): ("p.svg", lambda p: ["plot", "motor.vbj", "-o", p]),
    ("scope", "--output"): ("s.html", lambda p: ["scope", "run.vbj", "-o", p]),
    ("snap save", "file"): ("s.snap", lambda p: ["snap", "save", "bench", p]),
    ("snap bisect", "--save"): ("b.snap", lambda p: [
        "snap", "bisect", "run.vbj", "lm628.busy-write", "--save", p,
    ]),
    ("wave", "--output"): ("w.vcd", lambda p: ["wave", "run.vbj", "-o", p]),
    ("exec", "--transcript"): ("t.txt", _exec("--transcript")),
    ("run", "--trace"): ("m.trace", _machine("run", "--trace")),
    ("run", "--snapshot"): ("m.snap", lambda p: [
        "run", "single.toml", "--scenario", "scenario", "--snapshot", p,
    ]),
    ("up", "--trace"): ("u.trace", _machine("up", "--trace")),
    **{
        (verb, option): (name, make(option))
        for verb, make in (("exec", _exec), ("run", _run))
        for option, name in (
            ("--journal", "r.vbj"), ("--report", "r.sarif"), ("--coverage", "r.html"),
            ("--wave", "r.vcd"),
        )
    },
}  # fmt: skip
"""Every option that names a file to write, a name for one, and a command that writes it."""

PASSED = {("up", option) for option in ("--journal", "--report", "--coverage", "--wave")}
"""Options of ``vbus up``: the processes it starts take them."""
INPUTS = {
    "--suppress", "--from", "--baseline", "--host", "--scenario", "--board", "--map",
    "--certificate", "--key",
    "capture", "files", "first", "second", "scenario", "journal", "journals", "sources", "what",
    "file", "board", "run",
}  # fmt: skip
"""Options and arguments that name what is read."""
UNTIL_STOPPED = {("run", one) for one in ("--journal", "--report", "--coverage", "--wave")}


def options() -> Iterator[tuple[str, str]]:
    """Give each verb's options and arguments that name a file."""

    def walk(group: click.Group, before: str) -> Iterator[tuple[str, str]]:
        context = click.Context(group)
        for name in group.list_commands(context):
            command = group.get_command(context, name)
            if isinstance(command, click.Group):
                yield from walk(command, f"{before}{name} ")
                continue
            assert command is not None
            for one in command.params:
                named = str(one.metavar or "")
                if isinstance(one.type, click.Path | click.File) or "FILE" in named or (
                    named == "DIR" or re.search(r"\w\.[a-z]", named)
                ):  # fmt: skip
                    yield before + name, one.opts[-1]

    yield from walk(cli, "")


def test_every_option_that_names_a_file_is_known_to_read_or_to_write_it() -> None:
    """Put an option that writes into OUTPUTS, with a command; the tests below try it."""
    there = set(options())
    unknown = {
        (verb, option)
        for verb, option in there
        if (verb, option) not in {*OUTPUTS, *PASSED} and option not in INPUTS
    }
    assert not unknown
    assert {*OUTPUTS, *PASSED} <= there


@pytest.fixture(scope="module")
def sources(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Record a journal that tells of a violation, and one of a board with an axis."""
    folder = tmp_path_factory.mktemp("outputs")
    for name in ("bench", "other"):
        (folder / f"{name}.toml").write_text(BOARD.format(name=name))
    motor = BOARD.format(name="motor").replace('"none"', '"m"')
    (folder / "motor.toml").write_text(motor + '[plants.m]\nmodel = "dc_motor"\n')
    (folder / "machine.toml").write_text(MACHINE)
    (folder / "single.toml").write_text(
        BOARD.format(name="single").replace("[chips.x]", '[nodes.a]\n[chips.x]\nnode = "a"')
    )
    (folder / "scenario").write_text(SCENARIO)
    for board, journal in (("bench", "run"), ("motor", "motor")):
        command = [
            sys.executable, "-m", "vbus", "exec", "--board", f"{board}.toml", "--journal",
            f"{journal}.vbj", "--", sys.executable, "-c", PROGRAM,
        ]  # fmt: skip
        subprocess.run(command, cwd=folder, check=True, capture_output=True)
    return folder


@pytest.fixture
def folder(sources: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    monkeypatch.setenv("VBUS_RUNTIME", str(tmp_path / "run"))
    monkeypatch.setenv("PYTHONDONTWRITEBYTECODE", "1")
    monkeypatch.chdir(sources)
    with running("bench.toml"):
        yield tmp_path


def _left(folder: Path) -> list[str]:
    return sorted(path.name for path in folder.iterdir() if path.is_file())


@pytest.mark.slow
@pytest.mark.parametrize(("verb", "option"), OUTPUTS)
def test_a_file_that_is_being_written_is_refused_and_stays(
    folder: Path, verb: str, option: str
) -> None:
    name, make = OUTPUTS[verb, option]
    path = folder / name
    path.write_text("of another run")
    with path.open() as held:
        fcntl.flock(held, fcntl.LOCK_EX)
        done = vbus(*make(path))
    assert done.returncode == 1, done.stderr
    who = f"vbus: {path}: process {os.getpid()} ("
    assert who in done.stderr or f"vbus: {path}: another process writes this file" in done.stderr
    assert "writes this file; stop it, or give another file" in done.stderr
    assert path.read_text() == "of another run"
    assert _left(folder) == [name]


@pytest.mark.slow
@pytest.mark.parametrize(("verb", "option"), OUTPUTS)
def test_a_full_disk_is_told_and_leaves_no_half_result(
    folder: Path, verb: str, option: str
) -> None:
    name, make = OUTPUTS[verb, option]
    path = folder / name
    whole = option not in ("--journal", "--transcript") and (verb, option) not in (
        ("exec", "--wave"), ("run", "--wave"), ("campaign", "--json"),
    )  # fmt: skip
    # A snapshot replaces nothing but a snapshot.
    earlier = ("vbus snapshot\n" if path.suffix == ".snap" else "") + "of an earlier run"
    if whole:
        path.write_text(earlier)
    with subprocess.Popen(
        [sys.executable, "-m", "vbus", *map(str, make(path))], text=True,
        stdout=subprocess.PIPE, stderr=subprocess.PIPE, stdin=subprocess.DEVNULL,
        preexec_fn=lambda: resource.setrlimit(resource.RLIMIT_FSIZE, (LIMIT, LIMIT)),
    ) as process:  # fmt: skip
        if (verb, option) in UNTIL_STOPPED:
            assert process.stdout is not None
            while (line := process.stdout.readline()) and not line.startswith("ready"):
                pass
            with connect(f"unix:{folder}/run/other") if line else open(os.devnull):
                process.send_signal(signal.SIGTERM)
        _, err = process.communicate(timeout=60)
    assert "Traceback" not in err
    assert verb == "up" or f"{path}: " in err  # a process of it has no room either
    assert "File too large" in err
    assert process.returncode == 1
    if whole:
        assert path.read_text() == earlier
        assert _left(folder) == [name]


def test_a_second_start_leaves_the_first_run_its_files(folder: Path) -> None:
    files = [folder / name for name in ("a.vbj", "a.vcd", "a.json")]
    given = [word for pair in zip(("--journal", "--wave", "--report"), files, strict=True)
             for word in pair]  # fmt: skip
    old = folder / "old.vbj"
    old.write_text("vbus journal of another day")
    with running("other.toml", *given) as (first, _):
        with connect(f"unix:{folder}/run/other") as bus:
            for _ in range(100):
                bus.chip("x").read(0)
            bus.delay("1 ms")
        before = {file: file.read_bytes() for file in files[:2]}
        for again in (given, ["--journal", old]):
            done = vbus("run", "other.toml", *again)
            assert done.returncode == 4
            assert 'vbus: a board called "other" runs already (' in done.stderr
            assert f"is in use by process {first.pid}" in done.stderr
        for file, text in before.items():
            assert file.read_bytes().startswith(text)
        # A board of another name may not have one of them either.
        for option, file in zip(("--journal", "--wave", "--report"), files, strict=True):
            (folder / "third.toml").write_text(BOARD.format(name="third"))
            done = vbus("run", folder / "third.toml", "--journal", old, option, file)
            assert done.returncode == 1
            command = f"process {first.pid} ({sys.executable} -m vbus run other.toml"
            assert f"vbus: {file}: {command}" in done.stderr
    assert old.read_text() == "vbus journal of another day"
    assert vbus("replay", files[0]).stdout.startswith("no difference")
    assert '"violations"' in files[2].read_text()
    assert _left(folder) == ["a.json", "a.vbj", "a.vcd", "old.vbj", "third.toml"]


def test_standard_output_on_a_full_disk_is_told(folder: Path) -> None:
    with open("/dev/full", "w") as full:
        done = subprocess.run(
            [sys.executable, "-m", "vbus", "explain", "run.vbj"],
            stdout=full, stderr=subprocess.PIPE, text=True, timeout=60,
        )  # fmt: skip
    told = "vbus: standard output: cannot be written: No space left on device\n"
    assert (done.returncode, done.stderr) == (1, told)


def test_a_start_that_fails_writes_no_result(folder: Path) -> None:
    report = folder / "r.json"
    report.write_text("of an earlier run")
    (folder / "run" / "other").write_text("no socket")
    assert vbus("run", "other.toml", "--report", report).returncode == 4
    assert report.read_text() == "of an earlier run"
    assert _left(folder) == ["r.json"]


BY_HAND = {
    "serve/output_file.py": "the piece itself",
    "compiled/hook.py": "while vbus is installed",
    "cli/run/detach.py": "the log of a run in the background",
    "cli/run/doctor.py": "looks whether a folder can be written",
    "cli/cli.py": "the null device",
    "cli/hosted/preload.py": "a lock",
    "cli/look/scope.py": "the null device",
    "cli/test/fmu.py": "in a folder of its own, for the builder of units",
    "serve/in_process.py": "the null device",
    "testing/plugins/github.py": "GitHub's file, which every step of a job adds to",
    "transports/runtime.py": "locks and marks",
    "client/links.py": "terminals",
    "native/pic_dialect.py": "what a compiler is given, without vbus",
}
"""Files that open something to write without an output file, and why."""
WRITES = {"O_WRONLY", "O_RDWR", "O_CREAT"}


def _written_by_hand(path: Path) -> Iterator[int]:
    """Give the lines in which a file opens another to write."""
    for node in ast.walk(ast.parse(path.read_text())):
        if not isinstance(node, ast.Call):
            continue
        called = node.func
        name = called.id if isinstance(called, ast.Name) else getattr(called, "attr", "")
        words = [*node.args, *(keyword.value for keyword in node.keywords)]
        modes = {word.value for word in words if isinstance(word, ast.Constant)}
        of_self = isinstance(called, ast.Attribute) and isinstance(called.value, ast.Name) and (
            called.value.id == "self"
        )  # fmt: skip
        if name in ("open", "fdopen"):
            flags = {one.attr for word in words for one in ast.walk(word)
                     if isinstance(one, ast.Attribute)}  # fmt: skip
            texts = {mode for mode in modes if isinstance(mode, str)}
            if WRITES & flags or any(len(t) < 4 and set("wax+") & set(t) for t in texts):
                yield node.lineno
        elif name == "write_text" or (
            name == "write_bytes" and not of_self and not isinstance(called.value, ast.Call)
        ):
            yield node.lineno


def test_no_file_is_opened_to_write_by_hand() -> None:
    home = Path(next(iter(package.__path__)))
    found = {
        path.relative_to(home).as_posix(): lines
        for path in home.rglob("*.py")
        if (lines := list(_written_by_hand(path)))
        and path.relative_to(home).parts[:2] != ("cli", "generate")
    }
    assert found.keys() == BY_HAND.keys(), found
