"""The states of a session and of a terminal, and the events that lead from one to another.

The server runs by :data:`SESSION` and :data:`TERMINAL`; ARCHITECTURE.md draws them. A host comes
and goes by both: where a generation of clients of a terminal ends, its session has the event
:data:`GONE`.
"""

import logging
from typing import Final

NEW: Final = "new"
"""The session is made, and its link not served yet."""
READING: Final = "reading"
"""What comes is read and carried out."""
HELD: Final = "held"
"""A request waits for an instant, for the claim of another host, or for time to go on; nothing
is read."""
PAUSED: Final = "paused"
"""Nothing is read: the host takes no answers, or a fault stops the server from reading."""
DRAINING: Final = "draining"
"""The host sends no more, and still takes its answers."""
LEAVING: Final = "leaving"
"""The host has gone; the rest of what it had sent is read and carried out."""
DEPARTED: Final = "departed"
"""The link is closed; what the host had sent waits for an instant or a claim."""
CLOSED: Final = "closed"
"""The end."""

UNREAD: Final = (HELD, PAUSED, DRAINING)
"""While nothing is read, a host that goes is noticed by its descriptor alone."""

FRESH: Final = "fresh"
"""The name leads to the terminal, and it has no session."""
SHARED: Final = "shared"
"""The name leads to it; its clients, and those that open the name, have one session."""
OWNED: Final = "owned"
"""The name leads to the next terminal; the session is that of the clients that are here."""
UNUSED: Final = "unused"
"""The name leads to the next terminal, and there is no session."""

BEGIN: Final = "begin"
"""The server lets the host in: at once, or when time has passed for those that have gone."""
HOLD: Final = "hold"
"""A request (DELAY, WAIT, CLAIM, a time stamp ahead) cannot finish now, or time is paused."""
GO_ON: Final = "go on"
"""The instant has come, the claim has ended, or time goes on, in a step or for good."""
FULL: Final = "full"
"""Too many answers wait for the host, or a fault begins."""
ROOM: Final = "room"
"""Neither is so any more."""
FINISH: Final = "finish"
"""The end of what the host sends: it has closed its half of the link."""
GONE: Final = "gone"
"""The link is hung up, reset or closed; a terminal's clients have gone; all is sent."""
DONE: Final = "done"
"""Nothing is left to be carried out, or an error has ended that."""
GIVE_UP: Final = "give up"
"""Another host waits to be let in, others go on in real time, or the board stops."""
END: Final = "end"
"""The server ends the session: a fault, an error, the board stops."""

OPENED: Final = "opened"
"""A client has the terminal open: a session begins."""
WROTE: Final = "wrote"
"""The first byte has come: the name leads to a new terminal before the byte is read."""
LEFT: Final = "left"
"""The clients have written nothing, and have gone or are hung up on: the name leads to a new
terminal."""
OVER: Final = "over"
"""The session has ended."""
FREE: Final = "free"
"""No client has it open, or they are hung up on."""
STOP: Final = "stop"
"""The transport is closed."""

log = logging.getLogger("vbus.states")


class States:
    """States, and which event leads from which to which.

    Args:
        name: what has the states.
        rows: state, event and next state of each transition.
    """

    def __init__(self, name: str, *rows: tuple[str, str, str]) -> None:
        self.name: str = name
        self.rows: tuple[tuple[str, str, str], ...] = rows
        self._next: dict[tuple[str, str], str] = {(state, event): to for state, event, to in rows}

    def after(self, state: str, event: str, who: str) -> str:
        """Return the state after an event.

        Args:
            state: the state before.
            event: the event.
            who: what has the state, for the log.

        Raises:
            RuntimeError: the table has no such transition.
        """
        to = self._next.get((state, event))
        if to is None:
            raise RuntimeError(f'{who}: a {self.name} that is {state} knows no event "{event}"')
        log.debug("%s: %s: %s, %s, %s", who, self.name, state, event, to)
        return to


SESSION: Final = States(
    "session",
    (NEW, BEGIN, READING),
    (READING, HOLD, HELD),
    (READING, FULL, PAUSED),
    (READING, FINISH, DRAINING),
    (READING, GONE, LEAVING),
    (READING, END, CLOSED),
    (HELD, HOLD, HELD),
    (HELD, GO_ON, READING),
    (HELD, GONE, LEAVING),
    (HELD, END, CLOSED),
    (PAUSED, HOLD, HELD),
    (PAUSED, ROOM, READING),
    (PAUSED, GONE, LEAVING),
    (PAUSED, END, CLOSED),
    (DRAINING, GONE, LEAVING),
    (DRAINING, END, CLOSED),
    (LEAVING, HOLD, DEPARTED),
    (LEAVING, DONE, CLOSED),
    (DEPARTED, HOLD, DEPARTED),
    (DEPARTED, DONE, CLOSED),
    (DEPARTED, GIVE_UP, CLOSED),
)  # fmt: skip
"""One connected host: see :class:`vbus.serve.session.Session`."""

TERMINAL: Final = States(
    "terminal",
    (FRESH, OPENED, SHARED),
    (FRESH, WROTE, UNUSED),
    (FRESH, LEFT, UNUSED),
    (FRESH, STOP, CLOSED),
    (SHARED, WROTE, OWNED),
    (SHARED, LEFT, OWNED),
    (SHARED, STOP, CLOSED),
    (OWNED, OVER, UNUSED),
    (OWNED, STOP, CLOSED),
    (UNUSED, OPENED, OWNED),
    (UNUSED, FREE, CLOSED),
    (UNUSED, STOP, CLOSED),
)  # fmt: skip
"""One generation of clients of a terminal: see :class:`vbus.transports.pty.PtyTransport`."""
