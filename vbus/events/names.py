"""What the names in a condition stand for on a board."""

from collections.abc import Iterator, Mapping
from typing import Final

from msgspec import Struct

from vbus import plugins
from vbus.chips.base import Chip
from vbus.chips.tables import Bit, Register
from vbus.circuit import circuit
from vbus.circuit.circuit import Circuit
from vbus.glue.part import GluePart
from vbus.signals import Net
from vbus.values.settings import listed, suggestion

Value = int | float | str
Told = Mapping[str, Mapping[str, Value]]
"""What chips tell of themselves, by name of the chip."""

COUNTS: Final = "counts"
PER_SAMPLE: Final = "counts/sample"
PER_SECOND: Final = "counts/s"


class Level(Struct, frozen=True, eq=False):
    """Something that has a value at every instant.

    Attributes:
        key: what a waveform calls it: ``"x./CS"``, ``"x.real"``.
        net: the net, if it is one.
        chip: the chip that tells it, else.
        told: by which name, if it is a value that ``vbus monitor`` shows.
        register: its row, if it is a register.
        bit: the bit of it that is meant; -1: all of it.
        unit: of what it counts, as far as it is known.
    """

    key: str
    net: Net | None = None
    chip: Chip | None = None
    told: str = ""
    register: Register | None = None
    bit: int = -1
    unit: str = ""

    def value(self, told: Told) -> Value:
        """Return its value; ``told`` is what its chip tells now."""
        if self.net is not None:
            return self.net.value
        assert self.chip is not None
        if self.register is None:
            return told[self.chip.name][self.told]
        return register_value(self.chip, self.register)


def register_value(chip: Chip, row: Register) -> int | float:
    """Return what a register holds, as people read it.

    Raises:
        ValueError: this chip's registers cannot be looked at.
    """
    value = 0
    for address in row.addresses:
        value = value << 8 | chip.peek(address)
    if row.signed and value >> (row.bits - 1) & 1:
        value -= 1 << row.bits
    return value / (1 << row.fraction) if row.fraction else value


def net_names(board: Circuit) -> dict[str, Net]:
    """Return the nets by the name of each pin on them, and by their own."""
    parts: list[Chip | GluePart] = [*board.chips, *board.glue.parts]
    names = {
        f"{part.name}.{row.name}": part.pins[row.name].net
        for part in parts
        for row in part.pin_rows
    }
    return names | {net.name: net for net in names.values()}


def rules_of(board: Circuit) -> list[str]:
    """Return the rules that may be broken on a board."""
    rules = [rule.name for rule in circuit.RULES]
    rules += [rule.name for chip in board.chips for rule in type(chip).RULES]
    return list(dict.fromkeys(rules))


def _plain(name: str) -> str:
    """Return a name as it is compared: a blank may be written as ``_``."""
    return name.replace(" ", "_")


class Names:
    """Finds what names stand for.

    Args:
        board: the board.
    """

    def __init__(self, board: Circuit) -> None:
        self._board = board
        self._chips = {chip.name: chip for chip in board.chips}
        self._nets = net_names(board)
        self.rules: list[str] = rules_of(board)
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
            level = self._value(chip, of, bit) or self._register(chip, of, bit)
            if level is not None:
                return level
        return None

    def _value(self, chip: Chip, of: str, bit: str) -> Level | None:
        told = next((name for name in chip.telemetry() if _plain(name) == _plain(of)), None)
        if told is None:
            return None
        key = f"{chip.name}.{_plain(told)}"
        if not bit:
            units = plugins.family(chip.FAMILY).units
            unit = units.get(told, units.get(told.partition(" ")[0], ""))
            return Level(key, None, chip, told, unit=unit)
        row = _bit(self._flags(chip, told), bit)
        return Level(key, None, chip, told, bit=row.number) if row else None

    @staticmethod
    def _flags(chip: Chip, told: str) -> tuple[Bit, ...]:
        """Return the flags of a value; those of ``"status 1"`` are those of ``"status"``."""
        family = plugins.family(chip.FAMILY)
        table = family.flags.get(told) or family.flags.get(told.partition(" ")[0])
        return tuple(getattr(family.tables, table)) if table else ()

    @staticmethod
    def _register(chip: Chip, of: str, bit: str) -> Level | None:
        for row in plugins.family(chip.FAMILY).registers:
            if of == row.name or (
                len(row.addresses) == 1 and of.upper() == f"R{row.addresses[0]:02X}H"
            ):
                key = f"{chip.name}.{row.name}"
                flag = _bit(row.fields, bit) if bit else None
                if bit and flag is None:
                    return None
                return Level(key, None, chip, "", row, flag.number if flag else -1)
        return None

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
        family = plugins.family(chip.FAMILY)
        if len(parts) > 2:
            told = next((one for one in chip.telemetry() if _plain(one) == _plain(parts[1])), "")
            rows = next((row.fields for row in family.registers if row.name == parts[1]), ())
            flags = self._flags(chip, told) or rows
            if flags:
                path = f"{chip.name}.{parts[1]}"
                names = [_plain(bit.name) for bit in flags]
                hint = suggestion(_plain(parts[-1]), names)
                return f"{hint}{path} has {listed(names)}"
        values = [_plain(value) for value in chip.telemetry()]
        has = f"{hint}{chip.name} has the values {listed(values)}; the pins {listed(chip.pins)}"
        registers = [row.name for row in family.registers]
        return f"{has}; the registers {listed(registers)}" if registers else has

    def _known(self) -> Iterator[str]:
        yield from self._nets
        yield from self.rules
        for chip in self._board.chips:
            family = plugins.family(chip.FAMILY)
            for told in chip.telemetry():
                yield f"{chip.name}.{_plain(told)}"
                for bit in self._flags(chip, told):
                    yield f"{chip.name}.{_plain(told)}.{_plain(bit.name)}"
            yield from (f"{chip.name}.{row.name}" for row in family.registers)


def _bit(rows: tuple[Bit, ...], name: str) -> Bit | None:
    return next((row for row in rows if _plain(row.name) == _plain(name)), None)
