"""How a host moves words to and from an MC1241A or MC1141A, for asyncio."""

from typing import Final

from vbus.chips.mc1241a.datasheet import COMMAND_PORT, COMMANDS, DATA_PORT, STATUS_READY
from vbus.client.aio.access import Packets
from vbus.client.aio.bus import ChipCycles
from vbus.core.errors import ChecksumError

READY_POLLS: Final = 10_000
"""Status reads after which a chip set is given up: a reset takes 2 ms."""
_RESET: Final = COMMANDS["RESET"].code
"""After a reset there is no checksum (PMD-RST-1)."""


class Mc1241aPackets(Packets):
    """One chip set: the adapter's status byte, and packets with their checksums (PMD-PKT-1).

    Args:
        cycles: the chip set on its bus, from :meth:`~vbus.client.aio.bus.Bus.chip`; or a bus
            with one chip.
        ready: how HostRdy is waited for: ``"poll"`` or ``"wait"``.
        polls: status reads after which a busy chip set is given up.
        checked: read and compare the checksum of every packet (PMD-PKT-2).
    """

    COMMAND_PORT = COMMAND_PORT
    DATA_PORT = DATA_PORT
    READY_MASK = STATUS_READY
    READY_LEVEL = STATUS_READY

    def __init__(
        self, cycles: ChipCycles, *, ready: str = "poll", polls: int = READY_POLLS,
        checked: bool = False,
    ) -> None:  # fmt: skip
        super().__init__(cycles, ready=ready, polls=polls)
        self.checked: bool = checked

    async def packet(self, code: int, words: tuple[int, ...], count: int) -> list[int]:
        """Write a command byte and words, then read ``count`` words; return these.

        Raises:
            NotReadyError: the chip set stays busy; the rest of the packet is not sent.
            ChecksumError: the checksum is another one.
            ValueError: a word that does not fit.
        """
        if not self.checked or code == _RESET:
            return await super().packet(code, words, count)
        *answers, checksum = await super().packet(code, words, count + 1)
        expected = (code + sum(words) + sum(answers)) & 0xFFFF
        if checksum != expected:
            raise ChecksumError(
                f"packet {code:02X}h: checksum {checksum:04X}h, expected {expected:04X}h"
            )
        return answers
