"""The conformance kit finds what is planted, and says it in words that help."""

import os
import socket
from collections.abc import Callable
from pathlib import Path

import pytest

from vbus.board.board import Board
from vbus.chips.lm628.chip import LM628
from vbus.core.kernel import US
from vbus.plant.ideal import IdealPlant
from vbus.protocols.byte import ByteProtocol
from vbus.testing import Nonconformance, check_chip, check_plant, check_protocol, check_transport
from vbus.transports.sockets import UnixTransport

INTERPRETED = pytest.mark.core("interpreted")
"""The broken parts are made of the project's own, which take no subclass when compiled.

A part of somebody else derives from the base classes, which do, on either core.
"""


class Raises(LM628):
    def write(self, address: int, data: int) -> None:
        if data == 0xFF:
            raise KeyError(data)
        super().write(address, data)


class Drifts(LM628):
    calls = 0

    def end_read(self) -> int:
        Drifts.calls += 1
        return super().end_read() ^ (Drifts.calls > 200)


class NoByte(LM628):
    def end_read(self) -> int:
        return super().end_read() | 0x100


class Looked(LM628):
    def telemetry(self) -> dict[str, int | float | str]:
        self.write(0, 0x1E)
        return {}


class Forgets(LM628):
    STATE = (*LM628.STATE, "reads_so_far")
    so_far = 0

    @property
    def reads_so_far(self) -> int:
        return self.so_far

    @reads_so_far.setter
    def reads_so_far(self, number: int) -> None:
        """Take nothing back."""

    def end_read(self) -> int:
        self.so_far += 1
        return super().end_read()


class KeepsObjects(LM628):
    STATE = (*LM628.STATE, "thing")
    thing = object()


class Late(LM628):
    def due(self, kind: int) -> int:
        return super().due(kind) + 50 * US


class Past(LM628):
    def due(self, kind: int) -> int:
        return self.kernel.now


class NeverReady(LM628):
    def ready_at(self) -> int:
        return 1 << 60


class Timeless(LM628):
    @property
    def cycle_ps(self) -> int:
        return 0

    @cycle_ps.setter
    def cycle_ps(self, duration: int) -> None:
        """Take nothing."""


class Strobed(LM628):
    def write(self, address: int, data: int) -> None:
        super().write(address, data ^ bool(self.bus_net.observers))


def board_of(cls: type[LM628]) -> Callable[[], Board]:
    def make() -> Board:
        board = Board("bench")
        board.add_chip(cls, "x", "LM629N-8", 8_000_000)
        board.connect("x", 0, IdealPlant())
        board.power_on()
        return board

    return make


def test_a_sound_chip_passes() -> None:
    check_chip(board_of(LM628))


@INTERPRETED
@pytest.mark.parametrize(
    ("cls", "message"),
    [
        (Raises, "a write of FFh at .* raised KeyError: 255; whatever a host does, a chip goes on"),
        (Drifts, "two runs with the same bus cycles differ: .* read [0-9]+ gave"),
        (NoByte, "a read at [01]H gave [0-9]+, not a byte"),
        (Looked, "looking at it .* changes its run"),
        (Forgets, "the state loaded at bus cycle [0-9]+ is not the one saved"),
        (KeepsObjects, "its state has what a snapshot cannot hold"),
        (Late, "due\\(OUTPUT\\) promises too much"),
        (Past, "due\\(OUTPUT\\) gave .* it must lie ahead"),
        (NeverReady, "it never becomes ready"),
        (Timeless, "x: cycle_ps is 0: how long is a bus cycle"),
        (Strobed, "played as strobes on its pins, the same bus cycles differ"),
    ],
)
def test_a_broken_chip_is_found(cls: type[LM628], message: str) -> None:
    Drifts.calls = 0
    with pytest.raises(Nonconformance, match=message) as found:
        check_chip(board_of(cls))
    assert "Nonconformance" not in str(found.value), "what is found is said once"


class WrongCount(IdealPlant):
    def drive(self, command: float, error: int) -> int:
        return super().drive(command, error) + 1


class WrongCourse(IdealPlant):
    def count_at(self, fraction: float) -> int:
        return self.count


class FalseRest(IdealPlant):
    def resting(self) -> bool:
        return True


class LostState(IdealPlant):
    def after_load(self) -> None:
        super().after_load()
        self.count += 1


class LookedAt(IdealPlant):
    def before_save(self) -> None:
        super().before_save()
        self.count += 1


class Shy(IdealPlant):
    TAKES = ("drive", "phases")


class Odd(IdealPlant):
    TAKES = ("torque",)


@INTERPRETED
@pytest.mark.parametrize(
    ("plant", "message"),
    [
        (WrongCount, "returned .*, and .count is .*: both are the whole count"),
        (WrongCourse, "count_at\\(0.0\\) is"),
        (FalseRest, "resting\\(\\) after period .* another period .* changes it"),
        (LostState, "the state loaded after period"),
        (LookedAt, "LookedAt"),
        (Shy, "TAKES leaves out pulses, and pulses\\(\\) works"),
        (Odd, "TAKES is \\('torque',\\); it holds some of drive, pulses, phases"),
    ],
)
def test_a_broken_plant_is_found(plant: type[IdealPlant], message: str) -> None:
    with pytest.raises(Nonconformance, match=message):
        check_plant(plant)


class CutsMatter(ByteProtocol):
    def receive(self, data: bytes) -> None:
        super().receive(data if len(data) != 3 else data[:2])


class WantsMore(ByteProtocol):
    def receive(self, data: bytes) -> None:
        if len(data) > 1:
            super().receive(data)


class Falls(ByteProtocol):
    def receive(self, data: bytes) -> None:
        if b"\xfe" in data:
            raise ValueError("strange byte")
        super().receive(data)


class HalfKept(ByteProtocol):
    STATE = ()


class NoReset(ByteProtocol):
    def reset(self) -> None:
        """Forget nothing of what has begun."""
        if not hasattr(self, "_kept"):
            super().reset()


@INTERPRETED
@pytest.mark.parametrize(
    ("protocol", "message"),
    [
        (CutsMatter, "cut at .*, the same bytes give"),
        (WantsMore, "byte by byte, .*the same bytes give"),
        (Falls, "raised ValueError: strange byte; a host must get an answer"),
        (HalfKept, "saved and loaded at the cuts"),
        (NoReset, "reset\\(\\) after garbage keeps something"),
    ],
)
def test_a_broken_protocol_is_found(protocol: type[ByteProtocol], message: str) -> None:
    with pytest.raises(Nonconformance, match=message):
        check_protocol(protocol, bytes.fromhex("10 20 1E 10 21 00 21 0F 10 11 12 10 FF 10"))


class LeavesName(UnixTransport):
    def close(self) -> None:
        """Stay."""


class NoNews(UnixTransport):
    def open(self, loop, on_link) -> None:  # type: ignore[no-untyped-def]
        super().open(loop, lambda link: os.set_blocking(link.fd, True) or on_link(link))


def unix(url: str) -> int:
    with socket.socket(socket.AF_UNIX) as connection:
        connection.connect(url.partition(":")[2])
        return connection.detach()


@pytest.mark.parametrize(
    ("transport", "message"),
    [
        (LeavesName, "a host can still attach to .* after close"),
        (NoNews, "the link's descriptor blocks"),
    ],
)
def test_a_broken_transport_is_found(
    transport: type[UnixTransport], message: str, tmp_path: Path
) -> None:
    made: list[UnixTransport] = []

    def factory() -> UnixTransport:
        made.append(transport(str(tmp_path / "u"), {}))
        return made[-1]

    with pytest.raises(Nonconformance, match=message):
        check_transport(factory, unix)
    for one in made:
        UnixTransport.close(one)
    open_sockets = Path("/proc/net/unix").read_text()
    assert str(tmp_path) not in open_sockets, "the kit closes what the transport has handed over"
