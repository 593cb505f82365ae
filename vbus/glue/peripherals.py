"""What peripheral parts do: a port chip, a quadrature counter, port expanders on I2C.

Functions as in :mod:`vbus.glue.logic`. State 0 is how a part is after power-on.
"""

from typing import Final

from vbus.glue.logic import Function, Levels, Outcome, number

_PPI_RESET: Final = 0x9B
"""Control word of an 82C55 after a reset: all ports are inputs."""
_CONTROL: Final = 3


def port_chip(now: Levels, was: Levels, state: int) -> Outcome:
    """82C55 in mode 0: RESET, /CS, /RD, /WR, A0, A1, D0-D7, and the pins of ports A, B, C.

    The outputs are D0-D7 and the pins. Modes 1 and 2 set directions alone: there is no handshake.
    The state is what the ports hold, and the control word exclusive or that of a reset.
    """
    if now[0]:
        state = 0
    # A write ends with the first of /CS and /WR to rise, and takes what stood before.
    elif now[1] | now[3] > was[1] | was[3]:
        state = _port_written(state, number(was[4:6]), number(was[6:14]))
    control, held, address = state >> 24 ^ _PPI_RESET, state & 0xFFFFFF, number(now[4:6])
    out = sum(
        mask for bit, mask in ((0x10, 0xFF), (0x02, 0xFF00), (0x01, 0x0F0000), (0x08, 0xF00000))
        if not control & bit
    )  # fmt: skip
    seen = (held & out) | (number(now[14:38]) & ~out)
    data = control if address == _CONTROL else seen >> 8 * address & 0xFF
    reading = not now[1] | now[2] and now[3]
    return state, data | held << 8, (0xFF if reading else 0) | out << 8


def _port_written(state: int, address: int, data: int) -> int:
    if address != _CONTROL:
        return (state & ~(0xFF << 8 * address)) | data << 8 * address
    if data & 0x80:
        return (data ^ _PPI_RESET) << 24  # the output latches are cleared
    bit = 1 << 16 + (data >> 1 & 7)
    return state | bit if data & 1 else state & ~bit


_PHASE: Final = {(0, 0): 0, (1, 0): 1, (1, 1): 2, (0, 1): 3}
_INHIBIT, _LOW_READ = 1, 2


def quadrature_counter(now: Levels, was: Levels, state: int) -> Outcome:
    """HCTL-2016: SEL, /OE, /RST, CHA, CHB; the outputs are D0-D7.

    Its clock is taken to be faster than all else, so its filter passes every edge. The count is up
    while CHA leads. Reading the high byte (SEL low) holds both bytes until the low one has been
    read. The state is the count, the bytes held from bit 16 on, and the inhibit logic.
    """
    select, disabled, running = now[:3]
    count, held, flags = state & 0xFFFF, state >> 16 & 0xFFFF, state >> 32
    step = _PHASE[now[3], now[4]] - _PHASE[was[3], was[4]] & 3
    # Both channels at once are no step: which way it went cannot be known.
    count = count + (1 if step == 1 else -1 if step == 3 else 0) & 0xFFFF
    if not running:
        count = flags = 0
    elif disabled:
        flags = 0 if flags & _LOW_READ else flags
    elif not select:
        flags = _INHIBIT
    elif flags:
        flags |= _LOW_READ
    if not flags:
        held = count
    data = held & 0xFF if select else held >> 8
    return count | held << 16 | flags << 32, data, 0 if disabled else 0xFF


_IDLE, _ADDRESS, _WRITE, _READ = range(4)
_ACKNOWLEDGE: Final = 8
"""Eight bits have gone by: the ninth clock is to come, or under way."""
_BYTES: Final = (1 << 48) - 1
_INPUT, _OUTPUT, _INVERT, _DIRECTION = range(4)
"""The registers of a PCA9554, by its command byte."""


def expander(base: int, registers: bool) -> Function:
    """Return what a port expander does: SCL, SDA, A0-A2, P0-P7; outputs SDA, /INT, P0-P7.

    The state has, lowest byte first: shift register; phase, SDA in bit 2, "first byte" in bit 3 and
    clocks from bit 4 on; command, output exclusive or FFh, inversion, direction exclusive or FFh;
    and the pins as they were read last, with "have been" in bit 8.

    Args:
        base: its address with A0 to A2 low.
        registers: a PCA9554; else a PCF8574: pins that pull low, or are inputs.
    """

    def function(now: Levels, was: Levels, state: int) -> Outcome:
        shift, bits, *memory = (state & _BYTES).to_bytes(6, "little")
        phase, pulls, first, count = bits & 3, bits >> 2 & 1, bits >> 3 & 1, bits >> 4
        seen = state >> 48
        pins = number(now[5:13])
        if not seen:
            seen = 0x100 | pins
        rises, falls = now[0] > was[0], now[0] < was[0]
        if now[0] and was[0] and now[1] != was[1]:  # a start, or a stop
            phase, count, shift, pulls = _IDLE if now[1] else _ADDRESS, 0, 0, 0
        elif rises and phase in (_ADDRESS, _WRITE) and count < _ACKNOWLEDGE:
            shift, count = (shift << 1 | now[1]) & 0xFF, count + 1
        elif rises and phase == _READ:
            if count > _ACKNOWLEDGE and now[1]:
                phase = _IDLE  # the master has enough
            elif count < _ACKNOWLEDGE:
                count += 1
        elif falls and phase != _IDLE:
            ends = count > _ACKNOWLEDGE  # the ninth clock
            if phase == _ADDRESS and count == _ACKNOWLEDGE:
                matches = shift >> 1 == base + number(now[2:5])
                phase, count, pulls = (_ADDRESS, count + 1, 1) if matches else (_IDLE, 0, 0)
            elif phase == _WRITE and count == _ACKNOWLEDGE:
                memory = _taken(memory, shift, bool(first), registers)
                first, count, pulls = 0, count + 1, 1
            elif phase == _READ and count == _ACKNOWLEDGE:
                count, pulls = count + 1, 0
            elif ends and (phase == _READ or (phase == _ADDRESS and shift & 1)):
                phase, count, shift = _READ, 0, _given(memory, pins, registers)
                if not registers or memory[0] == _INPUT:
                    seen = 0x100 | pins
            elif ends:
                first, phase = int(phase == _ADDRESS), _WRITE
                count = shift = pulls = 0
                seen = seen if registers else 0x100 | pins
            if phase == _READ and count < _ACKNOWLEDGE:
                pulls = ~shift >> 7 - count & 1
        low, inputs = memory[1], memory[3] ^ 0xFF if registers else memory[1] ^ 0xFF
        asks = (pins ^ seen) & inputs & 0xFF != 0
        bits = phase | pulls << 2 | first << 3 | count << 4
        state = int.from_bytes(bytes([shift, bits, *memory]), "little") | seen << 48
        levels = low ^ 0xFF if registers else 0
        driven = inputs ^ 0xFF
        return state, levels << 2, pulls | asks << 1 | driven << 2

    return function


def _taken(memory: list[int], data: int, first: bool, registers: bool) -> list[int]:
    """Return command, output, inversion and direction after a written byte."""
    command, output, invert, direction = memory
    if not registers:
        return [command, data ^ 0xFF, invert, direction]
    if first:
        return [data & 3, output, invert, direction]
    if command == _OUTPUT:
        output = data ^ 0xFF
    elif command == _INVERT:
        invert = data
    elif command == _DIRECTION:
        direction = data ^ 0xFF
    return [command, output, invert, direction]


def _given(memory: list[int], pins: int, registers: bool) -> int:
    command, output, invert, direction = memory
    if not registers:
        return pins
    return (pins ^ invert, output ^ 0xFF, invert, direction ^ 0xFF)[command]
