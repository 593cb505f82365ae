"""The host port: busy, command bytes, data words, and hosts that break the rules."""

from collections.abc import Callable
from typing import ClassVar, Final

from mypy_extensions import i64

from vbus.chips.lm628 import datasheet as ds
from vbus.core.kernel import HELD, NEVER, Clock
from vbus.core.options import Value
from vbus.core.signals import Rule
from vbus.core.state import Names

Report = Callable[[Rule, str, int], None]
"""Files a violation: rule, detail, instant (ps)."""
Execute = Callable[[int, int, int], bool]
"""Carries out a step of a command: code, step, word. False if there is no such command."""

_NOTHING: Final = 0
_COMMAND: Final = 1
_WORD: Final = 2
_FETCH: Final = 3

_STATUS: Final = 0
_BYTE: Final = 1
_REPEAT: Final = 2
_UNASKED: Final = 3
_LOST: Final = 4

_NO_BYTE: Final = 0xFF

NO_COMMAND: Final = -1
"""In place of a command's code."""


def _undefined(code: int, step: int, word: int) -> bool:
    return False


class PortState:
    """State of the two ports.

    A byte that makes the chip busy has its effect when busy falls (LM-BUS-9): :meth:`finish` is
    called then. A command is carried out in steps: step 0 for the command byte, step n for the
    n-th data word.

    Args:
        clock: the chip's clock.
        settings: busy_clk, busy_jitter_clk, seed, busy.
        report: files violations.

    Attributes:
        busy_end: instant at which busy falls, NEVER if the chip is not busy (ps).
        words_due: data words the host still has to write.
    """

    STATE: ClassVar[Names] = (
        "busy_end", "words_due", "_pending", "_value", "_code", "_step", "_reply: list[i64, ...]",
        "_second: bool", "_high", "_latched", "_kind", "_random",
    )  # fmt: skip
    WIRING: ClassVar[Names] = ("_execute", "worst")

    def __init__(self, clock: Clock, settings: dict[str, Value], report: Report) -> None:
        self._clock: Clock = clock
        self._report: Report = report
        self._execute: Execute = _undefined
        self._busy_clk: int = int(settings["busy_clk"])
        self._jitter_clk: int = int(settings["busy_jitter_clk"])
        self.worst: bool = settings["busy"] == "worst"
        """Whether each byte keeps the chip busy for as long as it may (LM-BUS-8)."""
        self._random: int = int(settings["seed"])
        self._value: int = 0
        self._code: int = 0
        self._step: int = 0
        self._high: int = 0
        self._kind: int = _STATUS
        self.reset()

    def serve(self, execute: Execute) -> None:
        """Have ``execute`` carry out the commands."""
        self._execute = execute

    def reset(self) -> None:
        """Forget packets and the last byte (LM-RST-2, LM-RST-4)."""
        self.busy_end: i64 = NEVER
        self._pending: int = _NOTHING
        self._latched: int = 0
        self._drop_packet()
        # A data read under way at the reset shows the byte after reset, 00h.
        if self._kind != _STATUS:
            self._kind = _REPEAT

    def _drop_packet(self) -> None:
        self.words_due: int = 0
        self._reply: list[int] = []
        self._second: bool = False

    def reply(self, value: int, words: int) -> None:
        """Give the host ``words`` 16-bit words to read, high word first (LM-BUS-6)."""
        self._reply = [value >> 16 & 0xFFFF, value & 0xFFFF] if words == 2 else [value & 0xFFFF]

    @property
    def busy(self) -> bool:
        """Whether a byte is being digested."""
        return self.busy_end != NEVER

    def _begin_busy(self, now: int, pending: int, value: int) -> None:
        """LM-BUS-8: busy for its nominal time, give or take the jitter, never above the cap."""
        self._pending = pending
        self._value = value
        # Without a clock busy does not fall: it is counted from when the clock comes back.
        if self._clock.stopped:
            now = HELD
        if self.worst:
            self.busy_end = now + ds.BUSY_CAP
            return
        clk = self._busy_clk
        if self._jitter_clk:
            # One word of state, for snapshots; the upper half is drawn from, as the lower bits of
            # such a generator repeat soon.
            self._random = (self._random * 1664525 + 1013904223) & 0xFFFFFFFF
            clk += (self._random >> 16) % (2 * self._jitter_clk + 1) - self._jitter_clk
            clk = max(clk, 1)
        self.busy_end = now + min(self._clock.span(clk), ds.BUSY_CAP)

    # -- writing ------------------------------------------------------------------------------

    def write_command(self, code: int, now: int) -> None:
        """A command byte was latched; the chip is not in reset."""
        # LM-BUS-10: ignored; no command error.
        if self.busy:
            self._report(ds.BUSY_WRITE, f"command {code:02X}H written while busy", now)
            return
        # LM-BUS-11: data of the command before, of either direction, is still due.
        if self.words_due or self._reply:
            self._report(
                ds.CUT_PACKET, f"command {code:02X}H written before the data was complete", now
            )
        # LM-BUS-11: an odd byte is dropped; complete words have reached their buffers.
        self._drop_packet()
        if code == ds.RESET:
            # LM-RST-4: a reset begins at the strobe; busy shows for all of it, not for a busy time.
            self._execute(code, 0, 0)
        else:
            # LM-BUS-7: any command byte that is accepted, also an undefined one.
            self._begin_busy(now, _COMMAND, code)

    def write_data(self, data: int, now: int) -> bool:
        """A data byte was latched; False is a command error (LM-BUS-12)."""
        if self.busy:
            # LM-BUS-10: ignored; no command error.
            self._report(ds.BUSY_WRITE, f"data {data:02X}H written while busy", now)
        elif not self.words_due:
            self._report(ds.WRONG_WAY, f"data {data:02X}H written, none was expected", now)
            return False
        elif self._second:
            self._second = False
            # LM-BUS-7, LM-BUS-6: with the second, low byte of a word; the first leaves busy 0.
            self._begin_busy(now, _WORD, self._high << 8 | data)
        else:
            self._second = True
            self._high = data
        return True

    # -- reading ------------------------------------------------------------------------------

    def begin_read(self, address: int, in_reset: bool, now: int) -> None:
        """/RD falls: a data byte is latched (LM-BUS-3); a status read touches nothing (LM-BUS-5).

        During reset 00h is read of the data port (LM-RST-4).
        """
        if address == ds.COMMAND_PORT:
            self._kind = _STATUS
        elif in_reset:
            self._kind = _REPEAT
        elif self.busy:
            # LM-BUS-10: the byte that was driven last comes again, and no pointer moves.
            self._report(ds.BUSY_READ, "data read while busy", now)
            self._kind = _REPEAT
        elif not self._reply:
            # LM-BUS-12: such a read returns the last byte again.
            self._report(ds.WRONG_WAY, "data read, none was expected", now)
            self._kind = _UNASKED
        else:
            self._kind = _BYTE
            word = self._reply[0]
            # LM-BUS-3, LM-BUS-6: a data byte stays as it was when /RD fell; the high byte comes
            # first.
            self._latched = word & 0xFF if self._second else word >> 8

    def lose_read(self) -> None:
        """The read under way is lost: FFh is returned, no pointer moves."""
        self._kind = _LOST

    def reading_status(self) -> bool:
        """Whether the read under way is of the status byte."""
        return self._kind == _STATUS

    @property
    def reading(self) -> int:
        """Kind of the read under way."""
        return self._kind

    def resume_read(self, kind: int) -> None:
        """Go on with a read of a kind after others: the word it began with may have been read."""
        self._kind = kind if kind in (_STATUS, _LOST) else _REPEAT

    def data_byte(self) -> int:
        """Return the byte the data read under way shows."""
        return _NO_BYTE if self._kind == _LOST else self._latched

    def end_data(self, now: int) -> int:
        """/RD rises: the pointer moves; return the byte the host has taken."""
        kind, self._kind = self._kind, _REPEAT
        # LM-BUS-4: the read takes no byte from the reply.
        if kind == _LOST:
            return _NO_BYTE
        if kind == _BYTE:
            if self._second:
                self._second = False
                # LM-BUS-7: with the second byte that is read, when /RD rises.
                self._begin_busy(now, _FETCH, 0)
            else:
                self._second = True
        return self._latched

    def unasked(self) -> bool:
        """Whether the read under way takes data not offered: a command error (LM-BUS-12)."""
        return self._kind == _UNASKED

    # -- when busy falls ----------------------------------------------------------------------

    def finish(self) -> None:
        """Busy falls: the byte that made the chip busy has its effect (LM-BUS-9)."""
        when = self.busy_end
        self.busy_end = NEVER
        if self._pending == _FETCH:
            # The word that was read goes; the next one is on the port when busy falls.
            del self._reply[0]
        elif self._pending == _WORD:
            self._step += 1
            self.words_due -= 1
            self._execute(self._code, self._step, self._value)
        else:
            self._code = self._value
            self._step = 0
            # LM-BUS-13: busy as for any command; then nothing is done but report it.
            if not self._execute(self._code, 0, 0):
                self._report(
                    ds.UNDEFINED_COMMAND, f"command {self._code:02X}H is not defined", when
                )
        self._pending = _NOTHING

    def next_step(self) -> tuple[int, int, int]:
        """Return code (:data:`NO_COMMAND`: none), step and word carried out when busy falls."""
        if self._pending == _WORD:
            return self._code, self._step + 1, self._value
        return (self._value if self._pending == _COMMAND else NO_COMMAND), 0, 0
