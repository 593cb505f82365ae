"""The command line as its users meet it: processes, exit codes, what stands on which output."""

import json
import os
import re
import shutil
import signal
import socket
import subprocess
import sys
from importlib import metadata
from pathlib import Path

import pytest
from click.testing import CliRunner

import vbus as package
from tests.e2e.command import BOARD, plug_in, running, start, vbus
from tests.waiting import until
from vbus.cli.cli import _COMMANDS, cli
from vbus.compiled import core
from vbus.core import exit_codes


@pytest.fixture(autouse=True)
def plugged(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("PYTHONPATH", "")
    plug_in(tmp_path)


@pytest.fixture
def board(tmp_path: Path) -> Path:
    path = tmp_path / "bench.toml"
    path.write_text(BOARD)
    return path


IMPORTED = """
import runpy, sys

class CtrlC:
    def find_spec(self, name, path=None, target=None):
        if name == {module!r}:
            raise KeyboardInterrupt

sys.meta_path.insert(0, CtrlC())
sys.argv = ["vbus", "schema"]
runpy.run_module("vbus", run_name="__main__")
"""


@pytest.mark.parametrize(
    "module", ["click", "vbus.core.errors", "vbus.cli.run.check", "vbus.boardfile"]
)
def test_ctrl_c_while_something_is_imported_ends_it_quietly(module: str) -> None:
    done = subprocess.run(
        [sys.executable, "-c", IMPORTED.format(module=module)],
        capture_output=True,
        text=True,
        cwd=Path(__file__).parents[2],
    )
    assert (done.returncode, done.stdout, done.stderr.strip()) == (130, "", "")


def test_little_is_imported_before_ctrl_c_is_taken() -> None:
    code = "import sys, vbus.__main__; print(*sys.modules)"
    started = [sys.executable, "-S", "-c", code]
    root = Path(__file__).parents[2]
    done = subprocess.run(started, capture_output=True, text=True, cwd=root, check=True)
    assert {"typing", "re", "collections"} & set(done.stdout.split()) == set()


# -- version, help, usage -----------------------------------------------------------------------


def test_the_version_is_that_of_the_package_and_says_which_core_runs() -> None:
    done = vbus("--version")
    says = f"vbus {package.__version__} ({core()} core)\n"
    assert (done.returncode, done.stdout, done.stderr) == (0, says, "")
    assert metadata.version("vbus") == package.__version__


def test_help_names_every_command_and_exit_code_on_one_screen() -> None:
    done = vbus("--help")
    assert done.returncode == 0
    for command in _COMMANDS:
        assert len(re.findall(rf"(?:^|  ){command} +[A-Z]", done.stdout, re.M)) == 1
        assert CliRunner().invoke(cli, [command, "--help"]).exit_code == 0
    _, _, codes = done.stdout.partition("Exit codes:")
    assert {int(code) for code in re.findall(r"\d+", codes)} == {*exit_codes.MEANINGS}
    lines = done.stdout.splitlines()
    assert len(lines) < 24, "the prompt has a line too"
    assert max(map(len, lines)) <= 80


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (
            ["chek"],
            'Error: there is no command "chek"; did you mean "check"? there are '
            + ", ".join(_COMMANDS),
        ),
        (["check"], "Error: name a board file, or ask for --rules"),
        (["run"], "Error: Missing argument 'BOARD'."),
        (
            ["run", "b.toml", "--rate", "fast"],
            "Error: Invalid value for '--rate': \"fast\" is no rate; write a number from 0.001 up,"
            ' or "max"',
        ),
    ],
)
def test_a_wrong_command_line_ends_with_2_and_says_what_is_wrong(
    arguments: list[str], message: str
) -> None:
    done = vbus(*arguments)
    assert done.returncode == 2
    assert done.stdout == ""
    assert done.stderr.rstrip("\n").split("\n")[-1] == message


# -- check --------------------------------------------------------------------------------------


def test_check_tells_what_a_good_board_has(board: Path) -> None:
    done = vbus("check", board)
    assert done.returncode == 0
    assert done.stdout == (
        f"{board}: ok: x (ACME-1); pty:$VBUS_RUNTIME/x, unix:$VBUS_RUNTIME/x.sock; realtime\n"
    )


def test_check_notes_what_is_of_no_use(board: Path) -> None:
    text = BOARD.partition("[[hosts]]")[0] + '[plants.n]\nmodel = "motor"\nsupply = "9 V"\n'
    board.write_text(text)
    done = vbus("check", board)
    assert done.returncode == 0
    assert done.stdout.split("\n")[1:3] == [
        f"{board}: note: [plants.n] is not used by any chip",
        f"{board}: note: there is no [[hosts]]: nothing can attach to this board from outside",
    ]


def test_check_notes_a_clock_beyond_the_part(board: Path) -> None:
    board.write_text(
        '[board]\nname = "a"\n[chips.x]\npart = "LM629N-8"\nclock = "9 MHz"\nplant = "none"\n'
    )
    done = vbus("check", board)
    assert done.returncode == 0
    assert (
        "note: chips.x: lm628.T5 (LM-TIM-5): 9000000 Hz is above the grade of a LM629N-8:"
        " 111.111 ns, the limit is 125 ns\n"
    ) in done.stdout


def test_check_puts_mistakes_on_standard_error_and_ends_with_3(board: Path) -> None:
    good = vbus("check", board).stdout
    bad = board.with_name("bad.toml")
    bad.write_text(BOARD.replace("plant =", "plnt =").replace("24 V", "24 A"))
    done = vbus("check", bad, board)
    assert done.returncode == 3
    assert done.stdout == good
    assert [line.partition(": ")[0] for line in done.stderr.splitlines()] == [
        f"{bad}:4", f"{bad}:7", f"{bad}:11"
    ]  # fmt: skip


def test_check_gives_json(board: Path) -> None:
    bad = board.with_name("bad.toml")
    bad.write_text(BOARD.replace('"8 MHz"', "8"))
    done = vbus("check", "--json", board, bad)
    assert done.returncode == 3
    good, wrong = json.loads(done.stdout)["boards"]
    assert good["ok"] is True
    assert good["chips"] == {"x": "ACME-1"}
    assert wrong["ok"] is False
    [problem] = wrong["problems"]
    assert (problem["line"], problem["key"]) == (6, "chips.x.clock")


def test_check_lists_every_rule_with_clause_and_title() -> None:
    done = vbus("check", "--rules", "--json")
    assert done.returncode == 0
    rules = {rule["name"]: rule for rule in json.loads(done.stdout)["rules"]}
    assert rules["acme.slow"] == {
        "name": "acme.slow",
        "clause": "ACME-1",
        "title": "Look at least once a second.",
        "severity": "error",
        "rows": [],
    }
    assert "board.contention" in rules
    assert rules["mcp1200.tSDR"]["rows"] == [
        "tSDR at 5 V: at least 2.1 ns", "tSDR at 3.3 V: at least 3.1 ns"
    ]  # fmt: skip
    text = vbus("check", "--rules").stdout
    assert re.search(r"^acme\.slow +ACME-1 +error +Look at least once a second\.$", text, re.M)
    assert re.search(r"^lm628\.T14 +LM-TIM-14 .*\[row T14: at least 100 ns\]$", text, re.M)
    assert len(text.splitlines()) == len(rules)


def test_check_finds_recordings_that_could_not_begin(board: Path) -> None:
    board.write_text(
        BOARD + '[record]\nreport = "a.pdf"\ncoverage = "b.pdf"\nsuppress = "nowhere.toml"\n'
        '[waves.w]\nfile = "w.vcd"\nsignals = ["y.*"]\ntrigger = "violation acme.fast"\n'
    )
    lines = vbus("check", board).stderr.splitlines()
    first = BOARD.count("\n") + 2
    assert [line.partition(": ")[0] for line in lines] == [
        f"{board}:{line}" for line in (first, first + 1, first + 2, first + 5, first + 6)
    ]
    assert "record.suppress: nowhere.toml: cannot be read: No such file or directory" in lines[2]
    assert not board.with_name("w.vcd").exists()


# -- run ----------------------------------------------------------------------------------------


def test_run_tells_what_is_attached_where_and_ends_cleanly_with_ctrl_c(
    board: Path, runtime: Path
) -> None:
    with running(board) as (process, lines):
        assert lines == [
            f"bench: realtime, process {process.pid}",
            "  chip x: ACME-1 at 8 MHz",
            f"  link pty:{runtime}/x: byte protocol, to x",
            f"  link unix:{runtime}/x.sock: text protocol, to x",
            "ready; Ctrl-C stops it",
        ]
        assert (runtime / "x").is_symlink()
        process.send_signal(signal.SIGINT)
        out, err = process.communicate(timeout=60)
    assert (process.returncode, out, err) == (0, "", "")
    assert [path.name for path in runtime.iterdir()] == ["boards"]
    assert list((runtime / "boards").iterdir()) == []


def test_run_with_json_gives_one_line_when_ready(board: Path) -> None:
    with running(board, "--json", "--rate", "max") as (process, lines):
        [line] = lines
        status = json.loads(line)
        assert (status["board"], status["pid"], status["rate"]) == ("bench", process.pid, "max")
        assert status["core"] == core()


def test_a_host_reaches_the_chip_through_a_running_board(board: Path, runtime: Path) -> None:
    with running(board), socket.socket(socket.AF_UNIX) as link:
        link.connect(str(runtime / "x.sock"))
        link.sendall(b"w 1 5a\nr 1\n")
        answer = b""
        while answer.count(b"\n") < 2:
            answer += link.recv(100)
    assert answer == b"ok\n5a\n"


def test_run_of_a_bad_board_ends_with_3(board: Path) -> None:
    board.write_text(BOARD.replace("ACME-1", "ACME-9"))
    done = vbus("run", board)
    assert (done.returncode, done.stdout) == (3, "")
    assert done.stderr == (
        f'{board}:5: chips.x.part: found "ACME-9"; did you mean "ACME-2"? known are ACME-1,'
        " ACME-2\n"
    )


def test_run_of_a_board_without_hosts_says_what_to_write(board: Path) -> None:
    board.write_text(BOARD.partition("[[hosts]]")[0])
    done = vbus("run", board)
    assert done.returncode == 3
    assert done.stderr == (
        f"{board}: there is no [[hosts]], so nothing could attach; write one, such as\n"
        '[[hosts]]\ntransport = "pty:$VBUS_RUNTIME/bench"\n'
    )


def test_a_rate_needs_real_time(board: Path) -> None:
    board.write_text(BOARD.replace('name = "bench"', 'time = "lockstep"'))
    done = vbus("run", board, "--rate", "2")
    assert done.returncode == 2
    assert done.stderr == (
        f"vbus: {board}: a rate makes sense in real time only; this board is lockstep\n"
    )


def test_a_link_that_cannot_be_opened_ends_with_4(board: Path, runtime: Path) -> None:
    runtime.mkdir(mode=0o700)
    (runtime / "x").write_text("mine")
    done = vbus("run", board)
    assert (done.returncode, done.stdout) == (4, "")
    assert done.stderr == (
        f"vbus: {runtime}/x exists and is not a link of ours; remove it or choose another name\n"
    )
    assert (runtime / "x").read_text() == "mine"


def test_a_plug_in_that_is_broken_ends_with_5(board: Path) -> None:
    board.write_text(BOARD.replace('"pty:$VBUS_RUNTIME/x"', '"hole:x"'))
    done = vbus("run", board)
    assert (done.returncode, done.stdout) == (5, "")
    assert done.stderr == (
        'vbus: transport "hole" of acme (no_such_module:Transport) cannot be loaded:'
        " ModuleNotFoundError: No module named 'no_such_module'\n"
    )


def test_a_second_board_of_the_same_name_is_refused(board: Path) -> None:
    with running(board) as (process, _):
        done = vbus("run", board)
        assert done.returncode == 4
        assert re.fullmatch(
            rf'vbus: a board called "bench" runs already \(.* process {process.pid}\); "vbus stop'
            ' bench" stops it, or give this one another name\n',
            done.stderr,
        )
        assert vbus("ls", "bench").returncode == 0


def test_a_killed_board_leaves_nothing_that_a_restart_does_not_repair(
    board: Path, runtime: Path
) -> None:
    with running(board) as (process, _):
        process.kill()
    assert (runtime / "x").is_symlink()
    left = sorted(path.name for path in (runtime / "boards").iterdir())
    assert "warn  left-overs: 7 of servers that were killed" in vbus("doctor").stdout, left
    with running(board) as (process, lines):
        assert lines[-1] == "ready; Ctrl-C stops it"
        assert os.access(runtime / "x", os.R_OK | os.W_OK)
    assert not (runtime / "x").exists()
    assert list((runtime / "boards").iterdir()) == []


# -- ls -----------------------------------------------------------------------------------------


def test_ls_without_boards_says_so() -> None:
    done = vbus("ls")
    assert (done.returncode, done.stdout, done.stderr) == (0, "no board is running\n", "")
    assert json.loads(vbus("ls", "--json").stdout) == []


def test_ls_sees_a_running_board_with_chips_links_time_and_lag(board: Path, runtime: Path) -> None:
    with running(board) as (process, _):
        text = vbus("ls").stdout
        [status] = json.loads(vbus("ls", "--json").stdout)
        with socket.socket(socket.AF_UNIX) as host:
            host.connect(str(runtime / "x.sock"))
            host.sendall(b"now\n")
            host.recv(100)
            connected = vbus("ls").stdout.splitlines()[-1]
    head, chip, pty, unix = text.splitlines()
    assert re.fullmatch(
        rf"bench: process {process.pid}, realtime x1, chip time [\d.]+ m?s,"
        r" lag [\d.]+ m?s \(worst [\d.]+ m?s\), 0 violations",
        head,
    )
    assert chip == "  chip x: ACME-1 at 8 MHz, 0 reads, 0 writes"
    assert pty == f"  link pty:{runtime}/x: byte protocol, to x, waiting, 0 bytes in, 0 out"
    assert unix == f"  link unix:{runtime}/x.sock: text protocol, to x, waiting, 0 bytes in, 0 out"
    shown = f"  link unix:{runtime}/x.sock: text protocol, to x, connected, 4 bytes in"
    assert connected.startswith(shown)
    assert status["chips"] == [
        {
            "name": "x",
            "part": "ACME-1",
            "family": "acme",
            "bus_settings": {},
            "clock_hz": 8_000_000,
            "reads": 0,
            "writes": 0,
        }
    ]
    assert status["time_ps"] > 0
    assert status["lag_ps"] >= 0


def test_ls_of_a_board_that_does_not_run_ends_with_4() -> None:
    done = vbus("ls", "bench")
    assert (done.returncode, done.stdout) == (4, "")
    assert done.stderr == (
        'vbus: no board called "bench" answers; "vbus ls" shows which run, "vbus run FILE" starts'
        " one\n"
    )


# -- real time on request -----------------------------------------------------------------------


def test_a_board_runs_ahead_of_others_where_that_is_permitted_and_is_refused_elsewhere(
    board: Path,
) -> None:
    cpu = max(os.sched_getaffinity(0))
    done = vbus("run", str(board), "--detach", "--priority", "fifo:3", "--cpu", str(cpu))
    if done.returncode:
        assert done.returncode == 1
        assert "vbus: --priority fifo:3: " in done.stderr
        return
    process = int(done.stdout.splitlines()[0].split()[-1])
    children = Path(f"/proc/{process}/task/{process}/children").read_text().split()
    try:
        assert f"  scheduling SCHED_FIFO 3, memory locked, processor {cpu}" in done.stdout
        until(lambda: os.sched_getaffinity(process) == {cpu}, "it runs on its processor")
        assert os.sched_getscheduler(process) & ~os.SCHED_RESET_ON_FORK == os.SCHED_FIFO
        assert os.sched_getparam(process).sched_priority == 3
        locked = re.search(r"VmLck:\s+(\d+) kB", Path(f"/proc/{process}/status").read_text())
        assert locked is not None
        assert int(locked[1]) > 0
        for child in map(int, children):
            assert os.sched_getscheduler(child) == os.SCHED_OTHER
            assert os.sched_getaffinity(child) == os.sched_getaffinity(0)
        assert children
    finally:
        assert vbus("stop", "bench").returncode == 0


def test_a_priority_that_is_none_is_refused(board: Path) -> None:
    done = vbus("run", str(board), "--priority", "rr")
    assert done.returncode == 2
    assert '"rr" is none; write fifo, or fifo:1 to fifo:99' in done.stderr
    done = vbus("run", str(board), "--cpu", "5000")
    assert done.returncode == 2
    assert "vbus: --cpu 5000: this process may run on processors 0" in done.stderr


# -- doctor, cflags -----------------------------------------------------------------------------


def test_doctor_says_what_is_in_order_and_what_to_do_about_the_rest() -> None:
    done = vbus("doctor")
    assert done.returncode == 0
    lines = done.stdout.splitlines()
    assert f"ok    python: {sys.version.split()[0]} ({sys.executable})" in lines
    assert "warn  vbus.chips: HOLE is broken" in lines
    place = lines.index("warn  vbus.chips: HOLE is broken")
    assert lines[place + 1] == (
        '      part "HOLE" of acme (no_such_module:Chip) cannot be loaded: ModuleNotFoundError:'
        " No module named 'no_such_module'"
    )
    for what in ("msgspec", "PTY", "runtime directory", "left-overs", "timerfd, inotify"):
        assert any(line.startswith(f"ok    {what}: ") for line in lines)


def test_doctor_measures_how_late_the_machine_wakes_a_server() -> None:
    done = vbus("doctor", "--json", "--latency", "20 ms")
    findings = {finding["what"]: finding for finding in json.loads(done.stdout)}

    assert re.fullmatch(
        r"\d+ waits of 1 ms: p50 \d+ us, p99 \d+ us, max \d+ us late", findings["latency"]["detail"]
    )
    permitted = findings["real-time class"]["state"] == "ok"
    assert ("latency with --priority fifo" in findings) is permitted
    assert {"timer slack", "governor", "clock", "load"} <= findings.keys()


@pytest.mark.parametrize("duration", ["10", "0 s", "2 h", "x"])
def test_doctor_refuses_what_it_cannot_measure(duration: str) -> None:
    done = vbus("doctor", "--latency", duration)
    assert done.returncode == 2
    assert "--latency" in done.stderr


def test_doctor_fails_where_nothing_can_work(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "file").write_text("")
    monkeypatch.setenv("VBUS_RUNTIME", str(tmp_path / "file"))
    done = vbus("doctor", "--json")
    assert done.returncode == 1
    failed = [finding for finding in json.loads(done.stdout) if finding["state"] == "fail"]
    assert [finding["what"] for finding in failed] == ["runtime directory"]
    assert failed[0]["advice"] == "set VBUS_RUNTIME to a directory of your own"


@pytest.mark.skipif(shutil.which("gcc") is None, reason="needs gcc")
def test_cflags_are_all_a_compiler_needs_to_build_a_host(tmp_path: Path) -> None:
    (tmp_path / "host.c").write_text(
        '#include "vbus.h"\n'
        'int main(void) { struct vbus bus; return vbus_open(&bus, "pty:/nowhere") < 0 ? 7 : 0; }\n'
    )
    done = vbus("cflags")
    assert (done.returncode, done.stderr) == (0, "")
    host = tmp_path / "host"
    subprocess.run(
        ["gcc", "-std=c99", *done.stdout.split(), "-o", host, tmp_path / "host.c"], check=True
    )
    assert subprocess.run([host]).returncode == 7
    told = json.loads(vbus("cflags", "--json").stdout)
    assert [Path(source).name for source in told["sources"]] == ["vbus.c"]


def test_output_into_a_closed_pipe_ends_quietly() -> None:
    process = start("check", "--rules")
    assert process.stdout is not None
    process.stdout.close()
    process.wait(timeout=60)
    assert process.stderr is not None
    assert process.stderr.read() == ""
    process.stderr.close()


@pytest.mark.parametrize(
    ("words", "code"),
    [(["ls", "nobody"], 4), (["run", "nowhere.toml"], 3), (["nothing"], 2)],
    ids=["not there", "no file", "wrong use"],
)
def test_a_mistake_has_its_exit_code_also_where_nobody_reads_what_it_is(
    words: list[str], code: int
) -> None:
    unread, errors = os.pipe()
    os.close(unread)
    command = [sys.executable, "-m", "vbus", *words]
    done = subprocess.run(command, stdout=subprocess.DEVNULL, stderr=errors, timeout=60)
    os.close(errors)
    assert done.returncode == code
