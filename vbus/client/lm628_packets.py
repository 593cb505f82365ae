# Made from aio/lm628_packets.py by vbus.tools.generate; change that file.
"""How a host moves words to and from an LM628 or LM629, blocking."""

from typing import Final

from vbus.chips.lm628.datasheet import BUSY, COMMAND_PORT, DATA_PORT
from vbus.client.bus import Cycles
from vbus.errors import NotReadyError

READY_POLLS: Final = 1000
"""Status reads after which a chip that is still busy is given up."""
READY_TIME: Final = "10ms"
"""The same where the board waits for us: far above the 100 us of the manual, and a reset."""


def words_of(value: int) -> tuple[int, int]:
    """Return a 32-bit value, signed or not, as two words, high word first."""
    if not -(1 << 31) <= value < 1 << 32:
        raise ValueError(f"{value} does not fit into 32 bits")
    return value >> 16 & 0xFFFF, value & 0xFFFF


class Lm628Packets:
    """One LM628 or LM629: status, and packets of a command and its words (LM-BUS-6, LM-BUS-7).

    Args:
        cycles: the chip on its bus, from :meth:`Bus.chip`; or a bus with one chip.
        ready: how busy is waited for. ``"poll"`` reads the status before each access, as a
            driver on hardware does. ``"wait"`` lets the board wait: a whole packet is one
            message, which is several times faster.
        polls: status reads after which a busy chip is given up.
    """

    def __init__(self, cycles: Cycles, *, ready: str = "poll", polls: int = READY_POLLS) -> None:
        if ready not in ("poll", "wait"):
            raise ValueError(f"ready = {ready!r}: allowed are 'poll' and 'wait'")
        self.cycles: Cycles = cycles
        self.ready: str = ready
        self.polls: int = polls

    def status(self) -> int:
        """Return the status byte; possible at any time (LM-BUS-5)."""
        return self.cycles.read(COMMAND_PORT)

    def wait_ready(self) -> None:
        """Read the status until busy is low (LM-BUS-14).

        Raises:
            NotReadyError: it is still high after the number of polls allowed.
        """
        for _ in range(self.polls):
            if not self.status() & BUSY:
                return
        raise NotReadyError(f"the chip is still busy after {self.polls} status reads")

    def command(self, code: int, *words: int) -> None:
        """Write a command byte and its data words.

        Words are 16 bits, signed or not.

        Raises:
            NotReadyError: the chip stays busy; the rest of the packet is not sent.
            ValueError: a word that does not fit.
        """
        pairs = [_bytes_of(word) for word in words]
        if self.ready == "wait":
            self._packet(code, pairs, 0)
            return
        self.wait_ready()
        self.cycles.write(COMMAND_PORT, code)
        for pair in pairs:
            self.wait_ready()
            self.cycles.writes(DATA_PORT, pair)

    def query(self, code: int, count: int) -> int:
        """Write a command byte and read ``count`` words; return them as one unsigned number.

        Raises:
            NotReadyError: the chip stays busy.
        """
        if self.ready == "wait":
            return self._packet(code, [], count)
        self.wait_ready()
        self.cycles.write(COMMAND_PORT, code)
        value = 0
        for _ in range(count):
            self.wait_ready()
            value = value << 16 | int.from_bytes(self.cycles.reads(DATA_PORT, 2), "big")
        return value

    def _packet(self, code: int, pairs: list[bytes], count: int) -> int:
        """Move a whole packet in one message."""
        with self.cycles.batch() as batch:
            waits = [batch.wait(READY_TIME)]
            batch.write(COMMAND_PORT, code)
            for pair in pairs:
                waits.append(batch.wait(READY_TIME))
                batch.writes(DATA_PORT, pair)
            words = []
            for _ in range(count):
                waits.append(batch.wait(READY_TIME))
                words.append(batch.reads(DATA_PORT, 2))
        if not all(wait.value.ready for wait in waits):
            raise NotReadyError(f"the chip is still busy after {READY_TIME}")
        return int.from_bytes(b"".join(word.value for word in words), "big")


def _bytes_of(word: int) -> bytes:
    if not -(1 << 15) <= word < 1 << 16:
        raise ValueError(f"{word} does not fit into 16 bits")
    return (word & 0xFFFF).to_bytes(2, "big")
