"""The text protocol for a person at a terminal: what is typed is shown, and can be corrected."""

from typing import ClassVar, Final

from vbus.core.state import Names
from vbus.protocols.base import Protocol
from vbus.protocols.port import HostPort
from vbus.protocols.text import LONGEST_LINE, VERBS, TextProtocol

PROMPT: Final = b"> "
NEW_LINE: Final = b"\r\n"
BELL: Final = b"\x07"
RUB_OUT: Final = b"\b \b"

_CTRL_C: Final = 0x03
_BACKSPACE: Final = 0x08
_LF: Final = 0x0A
_CR: Final = 0x0D
_CTRL_U: Final = 0x15
_ESCAPE: Final = 0x1B
_DELETE: Final = 0x7F


class TerminalProtocol(Protocol):
    """The text protocol, typed by hand.

    Each key is shown. Backspace takes the last character back, Ctrl-U the whole line, Ctrl-C begins
    a new one; Enter is CR, LF or CR LF. An answer is followed by a prompt, and ``help`` has a line
    for each request. Keys that come while a request waits have their turn when it is answered.
    """

    NO_ROOM: ClassVar[bytes] = TextProtocol.NO_ROOM.replace(b"\n", NEW_LINE)
    STATE: ClassVar[Names] = (
        "_inner: part", "_typed: bytearray[...]", "_line: bytearray[...]", "_escape",
    )  # fmt: skip

    def __init__(self, port: HostPort) -> None:
        super().__init__(port)
        self._inner: TextProtocol = TextProtocol(port)
        self.reset()

    def reset(self) -> None:
        """Forget half a line and the selection: a session has ended or begun."""
        self._inner.reset()
        self.out.clear()
        self._typed: bytearray = bytearray()
        """Keys whose turn has not come."""
        self._line: bytearray = bytearray()
        self._escape: int = 0
        """How many bytes of an escape sequence have come: those of cursor keys mean nothing."""

    def receive(self, data: bytes) -> None:
        """Take keys from the host; show them, and carry out every line now complete."""
        self._typed += data
        place = 0
        while place < len(self._typed) and not self.port.held:
            self._key(self._typed[place])
            place += 1
        del self._typed[:place]

    def half(self) -> int:
        """Return how many characters of a line wait for Enter."""
        return len(self._line)

    def awaited(self) -> bool:
        """Tell whether keys have come behind the line that waits."""
        return bool(self._typed) or self._inner.awaited()

    def resume(self) -> None:
        """Go on after a wait; it need not have been for an answer."""
        if self._inner.half():
            self._inner.resume()
            self._answered()
        self.receive(b"")

    def _key(self, key: int) -> None:
        if self._escape:
            self._escape += 1
            bracket = self._escape == 2 and key in b"[O"
            if not bracket and 0x40 <= key <= 0x7E:
                self._escape = 0
        elif key == _ESCAPE:
            self._escape = 1
        elif key == _CR or (key == _LF and self._line):
            self._enter()
        elif key in (_BACKSPACE, _DELETE):
            if self._line:
                self._line.pop()
                self.out += RUB_OUT
        elif key == _CTRL_U:
            self.out += RUB_OUT * len(self._line)
            self._line.clear()
        elif key == _CTRL_C:
            self._line.clear()
            self.out += b"^C" + NEW_LINE + PROMPT
        elif 0x20 <= key < _DELETE:
            if len(self._line) < LONGEST_LINE:
                self._line.append(key)
                self.out.append(key)
            else:
                self.out += BELL

    def _enter(self) -> None:
        line = bytes(self._line).strip()
        self._line.clear()
        self.out += NEW_LINE
        if line == b"help":
            for verb in VERBS.values():
                self.out += f"{verb.usage:<26} {verb.title}".encode() + NEW_LINE
            self.out += PROMPT
        elif line:
            self._inner.receive(line + b"\r")
            self._answered()
        else:
            self.out += PROMPT

    def _answered(self) -> None:
        self.out += self._inner.take()
        if not self.port.held:
            self.out += PROMPT
