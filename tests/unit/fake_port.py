"""A port without a board: keeps a log of what it was asked, and answers by simple rules."""

from vbus.core.kernel import NEVER, US
from vbus.protocols import codes
from vbus.protocols.port import CardAccess, ChipInfo, HostPort, PortError, PortInfo

CHIPS = ("x", "y")
PINS = ("x./RST", "x.HI", "y./RST", "y.HI")
LINES = ("x./CS", "y./CS", "/RD", "/WR")
OUTPUTS = ("x.HI", "y.HI")


LAST_EDGE = 25_000 * US


class FakePort(HostPort):
    """Two chips ``x`` and ``y`` on a slaved board.

    * Read number n at address a gives ``17 * a + n`` modulo 256, or what stands in
      :attr:`answers` for that address, of which the last is given for ever. A cycle takes 1 us.
    * A write at address 0 toggles output line 0: an edge, if line 0 is watched.
    * The chips are ready 15 us after the last write.
    * An edge is possible every 5 us, up to :data:`LAST_EDGE`, while no output line is high.
    * Time cannot pass :attr:`limit`: a call that would need it holds the session.
    """

    def __init__(self) -> None:
        self.calls: list[tuple[object, ...]] = []
        self.answers: dict[int, list[int]] = {}
        self.time = 0
        self.limit = NEVER
        self.claimable = True
        self.held = False
        self.hold_until = 0
        self.outputs = 0
        self.busy_until = 0
        self._reads = 0
        self._mask = 0
        self._edges: list[tuple[int, int]] = []
        self._target = -1
        self._last_at = 0

    def lift(self, limit: int) -> None:
        """Let time pass up to ``limit`` and take the hold away."""
        self.limit = limit
        self.held = False

    def go_on(self) -> bool:
        if self.hold_until <= self.limit:
            self.held = False
        return not self.held

    def close(self) -> None:
        self.calls.append(("close",))

    def info(self) -> PortInfo:
        return PortInfo(
            "bench",
            "slaved",
            0.0,
            [ChipInfo(name, "LM629N-8", "lm628", 1, US) for name in CHIPS],
            list(LINES),
            list(OUTPUTS),
            list(PINS),
            ["events"],
        )

    def select(self, mask: int) -> None:
        if mask >> len(CHIPS):
            raise PortError(codes.NO_SUCH, f"select {mask:X}: this session has 2 chips")
        self.calls.append(("select", mask))

    def claim(self) -> bool:
        if not self.claimable:
            self._hold(NEVER)
            return False
        self.held = False
        self.calls.append(("claim",))
        return True

    def unclaim(self) -> None:
        self.calls.append(("unclaim",))

    def _hold(self, until: int) -> None:
        self.held = True
        self.hold_until = until

    def read(self, address: int) -> int:
        if address == 0xEE:
            raise PortError(codes.NO_SUCH, "address EE: nobody is there")
        self.time += US
        self._reads += 1
        self.calls.append(("read", address))
        scripted = self.answers.get(address)
        if scripted:
            return scripted.pop(0) if len(scripted) > 1 else scripted[0]
        return (17 * address + self._reads) & 0xFF

    def write(self, address: int, data: int) -> None:
        if address == 0xEE:
            raise PortError(codes.NO_SUCH, "address EE: nobody is there")
        self.time += US
        self.busy_until = self.time + 15 * US
        self.calls.append(("write", address, data))
        if address == 0:
            self.outputs ^= 1
            if self._mask & 1:
                self._edges.append((self.outputs, self.time))

    def _pass_to(self, when: int) -> bool:
        if when > self.limit:
            self._hold(when)
            return False
        self.held = False
        self.time = max(self.time, when)
        return True

    def lease(self, address: int) -> tuple[int, int, int] | None:
        if address == 0:
            return self.outputs, self.time, self.time + 5 * US
        return (self.outputs, self.time, NEVER) if address == 2 else None

    def foresee(self, address: int) -> tuple[int, int] | None:
        return (2, self.time + 7 * US) if address == 0 else None

    def polled(self, address: int, count: int) -> bool:
        if address == 0xEE:
            raise PortError(codes.NO_SUCH, "address EE: nobody is there")
        if self._target < 0:
            self._target = self.time + count * US
        if not self._pass_to(self._target):
            return False
        self._target = -1
        self.calls.append(("polled", address, count))
        return True

    def polled_at(self, address: int, first: int, steps: tuple[int, ...]) -> bool:
        self.calls.append(("polled_at", address, first, steps))
        return True

    def wait(self, longest: int) -> tuple[bool, int] | None:
        if self._target < 0:
            self._target = self.time + longest
        when = min(self._target, max(self.busy_until, self.time))
        if not self._pass_to(when):
            return None
        self._target = -1
        self.calls.append(("wait", longest))
        return self.time >= self.busy_until, self.time

    def lines(self, mask: int, levels: int) -> None:
        if mask >> len(LINES):
            raise PortError(codes.NO_SUCH, f"lines {mask:X}: this session has 4 lines")
        self.calls.append(("lines", mask, levels))

    def drive(self, data: int) -> None:
        self.calls.append(("drive", data))

    def release(self) -> None:
        self.calls.append(("release",))

    def sample(self) -> tuple[int, int]:
        self.calls.append(("sample",))
        return 0x84, self.outputs

    def pin(self, number: int, level: int) -> None:
        if number >= len(PINS):
            raise PortError(codes.NO_SUCH, f"pin {number}: this session has 4")
        self.calls.append(("pin", number, level))

    def getpin(self, number: int) -> int:
        if number >= len(PINS):
            raise PortError(codes.NO_SUCH, f"pin {number}: this session has 4")
        self.calls.append(("getpin", number))
        return number & 1

    def delay(self, duration: int) -> bool:
        if self._target < 0:
            self._target = min(self.time + duration, NEVER - 1)
        if not self._pass_to(self._target):
            return False
        self._target = -1
        self.calls.append(("delay", duration))
        return True

    def at(self, when: int) -> None:
        if when < self._last_at:
            raise PortError(codes.BAD_AT, f"at {when}: before the last at, {self._last_at}")
        self._last_at = when
        self.time = max(self.time, when)
        self.calls.append(("at", when))

    def now(self) -> int:
        return self.time

    def sync(self) -> tuple[int, int]:
        self.calls.append(("sync",))
        edge = self.time + 5 * US
        return self.outputs, NEVER if self.outputs or edge > LAST_EDGE else edge

    def events(self, mask: int) -> None:
        if mask >> len(OUTPUTS):
            raise PortError(codes.NO_SUCH, f"events {mask:X}: this session has 2 outputs")
        self._mask = mask
        self.calls.append(("events", mask))

    def edge(self, outputs: int) -> None:
        """Something else on the board moves the output lines."""
        self.outputs = outputs
        if self._mask:
            self._edges.append((outputs, self.time))

    def take_events(self) -> list[tuple[int, int]]:
        edges, self._edges = self._edges, []
        return edges

    def chip_number(self, name: str) -> int:
        return self._find(CHIPS, name, "chip")

    def pin_number(self, name: str) -> int:
        return self._find(PINS, name, "pin")

    def line_number(self, name: str) -> int:
        return self._find(LINES, name, "line")

    @staticmethod
    def _find(names: tuple[str, ...], name: str, kind: str) -> int:
        if name in names:
            return names.index(name)
        raise PortError(codes.NO_SUCH, f"no {kind} {name!r}; this session has {', '.join(names)}")

    def card(self, address: int, write: bool = False) -> CardAccess | None:
        if address == 0x342:
            return CardAccess(0, 1, 0, -1) if write else None
        rows = {
            0x340: CardAccess(0, 0, 0, -1),
            0x341: CardAccess(0, 1, 0, -1),
            0x344: CardAccess(1, 0, 0x7F, -1),
            0x345: CardAccess(0, 1, 0, 3),
            0x348: CardAccess(1, 0, 0, -1),
            0x34C: CardAccess(-1, 0, 0xFF, 3),
        }
        return rows.get(address)
