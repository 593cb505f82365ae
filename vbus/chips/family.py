"""A chip family: the one object that names all that is known of it."""

from collections.abc import Mapping
from importlib import import_module
from types import ModuleType
from typing import Any, TypeVar

from msgspec import Struct, field

from vbus.chips.ac_table import AcTable
from vbus.chips.base import Chip
from vbus.chips.packets import packets_of
from vbus.chips.tables import Command, Register
from vbus.core.errors import PluginError
from vbus.core.signals import Rule, ValueTable

_T = TypeVar("_T")


class Family(Struct, frozen=True):
    """What tools ask of a chip family.

    What takes code is named, ``"module:name"`` inside :attr:`home`, and imported by its user
    alone: a client loads no behaviour, a board no client. A tool does without what is left out.

    Attributes:
        name: the family's, which its rules begin with.
        chip: its class.
        home: the package it lies in.
        title: its parts, for people: ``"LM628 and LM629"``.
        kind: what they are, for people: ``"motion controller"``.
        about: what they are for, in a few sentences, with which their page begins.
        datasheet: the module of its tables: ``COMMANDS`` or ``REGISTERS``, ``BUS``, ``VALUES``,
            ``AC``, ``RULES``.
        packets: what reads cycles in the manual's words, a ``Decoder``; made from the register map
            if left out.
        coverage: what a host can exercise, an ``Exercises``; made from the tables if left out.
        upsets: what faults can do inside its chips, an ``ChipFaults``.
        limits: the inputs of limit switches by side, ``{}`` for the number of the axis.
        reset_pin: the input of the hardware reset.
        reset_write: address and byte that reset the chip.
        reset_name: what that write is called.
        access: how a client moves words or values, where the usual way is not enough: the class
            that the calls made from the tables are added to.
        host: its client above these, for asyncio, a class made with a bus and the chip's name.
        demo: its demonstration, a ``Demo``.
        demo_name: what the demonstration is called by.
        typical: parts for tests that say no more than how the part number begins.
        clock: their usual clock.
        plant: the usual plant model behind their axes.
        outputs: pins a host looks at, and that are compared with silicon.
        channels: sigrok's names of the control lines; made from those of the pins if left out.
        addresses: what its page says of each bus address: number, how, read, write.
        bits: bit tables of its page: heading, and the name in :attr:`datasheet`.
        cycle: number of clock periods of the cycle against which a host's phase matters, as it is
            after a reset, ``"datasheet:SAMPLE_CLK"``.
        reset: number of clock periods of a reset in which its chips take bus cycles already:
            ``ready_at()`` leaves it out; ``"datasheet:RESET_CLK"``.
        compatibility: parts it stands in for, each with a ``Uses`` that knows the differences.
        kept: rows of AC tables that the chip keeps itself and no host can break.
    """

    name: str
    chip: str | type[Chip] = ""
    home: str = ""
    title: str = ""
    kind: str = ""
    about: str = ""
    datasheet: str = ""
    packets: str = ""
    coverage: str = ""
    access: str = ""
    host: str = ""
    demo: str = ""
    demo_name: str = ""
    typical: tuple[str, ...] = ()
    clock: str = "8 MHz"
    plant: str = "dc_motor"
    upsets: str = ""
    limits: Mapping[str, str] = field(default_factory=dict)
    reset_pin: str = ""
    reset_write: tuple[int, int] | None = None
    reset_name: str = "RESET command"
    outputs: tuple[str, ...] = ()
    channels: tuple[str, ...] = ()
    addresses: tuple[tuple[str, str, str, str], ...] = ()
    bits: tuple[tuple[str, str], ...] = ()
    kept: frozenset[str] = frozenset()
    cycle: str | int = ""
    reset: str | int = ""
    compatibility: Mapping[str, str] = field(default_factory=dict)

    def load(self, role: str, base: type[_T]) -> type[_T] | None:
        """Return the class that attribute ``role`` names, or None if it is left out.

        Raises:
            PluginError: it cannot be imported, or is no subclass of ``base``.
        """
        found = self.object(role)
        # A register map says enough for whole registers; a command table has no such rule.
        if found is None and role == "packets" and self.registers:
            found = packets_of(self.name, self._of_chip("REGISTERS", None))
        return None if found is None else self._checked(role, getattr(self, role), found, base)

    def compatible_with(self, other: str, base: type[_T]) -> type[_T]:
        """Return what knows how a driver for the part ``other`` would be taken.

        Raises:
            PluginError: as :meth:`load`.
        """
        where = self.compatibility[other]
        return self._checked("compatibility", where, self._found("compatibility", where), base)

    def _checked(self, role: str, where: Any, found: Any, base: type[_T]) -> type[_T]:
        if not isinstance(found, type) or not issubclass(found, base):
            raise PluginError(
                f"family {self.name}: {role} = {where!r} is not a subclass of {base.__name__}"
            )
        return found

    def object(self, role: str) -> Any:
        """Return the object that attribute ``role`` names, or None if it is left out.

        Raises:
            PluginError: it cannot be imported.
        """
        return self._found(role, getattr(self, role))

    def _found(self, role: str, where: Any) -> Any:
        if not isinstance(where, str):
            return where
        module, colon, name = where.partition(":")
        if not module:
            return None
        try:
            found = import_module(f"{self.home}.{module}" if self.home else module)
            return getattr(found, name) if colon else found
        # A plug-in's module may raise anything: the user learns which of its names is broken.
        except Exception as error:
            raise PluginError(
                f"family {self.name}: {role} = {where!r} cannot be loaded:"
                f" {type(error).__name__}: {error}"
            ) from error

    # -- tables -------------------------------------------------------------------------------

    @property
    def tables(self) -> ModuleType | None:
        """The module of its tables."""
        found: ModuleType | None = self.object("datasheet")
        return found

    @property
    def commands(self) -> tuple[Command, ...]:
        """The rows of its command table."""
        return tuple(getattr(self.tables, "COMMANDS", ()))

    @property
    def registers(self) -> tuple[Register, ...]:
        """The rows of its register table."""
        return tuple(getattr(self.tables, "REGISTERS", ()))

    @property
    def values(self) -> ValueTable:
        """What a chip has inside, and how it is shown."""
        values: ValueTable = self._of_chip("VALUES", ValueTable())
        return values

    @property
    def rules(self) -> tuple[Rule, ...]:
        """What a host can break."""
        rows: tuple[Rule, ...] = self._of_chip("RULES", ())
        return rows

    def _of_chip(self, name: str, default: Any) -> Any:
        """Return a table of the datasheet, or else of the chip's class."""
        # The tables before the class: importing a chip loads its behaviour.
        found = getattr(self.tables, name, None)
        return getattr(self.load("chip", Chip), name, default) if found is None else found

    @property
    def ac_tables(self) -> Mapping[str, AcTable]:
        """The tables of AC characteristics by supply; ``""`` where there is one for all."""
        found: AcTable | Mapping[str, AcTable] = getattr(self.tables, "AC", {})
        return {"": found} if isinstance(found, AcTable) else found
