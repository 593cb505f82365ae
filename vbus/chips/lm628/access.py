"""How a host moves words to and from an LM628 or LM629, for asyncio."""

from vbus.chips.lm628.datasheet import BUSY, COMMAND_PORT, DATA_PORT
from vbus.client.aio.access import Packets


class Lm628Packets(Packets):
    """One LM628 or LM629: status, and packets of a command and its words (LM-BUS-6, LM-BUS-7).

    The status byte can be read at any time (LM-BUS-5); busy is its bit 0 (LM-BUS-14).
    """

    COMMAND_PORT = COMMAND_PORT
    DATA_PORT = DATA_PORT
    READY_MASK = BUSY
    READY_LEVEL = 0
