"""The C client over real links, against the byte protocol on a fake port."""

import os
import re
import socket
import subprocess
from pathlib import Path

import pytest

from tests.left_out import require
from tests.unit.client.served import Served
from tests.unit.native.conftest import WARNINGS, compile_c
from vbus.native import include_dir
from vbus.protocols.requests import REFUSALS, REPLIES, REQUESTS, VERSION

HEADER = (Path(include_dir()) / "vbus.h").read_text()
HERE = Path(__file__).parent


def run(exercise: Path, where: str, calls: str) -> list[str]:
    """Make the calls from a process of their own; return what it prints."""
    done = subprocess.run(
        [str(exercise), where, *calls.split()], capture_output=True, text=True, timeout=60
    )
    assert done.stderr == ""
    return done.stdout.splitlines()


def constants(prefix: str) -> dict[str, int]:
    found = re.findall(rf"^#define VBUS_{prefix}(\w+) ('.'|\w+)(?: |$)", HEADER, re.MULTILINE)
    return {
        name: ord(value[1]) if value.startswith("'") else int(value, 0)
        for name, value in found
        if re.fullmatch(r"'.'|0x\w+|\d+", value)
    }


# -- the header ------------------------------------------------------------------------------------


def test_the_header_has_the_opcodes_of_the_table() -> None:
    found = constants("")
    assert {row.name: found.get(row.name) for row in REQUESTS} == {
        row.name: row.code for row in REQUESTS
    }
    hexadecimal = set(re.findall(r"^#define VBUS_(\w+) 0x", HEADER, re.MULTILINE))
    assert hexadecimal == {row.name for row in REQUESTS}
    assert found["VERSION"] == VERSION


def test_the_header_has_the_reply_tags_of_the_table() -> None:
    assert sorted(constants("TAG_").values()) == sorted(reply.code for reply in REPLIES.values())


def test_the_header_has_the_reasons_of_the_table() -> None:
    assert constants("REFUSED_") == {name: code for code, (name, _) in REFUSALS.items()}


@pytest.mark.parametrize(
    "compiler",
    [
        ["gcc", "-std=c99"],
        ["gcc", "-std=c11", "-O2"],
        ["g++", "-x", "c++", "-std=c++11"],
        ["g++", "-x", "c++", "-std=c++17", "-O2"],
    ],
    ids=" ".join,
)
def test_it_builds_as_c_and_as_cpp_without_a_warning(compiler: list[str], tmp_path: Path) -> None:
    compile_c(compiler, HERE / "exercise.c", tmp_path / "exercise")


def test_it_builds_for_32_bits_without_a_warning(tmp_path: Path) -> None:
    (tmp_path / "probe.c").write_text("#include <stdint.h>\nint main(void) { return 0; }\n")
    gcc = [require("gcc"), "-m32"]
    probe = subprocess.run(
        [*gcc, "-o", str(tmp_path / "probe"), str(tmp_path / "probe.c")], capture_output=True
    )
    if probe.returncode:
        pytest.skip("needs a 32-bit compiler (gcc-multilib)")
    compile_c(["gcc", "-m32", "-std=c99"], HERE / "exercise.c", tmp_path / "exercise")


def test_it_uses_only_what_signal_handlers_may(tmp_path: Path) -> None:
    objects = tmp_path / "vbus.o"
    subprocess.run(
        [require("gcc"), "-std=c99", *WARNINGS, "-fno-stack-protector", "-c", "-o", str(objects),
         f"{include_dir()}/vbus.c"],
        check=True,
    )  # fmt: skip
    done = subprocess.run(
        [require("nm"), "-u", str(objects)], capture_output=True, text=True, check=True
    )
    used = {line.split()[-1] for line in done.stdout.splitlines()}
    # POSIX.1-2017, 2.4.3: functions that are async-signal-safe; poll since POSIX.1-2008.
    safe = {
        "access", "clock_gettime", "close", "connect", "fcntl", "getsockopt", "memcpy", "memset",
        "open", "poll", "read", "recv", "send", "setsockopt", "socket", "strchr", "strcmp",
        "strlen", "strncmp", "strrchr", "tcgetattr", "tcsetattr", "write", "__errno_location",
        "_GLOBAL_OFFSET_TABLE_", "flock", "sched_yield",  # system calls, no more; vbus.h names them
    }  # fmt: skip
    assert used <= safe


# -- what it does ----------------------------------------------------------------------------------

CALLS = """
    read 0  write 0 1e  write 80 55  wait 64  read 1  read 80  reads 1 3  writes 1 ab
    select 2  lines b 8  drive 55  sample  release  pin 0 0  getpin 1  echo 5a
    claim  unclaim  delay 64  now  at 3e8  sync
"""
PRINTED = """\
read 1
write 0
write 0
wait 1 at 18000000
read 13
read 83
reads 0 15 16 17
writes 0
select 0
lines 0
drive 0
sample 84 1
release 0
pin 0
getpin 1
echo 5a
claim 0
unclaim 0
delay 0
now 0 at 125000000
at 0
sync 0 1 until 18446744073709551615
"""
CALLED = [
    ("read", 0), ("write", 0, 0x1E), ("write", 0x80, 0x55), ("wait", 100_000_000), ("read", 1),
    ("read", 0x80), ("read", 1), ("read", 1), ("read", 1), ("write", 1, 0x61), ("write", 1, 0x62),
    ("select", 2), ("lines", 0xB, 8), ("drive", 0x55), ("sample",), ("release",), ("pin", 0, 0),
    ("getpin", 1), ("claim",), ("unclaim",), ("delay", 100_000_000), ("at", 1_000_000_000),
    ("sync",),
]  # fmt: skip


def test_every_call_over_every_kind_of_link(served: Served, exercise: Path) -> None:
    assert run(exercise, served.where, CALLS) == PRINTED.splitlines()
    assert served.port.calls == CALLED


def test_the_path_of_a_pty_is_enough(exercise: Path, tmp_path: Path) -> None:
    with Served("pty", tmp_path) as board:
        assert run(exercise, board.where.removeprefix("pty:"), "echo 7") == ["echo 7"]


def test_localhost_is_a_tcp_address(exercise: Path, tmp_path: Path) -> None:
    with Served("tcp", tmp_path) as board:
        where = board.where.replace("127.0.0.1", "localhost")
        assert run(exercise, where, "echo 7") == ["echo 7"]


def test_any_descriptor_will_do(exercise: Path, tmp_path: Path) -> None:
    with Served("unix", tmp_path) as board, socket.socket(socket.AF_UNIX) as link:
        link.connect(board.where.removeprefix("unix:"))
        for blocking in (True, False):
            os.set_blocking(link.fileno(), blocking)
            done = subprocess.run(
                [str(exercise), f"fd:{link.fileno()}", "write", "0", "1", "read", "0", "echo", "7"],
                pass_fds=[link.fileno()], capture_output=True, text=True,
            )  # fmt: skip
            assert done.stdout.splitlines()[-1] == "echo 7"


def test_all_256_values_pass_a_pty_that_was_left_cooked(exercise: Path, tmp_path: Path) -> None:
    with Served("pty", tmp_path) as board:
        board.cook()
        board.port.answers[1] = list(range(256))
        writes = " ".join(f"write 1 {value:x}" for value in range(256))
        printed = run(exercise, board.where, f"reads 1 ff read 1 {writes} echo 0")
        assert printed[0] == "reads 0 " + " ".join(f"{value:02x}" for value in range(255))
        assert printed[1] == "read ff"
        written = [call[2] for call in board.port.calls if call[0] == "write"]
        assert written == list(range(256))


def test_buffered_requests_travel_with_the_next_read(exercise: Path) -> None:
    calls = "buffer write 0 1 write 1 2 pin 0 1 read 1 write 1 3 write 1 4 flush write 1 5"
    # A socket that keeps messages apart shows what travels together.
    ours, theirs = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
    with ours, theirs:
        host = subprocess.Popen(
            [str(exercise), f"fd:{theirs.fileno()}", *calls.split()],
            pass_fds=[theirs.fileno()], stdout=subprocess.DEVNULL,
        )  # fmt: skip
        assert ours.recv(100).hex() == "2001210244000111"
        ours.send(b"D\x01")
        assert ours.recv(100).hex() == "21032104"
        assert ours.recv(100).hex() == "2105"
        assert host.wait() == 0


def test_more_than_the_buffer_holds_is_sent_in_time(exercise: Path, board: Served) -> None:
    run(exercise, board.where, "buffer " + "writes 1 " + "x" * 255 + (" writes 1 " + "y" * 255) * 4
        + " echo 1")  # fmt: skip
    written = [call[2] for call in board.port.calls]
    assert written == [ord("x")] * 255 + [ord("y")] * 1020


def test_64_reads_travel_in_one_message(exercise: Path, board: Served) -> None:
    printed = run(exercise, board.where, "buffer " + "ask 0 " * 65 + "read 0 " + "take " * 65)
    assert printed[1:65] == ["ask 0"] * 64
    order = "replies that were asked for must be taken first; at most 64 may wait"
    assert printed[65:67] == [f"ask: {order}", f"read: {order}"]
    assert printed[67:131] == [f"take {value:x}" for value in range(1, 65)]
    assert printed[131] == f"take: {order}"
    assert board.messages == [b"\x10" * 64]


def test_names_have_numbers(exercise: Path, board: Served) -> None:
    calls = (
        "number pins x./RST number pins y.HI number pins /RST number lines /RD number chips y"
        " number outputs nothing number nothing x number chips z echo 1"
    )
    name = "number: no such name, or several chips have it"
    assert run(exercise, board.where, calls) == [
        "number 0", "number 3", name, "number 2", "number 1", name, name, name, "echo 1",
    ]  # fmt: skip


def test_a_short_name_will_do_where_one_chip_has_it(
    exercise: Path, board: Served, monkeypatch: pytest.MonkeyPatch
) -> None:
    info = board.port.info()
    info.pins = ["x" * 200, "x.HI", "y./RST"] + [f"z.P{n}" for n in range(70_000 // 100)]
    monkeypatch.setattr(board.port, "info", lambda: info)
    calls = "number pins HI number pins /RST number pins P699 number pins z.P42 echo 1"
    assert run(exercise, board.where, calls) == [
        "number 1", "number 2", "number 2be", "number 2d", "echo 1",
    ]  # fmt: skip


def test_hello_gives_its_length_and_what_fits(exercise: Path, board: Served) -> None:
    board.port.calls.clear()
    hello, echo = run(exercise, board.where, "hello echo 1")
    assert re.fullmatch(r"hello [0-9a-f]+ version", hello)
    assert echo == "echo 1"


def test_events_are_called_back_between_replies_or_waited_for(
    exercise: Path, board: Served
) -> None:
    calls = "events 1 write 0 1 read 0 event 0 write 0 1 event 1388 echo 2"
    assert run(exercise, board.where, calls) == [
        "events 0", "write 0", "event 1 at 1000000", "read 1", "event 0", "write 0",
        "event 0 at 3000000", "event 1", "echo 2",
    ]  # fmt: skip


# -- when things go wrong --------------------------------------------------------------------------


def test_a_refused_read_is_told_and_the_session_goes_on(exercise: Path, board: Served) -> None:
    assert run(exercise, board.where, "read 0 read ee refused getpin 9 refused read 0") == [
        "read 1", "read: refused: no such line, pin, chip or address", "refused 1",
        "getpin: refused: no such line, pin, chip or address", "refused 2", "read 2",
    ]  # fmt: skip


def test_a_refused_write_is_told_by_the_next_call_that_waits(exercise: Path, board: Served) -> None:
    assert run(exercise, board.where, "at 5 at 4 write 0 1 read 0 refused read 0") == [
        "at 0", "at 0", "write 0",
        "read: refused: AT before the last AT, on a board that is not slaved, or past the end of"
        " time",
        "refused 1",
        "read 2",
    ]  # fmt: skip


def test_a_refused_write_in_front_of_a_read_asked_for_earlier(
    exercise: Path, board: Served
) -> None:
    calls = "buffer ask 0 write ee 0 ask 0 take take refused echo 1"
    assert run(exercise, board.where, calls)[4:] == [
        "take 1", "take: refused: no such line, pin, chip or address", "refused 1", "echo 1",
    ]  # fmt: skip


def test_no_reply_in_time_ends_the_session(exercise: Path, board: Served) -> None:
    board.mute = True
    late = "no reply in time; is the board running? open the session anew"
    assert run(exercise, board.where, "timeout 14 read 0 write 0 1 read 0") == [
        "timeout 0", f"read: {late}", f"write: {late}", f"read: {late}",
    ]  # fmt: skip


@pytest.mark.parametrize("answered", [True, False])
def test_a_pause_is_waited_out(exercise: Path, tmp_path: Path, answered: bool) -> None:
    mark = tmp_path / ".bus.paused"
    with socket.socket(socket.AF_UNIX) as listener:
        listener.bind(str(tmp_path / "bus"))
        listener.listen()
        mark.touch()
        command = [str(exercise), f"unix:{tmp_path}/bus", "timeout", "14", "read", "0"]
        with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as host:
            connection, _ = listener.accept()
            with connection:
                assert connection.recv(1) == b"\x10"
                with pytest.raises(subprocess.TimeoutExpired):
                    host.wait(0.3)
                if answered:
                    connection.sendall(b"D\x05")
                mark.unlink()
                said, _ = host.communicate(timeout=60)
    late = "read: no reply in time; is the board running? open the session anew"
    assert said.splitlines() == ["timeout 0", "read 5" if answered else late]


def test_time_that_a_request_lets_pass_is_waited_for(exercise: Path, board: Served) -> None:
    # Without the 10 ms and more of the delay the time-out of 0 would strike at once.
    assert run(exercise, board.where, "timeout 0 delay 2625a0 echo 1")[-1] == "echo 1"


def test_a_board_that_goes_away_is_told(served: Served, exercise: Path) -> None:
    with subprocess.Popen(
        [str(exercise), served.where, *["read", "0", "pause", "read", "0", "write", "0", "0"]],
        stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True,
    ) as host:  # fmt: skip
        assert host.stdin is not None
        assert host.stdout is not None
        assert host.stdout.readline() == "read 1\n"
        served.stop()
        host.stdin.write("\n")
        host.stdin.flush()
        gone = "the board has closed the link"
        assert host.stdout.read().splitlines() == ["pause a", f"read: {gone}", f"write: {gone}"]


def test_what_is_no_reply_ends_the_session(exercise: Path) -> None:
    ours, theirs = socket.socketpair()
    with ours, theirs:
        ours.sendall(b"error: unknown request\n")
        done = subprocess.run(
            [str(exercise), f"fd:{theirs.fileno()}", "read", "0", "read", "0"],
            pass_fds=[theirs.fileno()], capture_output=True, text=True,
        )  # fmt: skip
    no = "read: what came is no reply of the byte protocol; is it this link's protocol?"
    assert done.stdout.splitlines() == [no, no]


@pytest.mark.parametrize(
    "call", ["read 100", "write 0 100", "write 100 0", "reads 0 0", "reads 0 100", "select 10000",
             "lines 10000 0", "drive 100", "pin 0 3", "pin 100 0", "getpin 100", "echo 100",
             "ask 100"],
)  # fmt: skip
def test_an_argument_out_of_range_sends_nothing(exercise: Path, board: Served, call: str) -> None:
    name = call.split()[0]
    assert run(exercise, board.where, f"{call} echo 1") == [
        f"{name}: an argument is out of range; nothing was sent", "echo 1",
    ]  # fmt: skip
    assert board.messages == [b"\x02\x01"]


@pytest.mark.parametrize(
    ("where", "message"),
    [
        ("pty:{}/none", "No such file or directory"),
        ("{}/plain", "Inappropriate ioctl for device"),
        ("unix:{}/none", "No such file or directory"),
        ("unix:{}/plain", "Connection refused"),
    ],
)
def test_a_link_that_cannot_be_opened_says_why(
    exercise: Path, tmp_path: Path, where: str, message: str
) -> None:
    (tmp_path / "plain").touch()
    assert run(exercise, where.format(tmp_path), "") == [
        f"a system call failed (see errno in vbus.system): {message}"
    ]


@pytest.mark.parametrize(
    "where", ["unset", "bench", "usb:1", "tcp:host:1", "tcp:1.2.3:4", "tcp:1.2.3.4",
              "tcp:1.2.3.256:4", "tcp:1.2.3.4:65536", "tcp:1.2.3.4:5x", "tcp:localhost",
              "unix:/" + "x" * 200],
)  # fmt: skip
def test_what_is_no_link_is_refused(exercise: Path, where: str) -> None:
    assert run(exercise, where, "") == [
        "not a link; allowed are pty:PATH, unix:PATH, tcp:ADDRESS:PORT (numeric)"
    ]
