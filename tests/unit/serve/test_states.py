"""Each transition of a session and of a terminal, walked."""

import ast
import inspect
import logging
import os
import select
import socket
from contextlib import suppress
from itertools import pairwise
from typing import NoReturn

import pytest

from tests.unit.serve.test_session import CLAIM, READ, Served, served
from tests.unit.transports.test_pty_clients import Hosts, hosts, loop
from vbus.protocols.byte import ByteProtocol
from vbus.serve.session import Session
from vbus.transports import states
from vbus.transports.sockets import SocketLink
from vbus.transports.states import SESSION, TERMINAL, States

__all__ = ["hosts", "loop"]

UNCLAIM = b"\x05"
ANSWERS = {
    states.BEGIN: True, states.GO_ON: True, states.ROOM: True, states.HOLD: False,
    states.FULL: False,
}  # fmt: skip
"""Whether a host that is there is read and answered after an event, whatever the table says."""
OVER = (states.END, states.DONE, states.GIVE_UP)
"""Events after which the board has no port of the session."""
LEADS = {
    states.BEGIN: states.READING, states.GO_ON: states.READING, states.ROOM: states.READING,
    states.HOLD: states.HELD, states.FULL: states.PAUSED, states.FINISH: states.DRAINING,
    states.GONE: states.LEAVING, states.OPENED: states.OWNED, states.WROTE: states.OWNED,
    states.LEFT: states.OWNED, states.OVER: states.UNUSED,
    **dict.fromkeys((*OVER, states.STOP, states.FREE), states.CLOSED),
}  # fmt: skip
AFTER = {
    (states.LEAVING, states.HOLD): states.DEPARTED, (states.DEPARTED, states.HOLD): states.DEPARTED,
    (states.FRESH, states.OPENED): states.SHARED, (states.FRESH, states.WROTE): states.UNUSED,
    (states.FRESH, states.LEFT): states.UNUSED,
}  # fmt: skip
"""Where an event leads, whatever the table says: from every state, and after some elsewhere."""


def full(fd: int, data: bytearray) -> NoReturn:
    raise BlockingIOError


def broken(fd: int, data: bytearray) -> NoReturn:
    raise BrokenPipeError


class OneSession:
    """A session that is brought to each state, beside another that has claimed the chip."""

    def __init__(self, it: Served) -> None:
        self.it = it
        self.other = it.connect()
        self.other.send(CLAIM)
        it.turn(3)

    def bring_to(self, state: str) -> None:
        near, self.host = socket.socketpair()
        near.setblocking(False)
        self.it.hosts.append(self.host)
        port = self.it.board.open_port("host1")
        self.session = Session(self.it.services, SocketLink(near, "x"), port, ByteProtocol(port))
        self.it.sessions.append(self.session)
        if state == states.NEW:
            return
        self.session.begin()
        self.host.send(b"\x02\x01")  # ECHO
        self.it.turn(2)
        if state == states.HELD:
            self.do(states.HOLD)
        elif state == states.PAUSED:
            self.do(states.FULL)
        elif state == states.DRAINING:
            self.session._write_some = full
            self.host.send(b"\x02\x01")
            self.it.turn(2)
            self.do(states.FINISH)
        elif state == states.LEAVING:
            self.session._write_some = broken
            self.host.send(b"\x02\x01" + CLAIM + READ)
            self.session._readable()
        elif state == states.DEPARTED:
            self.do(states.HOLD)
            self.do(states.GONE)
        assert self.session.state == state

    def do(self, event: str) -> None:
        """Let an event happen."""
        session, it = self.session, self.it
        if event == states.BEGIN:
            session.begin()
        elif event == states.HOLD and session.state == states.READING:
            self.host.send(CLAIM + READ)
        elif event == states.HOLD:
            it.pacer.halt()
            session.hold()
        elif event == states.GO_ON or (event == states.DONE and session.state == states.DEPARTED):
            self.other.send(UNCLAIM)
        elif event == states.FULL:
            session.stop_reading()
        elif event == states.ROOM:
            session.read_again()
        elif event == states.FINISH:
            self.host.shutdown(socket.SHUT_WR)
        elif event == states.GONE:
            self.host.close()
        elif event == states.GIVE_UP:
            it.detached.close()
        elif event == states.END:
            session.end("the board stops")
        it.turn(4)


def moves_of(machine: States, who: str, caplog: pytest.LogCaptureFixture) -> list[object]:
    """Return the transitions that have been logged."""
    told = [record.args for record in caplog.records if record.name == "vbus.states"]
    return [one[2:] for one in told if isinstance(one, tuple) and one[:2] == (who, machine.name)]


@pytest.mark.parametrize(("state", "event", "to"), SESSION.rows)
def test_a_session_goes_from_state_to_state(
    state: str, event: str, to: str, caplog: pytest.LogCaptureFixture
) -> None:
    with served("realtime") as it:
        walker = OneSession(it)
        if (state, event) == (states.LEAVING, states.DONE):
            walker.other.send(UNCLAIM)
            it.turn(3)
        walker.bring_to(state)
        with caplog.at_level(logging.DEBUG, "vbus.states"):
            caplog.clear()
            walker.do(event)
            assert moves_of(SESSION, "x", caplog)[0] == (state, event, to)
            assert to == AFTER.get((state, event), LEADS[event])
        if event in ANSWERS and state not in (states.LEAVING, states.DEPARTED):
            walker.host.setblocking(False)
            walker.host.send(b"\x02\x07")  # ECHO
            it.turn(4)
            answers = b""
            with suppress(BlockingIOError):
                answers = walker.host.recv(4096)
            assert (b"E\x07" in answers) == ANSWERS[event]
            unread, *_ = select.select([walker.session.link.fd], [], [], 0)
            assert bool(unread) != ANSWERS[event]
        if event in OVER:
            assert walker.session.port not in it.board.ports


class OneTerminal:
    """A terminal that is brought to each state."""

    def __init__(self, hosts: Hosts) -> None:
        self.hosts = hosts
        self.terminal = hosts.transport._terminals[0]
        self.open: list[int] = []

    def bring_to(self, state: str) -> None:
        ways = {"shared": ("opened",), "owned": ("opened", "wrote"), "unused": ("wrote", "over")}
        for event in ways.get(state, ()):
            self.do(event)
        assert self.terminal.state == state

    def do(self, event: str) -> None:
        """Let an event happen."""
        transport, terminal = self.hosts.transport, self.terminal
        if event in (states.OPENED, states.WROTE, states.LEFT) and not self.open:
            self.open.append(os.open(terminal.name, os.O_RDWR | os.O_NOCTTY))
        if event == states.WROTE:
            os.write(self.open[0], b"\x10")
        elif event in (states.LEFT, states.OVER):
            os.close(self.open.pop())
        elif event == states.STOP:
            transport.close()
        self.hosts.look()
        if event == states.FREE:
            transport._free_unused(terminal)


@pytest.mark.parametrize(("state", "event", "to"), TERMINAL.rows)
def test_a_terminal_goes_from_state_to_state(
    state: str, event: str, to: str, hosts: Hosts, caplog: pytest.LogCaptureFixture
) -> None:
    walker = OneTerminal(hosts)
    walker.bring_to(state)
    with caplog.at_level(logging.DEBUG, "vbus.states"):
        caplog.clear()
        walker.do(event)
        assert moves_of(TERMINAL, walker.terminal.name, caplog)[0] == (state, event, to)
        assert to == AFTER.get((state, event), LEADS[event])
    if event == states.OPENED:
        terminals = len(hosts.transport._terminals)
        walker.do(states.WROTE)
        assert len(hosts.transport._terminals) == terminals + (state == states.FRESH)
    for one in walker.open:
        os.close(one)


def test_a_transition_that_the_table_does_not_have_is_an_error() -> None:
    with pytest.raises(RuntimeError, match='x: a session that is closed knows no event "begin"'):
        SESSION.after(states.CLOSED, states.BEGIN, "x")


def test_each_state_and_event_is_used_and_described() -> None:
    rows = SESSION.rows + TERMINAL.rows
    # A text constant is described by a docstring behind it.
    described = {
        getattr(states, ast.unparse(line.target))
        for line, doc in pairwise(ast.parse(inspect.getsource(states)).body)
        if isinstance(line, ast.AnnAssign) and isinstance(doc, ast.Expr)
    }
    named = {one for one in described if isinstance(one, str)}
    assert {one for row in rows for one in row} == named
