"""How a host moves words and register values to and from a chip, for asyncio."""

from collections.abc import Awaitable, Callable, Iterator, Mapping
from types import ModuleType
from typing import Any, Final

from vbus.chips.tables import Command, Register
from vbus.client.aio.bus import ChipCycles
from vbus.client.aio.waits import Core
from vbus.core.bits import sign_extend
from vbus.core.errors import NotReadyError

READY_POLLS: Final = 1000
"""Status reads after which a chip that is still busy is given up, where polls take wall time."""
READY_TIME: Final = "10ms"
"""The same where the board waits for us: far above every busy time, and a reset."""


def words_of(value: int) -> tuple[int, int]:
    """Return a 32-bit value, signed or not, as two words, high word first."""
    # Signed or not: the chip knows which, by the command.
    if not -(1 << 31) <= value < 1 << 32:
        raise ValueError(f"{value} does not fit into 32 bits")
    return value >> 16 & 0xFFFF, value & 0xFFFF


def bytes_of(word: int) -> bytes:
    """Return a 16-bit word, signed or not, as two bytes, high byte first."""
    if not -(1 << 15) <= word < 1 << 16:
        raise ValueError(f"{word} does not fit into 16 bits")
    return (word & 0xFFFF).to_bytes(2, "big")


class Packets(Core):
    """Packets of a command byte and 16-bit words, high byte first.

    A family says where its ports are and which status bit tells that it is ready.

    Args:
        cycles: the chip on its bus, from :meth:`~vbus.client.aio.bus.Bus.chip`; or a bus
            with one chip.
        ready: how busy is waited for. ``"poll"`` reads the status before each access, as a
            driver on hardware does. ``"wait"`` lets the board wait: a whole packet is one
            message, which is several times faster.
        polls: status reads after which a busy chip is given up.
        checked: look after every packet whether the chip has taken it, by what it tells of that.
    """

    COMMAND_PORT: int = 0
    DATA_PORT: int = 1
    READY_MASK: int = 0
    """The status bit."""
    READY_LEVEL: int = 0
    """What is left of the status under the mask while the chip is ready."""

    def __init__(
        self, cycles: ChipCycles, *, ready: str = "poll", polls: int = READY_POLLS,
        checked: bool = False,
    ) -> None:  # fmt: skip
        if ready not in ("poll", "wait"):
            raise ValueError(f"ready = {ready!r}: allowed are 'poll' and 'wait'")
        self.cycles: ChipCycles = cycles
        self.ready: str = ready
        self.polls: int = polls
        self.checked: bool = checked

    async def status(self) -> int:
        """Return the status byte; possible at any time."""
        return await self.cycles.read(self.COMMAND_PORT)

    async def wait_ready(self) -> None:
        """Read the status until the chip is ready.

        Raises:
            NotReadyError: it still is not after the number of polls allowed.
        """
        for _ in range(self.polls):
            if await self.status() & self.READY_MASK == self.READY_LEVEL:
                return
        raise NotReadyError(f"the chip is still busy after {self.polls} status reads")

    async def command(self, code: int, *words: int) -> None:
        """Write a command byte and its data words.

        Words are 16 bits, signed or not.

        Raises:
            NotReadyError: the chip stays busy; the rest of the packet is not sent.
            ValueError: a word that does not fit.
        """
        await self.packet(code, words, 0)

    async def query(self, code: int, count: int) -> int:
        """Write a command byte and read ``count`` words; return them as one unsigned number.

        Raises:
            NotReadyError: the chip stays busy.
        """
        value = 0
        for word in await self.packet(code, (), count):
            # High word first, as all three families send them.
            value = value << 16 | word
        return value

    async def packet(self, code: int, words: tuple[int, ...], count: int) -> list[int]:
        """Write a command byte and words, then read ``count`` words; return these.

        Raises:
            NotReadyError: the chip stays busy; the rest of the packet is not sent.
            ValueError: a word that does not fit.
        """
        pairs = [bytes_of(word) for word in words]
        if self.ready == "wait":
            return await self._message(code, pairs, count)
        await self.wait_ready()
        await self.cycles.write(self.COMMAND_PORT, code)
        for pair in pairs:
            await self.wait_ready()
            await self.cycles.writes(self.DATA_PORT, pair)
        answers = []
        for _ in range(count):
            await self.wait_ready()
            answers.append(int.from_bytes(await self.cycles.reads(self.DATA_PORT, 2), "big"))
        return answers

    async def _message(self, code: int, pairs: list[bytes], count: int) -> list[int]:
        """Move a whole packet in one message."""
        async with self.cycles.batch() as batch:
            # One wait before each byte that needs a ready chip: the board carries them out in turn.
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


class RegisterCycles(Core):
    """Values of one or more bytes.

    Args:
        cycles: the chip on its bus, from :meth:`~vbus.client.aio.bus.Bus.chip`; or a bus
            with one chip.
    """

    def __init__(self, cycles: ChipCycles) -> None:
        self.cycles: ChipCycles = cycles

    async def read_bytes(self, addresses: tuple[int, ...], signed: bool = False) -> int:
        """Read the register at ``addresses`` (most significant byte first) as a number.

        The least significant byte is read first: it freezes the others where they are live.
        """
        async with self.cycles.batch() as batch:
            # In one message: no other session comes between the bytes.
            later = [batch.read(address) for address in reversed(addresses)]
        data = bytes(byte.value for byte in later)
        return int.from_bytes(data, "little", signed=signed)

    async def write_bytes(self, addresses: tuple[int, ...], value: int) -> None:
        """Write ``value`` to the register at ``addresses``, most significant byte first.

        Raises:
            ValueError: the value does not fit.
        """
        bits = 8 * len(addresses)
        if not -(1 << (bits - 1)) <= value < 1 << bits:
            raise ValueError(f"{value} does not fit into {bits} bits")
        async with self.cycles.batch() as batch:
            for place, address in enumerate(addresses):
                batch.write(address, value >> (bits - 8 - 8 * place) & 0xFF)


# -- one call for each row of a table -----------------------------------------------------------

_SCOPES: Final = {
    "c": "Acts on the current axis.",
    "g": "Acts on the whole chip set.",
    "i": "Acts on the interrupting axis.",
}


_ABOUT: Final = """A call for each row of the chip's tables, under the manual's name in lower case.

Values are plain integers in the chip's own units. Of several words or bytes, the most
significant one is written first."""


def calls_of(name: str, base: type, tables: ModuleType) -> Any:
    """Return a class with a call for each row of a chip's tables.

    Args:
        name: name of the class.
        base: its base class, which has what moves words or registers.
        tables: the chip's ``datasheet``: ``COMMANDS``, with the ``NOTES`` to which the rows refer,
            or ``REGISTERS``.
    """
    # Made at import, in half a millisecond: no committed copy can differ from the tables.
    body: dict[str, Any] = {"__doc__": _ABOUT, "__module__": f"{tables.__package__}.host"}
    notes: Mapping[str, str] = getattr(tables, "NOTES", {})
    for command in getattr(tables, "COMMANDS", ()):
        _add(body, name, command.name.lower(), _command(command), _meaning(command, notes))
    for register in getattr(tables, "REGISTERS", ()):
        for verb, call in _register(register):
            meaning = _register_meaning(register, verb)
            _add(body, name, f"{verb}_{register.name.lower()}", call, meaning)
    return type(name, (base,), body)


def _add(body: dict[str, Any], owner: str, name: str, call: Any, meaning: list[str]) -> None:
    # As if it had been written: for help(), and in tracebacks.
    call.__name__, call.__qualname__ = name, f"{owner}.{name}"
    del call.__annotations__["self"]
    call.__doc__ = "\n\n".join(filter(None, meaning))
    body[name] = call


def _command(row: Command) -> Callable[..., Awaitable[int | None]]:
    code, count, bits = row.code, row.read, 16 * row.read
    if row.read:

        async def read(self: Packets) -> int:
            value = await self.query(code, count)
            return sign_extend(value, bits) if row.signed else value

        return read
    if row.up_to > row.write:

        async def control(self: Packets, control: int, *words: int) -> None:
            await self.command(code, control, *words)

        return control
    if row.write:

        async def write(self: Packets, value: int) -> None:
            await self.command(code, *((value,) if row.write == 1 else words_of(value)))

        return write

    async def plain(self: Packets) -> None:
        await self.command(code)

    return plain


def _register(row: Register) -> Iterator[tuple[str, Callable[..., Awaitable[int | None]]]]:
    async def read(self: RegisterCycles) -> int:
        return await self.read_bytes(row.addresses, row.signed)

    yield "read", read
    if row.access != "r":

        async def write(self: RegisterCycles, value: int) -> None:
            await self.write_bytes(row.addresses, value)

        yield "write", write


def _meaning(row: Command, notes: Mapping[str, str]) -> list[str]:
    title = f"{row.title[:1].upper()}{row.title[1:]} ({row.name}, {row.code:02X}H, {row.clause})."
    remarks = [notes.get(row.note, ""), _SCOPES.get(row.scope, "")]
    if row.buffered and not row.read:
        remarks.append("Takes effect at an update.")
    remark = " ".join(filter(None, remarks))
    if row.read:
        return [title, remark, f"Returns {_sense(row, 16 * row.read)}."]
    if row.up_to > row.write:
        words = f"    words: 0 to {row.up_to - row.write} data words."
        return [
            title,
            remark,
            f"Args:\n    control: the control word, which says what follows.\n{words}",
        ]
    if row.write:
        width = row.bits or 16 * row.write
        return [
            title,
            remark,
            f"Args:\n    value: {_sense(row, width)},\n        {_range(row, width)}.",
        ]
    return [title, remark]


def _register_meaning(row: Register, verb: str) -> list[str]:
    names = ", ".join(f"R{address:02X}H" for address in row.addresses)
    title = f"{verb.capitalize()} {row.title} ({names}, {row.clause})."
    sense = _sense(row, row.bits)
    if verb == "read":
        return [title, f"Returns {sense}."]
    return [title, f"Args:\n    value: {sense}, {_range(row, row.bits)}."]


def _sense(row: Command | Register, bits: int) -> str:
    unit = f"1/{1 << row.fraction} {row.unit}".rstrip() if row.fraction else row.unit
    sense = "two's complement" if row.signed else "unsigned"
    return f"{bits} bits, {sense}{', in ' if unit else ''}{unit}"


def _range(row: Command | Register, bits: int) -> str:
    least = getattr(row, "least", 0) or (-(1 << bits - 1) if row.signed else 0)
    return f"{least} to {(1 << bits - row.signed) - 1}"
