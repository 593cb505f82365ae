"""The text protocol: one line, one request, one line back; for people, expect scripts and qtest."""

from collections.abc import Callable
from typing import ClassVar, Final, NamedTuple

from vbus.core.instants import END, NEVER, NS
from vbus.core.state import Names
from vbus.protocols.base import Protocol
from vbus.protocols.port import PIN_LEVELS, CardAccess, HostPort, NotYet, PortError
from vbus.protocols.quantities import format_instant, parse_duration

LONGEST_LINE: Final = 512
"""Most characters of a line; the rest of a longer one is skipped and the line refused."""

UNCLAIMED: Final = 0xFF
"""What a read gives at a card address where no chip answers."""

_DIGITS: Final = "0123456789"
_HEX_DIGITS: Final = "0123456789abcdefABCDEF"
_BYTES: Final = [f"{value:02x}" for value in range(256)]
"""Bytes as they are answered: quicker than to format each."""

_WAITS: Final = (b"wait", b"step", b"clock_step", b"claim")
"""Verbs that do nothing but wait."""
_CR: Final = 0x0D


class Verb(NamedTuple):
    """One row of the text protocol.

    Attributes:
        name: first word of the line.
        arguments: what follows, for people; ``...`` means more of the same.
        fewest: how many words must follow.
        most: how many may follow.
        answer: example of an answer.
        title: what it does.
        qtest: it speaks as QEMU's qtest does: ``OK``, ``FAIL``, numbers as in C.
    """

    name: str
    arguments: str
    fewest: int
    most: int
    answer: str
    title: str
    qtest: bool = False

    @property
    def usage(self) -> str:
        """The line as it is typed."""
        return f"{self.name} {self.arguments}".strip()


_MANY: Final = LONGEST_LINE

VERBS: Final = {
    verb.name: verb
    for verb in (
        Verb("r", "ADDRESS [COUNT]", 1, 2, "84", "read cycles at one address"),
        Verb("w", "ADDRESS DATA ...", 2, _MANY, "ok", "write cycles at one address"),
        Verb("select", "NAME ...|all|none", 1, _MANY, "ok", "cycles go to these chips"),
        Verb("claim", "", 0, 0, "ok", "hold the selected chips' bus for a packet"),
        Verb("unclaim", "", 0, 0, "ok", "let the bus go"),
        Verb("wait", "DURATION", 1, 2, "ready 15us",
             'until the chip takes the next cycle, at most this long; else "busy", and when'),
        Verb("pin", "NAME [0|1|z]", 1, 2, "ok", "drive a pin, or let it go; alone: its level"),
        Verb("lines", "NAME=LEVEL ...", 1, _MANY, "ok", "control lines, all at one instant"),
        Verb("drive", "DATA", 1, 1, "ok", "drive D0-D7"),
        Verb("release", "", 0, 0, "ok", "let D0-D7 float"),
        Verb("sample", "", 0, 0, "84 1", "D0-D7 and the output lines as they stand"),
        Verb("step", "DURATION", 1, 2, "10000us", "let time pass; tells chip time"),
        Verb("now", "", 0, 0, "341.333333us", "chip time"),
        Verb("chips", "", 0, 0, "NAME PART selected", "what is attached"),
        Verb("names", "", 0, 0, "pins x./RST; lines x./CS", "names of pins, lines and outputs"),
        Verb("help", "[VERB]", 0, 1, "now: chip time", "what can be typed"),
        Verb("inb", "ADDRESS", 1, 1, "OK 0x0084", "read a card's port", True),
        Verb("outb", "ADDRESS DATA", 2, 2, "OK", "write a card's port", True),
        Verb("readb", "ADDRESS", 1, 1, "OK 0x0000000000000084", "read a card's memory", True),
        Verb("writeb", "ADDRESS DATA", 2, 2, "OK", "write a card's memory", True),
        Verb("clock_step", "[NS]", 0, 1, "OK 1000000", "let time pass; tells ns", True),
    )
}  # fmt: skip
"""Everything that can be typed."""


class _Mistake(Exception):
    """A line that is no request; its text goes back to the host."""


class TextProtocol(Protocol):
    """The text protocol, board's end; :data:`VERBS` lists what it understands.

    A line ends with LF, CR or CR LF; the answer ends with what the line's first end character
    calls for: CR LF after CR, LF after LF. Every line that is not empty gets exactly one line
    back, in order. Numbers are hexadecimal, except behind qtest's verbs (as in C).
    """

    NO_ROOM: ClassVar[bytes] = b"error: the board can take no more hosts\n"
    STATE: ClassVar[Names] = (
        "_kept: bytearray[...]", "_overlong: bool", "_mask", "_partial: list[str, ...]",
    )  # fmt: skip
    WIRING: ClassVar[Names] = ("_handlers",)

    def __init__(self, port: HostPort) -> None:
        super().__init__(port)
        self.reset()
        self._handlers: dict[str, Callable[[list[str]], str | None]] = {
            name: getattr(self, "_do_" + name) for name in VERBS
        }

    def reset(self) -> None:
        """Forget half a line and the selection: a session has ended or begun."""
        self.out.clear()
        self._kept: bytearray = bytearray()
        self._overlong: bool = False
        self._mask: int = 1
        self._partial: list[str] = []
        """What a line of several cycles has done that had to stop in between."""

    def half(self) -> int:
        """Return how many characters of a line wait for its end."""
        return len(self._kept)

    def awaited(self) -> bool:
        """Tell whether anything is left but a line that asks to wait."""
        lines = bytes(self._kept).split()
        return bool(lines) and not (
            lines[0].lower() in _WAITS and len(self._kept.splitlines()) == 1
        )

    def receive(self, data: bytes) -> None:
        """Take bytes from the host; carry out every line now complete."""
        if self._kept:
            self._kept += data
            data = bytes(self._kept)
            self._kept.clear()
        used = self._carry_out(data)
        if used < len(data):
            self._kept += data[used:]

    def _carry_out(self, data: bytes) -> int:
        """Answer lines until one is not complete or has to wait; return the bytes used."""
        start = 0
        while not self.port.held:
            end = _line_end(data, start)
            if end < 0:
                if len(data) - start > LONGEST_LINE:
                    self._overlong = True
                    return len(data)
                break
            answer = self._answer(data, start, end)
            if answer is None:
                break
            if answer:
                answer += "\r\n" if data[end] == _CR else "\n"
                self.out += answer.encode("ascii", "backslashreplace")
            start = end + 1
        return start

    def _answer(self, data: bytes, start: int, end: int) -> str | None:
        """Return the line that answers ``data[start:end]``; empty for none, None to wait."""
        if self._overlong or end - start > LONGEST_LINE:
            self._overlong = False
            return f"error: the line is too long; at most {LONGEST_LINE} characters"
        words = data[start:end].decode("ascii", "replace").split()
        if not words:
            return ""
        verb = VERBS.get(words[0])
        if verb is None:
            allowed = ", ".join(VERBS)
            return f"error: unknown request {words[0]!r}; allowed are {allowed}"
        arguments = words[1:]
        try:
            if not verb.fewest <= len(arguments) <= verb.most:
                raise _Mistake(f"{verb.name} with {len(arguments)} arguments; usage: {verb.usage}")
            return self._handlers[words[0]](arguments)
        except NotYet:
            return None
        except (_Mistake, PortError) as error:
            self._partial.clear()
            return f"{'FAIL' if verb.qtest else 'error:'} {error}"

    # -- one method for each row of the table; None: not now, make the same call when resumed -----

    def _do_r(self, arguments: list[str]) -> str | None:
        address = _byte(arguments[0], "address")
        count = _byte(arguments[1], "count") if len(arguments) > 1 else 1
        if count == 0:
            raise _Mistake("count 0; allowed are 1 to FF")
        values = self._partial
        while len(values) < count:
            values.append(_BYTES[self.port.read(address)])
        answer = " ".join(values)
        values.clear()
        return answer

    def _do_w(self, arguments: list[str]) -> str | None:
        address = _byte(arguments[0], "address")
        bytes_ = [_byte(word, "data") for word in arguments[1:]]
        done = self._partial
        while len(done) < len(bytes_):
            self.port.write(address, bytes_[len(done)])
            done.append("")
        done.clear()
        return "ok"

    def _do_select(self, arguments: list[str]) -> str | None:
        mask = 0
        for name in arguments:
            if name == "all":
                mask = (1 << len(self.port.info().chips)) - 1
            elif name != "none":
                mask |= 1 << self.port.chip_number(name)
        self.port.select(mask)
        self._mask = mask
        return "ok"

    def _do_claim(self, arguments: list[str]) -> str | None:
        return "ok" if self.port.claim() else None

    def _do_unclaim(self, arguments: list[str]) -> str | None:
        self.port.unclaim()
        return "ok"

    def _do_wait(self, arguments: list[str]) -> str | None:
        answer = self.port.wait(_duration(arguments))
        if answer is None:
            return None
        ready, instant = answer
        return f"{'ready' if ready else 'busy'} {format_instant(instant)}"

    def _do_pin(self, arguments: list[str]) -> str | None:
        number = self.port.pin_number(arguments[0])
        if len(arguments) == 1:
            return str(self.port.getpin(number))
        level = PIN_LEVELS.get(arguments[1].lower())
        if level is None:
            raise _Mistake(f"level {arguments[1]!r}; allowed are 0, 1, and z to let go")
        self.port.pin(number, level)
        return "ok"

    def _do_lines(self, arguments: list[str]) -> str | None:
        mask = levels = 0
        for word in arguments:
            name, equals, level = word.rpartition("=")
            if not equals or level not in ("0", "1"):
                raise _Mistake(f"{word!r}; allowed is NAME=0 or NAME=1")
            bit = 1 << self.port.line_number(name)
            if mask & bit:
                raise _Mistake(f"{name} stands there twice; name each line once")
            mask |= bit
            levels |= bit if level == "1" else 0
        self.port.lines(mask, levels)
        return "ok"

    def _do_drive(self, arguments: list[str]) -> str | None:
        self.port.drive(_byte(arguments[0], "data"))
        return "ok"

    def _do_release(self, arguments: list[str]) -> str | None:
        self.port.release()
        return "ok"

    def _do_sample(self, arguments: list[str]) -> str | None:
        data, outputs = self.port.sample()
        return f"{_BYTES[data]} {outputs:x}"

    def _do_step(self, arguments: list[str]) -> str | None:
        if not self.port.delay(_duration(arguments)):
            return None
        return format_instant(self.port.now())

    def _do_now(self, arguments: list[str]) -> str | None:
        return format_instant(self.port.now())

    def _do_chips(self, arguments: list[str]) -> str | None:
        return (
            ", ".join(
                f"{chip.name} {chip.part}" + (" selected" if self._mask >> number & 1 else "")
                for number, chip in enumerate(self.port.info().chips)
            )
            or "none"
        )

    def _do_names(self, arguments: list[str]) -> str | None:
        info = self.port.info()
        groups = (("pins", info.pins), ("lines", info.lines), ("outputs", info.outputs))
        return "; ".join(f"{title} {' '.join(names) or 'none'}" for title, names in groups)

    def _do_help(self, arguments: list[str]) -> str | None:
        if not arguments:
            return "; ".join(verb.usage for verb in VERBS.values())
        verb = VERBS.get(arguments[0])
        if verb is None:
            raise _Mistake(f"no help on {arguments[0]!r}; allowed are {', '.join(VERBS)}")
        return f"{verb.usage}: {verb.title}"

    # -- qtest ------------------------------------------------------------------------------------

    def _do_inb(self, arguments: list[str]) -> str | None:
        return "OK 0x00" + _BYTES[self._card_read(arguments)]

    def _do_readb(self, arguments: list[str]) -> str | None:
        return "OK 0x00000000000000" + _BYTES[self._card_read(arguments)]

    def _do_clock_step(self, arguments: list[str]) -> str | None:
        if arguments:
            duration = _c_number(arguments[0], "ns") * NS
            if duration > END:
                raise _Mistake(f"ns {arguments[0]}; at most {END // NS}")
        else:
            edge = self.port.sync()[1]
            duration = 0 if edge >= NEVER else max(0, edge - self.port.now())
        if not self.port.delay(duration):
            return None
        return f"OK {self.port.now() // NS}"

    def _card_read(self, arguments: list[str]) -> int:
        access = self.port.card(_c_number(arguments[0], "address"))
        return UNCLAIMED if access is None else self._card_cycle(access, None)

    def _do_outb(self, arguments: list[str]) -> str | None:
        access = self.port.card(_c_number(arguments[0], "address"), write=True)
        data = _c_number(arguments[1], "data") & 0xFF
        if access is not None:
            self._card_cycle(access, data)
        return "OK"

    def _do_writeb(self, arguments: list[str]) -> str | None:
        return self._do_outb(arguments)

    def _card_cycle(self, access: CardAccess, written: int | None) -> int:
        """Run a cycle of the card, a write if there is a byte for it; return what was read."""
        data = access.floating
        if access.chip >= 0:
            self.port.select(1 << access.chip)
            try:
                if written is None:
                    data |= self.port.read(access.address)
                else:
                    self.port.write(access.address, written)
            finally:
                self.port.select(self._mask)
        if access.pulsed >= 0:
            self.port.pin(access.pulsed, 0)
            self.port.pin(access.pulsed, 2)
        return data


def _line_end(data: bytes, start: int) -> int:
    """Return where the line that starts at ``start`` ends, or -1."""
    lf = data.find(b"\n", start)
    if _CR not in data:
        return lf
    # Of CR LF the LF ends an empty line, which has no answer.
    cr = data.find(b"\r", start, lf if lf >= 0 else len(data))
    return cr if cr >= 0 else lf


def _duration(words: list[str]) -> int:
    try:
        return parse_duration("".join(words))
    except ValueError as error:
        raise _Mistake(str(error)) from error


def _byte(text: str, what: str) -> int:
    """Return a byte from a hexadecimal number; ``0x`` in front and ``h`` behind are allowed."""
    digits = text
    if text.strip(_HEX_DIGITS):  # which leaves what is no digit, and what is between two of these
        digits = text.lower().removeprefix("0x").removesuffix("h")
    if not digits or digits.strip(_HEX_DIGITS):
        raise _Mistake(f"{what} {text!r} is no hexadecimal number; allowed are 0 to FF")
    value = int(digits, 16)
    if value > 0xFF:
        raise _Mistake(f"{what} {text}; allowed are 0 to FF")
    return value


def _c_number(text: str, what: str) -> int:
    """Return a number as C writes it, below 2^63."""
    prefixed = text.startswith(("0x", "0X"))
    digits = text[2:] if prefixed else text
    if not digits or digits.strip(_HEX_DIGITS if prefixed else _DIGITS):
        raise _Mistake(f"{what} {text!r} is no number; allowed are 0x1f or 31")
    value = int(digits, 16 if prefixed else 10)
    if value >= 1 << 63:
        raise _Mistake(f"{what} {text}; allowed are numbers below 2^63")
    return value
