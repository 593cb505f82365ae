"""A serial line between a host and a wire format: each byte takes its time, in chip time."""

from typing import ClassVar, Final

from msgspec import Struct

from vbus.core.instants import SECOND
from vbus.core.state import Names
from vbus.protocols.base import Protocol
from vbus.protocols.port import HostPort, PortError

FRAMES: Final = {"8N1": 10, "8E1": 11, "8O1": 11, "8N2": 11, "8E2": 12, "8O2": 12}
"""Bits of a frame, by its usual name: a start bit, eight of data, parity or none, stop bits."""
USUAL_FRAME: Final = "8N1"

MARK: Final = 0xFF
"""Begins a mark in what comes over a link that has modem lines: :func:`marked`."""
DTR: Final = 1
RTS: Final = 2
BREAK: Final = 4


def frame_ps(baud: int, frame: str) -> int:
    """Return how long one byte takes: its last bit's edge, rounded from the frame's start (ps)."""
    return (2 * FRAMES[frame] * SECOND + baud) // (2 * baud)


def marked(data: bytes) -> bytes:
    """Return bytes of a host as they stand beside marks: the byte FF is FF FF."""
    return data.replace(b"\xff", b"\xff\xff")


def mark(lines: int) -> bytes:
    """Return what stands among the host's bytes where its lines change: FF, and which are on."""
    return bytes((MARK, lines))


class ModemPins(Struct, frozen=True):
    """Side pins of a session that follow the lines of its host; low while a line is on.

    Attributes:
        lines: the pins of DTR, RTS and break, each with the bit of its line.
        reset: pins pulled low for a time when DTR goes on.
        change_ps: how long a change of a line takes, and those pins are low.
    """

    lines: tuple[tuple[int, int], ...]
    reset: tuple[int, ...]
    change_ps: int

    def follow(self, changed: int) -> bool:
        """Tell whether a pin follows one of these lines."""
        return bool(self.reset and changed & DTR) or any(bit & changed for bit, _ in self.lines)


class SerialLine(Protocol):
    """A wire format at the end of a serial line.

    A byte of the host reaches the wire format when its frame has ended; a byte of the answer
    reaches the host when its own has. On boards in real time both directions are under way at
    once. In other modes the board cannot know whether a host waited for an answer, so one happens
    after the other: a frame of the host begins when all before it has been done and answered.

    Frames pass as time of the host, like a DELAY: a journal has them, and a replay needs no line.

    Args:
        port: the host's hold on the board.
        inner: the wire format, on that port.
        frame: how long a byte takes (ps); 0: no time.
        modem: pins that follow the host's lines, on a link that marks their changes.
    """

    STATE: ClassVar[Names] = (
        "_inner: part", "_coming: bytearray[...]", "_going: bytearray[...]", "_host_due",
        "_board_due", "_waits: bool", "_lines",
    )  # fmt: skip

    def __init__(
        self, port: HostPort, inner: Protocol, frame: int, modem: ModemPins | None = None
    ) -> None:
        super().__init__(port)
        self._inner: Protocol = inner
        self._frame: int = frame
        self.modem: ModemPins | None = modem
        self._duplex: bool = port.info().policy == "realtime"
        self.reset()

    def reset(self) -> None:
        """Forget what is on the line: a session has ended or begun."""
        self._inner.reset()
        self.out.clear()
        self._coming: bytearray = bytearray()
        """What the host has sent and has not arrived, marks among it."""
        self._going: bytearray = bytearray()
        """What answers it and has not arrived."""
        self._host_due: int = -1
        """When the first of what comes has arrived (ps); -1: it has not begun."""
        self._board_due: int = -1
        """When the first of what goes has arrived (ps)."""
        self._waits: bool = False
        """Whether the line waits for time, not the request before."""
        self._lines: int = 0
        """The host's lines that are on."""

    def half(self) -> int:
        """Return how many bytes of a request have arrived and wait for the rest of it."""
        return self._inner.half() + len(self._coming)

    def awaited(self) -> bool:
        """Tell whether anything of the host is on the line, or waits at its end."""
        return bool(self._coming) or self._inner.awaited()

    def receive(self, data: bytes) -> None:
        """Take what the host sends, as it begins."""
        self._coming += data
        self._go_on()

    def resume(self) -> None:
        """Go on after a wait, or send what the watched lines did."""
        if not self._waits:
            self._inner.resume()
            self._answered()
        self._go_on()

    # -- the line ------------------------------------------------------------------------------

    def _go_on(self) -> None:
        while not self.port.held:
            size = self._size()
            if self._host_due < 0 and size and (self._duplex or not self._going):
                self._begin(size)
            if self._going and not 0 <= self._host_due < self._board_due:
                if not self._passed(self._board_due):
                    break
                self.out.append(self._going.pop(0))
                self._board_due += self._frame
            elif self._host_due >= 0:
                if not self._passed(self._host_due):
                    break
                self._end(size)
            else:
                break

    def _size(self) -> int:
        """Return how many bytes the first thing the host has sent takes; 0: it is not whole."""
        size = 2 if self.modem is not None and self._coming[:1] == b"\xff" else 1
        return size if len(self._coming) >= size else 0

    def _passed(self, when: int) -> bool:
        """Let time pass to an instant; False to be called again when it has."""
        now = self.port.now()
        if now < when or self._waits:
            try:
                self._waits = not self.port.delay(max(when - now, 0))
            except PortError:  # time ends before: what is on the line arrives with it
                self._waits = False
            if not self._waits:
                self._answered()  # lines that are watched may have moved
        return not self._waits

    def _begin(self, size: int) -> None:
        """The host's next byte begins, or its lines change."""
        lasts = self._frame
        if size == 2 and self._coming[1] != MARK and self.modem is not None:
            lasts = self._change(self.modem, self._coming[1])
        self._host_due = self.port.now() + lasts

    def _end(self, size: int) -> None:
        """What the host has begun to send has arrived."""
        byte = self._coming[size - 1]
        del self._coming[:size]
        self._host_due = -1
        if size == 2 and byte != MARK:
            for number in self.modem.reset if self.modem is not None else ():
                self.port.pin(number, 2)
        else:
            self._inner.receive(bytes((byte,)))
            self._answered()

    def _change(self, modem: ModemPins, lines: int) -> int:
        """Let the pins follow the host's lines; return how long that takes (ps)."""
        changed = lines ^ self._lines
        self._lines = lines
        for bit, number in modem.lines:
            if changed & bit:
                self.port.pin(number, 0 if lines & bit else 1)
        if changed & lines & DTR:
            for number in modem.reset:
                self.port.pin(number, 0)
        return modem.change_ps if modem.follow(changed) else 0

    def _answered(self) -> None:
        """Put what the wire format has answered on the line."""
        self._inner.report_events()
        answer = self._inner.take()
        if answer and not self._going:
            self._board_due = self.port.now() + self._frame
        self._going += answer
        if self._duplex and self.port.held:  # by a request: what is on its way arrives meanwhile
            while self._going and self._board_due <= self.port.hold_until:
                self.out.append(self._going.pop(0))
                self._board_due += self._frame
