"""The byte protocol: one byte says what is asked, replies come back in the same order."""

from collections.abc import Callable
from struct import Struct, pack, unpack_from
from typing import ClassVar, Final

from mypy_extensions import i64

from vbus.core.instants import END, NEVER
from vbus.core.state import Names
from vbus.protocols import codes
from vbus.protocols.base import Protocol
from vbus.protocols.info import encode_hello
from vbus.protocols.port import HostPort, NotYet, PortError
from vbus.protocols.requests import FATAL, FORESEEN, LEASED, NO_EDGE, REQUESTS, VERSION

_READ4: Final = REQUESTS["READ4"].code
_WRITE4: Final = REQUESTS["WRITE4"].code
_AT: Final = REQUESTS["AT"].code
_HELLO: Final = REQUESTS["HELLO"].code
_WAITS: Final = bytes(REQUESTS[name].code for name in ("WAIT", "DELAY", "CLAIM"))
"""Requests that do nothing but wait."""
_L: Final = ord(LEASED)
_M: Final = ord(FORESEEN)
_U32: Final = (1 << 32) - 1
_LEASE: Final = Struct(">BBIQQ").pack
_LEASE_AHEAD: Final = Struct(">BBIQQBQ").pack
_STEPS: Final = [Struct(f">{count}I").unpack_from for count in range(64)]
_DATA: Final = [b"D" + bytes((value,)) for value in range(256)]
"""What answers a read, by the byte read."""

SIZES: Final = bytes(
    row.size if (row := REQUESTS.at(code)) is not None else 1 for code in range(256)
)
"""Bytes of the fixed part of a request, by its first byte."""

COUNTED: Final = bytes(
    (row := REQUESTS.at(code)) is not None and row.layout.counted for code in range(256)
)
"""Whether the fixed part ends with the length of a run of bytes, by the first byte."""


class ByteProtocol(Protocol):
    """The byte protocol, board's end; :mod:`vbus.protocols.requests` lists what it understands.

    Requests are carried out in the order they come; each reply stands in its request's place. An
    event stands before the reply of the request during which its edge happened.

    A refused request is answered ``'X'``, reason, number. After an unknown request, a bad length
    or a bad version it is unknown where the next request starts: from then on every byte is
    answered with that same refusal until :meth:`reset`.
    """

    NO_ROOM: ClassVar[bytes] = bytes((ord("X"), codes.NO_ROOM, 0, 0))
    STATE: ClassVar[Names] = (
        "_kept: bytearray[...]", "_number", "_refusal: bytes[...]", "_watching: bool", "_leasing",
        "_partial: bytearray[...]",
    )  # fmt: skip
    WIRING: ClassVar[Names] = ("_handlers", "_greeted", "_told")

    def __init__(self, port: HostPort) -> None:
        super().__init__(port)
        self.reset()
        self._handlers: list[Callable[[bytes, int], None]] = [
            self._handler(code) for code in range(256)
        ]

    def _handler(self, code: int) -> Callable[[bytes, int], None]:
        row = REQUESTS.at(code)
        if row is None or row.code == _READ4:  # which never gets here
            return self._do_unknown
        handler: Callable[[bytes, int], None] = getattr(self, "_do_" + row.name.lower())
        return handler

    def reset(self) -> None:
        """Forget half a request, a refusal and the request count: a session ends or begins."""
        self.out.clear()
        self._kept: bytearray = bytearray()
        self._number: int = 0
        self._refusal: bytes = b""
        self._watching: bool = False
        self._leasing: int = 0
        self._partial: bytearray = bytearray()
        """What a READS, WRITES or PASS has done that had to stop in between."""
        self._greeted: bool = False
        """Whether the host has said HELLO, so that it reads ``'H'``: no state of the board."""
        self._told: bool = False
        """Whether the last report to the host was of a pause."""

    def receive(self, data: bytes) -> None:
        """Take bytes from the host; carry out every request now complete."""
        if self._kept:
            self._kept += data
            if self.port.held:
                return
            data = bytes(self._kept)
            self._kept.clear()
        position = 0
        if not self._refusal:
            position = self._carry_out(data)
        if self._refusal:
            self.out += self._refusal * (len(data) - position)
        elif position < len(data):
            self._kept += data[position:]

    def _carry_out(self, data: bytes) -> int:
        """Run requests until bytes are missing or one has to wait; return the bytes used."""
        port = self.port
        out = self.out
        position = 0
        end = len(data)
        while position < end and not port.held:
            code = data[position]
            following = position + SIZES[code]
            if following > end:
                break
            mark = len(out)
            try:
                if code & 0xF0 == _READ4:
                    out += self._read_reply(code & 15, port.read(code & 15))
                elif code & 0xF0 == _WRITE4:
                    self._do_write4(data, position + 1)
                elif code == _AT:
                    self._do_at(data, position + 1)
                else:
                    if COUNTED[code]:
                        following += data[following - 1]
                        if following > end:
                            break
                    self._handlers[code](data, position + 1)
            except NotYet:
                break
            except PortError as error:
                self._partial.clear()
                refusal = self._refuse(error.code)
                out += refusal
                if error.code in FATAL:
                    self._refusal = refusal
            self._number += 1
            position = following
            if self._watching:
                self._insert_events(mark)
            if self._refusal:
                break
        return position

    def half(self) -> int:
        """Return how many bytes of a request wait for the rest of it."""
        return len(self._kept)

    def awaited(self) -> bool:
        """Tell whether anything is left but a request to wait."""
        half = self._kept
        return bool(half) and not (half[0] in _WAITS and len(half) <= SIZES[half[0]])

    def finish(self) -> bool:
        """End a message that holds whole requests only; False while one of them has to wait.

        Half a request is refused as a bad length. The next message starts with a request, so an
        earlier refusal is forgotten.
        """
        if self._kept:
            if self.port.held:
                return False
            self._kept.clear()
            self.out += self._refuse(codes.BAD_LENGTH)
            self._number += 1
        self._refusal = b""
        return True

    def _refuse(self, code: int) -> bytes:
        return b"X" + bytes((code,)) + (self._number & 0xFFFF).to_bytes(2, "big")

    def report_events(self) -> None:
        """Append what the watched lines did since the last call, if the host asked."""
        if self._watching:
            self._insert_events(len(self.out))

    def _insert_events(self, mark: int) -> None:
        events = self.port.take_events()
        if events:
            self.out[mark:mark] = b"".join(
                b"I" + (outputs & _U32).to_bytes(4, "big") + when.to_bytes(8, "big")
                for outputs, when in events
            )

    def tell_pause(self, paused: bool) -> None:
        """Append a pause or its end for a host that says HELLO; HELLO may still wait itself."""
        half = self._kept
        asks = len(half) > 1 and half[0] == _HELLO
        if paused != self._told and (asks or self._greeted):
            self._told = paused
            self.out += b"H\x01" if paused else b"H\x00"

    # -- one method for each row of the table; NotYet: the same call is made again when resumed --

    def _do_unknown(self, data: bytes, start: int) -> None:
        raise PortError(codes.UNKNOWN_REQUEST, f"unknown request {data[start - 1]:02x}")

    def _do_hello(self, data: bytes, start: int) -> None:
        if data[start] == 0:
            raise PortError(codes.BAD_VERSION, f"version 0; allowed are 1 to {VERSION}")
        version = min(data[start], VERSION)
        hello = encode_hello(version, self.port.info())
        if len(hello) > 0xFFFF:
            raise PortError(codes.BAD_LENGTH, "the session's description is over 65535 bytes")
        self.out += b"V" + len(hello).to_bytes(2, "big") + hello
        self._greeted = True

    def _do_echo(self, data: bytes, start: int) -> None:
        self.out += bytes((ord("E"), data[start]))

    def _do_select(self, data: bytes, start: int) -> None:
        self.port.select(data[start] << 8 | data[start + 1])

    def _do_claim(self, data: bytes, start: int) -> None:
        if not self.port.claim():
            raise NotYet
        self.out += b"C\x01"

    def _do_unclaim(self, data: bytes, start: int) -> None:
        self.port.unclaim()

    def _do_write4(self, data: bytes, start: int) -> None:
        self.port.write(data[start - 1] & 15, data[start])

    def _do_read(self, data: bytes, start: int) -> None:
        value = self.port.read(data[start])
        self.out += self._read_reply(data[start], value)

    def _read_reply(self, address: int, value: int) -> bytes:
        """Return what answers a read: with a lease if one can be given and was asked for."""
        lease = self.port.lease(address) if self._leasing else None
        if lease is None:
            return _DATA[value]
        outputs, instant, until = lease
        following = self.port.foresee(address) if self._leasing == 2 else None
        last: i64 = until
        end = NO_EDGE if last >= NEVER else until
        if following is None:
            return _LEASE(_L, value, outputs & _U32, instant, end)
        then, until = following
        return _LEASE_AHEAD(_M, value, outputs & _U32, instant, end, then, until)

    def _do_write(self, data: bytes, start: int) -> None:
        self.port.write(data[start], data[start + 1])

    def _do_reads(self, data: bytes, start: int) -> None:
        address = data[start]
        count = data[start + 1]
        if count == 0:
            raise PortError(codes.BAD_LENGTH, "READS of 0 bytes")
        port = self.port
        values = self._partial
        while len(values) < count:
            values.append(port.read(address))
        self.out += bytes((ord("B"), count)) + values
        values.clear()

    def _do_writes(self, data: bytes, start: int) -> None:
        address = data[start]
        count = data[start + 1]
        if count == 0:
            raise PortError(codes.BAD_LENGTH, "WRITES of 0 bytes")
        port = self.port
        done = self._partial
        while len(done) < count:
            port.write(address, data[start + 2 + len(done)])
            done.append(0)
        done.clear()

    def _do_wait(self, data: bytes, start: int) -> None:
        answer = self.port.wait(_u64(data, start))
        if answer is None:
            raise NotYet
        ready, instant = answer
        self.out += b"R\x01" if ready else b"R\x00"
        self.out += instant.to_bytes(8, "big")

    def _do_lines(self, data: bytes, start: int) -> None:
        mask = data[start] << 8 | data[start + 1]
        self.port.lines(mask, data[start + 2] << 8 | data[start + 3])

    def _do_drive(self, data: bytes, start: int) -> None:
        self.port.drive(data[start])

    def _do_release(self, data: bytes, start: int) -> None:
        self.port.release()

    def _do_sample(self, data: bytes, start: int) -> None:
        value, outputs = self.port.sample()
        self.out += b"P" + bytes((value,)) + (outputs & _U32).to_bytes(4, "big")

    def _do_pin(self, data: bytes, start: int) -> None:
        self.port.pin(data[start], data[start + 1])

    def _do_getpin(self, data: bytes, start: int) -> None:
        self.out += _DATA[self.port.getpin(data[start])]

    def _do_delay(self, data: bytes, start: int) -> None:
        if not self.port.delay(_u64(data, start)):
            raise NotYet

    def _do_at(self, data: bytes, start: int) -> None:
        self.port.at(_u64(data, start))

    def _do_now(self, data: bytes, start: int) -> None:
        self.out += b"T" + self.port.now().to_bytes(8, "big")

    def _do_sync(self, data: bytes, start: int) -> None:
        outputs, edge = self.port.sync()
        self.out += b"S" + (outputs & _U32).to_bytes(4, "big")
        self.out += (NO_EDGE if edge >= NEVER else edge).to_bytes(8, "big")

    def _do_pass(self, data: bytes, start: int) -> None:
        port = self.port
        slaved = port.info().policy == "slaved"
        longest = _u64(data, start)
        begun, now, step = -1, 0, 0
        if self._partial:  # resumed in the middle of a step
            begun, now, step = unpack_from(">QQQ", self._partial)
        while True:
            if step:
                self._partial[:] = pack(">QQQ", begun, now, step)
                if slaved:
                    port.at(now + step)
                else:
                    port.delay(step)
                if port.held:
                    raise NotYet
                now += step
            outputs, edge = port.sync()
            self._partial.clear()
            if begun < 0:
                begun = now = port.now()
            # Time has an end: what is left of it is the most that can pass.
            longest = min(longest, END - begun)
            mark = len(self.out)
            self.report_events()
            if len(self.out) > mark or now - begun >= longest:
                break
            # No further than the next possible edge, so that an event is found at its own instant.
            step = min(max(edge - now, 1), longest - (now - begun))
        self.out += b"W" + (outputs & _U32).to_bytes(4, "big") + (now - begun).to_bytes(8, "big")

    def _do_polled(self, data: bytes, start: int) -> None:
        if not self.port.polled(data[start], data[start + 1] << 8 | data[start + 2]):
            raise NotYet

    def _do_polled_at(self, data: bytes, start: int) -> None:
        size = data[start + 9]
        if size & 3:
            raise PortError(codes.BAD_LENGTH, f"POLLED_AT with {size} bytes of steps of 4 bytes")
        steps = _STEPS[size >> 2](data, start + 10)
        if not self.port.polled_at(data[start], _u64(data, start + 1), steps):
            raise NotYet

    def _do_leases(self, data: bytes, start: int) -> None:
        if data[start] > 2:
            raise PortError(codes.NO_SUCH, f"leases {data[start]}; allowed are 0, 1 and 2")
        self._leasing = data[start]

    def _do_events(self, data: bytes, start: int) -> None:
        mask = int.from_bytes(data[start : start + 4], "big")
        self.port.events(mask)
        self.report_events()
        self._watching = mask != 0


def _u64(data: bytes, start: int) -> int:
    high = data[start] << 24 | data[start + 1] << 16 | data[start + 2] << 8 | data[start + 3]
    low = data[start + 4] << 24 | data[start + 5] << 16 | data[start + 6] << 8 | data[start + 7]
    return high << 32 | low
