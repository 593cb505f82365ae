# Made from aio/packets.py by vbus.tools.generate; change that file.
"""How a host moves words to and from a chip that takes packets and has a busy bit, blocking."""

from typing import Final

from vbus.client.bus import ChipCycles
from vbus.client.words import bytes_of
from vbus.errors import NotReadyError

READY_POLLS: Final = 1000
"""Status reads after which a chip that is still busy is given up."""
READY_TIME: Final = "10ms"
"""The same where the board waits for us: far above every busy time, and a reset."""


class Packets:
    """Packets of a command byte and 16-bit words, high byte first.

    A family says where its ports are and which status bit tells that it is ready.

    Args:
        cycles: the chip on its bus, from :meth:`~vbus.client.bus.Bus.chip`; or a bus
            with one chip.
        ready: how busy is waited for. ``"poll"`` reads the status before each access, as a
            driver on hardware does. ``"wait"`` lets the board wait: a whole packet is one
            message, which is several times faster.
        polls: status reads after which a busy chip is given up.
    """

    COMMAND_PORT: int = 0
    DATA_PORT: int = 1
    READY_MASK: int = 0
    """The status bit."""
    READY_LEVEL: int = 0
    """What is left of the status under the mask while the chip is ready."""

    def __init__(
        self, cycles: ChipCycles, *, ready: str = "poll", polls: int = READY_POLLS
    ) -> None:
        if ready not in ("poll", "wait"):
            raise ValueError(f"ready = {ready!r}: allowed are 'poll' and 'wait'")
        self.cycles: ChipCycles = cycles
        self.ready: str = ready
        self.polls: int = polls

    def status(self) -> int:
        """Return the status byte; possible at any time."""
        return self.cycles.read(self.COMMAND_PORT)

    def wait_ready(self) -> None:
        """Read the status until the chip is ready.

        Raises:
            NotReadyError: it still is not after the number of polls allowed.
        """
        for _ in range(self.polls):
            if self.status() & self.READY_MASK == self.READY_LEVEL:
                return
        raise NotReadyError(f"the chip is still busy after {self.polls} status reads")

    def command(self, code: int, *words: int) -> None:
        """Write a command byte and its data words.

        Words are 16 bits, signed or not.

        Raises:
            NotReadyError: the chip stays busy; the rest of the packet is not sent.
            ValueError: a word that does not fit.
        """
        self.packet(code, words, 0)

    def query(self, code: int, count: int) -> int:
        """Write a command byte and read ``count`` words; return them as one unsigned number.

        Raises:
            NotReadyError: the chip stays busy.
        """
        value = 0
        for word in self.packet(code, (), count):
            value = value << 16 | word
        return value

    def packet(self, code: int, words: tuple[int, ...], count: int) -> list[int]:
        """Write a command byte and words, then read ``count`` words; return these.

        Raises:
            NotReadyError: the chip stays busy; the rest of the packet is not sent.
            ValueError: a word that does not fit.
        """
        pairs = [bytes_of(word) for word in words]
        if self.ready == "wait":
            return self._message(code, pairs, count)
        self.wait_ready()
        self.cycles.write(self.COMMAND_PORT, code)
        for pair in pairs:
            self.wait_ready()
            self.cycles.writes(self.DATA_PORT, pair)
        answers = []
        for _ in range(count):
            self.wait_ready()
            answers.append(int.from_bytes(self.cycles.reads(self.DATA_PORT, 2), "big"))
        return answers

    def _message(self, code: int, pairs: list[bytes], count: int) -> list[int]:
        """Move a whole packet in one message."""
        with self.cycles.batch() as batch:
            waits = [batch.wait(READY_TIME)]
            batch.write(self.COMMAND_PORT, code)
            for pair in pairs:
                waits.append(batch.wait(READY_TIME))
                batch.writes(self.DATA_PORT, pair)
            words = []
            for _ in range(count):
                waits.append(batch.wait(READY_TIME))
                words.append(batch.reads(self.DATA_PORT, 2))
        if not all(wait.value.ready for wait in waits):
            raise NotReadyError(f"the chip is still busy after {READY_TIME}")
        return [int.from_bytes(word.value, "big") for word in words]
