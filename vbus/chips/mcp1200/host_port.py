"""The register map as the bus sees it: one byte at a time, with the manual's latches."""

from collections.abc import Callable
from typing import ClassVar, Final

from mypy_extensions import i64

from vbus.chips.mcp1200 import datasheet as ds
from vbus.chips.mcp1200.control_loop import (
    CONTROL,
    RESETTING,
    STANDING,
    ControlLoop,
    SampleTimer,
)
from vbus.chips.mcp1200.encoder import PositionCounter
from vbus.chips.mcp1200.pins import EncoderChannels, InputLevels
from vbus.chips.mcp1200.registers import FAR, RegisterFile
from vbus.chips.tables import names_of
from vbus.core.bits import sign_extend
from vbus.core.signals import Rule
from vbus.core.state import Names

Find = Callable[[Rule, int, int, str], bool]
"""Files a violation: rule, clock cycle, what was measured, detail."""

# MCP-CAP-1, MCP-AMB-15: by the table, bits 4 and 1 enable, and bits 3 and 0 are latches that a 0
# clears.
_STORED_CAPTURE_BITS: Final = (
    ds.BUSY_ON_PROF | ds.INDEX_RISING | ds.INDEX_CAPTURE | ds.TRIG_INPUT | ds.TRIG_CAPTURE
)
_CAPTURE_LATCHES: Final = ds.INDEX_LATCH | ds.TRIG_LATCH
_COMMAND: Final = ds.REGISTERS["COMMAND_POSITION"].addresses
_COMMAND_MSB, _COMMAND_CSB = _COMMAND[:2]
_FINAL_POSITION: Final = ds.REGISTERS["FINAL_POSITION"].addresses
_SATURATION: Final = ds.REGISTERS["SATURATION"].low
_PRESET: Final = ds.REGISTERS["PRESET_POSITION"].addresses
_MODE: Final = ds.REGISTERS["MODE"].low
_FEATURE: Final = ds.REGISTERS["FEATURE"].low
_JERK: Final = ds.REGISTERS["JERK"].addresses
_LEAD: Final = tuple(ds.REGISTERS[f"LEAD_{name}"].low for name in ("ZERO", "POLE", "GAIN"))
_GAINS: Final = tuple(ds.REGISTERS[name].low for name in ("KP", "KI", "KD"))
_PARTS: Final = tuple(
    ds.REGISTERS[name]
    for name in ("VELOCITY", "ACCELERATION", "BREAKPOINT", "MAX_ERROR", "JERK", "INTEGRAL_LIMIT")
)
"""Registers whose bytes after a reset the manual leaves open, or that are not 0 then."""
_ACTUAL_MSB, _ACTUAL_CSB, _ACTUAL_LSB = ds.REGISTERS["ACTUAL_POSITION"].addresses
_CAPTURE: Final = ds.REGISTERS["CAPTURE"].addresses
_PINS: Final = (("/LIMIT", 0, ds.LIMIT_UNGUARDED), ("/STOP", 2, ds.STOP_UNGUARDED))
"""Pins with an action, the lower bit of each in R04, and the rule that asks for it back."""
_HIGH_FIRST: Final = _ACTUAL_MSB << 8 | _ACTUAL_CSB


class WriteQueue:
    """Written bytes on their way in, in order (MCP-BUS-5).

    Attributes:
        due: cycle at which the first of them becomes visible, :data:`FAR` if there is none.
    """

    STATE: ClassVar[Names] = ("_waiting: list[(i64, i64, i64), ...]",)
    DERIVED: ClassVar[Names] = ("due",)

    def __init__(self) -> None:
        self._waiting: list[tuple[int, int, int]] = []
        self.due: i64 = FAR

    def add(self, cycle: int, address: int, data: int) -> None:
        """A byte has been written in ``cycle``."""
        # MCP-BUS-5: in whole clocks after the one in which /CS rose.
        self._waiting.append((cycle + ds.WRITE_CLK, address, data))
        self.after_load()

    def take(self) -> tuple[int, int]:
        """Return address and data of the first byte, which is visible now."""
        _, address, data = self._waiting.pop(0)
        self.after_load()
        return address, data

    def waits_for(self, registers: tuple[int, ...]) -> bool:
        """Tell whether a byte is on its way to one of some registers."""
        # Six bits of the address: with seven another register's byte may count, which makes the
        # host wait for an earlier instant, never for a later one.
        return any(address & 0x3F in registers for _, address, _ in self._waiting)

    def lose(self) -> None:
        """Forget the byte written last, if it is not yet visible."""
        # The byte that breaks a hold time is the last one, and waits still: a hold time is shorter
        # than four clocks.
        del self._waiting[-1:]
        self.after_load()

    def clear(self) -> None:
        """Forget all of them."""
        self._waiting.clear()
        self.after_load()

    def after_load(self) -> None:
        """Find out when the first of them becomes visible."""
        self.due = self._waiting[0][0] if self._waiting else FAR


def _registers(addresses: list[int]) -> str:
    return " and ".join(f"R{address:02X}" for address in addresses)


def _flags(flags: int) -> str:
    return names_of(ds.FLAG_BITS, flags, " and ")


def driven(registers: RegisterFile) -> str:
    """Return which motor command the outputs give, if any."""
    if registers.pwm == 0 and registers.dac == ds.DAC_ZERO:
        return ""
    return f"R08 is {registers.motor_command:02X}H, R09 {registers.pwm_command & 0xFF:02X}H"


class HostRegisters:
    """What reading and writing a byte does: the methods that the rows of the table name.

    Args:
        registers: where bytes are stored.
        timer: what R0F reads.
        counter: what R12 to R14 read and set.
        channels: the filter that R1A sets.
        loop: takes points, flags and positions.
        inputs: /LIMIT and /STOP, which hold errors and motor outputs.
        find: files a violation.
        ask: takes what is written to R05, and when.
    """

    STATE: ClassVar[Names] = (
        "_held_msb", "_held_csb", "_noted: set[i64]", "_position_bytes", "_late_bytes",
        "_latched: bool", "_held: set[i64]", "_written: set[i64]", "_jerked: bool",
        "_before", "_begun: bool", "_unserved: set[i64]", "_lost: set[i64]", "_no_integral: bool",
        "_unguarded",
    )  # fmt: skip

    def __init__(
        self,
        registers: RegisterFile,
        timer: SampleTimer,
        counter: PositionCounter,
        channels: EncoderChannels,
        loop: ControlLoop,
        inputs: InputLevels,
        find: Find,
        ask: Callable[[int, int], None],
    ) -> None:
        self._registers: RegisterFile = registers
        self._timer: SampleTimer = timer
        self._counter: PositionCounter = counter
        self._channels: EncoderChannels = channels
        self._loop: ControlLoop = loop
        self._inputs: InputLevels = inputs
        self._find: Find = find
        self._ask: Callable[[int, int], None] = ask
        self._held_msb: int = 0
        self._held_csb: int = 0
        self._noted: set[int] = set()
        self._position_bytes: int = 0
        """Bytes of a final position written since F0 was set last, a bit each, whole at 7."""
        self._late_bytes: int = 0
        """Those that were not written when it was set, although others were."""
        self._latched: bool = False
        """R14 has been read, or R13 and R12 are known to be stale."""
        self._held: set[int] = set()
        """Bytes that wait for the last one, R0E or R17."""
        self._written: set[int] = set()
        """Addresses of storage that have been written since a reset."""
        self._jerked: bool = False
        """A jerk has been written, and no profile started since."""
        self._before: int = 0
        """Addresses of the last three accesses, the last one lowest, FFh for a write."""
        self._begun: bool = False
        """R05 = 03 has been written since a reset."""
        self._unserved: set[int] = set()
        """Settings written in idle mode since control began last, not with what a reset loads."""
        self._lost: set[int] = set()
        """Those of them that a soft reset has loaded, and that have not been written since."""
        self._no_integral: bool = False
        """Control has begun with an integral gain above 0 whose limit has been 0 ever since."""
        self._unguarded: int = 0
        """Actions of R04 that were taken back while their pins were low, where they stood."""

    def map(self, address: int) -> int:
        """Register a bus address selects: 6 bits of it, or 7 (MCP-BUS-9)."""
        return address & (0x7F if self._registers.config & ds.EXTENDED else 0x3F)

    def clear(self) -> None:
        """Forget held bytes: a hard reset."""
        self._held_msb = 0
        self._held_csb = 0
        self._latched = False
        self._held.clear()
        self._written.clear()
        self._begun = self._no_integral = False
        self._unguarded = 0
        self._unserved.clear()
        self._lost.clear()

    def serve(self) -> str:
        """Control begins: what is written is in force; return settings that a reset has undone."""
        registers = self._registers
        self._no_integral = registers.ki > 0 and not registers.integral_limit & 0x7FFF
        lost = _registers(sorted(self._lost))
        self._unserved.clear()
        self._lost.clear()
        return lost

    def undo(self) -> None:
        """A soft reset has loaded some registers (MCP-RST-4)."""
        self._lost |= self._unserved
        self._unserved.clear()

    def left_over(self) -> list[tuple[Rule, str]]:
        """Return which bytes were written in vain, and which were left out."""
        found = []
        if self._held:
            last = "R0E" if _COMMAND_MSB in self._held or _COMMAND_CSB in self._held else "R17"
            text = f"{_registers(sorted(self._held))} wait for a byte written to {last}"
            found.append((ds.LEFT_HELD, text))
        for row in _PARTS:
            missing = [byte for byte in row.addresses if byte not in self._written]
            if 0 < len(missing) < len(row.addresses):
                text = f"of {row.name} {_registers(missing)} have not been written since a reset"
                found.append((ds.PART_VALUE, text))
        registers = self._registers
        flags = registers.flag & ds.MODE_FLAGS
        # After an error it is the chip that has gone to idle mode.
        stands = ds.ERROR_FLAGS & ~int(registers.status)
        over = flags & (ds.F3 | ds.F4) if not registers.flag & ds.F2 else 0
        if self._loop.state == STANDING:
            if flags and not stands:
                found.append((ds.FLAG_LEFT, f"in idle mode at the end: {_flags(flags)}"))
            if driven(registers):
                found.append((ds.OUTPUT_LEFT, f"in idle mode at the end {driven(registers)}"))
        elif self._loop.state == CONTROL and over:
            found.append((ds.FLAG_LEFT, f"at the end the axis stands, and has {_flags(over)}"))
        if registers.exception >> 6 and registers.max_error == 0xFFFF and not registers.step_mode:
            text = f"R04 = {registers.exception:02X}H has an action, and R4A:R49 are FFFFH"
            found.append((ds.NO_MAX_ERROR, text))
        if self._no_integral:
            text = f"control has begun with Ki {registers.ki}, and R66:R65 have been 0 ever since"
            found.append((ds.NO_INTEGRAL, text))
        for name, place, rule in _PINS:
            before = self._unguarded >> place & 3
            if before and registers.exception >> place & 3 == ds.REPORT:
                text = f"R04 = {registers.exception:02X}H only reports {name} since it was left"
                found.append((rule, f"{text}: {ds.ACTIONS[before]} stood there"))
        return found

    def read(self, address: int, cycle: int) -> int:
        """Return the byte at ``address``; nothing changes."""
        hook = _READS.get(address)
        if hook is None:
            return self._registers.byte(address)
        byte: int = hook(self, address, cycle)
        return byte

    def taken(self, address: int, cycle: int) -> None:
        """The byte has been latched for the host: reading R14 latches R13 and R12."""
        before, self._before = self._before, (self._before << 8 | address) & 0xFFFFFF
        if address == _ACTUAL_LSB:
            # MCP-REG-16: latched together, so that the three are of one instant.
            old, new = self._registers.actual_position, self._counter.position(cycle)
            # A dump of all registers has read R11 before, and R14, R12, R13 again and again R14.
            alone = before >> 16 not in (_ACTUAL_MSB - 1, _ACTUAL_LSB)
            if before & 0xFFFF == _HIGH_FIRST and alone and old >> 8 != new >> 8:
                text = f"R12 and R13 are of {old} counts, and R14 after them is of {new}"
                self._find(ds.STALE_POSITION, cycle, old - new, text)
            self._registers.actual_position = new
            self._latched = True
        elif _ACTUAL_CSB - 1 <= address <= _ACTUAL_CSB and not self._latched:
            self._latched = True
            text = f"R{address:02X} is read, and R14 has not been"
            self._find(ds.STALE_READ, cycle, address, text)
        elif address in _CAPTURE:
            control = self._registers.capture_control
            off = not control & (ds.INDEX_CAPTURE | ds.TRIG_CAPTURE) and control & _CAPTURE_LATCHES
            # Beside its neighbour it is read in a dump, or has been judged.
            if off and not self._registers.capture and abs((before & 0xFF) - address) != 1:
                text = f"R{address:02X} is read with R03 = {control:02X}H"
                self._find(ds.NO_CAPTURE, cycle, control, f"{text}: nothing has been captured")
        elif address not in _WRITES:
            self._note(address, -1)

    def write(self, bus_address: int, data: int, cycle: int) -> None:
        """Take the byte ``data``; it is visible from ``cycle`` on."""
        address = self.map(bus_address)
        self._before = (self._before << 8 | 0xFF) & 0xFFFFFF
        # MCP-BUS-9: with six bits the write goes to another register.
        if address != bus_address and bus_address in _WRITES:
            meant = f"R{bus_address:02X} = {data:02X}H goes to R{address:02X}"
            self._find(ds.EXTENDED_OFF, cycle, bus_address, f"{meant}: bit 0 of R02 is 0")
        loop = self._loop
        resets = loop.state == RESETTING or loop.request == ds.SOFT_RESET_CODE
        if resets and (address, data) != (_MODE, ds.SOFT_RESET_CODE):
            text = f"R{address:02X} = {data:02X}H comes before F1 has risen after a reset"
            self._find(ds.RESET_WRITE, cycle, address, text)
        most = ds.LISTED_MOST.get(address)
        bits = ds.LISTED_BITS.get(address, 0xFF)
        if most is not None and data & bits > most:
            which = "" if bits == 0xFF else f" in its bits {bits:02X}H"
            text = f"R{address:02X} = {data:02X}H: the manual lists 00H to {most:02X}H{which}"
            self._find(ds.LISTED_RANGE, cycle, data, text)
        if address == _SATURATION and data in ds.FORCELESS:
            text = f"R4B = {data:02X}H: a saturated DAC port gives 800H, which is no force"
            self._find(ds.NO_FORCE, cycle, data, text)
        hook = _WRITES.get(address)
        if hook is None:
            self._note(address, cycle)
        else:
            hook(self, address, data, cycle)

    def _note(self, address: int, cycle: int) -> None:
        # MCP-BUS-10: once for each address: a driver that sweeps them would file thousands.
        if address not in self._noted:
            self._noted.add(address)
            self._find(
                ds.RESERVED, cycle, address, f"address {address:02X}H is not in the register table"
            )

    # -- what rows name -----------------------------------------------------------------------

    def read_sample_timer(self, address: int, cycle: int) -> int:
        """R0F reads the counter, not what it is loaded with (MCP-REG-14)."""
        return self._timer.count(cycle)

    def read_actual_position(self, address: int, cycle: int) -> int:
        """R14 reads the counter, R13 and R12 what was latched then (MCP-REG-16)."""
        if address == _ACTUAL_LSB:
            return self._counter.position(cycle) & 0xFF
        return self._registers.byte(address)

    def store(self, address: int, data: int, cycle: int) -> None:
        """A byte of storage; with the last one some registers take effect."""
        if address == _FEATURE:
            self._judge_filter(data, cycle)
        changes = self._registers.byte(address) != data
        self._registers.put(address, data)
        self._written.add(address)
        self._note_setting(address, data)
        self._jerked |= address in _JERK
        if address in _PRESET:
            self._hold(address, _PRESET)
        if address in _FINAL_POSITION:
            self._note_position(address, changes, cycle)
        loaded = _LOADED.get(address)
        if loaded is not None:
            loaded(self, cycle)

    def _note_setting(self, address: int, data: int) -> None:
        """A setting has been written that a soft reset would undo, or an integral limit."""
        registers = self._registers
        if address in ds.LOST:
            self._lost.discard(address)
            self._unserved.discard(address)
            if self._loop.state == STANDING and data != ds.LOST[address]:
                self._unserved.add(address)
        elif registers.integral_limit & 0x7FFF or not registers.ki:
            self._no_integral = False

    def _note_position(self, address: int, changes: bool, cycle: int) -> None:
        """A byte of the final position has come: perhaps one that F0 has not waited for."""
        registers = self._registers
        if registers.flag & ds.F0 and registers.phase > 4 and address == _FINAL_POSITION[-1]:
            text = f"R29 is written in phase {registers.phase} of the profile"
            self._find(ds.LATE_POSITION, cycle, int(registers.phase), text)
        early = registers.flag & ds.F3 and registers.capture_control & ds.INTERPOLATOR_BUSY
        if early and self._position_bytes % 7 & 1 and address != _FINAL_POSITION[-1]:
            text = f"R{address:02X} is written after R29, which has taken the point without it"
            self._find(ds.EARLY_POINT, cycle, address, text)
        bit = 1 << address - _FINAL_POSITION[-1]
        if not self._late_bytes & bit or not self._registers.flag & ds.F0:
            self._late_bytes = 0
            self._position_bytes = bit | self._position_bytes % 7  # 7 is a whole one
            return
        self._late_bytes &= ~bit
        if changes:
            text = f"R{address:02X} is written after F0 was set"
            self._find(ds.SPLIT_POSITION, cycle, address, text)

    def _judge_position(self, cycle: int) -> None:
        """F0 is set: say so if the final position has been written in part."""
        written, self._position_bytes = self._position_bytes, 0
        self._late_bytes = ~written & 7 if written else 0
        registers = self._registers
        if not written and registers.final_position == registers.command_position:
            text = "F0 is set where the final position is the command position"
            self._find(ds.NO_WAY, cycle, 0, text)
            # What comes before the next sample was to be this profile's.
            if self._loop.state == CONTROL and registers.acceleration:
                self._late_bytes = 7
        elif self._late_bytes:
            names = [f"R{_FINAL_POSITION[-1] + n:02X}" for n in range(3) if not written >> n & 1]
            text = f"of the final position {' and '.join(names)} stayed as before"
            self._find(ds.PART_POSITION, cycle, written, text)

    def ignore(self, address: int, data: int, cycle: int) -> None:
        """A register that cannot be written."""
        self._find(ds.READ_ONLY, cycle, address, f"R{address:02X} = {data:02X}H has no effect")

    def _judge_filter(self, data: int, cycle: int) -> None:
        """Say so if R01 makes another filter run, of which the host has written nothing."""
        leaves = self._registers.feature & ~data & ds.PID
        closed = self._loop.state == CONTROL and not self._registers.step_mode
        if leaves and closed and self._written.isdisjoint(_LEAD):
            text = "bit 3 of R01 is cleared in control mode: the lead filter runs, and R20 to R22"
            self._find(ds.FILTER_CHANGED, cycle, data, f"{text} have not been written")

    def write_flag(self, address: int, data: int, cycle: int) -> None:
        """One flag by number, set or cleared (MCP-FLG-1, 2)."""
        registers, loop = self._registers, self._loop
        flag = 1 << (data & 7)
        # MCP-FLG-2, MCP-AMB-12: F1, F2, 6 and 7 are the core's, or are not there.
        if not flag & ds.MODE_FLAGS:
            return
        # MCP-FLG-1: bit 3 sets or clears, bits 2 to 0 say which.
        if data & 8:
            # MCP-MOD-9, MCP-FLG-3: flag Fn reads in bit n, in idle mode too, where its mode waits
            # for control.
            registers.flag |= flag
            self._judge_flag(flag, cycle)
            # F2 acknowledges a profile at once, so that a host may wait for it to fall (NOTES 3).
            controls = loop.state == CONTROL and not loop.halted
            # MCP-FLG-4: at once, for a host that polls for its fall.
            if flag == ds.F0 and not registers.flag & ds.F1 and controls:
                registers.flag |= ds.F2
        else:
            if flag & ds.F5 and registers.flag & ds.F5 and registers.flag & ds.F2:
                fine = registers.feature & ds.HIGH_RESOLUTION
                goal = registers.velocity if fine else registers.velocity_command
                speed = abs(int(loop.command.velocity))
                if goal == 0 and speed > max(512, int(registers.acceleration)):
                    text = f"F5 is cleared on the way to velocity 0, at {speed / 256:.3g}"
                    self._find(ds.RAMP_CUT, cycle, speed, f"{text} counts a sample")
                else:
                    text = "F5 is cleared while F2 is 1: the axis is to stop in one sample"
                    self._find(ds.CLEARED_AT_SPEED, cycle, flag, text)
            registers.flag &= ~flag
            loop.drop(flag)

    def _judge_flag(self, flag: int, cycle: int) -> None:
        """Say so if the mode that a flag begins is not there yet, or cannot move."""
        registers, loop = self._registers, self._loop
        if loop.state == STANDING and loop.request == ds.CONTROL_CODE:
            self._find(ds.TOO_EARLY, cycle, flag, "R00 is written before R05 = 03 is obeyed")
        if loop.state == CONTROL and not registers.step_mode:
            self._judge_gains(flag, cycle)
        others = registers.flag & ds.MODE_FLAGS & ~flag
        if others:
            text = f"{_flags(flag)} is set beside {_flags(others)}"
            self._find(ds.TWO_MODES, cycle, flag, text)
        if flag == ds.F5 and registers.acceleration == 0:
            self._find(ds.NO_RATE, cycle, 0, "F5 is set with acceleration 0")
        if flag != ds.F0:
            return
        if not registers.feature & ds.S_CURVE and self._jerked:
            text = "R55 and R54 have been written, and the profile is a trapezoid"
            self._find(ds.JERK_UNUSED, cycle, 0, text)
        self._jerked = False
        self._judge_position(cycle)
        fine = registers.feature & ds.HIGH_RESOLUTION
        low = registers.profile_velocity
        velocity, other = (registers.velocity, low) if fine else (low, registers.velocity)
        if velocity == 0 != other:
            meant = "R28, and R01 chooses R23 to R25" if fine else "R23 to R25, and R01 chooses R28"
            self._find(ds.OTHER_VELOCITY, cycle, 0, f"the velocity is in {meant}, which is 0")
        elif velocity == 0 or registers.acceleration == 0:
            what = "velocity" if velocity == 0 else "acceleration"
            self._find(ds.NO_RATE, cycle, 0, f"the profile is started with {what} 0")

    def _judge_gains(self, flag: i64, cycle: int) -> None:
        """Say so if values are written for one filter, and the other runs as the reset left it."""
        registers, written = self._registers, self._written
        gains = (int(registers.kp), int(registers.ki), int(registers.kd))
        text = ""
        if registers.feature & ds.PID:
            # The lead filter's registers have not been written for nothing.
            if written.isdisjoint(_GAINS) and not written.isdisjoint(_LEAD):
                text = "R20 to R22 written, and the PID filter runs as"
        elif gains != ds.RESET_GAINS and written.isdisjoint(_LEAD):
            text = "Kp, Ki, Kd written, and the lead filter runs as"
        if text:
            text = f"{_flags(flag)} is set with {text} the reset has left it"
            self._find(ds.OTHER_FILTER, cycle, 0, text)

    def write_exception(self, address: int, data: int, cycle: int) -> None:
        """An action may be taken back for as long as a switch is closed (MCP-EXC-8)."""
        registers = self._registers
        levels = (self._inputs.limit, self._inputs.stop)
        for (_, place, _), level in zip(_PINS, levels, strict=True):
            before, after = registers.exception >> place & 3, data >> place & 3
            # Before control begins it is how the axis is set up.
            if before != after:
                self._unguarded &= ~(3 << place)
                if after == ds.REPORT and level == 0 and self._begun:
                    self._unguarded |= int(before) << place
        registers.put(address, data)
        self._note_setting(address, data)

    def write_config(self, address: int, data: int, cycle: int) -> None:
        """The position stays when the counter's source changes (MCP-STP-1)."""
        counter = self._counter
        here = counter.position(cycle)
        before = self._registers.config
        changed = (before ^ data) & ds.STEP_MODE
        repeats = before & ds.BREAK_ENABLE and data & ~before & ds.BREAK_REPEAT
        if repeats and counter.breakpoint.waiting:
            first, old = self._registers.breakpoint, counter.breakpoint.compare
            text = f"repeat mode is chosen before a sample has loaded the breakpoint {first}"
            self._find(ds.BREAKPOINT_LOST, cycle, int(first), f"{text}: it stays at {old}")
        self._registers.config = data
        # MCP-STP-1: steps or counts go on from the same position.
        if changed:
            counter.preset(here, cycle)

    def write_capture_control(self, address: int, data: int, cycle: int) -> None:
        """Latches can be cleared only, the busy bit not at all (MCP-CAP-2)."""
        registers = self._registers
        if data & (ds.TRIG_CAPTURE | ds.TRIG_INPUT) == ds.TRIG_CAPTURE:
            text = f"R03 = {data:02X}H: TRIG is to capture, and is an output"
            self._find(ds.TRIG_OUTPUT, cycle, data, text)
        kept = registers.capture_control & (ds.INTERPOLATOR_BUSY | data & _CAPTURE_LATCHES)
        registers.capture_control = data & _STORED_CAPTURE_BITS | kept

    def write_mode(self, address: int, data: int, cycle: int) -> None:
        """MCP-MOD-1."""
        if self._held and data == ds.CONTROL_CODE and self._loop.state == STANDING:
            text = f"R05 = 03 comes while {_registers(sorted(self._held))}"
            self._find(ds.HELD_AT_CONTROL, cycle, 0, f"{text} wait to be loaded")
        self._begun = data >= ds.CONTROL_CODE or (self._begun and data != ds.SOFT_RESET_CODE)
        self._ask(min(data, 3), cycle)

    def write_status(self, address: int, data: int, cycle: int) -> None:
        """Any byte clears the errors (MCP-STA-2)."""
        self.clear_errors()

    def clear_errors(self) -> None:
        """Error flags off, except of a pin that is still low (MCP-STA-2)."""
        flags = ds.ERROR_FLAGS
        # MCP-STA-2, MCP-EXC-4: a pin that is low keeps its own flag at 0.
        if not self._inputs.limit:
            flags &= ~ds.LIMIT_OK
        if not self._inputs.stop:
            flags &= ~ds.STOP_OK
        # MCP-AMB-20, MCP-AMB-21: the error flags are active low: cleared is 1.
        self._registers.status = self._registers.status & ~ds.ERROR_FLAGS | flags

    def guard(self) -> None:
        """Idle with /LIMIT low: the motor outputs stay off, whatever R04 says (MCP-MOD-4)."""
        if self._loop.state == STANDING and self._inputs.limit == 0:
            self._registers.outputs_off()

    def guard_outputs(self, cycle: int) -> None:
        """A motor command of the host's (MCP-MOD-4)."""
        if self._loop.state == CONTROL:
            text = "a motor command is written in control mode, and lasts to the next sample"
            self._find(ds.OUTPUT_IN_CONTROL, cycle, 0, text)
        self.guard()

    def write_output_low(self, address: int, data: int, cycle: int) -> None:
        """Its low four bits."""
        # MCP-REG-40, MCP-REG-41: bits 3 to 0 read 0.
        self._registers.put(address, data & 0xF0)
        self.guard_outputs(cycle)

    def load_command_increment(self, cycle: int) -> None:
        """One written while BUSY is high counts in the next sample (NOTES 2)."""
        loop, registers = self._loop, self._registers
        flags = registers.flag & ds.MODE_FLAGS
        if loop.state == CONTROL and registers.command_increment:
            if loop.increment_written:
                text = "R0B is written a second time before a sample has taken it"
                self._find(ds.INCREMENT_LOST, cycle, int(registers.command_increment), text)
            elif flags:
                text = f"R0B is written while {_flags(flags)} is set"
                self._find(ds.INCREMENT_WAITS, cycle, int(registers.command_increment), text)
        loop.increment_written = True

    def write_command_position(self, address: int, data: int, cycle: int) -> None:
        """The last byte loads all three (MCP-REG-13)."""
        # MCP-REG-13: held until the last byte takes all three at once.
        self._hold(address, _COMMAND)
        if address == _COMMAND_MSB:
            self._held_msb = data
        elif address == _COMMAND_CSB:
            self._held_csb = data
        else:
            value = self._held_msb << 16 | self._held_csb << 8 | data
            self._registers.command_position = sign_extend(value, 24)
            self._loop.command_written = True

    def _hold(self, address: int, addresses: tuple[int, ...]) -> None:
        """A byte of a register has come that waits for its last one."""
        if address == addresses[-1]:
            self._held.difference_update(addresses)
        else:
            self._held.add(address)

    def write_actual_position(self, address: int, data: int, cycle: int) -> None:
        """Any byte written to R13 clears the counter (MCP-REG-16)."""
        # MCP-REG-16: to R12 and R14 nothing can be written.
        if address == _ACTUAL_CSB:
            self._preset(0, cycle)
        else:
            self.ignore(address, data, cycle)

    def preset_position(self, cycle: int) -> None:
        """The counter is preset (MCP-REG-17)."""
        self._preset(self._registers.preset_position, cycle)

    def _preset(self, position: int, cycle: int) -> None:
        here = self._counter.position(cycle)
        closed = self._loop.state == CONTROL and not self._registers.step_mode
        if closed and abs(int(position - here)) > ds.JUMP_COUNTS:
            text = f"the counter is set from {here} to {position} while the loop is closed"
            self._find(ds.PRESET_IN_CONTROL, cycle, position - here, text)
        self._counter.preset(position, cycle)

    def write_encoder_pwm(self, address: int, data: int, cycle: int) -> None:
        """Encoder filter, and whether the channels are swapped (MCP-ENC-1)."""
        self._registers.put(address, data)
        self._channels.configure(cycle)

    def load_final_position(self, cycle: int) -> None:
        """A point for the interpolation is there (MCP-INT-2)."""
        # MCP-INT-2: the three bytes as they are at this write, whatever is written before the
        # segment.
        self._judge_point(ds.F3, ds.F4, cycle)
        self._loop.point = self._registers.final_position
        self._load(ds.F4)

    def load_velocity(self, cycle: int) -> None:
        """A velocity for the interpolation is there (MCP-INT-2)."""
        # MCP-INT-2: as with positions, R25 last.
        self._judge_point(ds.F4, ds.F3, cycle)
        self._loop.velocity_point = self._registers.velocity
        self._load(ds.F3)

    def _judge_point(self, own: i64, other: i64, cycle: int) -> None:
        """Say so if a point takes another's place, or the interpolation is of another kind."""
        modes = self._registers.flag & (ds.F3 | ds.F4)
        name = "position" if own == ds.F3 else "velocity"
        if modes == own and self._registers.capture_control & ds.INTERPOLATOR_BUSY:
            text = f"a {name} is written while bit 7 of R03 is 1: the one before is lost"
            self._find(ds.POINT_LOST, cycle, 0, text)
        elif modes == other and self._loop.state == CONTROL:
            text = f"a {name} is written while F{3 if other == ds.F3 else 4} is set"
            self._find(ds.OTHER_POINT, cycle, 0, text)

    def _load(self, other: i64) -> None:
        """The interpolator is busy, unless the other interpolation runs (NOTES 12)."""
        if not self._registers.flag & other:
            self._registers.capture_control |= ds.INTERPOLATOR_BUSY


_READS: Final = ds.REGISTERS.find_hooks("on_read", HostRegisters)
_WRITES: Final = ds.REGISTERS.find_hooks("on_write", HostRegisters, "store", "ignore")
_LOADED: Final = ds.REGISTERS.find_hooks("on_loaded", HostRegisters)
