"""MC1241A: two microstepped axes, an S-curve, and moves started by one MULTI_UPDATE."""

from typing import Final

from vbus.chips.mc1241a import datasheet as ds
from vbus.client import Bus
from vbus.client.demo import Demo, Gauge, Step
from vbus.errors import NotReadyError, VbusError

_BOARD: Final = """\
[chips.xy]
part = "MC1241A"
clock = "25 MHz"
plants = ["first", "second"]

[plants.first]
model = "stepper"
encoder_lines = 500

[plants.second]
model = "stepper"
encoder_lines = 500
"""

_TURN: Final = 12_800
"""Microsteps in a turn: 200 full steps of 64."""
_COUNTS: Final = 2000
"""Encoder counts in a turn."""
_AMPLITUDE: Final = 24_000
_RATIO: Final = _COUNTS * 256 // _TURN


def _explain(write: bool, address: int, data: int) -> str:
    if address == ds.DATA_PORT:
        return f"data   {'<-' if write else '->'} {data:02X}h"
    if not write:
        ready = "ready" if data & ds.STATUS_READY else "busy"
        return f"status -> {data:02X}h, {ready}"
    row = ds.COMMANDS.by_code(data)
    return f"{row.name}: {row.title}" if row is not None else f"command {data:02X}h"


class _Packets:
    """Packets with their checksums."""

    def __init__(self, bus: Bus) -> None:
        self.bus: Bus = bus

    def send(self, name: str, value: int = 0) -> int:
        """Send a command with its data; return what it gives, signed if the manual says so.

        Raises:
            VbusError: the checksum of the packet is wrong.
        """
        row = ds.COMMANDS[name]
        words = [value >> shift & 0xFFFF for shift in range(16 * row.write - 16, -16, -16)]
        self._ready()
        self.bus.write(ds.COMMAND_PORT, row.code)
        for word in words:
            self._ready()
            self.bus.writes(ds.DATA_PORT, word.to_bytes(2, "big"))
        words += [self._word() for _ in range(row.read)]
        checksum = self._word()
        if checksum != (row.code + sum(words)) & 0xFFFF:
            raise VbusError(f"{name}: checksum {checksum:04X}h is wrong")
        data = b"".join(word.to_bytes(2, "big") for word in words[row.write :])
        return int.from_bytes(data, "big", signed=row.signed)

    def _word(self) -> int:
        self._ready()
        return int.from_bytes(self.bus.reads(ds.DATA_PORT, 2), "big")

    def _ready(self) -> None:
        """Poll HostRdy at the card's status port."""
        for _ in range(1000):
            if self.bus.read(ds.COMMAND_PORT) & ds.STATUS_READY:
                return
        raise NotReadyError("HostRdy stays low")

    def wait(self, event: int) -> None:
        """Read the status of the current axis until an event bit is set, for 10 s at most."""
        end = self.bus.now() + 10 * 10**12
        while not self.send("GET_STATUS") & event:
            if self.bus.now() > end:
                raise NotReadyError(f"status {self.send('GET_STATUS'):04X}h after 10 s")
            self.bus.delay("2ms")


def _host(bus: Bus) -> None:
    chip = _Packets(bus)

    step = Step(bus, "look at version and status after reset")
    step.found("version", 0x4A10, chip.send("GET_VRSN"), digits=4)
    step.found("status of axis 2", 0x1300, chip.send("SET_2"), digits=4)
    step.found("status of axis 1", 0x0300, chip.send("SET_1"), digits=4)

    step = Step(bus, "both axes: two phases, current, encoder ratio")
    for axis in ("SET_2", "SET_1"):
        chip.send(axis)
        chip.send("SET_PHASE_2")
        chip.send("SET_STEP_RATIO", _RATIO)
        chip.send("SET_BUF_MTR_CMD", _AMPLITUDE)
    chip.send("MULTI_UPDATE", 0x3)
    bus.delay("50ms")
    step.found("motor command", _AMPLITUDE, chip.send("GET_MTR_CMD"))

    step = Step(bus, "axis 1: two turns in an S-curve")
    chip.send("SET_PRFL_S_CRV")
    chip.send("SET_POS", 2 * _TURN)
    chip.send("SET_VEL", 18 << 16)
    chip.send("SET_MAX_ACC", 0x1000)
    chip.send("SET_JERK", 0x0020_0000)
    chip.send("UPDATE")
    chip.wait(ds.MOTION_COMPLETE)
    bus.delay("50ms")
    step.found("target position", 2 * _TURN, chip.send("GET_TRGT_POS"))
    step.found("actual position", 2 * _COUNTS, chip.send("GET_ACTL_POS"), tolerance=2)

    step = Step(bus, "both axes started by one MULTI_UPDATE, in opposite directions")
    _together(chip, _TURN, -_TURN)
    for axis, counts in (("SET_1", _COUNTS), ("SET_2", -_COUNTS)):
        chip.send(axis)
        step.found(f"actual position, {axis[-1]}", counts, chip.send("GET_ACTL_POS"), tolerance=2)

    step = Step(bus, "both axes home")
    _together(chip, 0, 0)
    for axis in ("SET_1", "SET_2"):
        chip.send(axis)
        step.found(f"actual position, {axis[-1]}", 0, chip.send("GET_ACTL_POS"), tolerance=2)


def _together(chip: _Packets, first: int, second: int) -> None:
    for axis, position in (("SET_1", first), ("SET_2", second)):
        chip.send(axis)
        chip.send("SET_PRFL_TRAP")
        chip.send("SET_POS", position)
        chip.send("SET_VEL", 15 << 16)
        chip.send("SET_ACC", 0x1000)
        chip.send("CLR_STATUS")
    chip.send("MULTI_UPDATE", 0x3)
    for axis in ("SET_1", "SET_2"):
        chip.send(axis)
        chip.wait(ds.MOTION_COMPLETE)
    chip.bus.delay("50ms")


DEMO: Final = Demo(
    title="MC1241A and two stepper motors",
    board=_BOARD,
    chip="xy",
    gauges=(
        Gauge("target 1 (microsteps)", "target 1", 30_000),
        Gauge("actual 1 (counts)", "actual 1", 4700),
        Gauge("error 1 (counts)", "error 1", 20),
        Gauge("target 2 (microsteps)", "target 2", 30_000),
        Gauge("actual 2 (counts)", "actual 2", 4700),
        Gauge("error 2 (counts)", "error 2", 20),
    ),
    flags={"status 1": ds.STATUS_BITS},
    explain=_explain,
    host=_host,
    rest=(0, 0),
)
