"""Faults of running boards: through ``vbus fault``, and on links that a host really uses."""

import json
import os
import select
import socket
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

from tests.e2e.command import vbus
from tests.e2e.serving import served
from tests.e2e.test_pty import PTY, open_raw, read_exactly, toy_board
from tests.waiting import until
from vbus.board.board import Board
from vbus.board.build import load_board_text
from vbus.core.errors import TransportError, VbusError
from vbus.serve.registry import order
from vbus.serve.server import LinkSpec, Server

BOARD = """\
[board]
name = "bench"
time = "lockstep"
power_on = "done"
[chips.x]
part = "LM629N-8"
clock = "8 MHz"
plant = "m"
[plants.m]
model = "dc_motor"
"""

PATIENT = 60.0
SHORT = 0.3
"""For what must not come."""


def board() -> Board:
    return load_board_text(BOARD)


@contextmanager
def host(path: Path) -> Iterator[socket.socket]:
    with socket.socket(socket.AF_UNIX, socket.SOCK_STREAM) as link:
        link.settimeout(PATIENT)
        link.connect(str(path))
        yield link


def line(link: socket.socket) -> str:
    got = b""
    while not got.endswith(b"\n"):
        got += link.recv(1)
    return got.decode().strip()


def ask(link: socket.socket, text: str) -> str:
    link.sendall(f"{text}\n".encode())
    return line(link)


def silent(link: socket.socket) -> bool:
    link.settimeout(SHORT)
    try:
        return not link.recv(100)
    except TimeoutError:
        return True
    finally:
        link.settimeout(PATIENT)


@contextmanager
def running(tmp_path: Path) -> Iterator[tuple[Server, Path]]:
    path = tmp_path / "host"
    with served(board(), LinkSpec(f"unix:{path}", "text")) as server:
        yield server, path


def test_an_answer_is_lost_after_its_effect(tmp_path: Path) -> None:
    with running(tmp_path) as (server, path), host(path) as link:
        status = ask(link, "r 0")
        order("bench", "fault.arm", name="answer_lost", when="cycle 1")
        writes = server.board.chips[0].writes
        ask(link, "w 0 0")
        link.sendall(b"w 0 0\n")
        assert silent(link)
        until(lambda: server.board.chips[0].writes == writes + 2, "the effect")
        assert ask(link, "r 0") == status.replace("84", "01")


def test_late_answers_come_all_at_once(tmp_path: Path) -> None:
    with running(tmp_path) as (_, path), host(path) as link:
        usual = ask(link, "r 0")
        order("bench", "fault.arm", name="answers_late")
        link.sendall(b"r 0\nr 0\nr 0\n")
        assert silent(link)
        order("bench", "fault.clear")
        assert [line(link) for _ in range(3)] == [usual] * 3


def test_half_an_answer_then_silence(tmp_path: Path) -> None:
    with running(tmp_path) as (_, path), host(path) as link:
        usual = ask(link, "r 0").encode() + b"\n"
        order("bench", "fault.arm", name="half_answer")
        link.sendall(b"r 0\n")
        assert link.recv(100) == usual[: len(usual) // 2]
        link.sendall(b"r 0\n")
        assert silent(link)
        order("bench", "fault.clear", which="half_answer")
        assert ask(link, "r 0").encode() + b"\n" == usual


def test_a_closed_link_is_closed_and_can_be_opened_again(tmp_path: Path) -> None:
    with running(tmp_path) as (_, path):
        with host(path) as link:
            ask(link, "r 0")
            order("bench", "fault.arm", name="link_closed", target="host0")
            assert link.recv(1) == b""
        with host(path) as link:
            assert ask(link, "r 0")


def test_a_closed_terminal_hangs_up_on_its_client_and_its_name_leads_to_a_new_one(
    runtime: Path,
) -> None:
    with served(toy_board(), PTY):
        fd = open_raw(runtime / "x")
        os.write(fd, b"\x02\x01")
        assert read_exactly(fd, 2) == b"E\x01"
        mine = os.ttyname(fd)
        order("bench", "fault.arm", name="link_closed", target="host0")
        until(lambda: select.select([fd], [], [], 0)[0], "a hang-up")
        with pytest.raises(OSError, match="Input/output error"):
            os.write(fd, b"\x02\x02")
        os.close(fd)
        assert os.readlink(runtime / "x") != mine
        fd = open_raw(runtime / "x")
        os.write(fd, b"\x02\x03")
        assert read_exactly(fd, 2) == b"E\x03"
        os.close(fd)


def test_a_dead_link_is_open_and_carries_out_what_it_was_told_afterwards(tmp_path: Path) -> None:
    with running(tmp_path) as (server, path), host(path) as link:
        usual = ask(link, "r 0")
        order("bench", "fault.arm", name="link_dead")
        reads = server.board.chips[0].reads
        link.sendall(b"r 0\n")
        assert silent(link)
        assert server.board.chips[0].reads == reads
        with host(path) as other:
            other.sendall(b"r 0\n")
            assert silent(other)
            order("bench", "fault.clear")
            assert line(link) == usual
            assert line(other) == usual


def test_faults_of_one_link_end_one_after_the_other(tmp_path: Path) -> None:
    with running(tmp_path) as (_, path), host(path) as link:
        usual = ask(link, "r 0")
        dead = [order("bench", "fault.arm", name="link_dead")["number"] for _ in range(2)]
        order("bench", "fault.arm", name="answers_late")
        link.sendall(b"r 0\n")
        order("bench", "fault.clear", which=dead[0])
        order("bench", "fault.clear", which="answers_late")
        assert silent(link)
        order("bench", "fault.clear", which=dead[1])
        assert line(link) == usual


def test_a_link_fault_that_cannot_act_says_why(tmp_path: Path) -> None:
    with running(tmp_path):
        order("bench", "fault.arm", name="link_closed", target="host3")
        order("bench", "fault.arm", name="link_closed")
        texts = [entry["text"] for entry in order("bench", "fault.log")]
        assert texts == [
            "there is no link host3: count the [[hosts]] from 0",
            "no host is connected to host0",
        ]


def test_the_command_line_arms_lists_clears_and_shows_the_evidence(tmp_path: Path) -> None:
    with running(tmp_path) as (_, path), host(path) as link:
        armed = vbus("fault", "arm", "bench", "byte_flipped", "mask=0x01", "--when", "cycle 2")
        assert armed.stdout == (
            "#1 byte_flipped x mask=1 cycles=both, when cycle 2, until once: waiting, fired 0"
            " times\n"
        )
        first, second, third = (ask(link, "r 0") for _ in range(3))
        assert first == third != second
        shown = vbus("fault", "log", "bench").stdout
        assert "#1 byte_flipped x: begun; bits 01H of both cycles inverted" in shown
        assert json.loads(vbus("fault", "list", "bench", "--json").stdout)[0]["fired"] == 1
        vbus("fault", "arm", "bench", "jam", "--when", "at 5 s", "--until", "for 10 ms")
        assert "jam x.1" in vbus("fault", "clear", "bench", "jam").stdout
        assert vbus("fault", "clear", "bench").stdout == "nothing waited or acted\n"


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("jamm",), 'bench: there is no fault "jamm"; did you mean "jam"?'),
        (("slip", "shar=1"), 'slip has no "shar"; did you mean "share"?'),
        (("slip", "share=half"), "slip: share = "),
        (("load_step", "torque=5 V"), "unit of a voltage"),
    ],
)
def test_the_command_line_says_what_is_wrong(
    tmp_path: Path, arguments: tuple[str, ...], message: str
) -> None:
    with running(tmp_path):
        done = vbus("fault", "arm", "bench", *arguments)
        assert done.returncode == 1
        assert message in done.stderr


def test_orders_that_make_no_sense_are_refused(tmp_path: Path) -> None:
    with running(tmp_path):
        with pytest.raises(VbusError, match="name' is missing"):
            order("bench", "fault.arm")
        with pytest.raises(VbusError, match="parameters are a JSON object"):
            order("bench", "fault.arm", name="jam", parameters=[1])
        with pytest.raises(VbusError, match="when = "):
            order("bench", "fault.arm", name="jam", when=[1])
        with pytest.raises(VbusError, match='no fault "7" is armed'):
            order("bench", "fault.clear", which=7)
    with pytest.raises(TransportError, match="no board called"):
        order("bench", "fault.list")


def test_the_table_needs_no_board() -> None:
    shown = vbus("fault", "list").stdout
    assert "mechanics:" in shown
    assert "jam" in shown
    assert len(json.loads(vbus("fault", "list", "--json").stdout)) >= 30
