"""Each transition of a session and of a terminal, walked."""

import logging
import os
import socket
from typing import NoReturn

import pytest

from tests.unit.server.test_session import CLAIM, READ, Served, served
from tests.unit.transports.test_pty_clients import Hosts, hosts, loop
from vbus.protocols.byte import ByteProtocol
from vbus.server.session import Session
from vbus.transports.sockets import SocketLink
from vbus.transports.states import (
    BEGIN,
    CLOSED,
    DEPARTED,
    DONE,
    DRAINING,
    END,
    EVENTS,
    FINISH,
    FREE,
    FULL,
    GIVE_UP,
    GO_ON,
    GONE,
    HELD,
    HOLD,
    LEAVING,
    LEFT,
    NEW,
    OPENED,
    OVER,
    OWNED,
    PAUSED,
    READING,
    ROOM,
    SESSION,
    SHARED,
    STATES,
    STOP,
    TERMINAL,
    UNUSED,
    WROTE,
    Machine,
)

__all__ = ["hosts", "loop"]

UNCLAIM = b"\x05"


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
        self.session = Session(self.it.serving, SocketLink(near, "x"), port, ByteProtocol(port))
        self.it.sessions.append(self.session)
        if state == NEW:
            return
        self.session.begin()
        self.host.send(b"\x02\x01")  # ECHO
        self.it.turn(2)
        if state == HELD:
            self.do(HOLD)
        elif state == PAUSED:
            self.do(FULL)
        elif state == DRAINING:
            self.session._write_some = full
            self.host.send(b"\x02\x01")
            self.it.turn(2)
            self.do(FINISH)
        elif state == LEAVING:
            self.session._write_some = broken
            self.host.send(b"\x02\x01" + CLAIM + READ)
            self.session._readable()
        elif state == DEPARTED:
            self.do(HOLD)
            self.do(GONE)
        assert self.session.state == state

    def do(self, event: str) -> None:
        """Let an event happen."""
        session, it = self.session, self.it
        if event == BEGIN:
            session.begin()
        elif event == HOLD and session.state == READING:
            self.host.send(CLAIM + READ)
        elif event == HOLD:
            it.pacer.halt()
            session.hold()
        elif event == GO_ON or (event == DONE and session.state == DEPARTED):
            self.other.send(UNCLAIM)
        elif event == FULL:
            session.stop_reading()
        elif event == ROOM:
            session.read_again()
        elif event == FINISH:
            self.host.shutdown(socket.SHUT_WR)
        elif event == GONE:
            self.host.close()
        elif event == GIVE_UP:
            it.departures.close()
        elif event == END:
            session.end("the board stops")
        it.turn(4)


def moves_of(machine: Machine, who: str, caplog: pytest.LogCaptureFixture) -> list[object]:
    """Return the transitions that have been logged."""
    told = [record.args for record in caplog.records if record.name == "vbus.states"]
    return [one[2:] for one in told if isinstance(one, tuple) and one[:2] == (who, machine.name)]


@pytest.mark.parametrize(("state", "event", "to"), SESSION.rows)
def test_a_session_goes_from_state_to_state(
    state: str, event: str, to: str, caplog: pytest.LogCaptureFixture
) -> None:
    with served("realtime") as it:
        walker = OneSession(it)
        if (state, event) == (LEAVING, DONE):
            walker.other.send(UNCLAIM)
            it.turn(3)
        walker.bring_to(state)
        with caplog.at_level(logging.DEBUG, "vbus.states"):
            caplog.clear()
            walker.do(event)
            assert moves_of(SESSION, "x", caplog)[0] == (state, event, to)


class OneTerminal:
    """A terminal that is brought to each state."""

    def __init__(self, hosts: Hosts) -> None:
        self.hosts = hosts
        self.terminal = hosts.transport._terminals[0]
        self.open: list[int] = []

    def bring_to(self, state: str) -> None:
        for event in {SHARED: (OPENED,), OWNED: (OPENED, WROTE), UNUSED: (WROTE, OVER)}.get(
            state, ()
        ):
            self.do(event)
        assert self.terminal.state == state

    def do(self, event: str) -> None:
        """Let an event happen."""
        transport, terminal = self.hosts.transport, self.terminal
        if event in (OPENED, WROTE, LEFT) and not self.open:
            self.open.append(os.open(terminal.name, os.O_RDWR | os.O_NOCTTY))
        if event == WROTE:
            os.write(self.open[0], b"\x10")
        elif event in (LEFT, OVER):
            os.close(self.open.pop())
        elif event == STOP:
            transport.close()
        self.hosts.look()
        if event == FREE:
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
    for one in walker.open:
        os.close(one)


def test_a_transition_that_the_table_does_not_have_is_an_error() -> None:
    with pytest.raises(RuntimeError, match='x: a session that is closed knows no event "begin"'):
        SESSION.after(CLOSED, BEGIN, "x")


def test_each_state_and_event_is_used_and_described() -> None:
    rows = SESSION.rows + TERMINAL.rows
    assert {one for state, _, to in rows for one in (state, to)} == set(STATES)
    assert {event for _, event, _ in rows} == set(EVENTS)
