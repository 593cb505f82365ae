"""What parts of glue do: functions from inputs and state to outputs.

Each takes the levels of its inputs as they are and as they were before they moved, and the state
of the part, a number. It gives the new state, the levels of its outputs as bits of a number, the
first output lowest, and which of them it drives. What moves together with a clock comes too late
for it: registers take what was there before.
"""

from collections.abc import Callable, Mapping, Sequence
from typing import Final

Levels = tuple[int, ...]
Outcome = tuple[int, int, int]
"""State, levels of the outputs, and which of them are driven."""

Function = Callable[[Levels, Levels, int], Outcome]
ALL: Final = -1
"""Every output is driven."""


def number(bits: Sequence[int]) -> int:
    """Return the number whose lowest bit comes first."""
    return sum(bit << place for place, bit in enumerate(bits))


def gate(operate: Callable[[Levels], int]) -> Function:
    """One output of several inputs."""
    return lambda now, was, state: (state, operate(now) & 1, ALL)


def driver(active: int, width: int) -> Function:
    """An enable and so many wires: they are driven while it is ``active``."""

    def function(now: Levels, was: Levels, state: int) -> Outcome:
        return state, number(now[1 : 1 + width]), ALL if now[0] == active else 0

    return function


def decoder(select: int, enables: Levels) -> Function:
    """Inputs that select, lowest first, then enables with the levels they need; one output low."""

    def function(now: Levels, was: Levels, state: int) -> Outcome:
        high = (1 << (1 << select)) - 1
        on = now[select:] == enables
        return state, high & ~(1 << number(now[:select])) if on else high, ALL

    return function


def multiplexer(select: int, inverted: bool) -> Function:
    """Selecting inputs, an enable that is low, and sources; the output follows the selected one.

    Args:
        select: how many inputs select.
        inverted: whether a second output is the first one inverted.
    """

    def function(now: Levels, was: Levels, state: int) -> Outcome:
        level = 0 if now[select] else now[select + 1 + number(now[:select])]
        return state, level | (~level & 1) << 1 if inverted else level, ALL

    return function


def transparent(now: Levels, was: Levels, state: int) -> Outcome:
    """74HC373: output enable (low), latch enable, eight inputs."""
    if now[1]:
        state = number(now[2:])
    return state, state, 0 if now[0] else ALL


def clocked(
    step: Callable[[Levels, int], int], enables: bool = False, clears_at: int = 0,
    falling: bool = False,
) -> Function:  # fmt: skip
    """A clear, or an output enable (low), then a clock: a register whose outputs are its state.

    Args:
        step: gives the state after an edge of the clock, from the inputs before it and the state.
        enables: whether the first input enables the outputs.
        clears_at: else the level at which it clears.
        falling: whether the state changes when the clock falls.
    """

    def function(now: Levels, was: Levels, state: int) -> Outcome:
        if not enables and now[0] == clears_at:
            state = 0
        elif (now[1] < was[1]) if falling else (now[1] > was[1]):
            # The inputs as they were: what moves together with the clock misses its set-up time.
            state = step(was, state)
        return state, state, 0 if enables and now[0] else ALL

    return function


def taken(was: Levels, state: int) -> int:
    """All inputs behind the clock."""
    return number(was[2:])


def shifted_in(was: Levels, state: int) -> int:
    """74HC164: eight bits, shifted by one; two data inputs must be high both."""
    return (state << 1 | (was[2] & was[3])) & 0xFF


def counter(bits: int) -> Function:
    """Clear (high) and clock that falls, and so many outputs of a counter that goes up."""
    mask = (1 << bits) - 1
    return clocked(lambda was, state: state + 1 & mask, clears_at=1, falling=True)


def flip_flop(now: Levels, was: Levels, state: int) -> Outcome:
    """One half of a 74HC74: clear and preset (low), clock, data; while both are low both are high.

    The state is Q and the other output.
    """
    clear, preset, clock, _ = now
    if not (clear and preset):
        state = (0 if preset else 1) | (0 if clear else 2)
    elif clock > was[2]:
        state = 1 if was[3] else 2
    # Just powered, or both released together: data books leave it open; Q is low, so runs repeat.
    elif state in (0, 3):
        state = 2
    return state, state, ALL


def transceiver(now: Levels, was: Levels, state: int) -> Outcome:
    """74HC245: direction (high: A to B), enable (low), A0-A7, B0-B7; the outputs are A, then B."""
    direction, disabled = now[:2]
    a, b = number(now[2:10]), number(now[10:18])
    driven = 0 if disabled else 0xFF00 if direction else 0x00FF
    return state, b | a << 8, driven


def parallel_in(now: Levels, was: Levels, state: int) -> Outcome:
    """74HC165: load (low), clock, inhibit, serial data, A to H; the outputs are QH and /QH."""
    if not now[0]:
        state = number(now[4:])
    elif now[1] | now[2] > was[1] | was[2]:
        state = (state << 1 | was[3]) & 0xFF
    last = state >> 7 & 1
    return state, last | (1 - last) << 1, ALL


def shift_and_store(now: Levels, was: Levels, state: int) -> Outcome:
    """74HC595: enable (low), clear (low), shift clock, storage clock, data; QA to QH and QH'.

    The state is the shift register, and the storage register above it.
    """
    shifted, stored = state & 0xFF, state >> 8
    # Before the shift: with both clocks tied the storage is one pulse behind, as the data book
    # says.
    if now[3] > was[3]:
        stored = shifted
    if not now[1]:
        shifted = 0
    elif now[2] > was[2]:
        shifted = (shifted << 1 | was[4]) & 0xFF
    last = (shifted >> 7) << 8
    return shifted | stored << 8, stored | last, 0x100 if now[0] else 0x1FF


def loaded_counter(synchronous: bool) -> Function:
    """74HC161, 74HC163: clear, load (low), clock, count enables P and T, A to D; QA to QD, RCO."""

    def function(now: Levels, was: Levels, state: int) -> Outcome:
        rises = now[2] > was[2]
        if not (was if synchronous else now)[0]:
            state = 0 if rises or not synchronous else state
        elif rises:
            if not was[1]:
                state = number(was[5:])
            elif was[3] & was[4]:
                state = (state + 1) & 15
        # Only T gates the carry: a chain of counters passes it on between two clocks.
        return state, state | (now[4] if state == 15 else 0) << 4, ALL

    return function


def supervisor(now: Levels, was: Levels, state: int) -> Outcome:
    """Manual reset (low): /RESET and its opposite."""
    return state, 1 if now[0] else 2, ALL


def jumper(now: Levels, was: Levels, state: int) -> Outcome:
    """It pulls low."""
    return state, 0, ALL


def _hit(levels: Levels, where: frozenset[int], lines: int) -> bool:
    """Whether address lines, lowest first, show one of some addresses, and what follows is low."""
    return number(levels[:lines]) in where and not any(levels[lines:])


def selected(where: frozenset[int], lines: int, active: int) -> Function:
    """Address lines, and inputs that must be low: one output, ``active`` at these addresses."""
    return lambda now, was, state: (
        state, active if _hit(now, where, lines) else 1 - active, ALL
    )  # fmt: skip


def strobed(where: frozenset[int], lines: int) -> Function:
    """Read and write strobe (low), address lines, and inputs that must be low: both strobes again.

    The outputs are low only at these addresses.
    """

    def function(now: Levels, was: Levels, state: int) -> Outcome:
        return state, number(now[:2]) if _hit(now[2:], where, lines) else 3, ALL

    return function


def stored(values: Mapping[int, int]) -> Function:
    """An enable (low), address lines: the byte at the address."""

    def function(now: Levels, was: Levels, state: int) -> Outcome:
        return state, values.get(number(now[1:]), 0xFF), 0 if now[0] else ALL

    return function


def card_latch(reset: int) -> Function:
    """RESET, write strobe (low), eight data lines: eight outputs that keep what is written.

    The state is what it holds, exclusive or what it holds after a reset.
    """

    def function(now: Levels, was: Levels, state: int) -> Outcome:
        # Every block starts with state 0, which stands for the byte after a reset.
        if now[0]:
            state = 0
        elif now[1] > was[1]:
            state = number(was[2:10]) ^ reset
        return state, state ^ reset, ALL

    return function


def pending(level: bool) -> Function:
    """RESET, write strobe (low), eight data lines, eight inputs: which inputs have been high.

    A written 1 clears; what comes at that instant stays.
    """

    def function(now: Levels, was: Levels, state: int) -> Outcome:
        high, before = number(now[10:18]), number(was[10:18])
        if now[0]:
            state = 0
        elif now[1] > was[1]:
            state &= ~number(was[2:10])
        if not now[0]:
            state |= high if level else high & ~before
        return state, state, ALL

    return function


def enabled(now: Levels, was: Levels, state: int) -> Outcome:
    """Eight bits and eight enables: whether one that is enabled is set."""
    return state, int(bool(number(now[:8]) & number(now[8:]))), ALL


def card_interrupt(active: Levels, latched: bool, edge: bool) -> Function:
    """Outputs that interrupt while they are at the levels ``active``; then, if latched, /ACK."""

    def wire(levels: Levels) -> bool:
        return any(level == on for level, on in zip(levels, active, strict=False))

    def function(now: Levels, was: Levels, state: int) -> Outcome:
        if wire(now) and not (latched and edge and wire(was)):
            state = 1
        elif not latched or not now[-1]:
            state = 0
        return state, 1 - state, ALL

    return function
