"""The byte protocol inside frames, for real serial lines: they lose bytes and know no sessions."""

from typing import ClassVar

from vbus.core.state import Names
from vbus.protocols.base import Protocol
from vbus.protocols.byte import ByteProtocol
from vbus.protocols.frames import EVENT, FrameReader, frames
from vbus.protocols.port import HostPort


class FramedProtocol(Protocol):
    """Requests of the byte protocol, each frame holding whole requests; board's end.

    * Every good frame is answered by at least one frame with its sequence byte (0 to 127); the
      reply's bytes run on over as many frames as they need, and an empty frame says there are
      none. Damaged frames are not answered: the host repeats what was not answered in time.
    * A frame with the sequence byte of the frame before it is a repeat. Its requests are not
      carried out again; the same answer is sent once more.
    * An empty frame starts a new session: requests are counted from 0, events are off, the first
      chip is selected, no bus is claimed. Hosts begin with it.
    * A refusal ends with its frame, because the next one starts with a request again. Half a
      request at the end of a frame is refused as a bad length.
    * An event during a request stands before its reply, as ever. Events between requests come in
      frames of their own, whose sequence byte has bit 7 set; they are not repeated.
    """

    STATE: ClassVar[Names] = (
        "_inner: part", "_reader: part", "_sequence", "_busy: bool", "_answer: bytes[...]",
    )  # fmt: skip

    def __init__(self, port: HostPort) -> None:
        super().__init__(port)
        self._inner: ByteProtocol = ByteProtocol(port)
        self._reader: FrameReader = FrameReader()
        self.reset()

    def reset(self) -> None:
        """Forget half a frame, the last answer and the request count."""
        self._reader.clear()
        self.out.clear()
        self._start_session()

    def _start_session(self) -> None:
        self._inner.reset()
        self._sequence: int = -1
        self._busy: bool = False
        self._answer: bytes = b""

    def half(self) -> int:
        """Return how many bytes of a frame wait for the rest of it."""
        return len(self._reader)

    def awaited(self) -> bool:
        """Tell whether requests of its frame, or frames, have come behind the one that waits."""
        return bool(len(self._reader)) or self._inner.awaited()

    def receive(self, data: bytes) -> None:
        """Take bytes from the host; carry out the requests of every frame now complete."""
        self._reader.feed(data)
        if not self.port.held:
            self._go_on()

    def _go_on(self) -> None:
        while True:
            if self._busy:
                self._inner.resume()
                if not self._inner.finish():
                    return
                self._busy = False
                self._answer = frames(self._sequence, self._inner.take())
                self.out += self._answer
            found = self._reader.next()
            if found is None:
                return
            self._begin(*found)

    def _begin(self, sequence: int, payload: bytes) -> None:
        if sequence & EVENT:
            return
        if not payload:
            self.port.events(0)
            self.port.unclaim()
            if self.port.info().chips:
                self.port.select(1)
            self._start_session()
            self.out += frames(sequence, b"")
        elif sequence == self._sequence:
            self.out += self._answer
        else:
            self._sequence = sequence
            self._busy = True
            self._inner.receive(payload)

    def report_events(self) -> None:
        """Send what the watched lines did since the last call, if the host asked."""
        self._inner.report_events()
        if not self._busy:
            events = self._inner.take()
            if events:
                self.out += frames(EVENT | max(self._sequence, 0), events)
