"""How a host moves words to and from an LM628 or LM629, for asyncio."""

from typing import Final

from vbus.chips.lm628.datasheet import BUSY, COMMAND_ERROR, COMMAND_PORT, COMMANDS, DATA_PORT
from vbus.client.aio.access import READY_POLLS, Packets
from vbus.client.aio.bus import ChipCycles
from vbus.core.errors import ReadBackError

_UNCHECKED: Final = (COMMANDS["RESET"].code, COMMANDS["RSTI"].code)
"""After these the flag is that of an earlier command, or says nothing yet."""


class Lm628Packets(Packets):
    """One LM628 or LM629: status, and packets of a command and its words (LM-BUS-6, LM-BUS-7).

    The status byte can be read at any time (LM-BUS-5); busy is its bit 0 (LM-BUS-14).

    Args:
        cycles: the chip on its bus, from :meth:`~vbus.client.aio.bus.Bus.chip`; or a bus
            with one chip.
        ready: how busy is waited for, ``"poll"`` or ``"wait"``.
        polls: status reads after which a busy chip is given up.
        checked: look after every packet whether the chip has taken it for an error (LM-AMB-12).
    """

    COMMAND_PORT = COMMAND_PORT
    DATA_PORT = DATA_PORT
    READY_MASK = BUSY
    READY_LEVEL = 0

    def __init__(
        self, cycles: ChipCycles, *, ready: str = "poll", polls: int = READY_POLLS,
        checked: bool = False,
    ) -> None:  # fmt: skip
        super().__init__(cycles, ready=ready, polls=polls)
        self.checked: bool = checked

    async def packet(self, code: int, words: tuple[int, ...], count: int) -> list[int]:
        """Write a command byte and words, then read ``count`` words; return these.

        Raises:
            NotReadyError: the chip stays busy; the rest of the packet is not sent.
            ReadBackError: the chip has found a command error.
            ValueError: a word that does not fit.
        """
        answers = await super().packet(code, words, count)
        if self.checked and code not in _UNCHECKED:
            await self.wait_ready()
            if (status := await self.status()) & COMMAND_ERROR:
                raise ReadBackError(
                    f"packet {code:02X}h: status {status:02X}h has a command error; RSTI clears it"
                )
        return answers
