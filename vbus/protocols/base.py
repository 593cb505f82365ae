"""What a protocol is: bytes in, calls on a port, bytes out."""

from typing import ClassVar

from mypy_extensions import mypyc_attr

from vbus.core.state import Names
from vbus.protocols.port import HostPort


@mypyc_attr(allow_interpreted_subclasses=True)
class Protocol:
    """Base of wire formats, free of I/O.

    A session feeds bytes as they came, in pieces of any size, and takes what is to be sent.
    The result does not depend on how the bytes were cut.

    When a request has to wait (``port.held``), the protocol keeps it and everything after it;
    the session calls :meth:`resume` when the wait may be over.
    """

    NO_ROOM: ClassVar[bytes] = b""
    """The bytes a host gets in place of an answer when the board can take no more hosts."""
    STATE: ClassVar[Names] = ()
    """What stands between this request and the next: half of one, counts, promises. Bytes not yet
    sent are no part of it."""
    WIRING: ClassVar[Names] = ("out",)

    def __init__(self, port: HostPort) -> None:
        self.port: HostPort = port
        self.out: bytearray = bytearray()

    def receive(self, data: bytes) -> None:
        """Take bytes from the host; carry out every request now complete."""
        raise NotImplementedError

    def resume(self) -> None:
        """Go on after a wait."""
        self.receive(b"")

    def report_events(self) -> None:
        """Append what the port's watched lines did since the last call, if the host asked."""

    def tell_pause(self, paused: bool) -> None:
        """Append that the board is paused or goes on, if the host asked for such reports."""

    def reset(self) -> None:
        """Forget half a request: a session has ended or begun."""
        raise NotImplementedError

    def half(self) -> int:
        """Return of how many bytes the request is that has begun and is not whole; 0: of none.

        Asked where the host sends no more, while the port is not held.
        """
        return 0

    def awaited(self) -> bool:
        """Tell whether the host has sent anything behind the request that waits for time.

        Asked while the port is held: where time runs of itself, nothing is lost with a wait that
        nothing stands behind.
        """
        return True

    def take(self) -> bytes:
        """Return and forget the bytes that are to be sent."""
        data = bytes(self.out)
        self.out.clear()
        return data
