# Made from aio/access.py by contrib.generate; change that.
"""How a host moves words and register values to and from a chip, blocking."""

from typing import Final

from vbus.client.blocking import Blocking
from vbus.client.bus import ChipCycles

READY_POLLS: Final = 1000
READY_TIME: Final = "10ms"

class Packets(Blocking):
    """Packets of a command byte and 16-bit words, high byte first.

    A family says where its ports are and which status bit tells that it is ready.

    Args:
        cycles: the chip on its bus, from :meth:`~vbus.client.bus.Bus.chip`; or a bus
            with one chip.
        ready: how busy is waited for. ``"poll"`` reads the status before each access, as a
            driver on hardware does. ``"wait"`` lets the board wait: a whole packet is one
            message, which is several times faster.
        polls: status reads after which a busy chip is given up.
        checked: look after every packet whether the chip has taken it, by what it tells of that.
    """

    cycles: ChipCycles
    ready: str
    polls: int
    checked: bool
    COMMAND_PORT: int = 0
    DATA_PORT: int = 1
    READY_MASK: int = 0
    READY_LEVEL: int = 0

    def __init__(
        self,
        cycles: ChipCycles,
        *,
        ready: str = "poll",
        polls: int = READY_POLLS,
        checked: bool = False,
    ) -> None: ...
    def status(self) -> int:
        """Return the status byte; possible at any time."""

    def wait_ready(self) -> None:
        """Read the status until the chip is ready.

        Raises:
            NotReadyError: it still is not after the number of polls allowed.
        """

    def command(self, code: int, *words: int) -> None:
        """Write a command byte and its data words.

        Words are 16 bits, signed or not.

        Raises:
            NotReadyError: the chip stays busy; the rest of the packet is not sent.
            ValueError: a word that does not fit.
        """

    def query(self, code: int, count: int) -> int:
        """Write a command byte and read ``count`` words; return them as one unsigned number.

        Raises:
            NotReadyError: the chip stays busy.
        """

    def packet(self, code: int, words: tuple[int, ...], count: int) -> list[int]:
        """Write a command byte and words, then read ``count`` words; return these.

        Raises:
            NotReadyError: the chip stays busy; the rest of the packet is not sent.
            ValueError: a word that does not fit.
        """

class RegisterCycles(Blocking):
    """Values of one or more bytes.

    Args:
        cycles: the chip on its bus, from :meth:`~vbus.client.bus.Bus.chip`; or a bus
            with one chip.
    """

    cycles: ChipCycles

    def __init__(self, cycles: ChipCycles) -> None: ...
    def read_bytes(self, addresses: tuple[int, ...], signed: bool = False) -> int:
        """Read the register at ``addresses`` (most significant byte first) as a number.

        The least significant byte is read first: it freezes the others where they are live.
        """

    def write_bytes(self, addresses: tuple[int, ...], value: int) -> None:
        """Write ``value`` to the register at ``addresses``, most significant byte first.

        Raises:
            ValueError: the value does not fit.
        """
