"""What the names in a condition stand for on a board."""

from collections.abc import Callable, Iterator, Sequence
from typing import Final

from msgspec import Struct

from vbus import plugins
from vbus.chips.base import Chip
from vbus.chips.packets import calls
from vbus.chips.tables import Bit
from vbus.circuit import circuit
from vbus.circuit.circuit import Circuit
from vbus.circuit.stream import decoder_of
from vbus.core.signals import Net, Reading, Value
from vbus.core.signals.values import reader
from vbus.core.values.settings import among, listed, suggestion
from vbus.glue.part import GluePart

COUNTS: Final = "counts"
PER_SAMPLE: Final = "counts/sample"
PER_SECOND: Final = "counts/s"


class Level(Struct, frozen=True, eq=False):
    """Something that has a value at every instant.

    Attributes:
        key: what a waveform calls it: ``"x./CS"``, ``"x.real"``.
        net: the net, if it is one.
        chip: the chip whose value or register it is, else; it is up to date when it is read.
        read: gives the value of the chip.
        text: whether the value is a text.
        bit: the bit of it that is meant; -1: all of it.
        unit: of what it counts, as far as conditions know it.
    """

    key: str
    net: Net | None = None
    chip: Chip | None = None
    read: Callable[[Chip], Reading] | None = None
    text: bool = False
    bit: int = -1
    unit: str = ""

    def value(self) -> Reading:
        """Return its value."""
        if self.net is not None:
            return self.net.value
        assert self.chip is not None
        assert self.read is not None
        return self.read(self.chip)


def net_names(board: Circuit) -> dict[str, Net]:
    """Return the nets by the name of each pin on them, and by their own."""
    parts: list[Chip | GluePart] = [*board.chips, *board.glue.parts]
    names = {
        f"{part.name}.{row.name}": part.pins[row.name].net
        for part in parts
        for row in part.pin_rows
    }
    return names | {net.name: net for net in names.values()}


def _plain(name: str) -> str:
    """Return a name as it is compared: a blank may be written as ``_``."""
    return name.replace(" ", "_")


def unknown_packet(name: str, known: Sequence[str]) -> str:
    """Return how a sentence ends that a name is none of the known packets'; "" if it is one's.

    Of several words a name may be one that no table has: "reserved command 1AH".
    """
    word = name.removeprefix("read ").removeprefix("write ")
    if " " in word or any(word in calls(one) for one in known):
        return ""
    return f'"{name}"; {among(word, known, "there are")}'


class Names:
    """Finds what names stand for.

    Args:
        board: the board.
    """

    def __init__(self, board: Circuit) -> None:
        self._board = board
        self._chips = {chip.name: chip for chip in board.chips}
        self._nets = net_names(board)
        rules = (*circuit.RULES, *(rule for chip in board.chips for rule in type(chip).RULES))
        self.rules: list[str] = list(dict.fromkeys(rule.name for rule in rules))
        """The rules that may be broken."""

    def find(self, parts: tuple[str, ...]) -> Level | None:
        """Return what a name stands for; None if it is no pin, value, register or flag."""
        name = ".".join(parts)
        net = self._nets.get(name)
        if net is not None:
            return Level(net.name, net)
        chip = self._chips.get(parts[0])
        if chip is None or len(parts) < 2:
            return None
        *path, last = parts[1:]
        for of, bit in ((".".join((*path, last)), ""), (".".join(path), last)):
            level = self._level(chip, of, bit)
            if level is not None:
                return level
        return None

    def _level(self, chip: Chip, of: str, bit: str) -> Level | None:
        """Return a value or a register of a chip, or a bit of it."""
        for register in plugins.family(chip.FAMILY).registers:
            if len(register.addresses) == 1 and of.upper() == f"R{register.low:02X}H":
                of = register.name
        row, axis = _values(chip).get(_plain(of), (None, 0))
        flag = _bit(row.fields, bit) if row is not None else None
        if row is None or (bit and flag is None):
            return None
        unit = row.plain_unit if not bit and row.plain_unit in (COUNTS, PER_SAMPLE) else ""
        place = flag.number if flag is not None else -1
        key, read = f"{chip.name}.{_plain(of)}", reader(row.number(axis))
        return Level(key, None, chip, read, row.text, place, unit)

    # -- events -----------------------------------------------------------------------------------

    def mnemonics(self, chip: str = "") -> list[str]:
        """Return the commands and registers of a chip, or of all; none if not all are known."""
        found: list[str] = []
        for one in self._board.chips:
            if chip in ("", one.name):
                family = plugins.family(one.FAMILY)
                names = [row.name for row in family.commands]
                names += [row.name for row in family.registers]
                if not names:
                    return []
                found += names
        return found

    def packets(self, chip: str = "") -> list[str]:
        """Return the mnemonics, and the names of packets that are in no table; none if not all
        are known."""
        known = self.mnemonics(chip)
        chips = [one for one in self._board.chips if chip in ("", one.name)] if known else []
        return known + [name for one in chips for name in decoder_of(one.FAMILY).NAMES]

    def has_chip(self, name: str) -> bool:
        """Whether there is a chip of this name."""
        return name in self._chips

    # -- messages -------------------------------------------------------------------------------

    def help(self, parts: tuple[str, ...]) -> str:
        """Return what may be written in place of a name that stands for nothing."""
        name = ".".join(parts)
        hint = suggestion(name, self._known())
        chip = self._chips.get(parts[0])
        if chip is None:
            there = listed([*self._chips, *self._board.nets])
            return f"{hint}this board has {there}, and the rules of vbus check --rules"
        if len(parts) > 2:
            row, _ = _values(chip).get(_plain(parts[1]), (None, 0))
            if row is not None and row.fields:
                names = [_plain(bit.name) for bit in row.fields]
                hint = suggestion(_plain(parts[-1]), names)
                return f"{hint}{chip.name}.{parts[1]} has {listed(names)}"
        values = [_plain(key) for key in chip.VALUES.by_key(chip.axis_count)]
        has = f"{hint}{chip.name} has the values {listed(values)}; the pins {listed(chip.pins)}"
        registers = [row.name for row in plugins.family(chip.FAMILY).registers]
        return f"{has}; the registers {listed(registers)}" if registers else has

    def _known(self) -> Iterator[str]:
        yield from self._nets
        yield from self.rules
        for chip in self._board.chips:
            for name, (row, _) in _values(chip).items():
                yield f"{chip.name}.{name}"
                yield from (f"{chip.name}.{name}.{_plain(bit.name)}" for bit in row.fields)


def _values(chip: Chip) -> dict[str, tuple[Value, int]]:
    """Return what a chip tells and its registers, row and axis (0-based), by name."""
    keyed = chip.VALUES.by_key(chip.axis_count).items()
    registers = {name: (row, 0) for name, row in chip.VALUES.registers.items()}
    return registers | {_plain(key): found for key, found in keyed}


def _bit(rows: tuple[Bit, ...], name: str) -> Bit | None:
    return next((row for row in rows if _plain(row.name) == _plain(name)), None)
