"""From the glue of a board file to parts and nets: what is wired to what, and in which order.

Glue is wired by names: a pin of a chip, a card's interrupt or another part of glue (``"x./CS"``),
a line of a bus (``"main./RD"``), one wire of D0-D7 (``"x.D3"``, at inputs only), or a wire by its
own name, in ``[nets]`` or not.
"""

from collections.abc import Callable, Iterable, Iterator, Mapping
from functools import partial

from msgspec import Struct, field

from vbus.board.card.card_parts import CardPart, names_of, parts_of
from vbus.board.equations import read
from vbus.board.glue_order import Fail, Place, Planned, order_of
from vbus.boardfile.cards import CardSection
from vbus.boardfile.lines import Path
from vbus.boardfile.sections import BoardFile, GlueSection, NetSection
from vbus.chips.tables import PinRow
from vbus.core.signals import HIGH, LOW
from vbus.core.values.lexer import ConditionError
from vbus.core.values.settings import among, listed, unknown
from vbus.glue.card_buses import BUSES, DATA
from vbus.glue.part import bundled
from vbus.glue.table import PARTS, PLD, Block, GlueRow


class GluePlan(Struct):
    """The glue of a board file.

    Attributes:
        parts: in the order of the file.
        nets: those of the file, with the pins of glue on them, and those that glue adds.
        order: of the blocks; none comes before one that it follows.
        wires: the name of the net of each pin, glue's and others'.
    """

    parts: list[Planned] = field(default_factory=list)
    nets: list[NetSection] = field(default_factory=list)
    order: list[Place] = field(default_factory=list)
    wires: dict[str, str] = field(default_factory=dict)


def plan_glue(file: BoardFile, pins: Mapping[str, PinRow], fail: Fail) -> GluePlan:
    """Return the parts, nets and order of a file's glue.

    Args:
        file: the board file.
        pins: the pins that glue may be wired to, by full name.
        fail: takes each mistake: where, and what is wrong.
    """
    return _Planner(file, pins, fail).plan()


class _Planner:
    def __init__(self, file: BoardFile, pins: Mapping[str, PinRow], fail: Fail) -> None:
        self._file: BoardFile = file
        self._rows: dict[str, PinRow] = dict(pins)
        self._fail: Fail = fail
        self._glue: set[str] = {section.name for section in file.glue}
        self._glue |= {name for card in file.cards if card.bus for _, name in names_of(card)}
        self._elsewhere: set[str] = {
            target
            for pins in (*(part.pins for part in file.glue), *(card.pins for card in file.cards))
            for targets in pins.values()
            for target in targets
        } | {pin for net in file.nets for pin in net.pins}
        """Pins that are wired where something else is."""
        self._cards: set[str] = {card.name for card in file.cards if card.bus}
        self._plan: GluePlan = GluePlan()
        self._inputs: set[str] = set()
        """Inputs of parts, used or not."""
        self._inner: set[str] = set()
        """Outputs of equations that other equations of the same part look at."""
        self._joined: dict[str, str] = {}
        """Each name's better-known name on the same wire; a wire's best one stands for itself."""
        self._buses: dict[str, tuple[str, ...]] = {
            f"{bus.name}.{name.partition('.')[2]}": tuple(
                f"{chip}.{name.partition('.')[2]}" for chip in bus.chips
            )
            for bus in file.buses
            for name, row in pins.items()
            if row.shared and bus.chips and name.partition(".")[0] == bus.chips[0]
        }

    def plan(self) -> GluePlan:
        for net in self._file.nets:
            for pin in net.pins:
                self._join(f"={net.name}", pin)
        # A line of a bus is called by the name of the bus, at whichever chip glue is wired to it.
        for bus, members in self._buses.items():
            for member in members:
                self._join(bus, member)
        wiring: list[tuple[GlueSection, dict[str, tuple[str, ...]]]] = []
        for section in self._file.glue:
            row = self._row(section)
            if row is not None:
                wiring.append((section, self._part(section, row)))
        parts = [part for card in self._file.cards if card.bus for part in self._card_parts(card)]
        for card in self._file.cards:
            known = [row.name for row in BUSES[card.bus].pins] if card.bus else []
            for pin in card.pins:
                if card.bus and pin not in known:
                    self._no_pin(_card_pin(card.name, pin), pin, known, "pin")
            self._wire(card.name, card.pins, partial(_card_pin, card.name))
        for part in parts:
            self._wire(part.part.name, part.wires, partial(_card_part_pin, part))
        for section, pins in wiring:
            self._wire(section.name, pins, partial(_place, section))
        self._nets()
        self._plan.order = order_of(self._plan.parts, self._root, self._fail)
        return self._plan

    def _card_parts(self, card: CardSection) -> Iterator[CardPart]:
        for part in parts_of(card, self._fail):
            planned = part.part
            self._rows |= {f"{planned.name}.{row.name}": row for row in planned.pin_rows}
            self._plan.parts.append(planned)
            yield part

    # -- one part -------------------------------------------------------------------------------

    def _row(self, section: GlueSection) -> GlueRow | None:
        path: Path = ("glue", section.name)
        if section.part != PLD:
            if section.equations:
                self._fail(
                    (*path, "equations"), f'equations are for part = "{PLD}"; this is another part'
                )
            row = PARTS.get(section.part)
            if row is None:
                self._fail((*path, "part"), unknown(section.part, [*PARTS, PLD]))
            elif row.blocks[0].holds and not section.delay:
                self._fail(path, 'a reset lasts for its "delay"; write one, such as "100 ms"')
            return row
        blocks = []
        for output, text in section.equations.items():
            try:
                blocks.append(read(output, text).block)
            except ConditionError as error:
                self._fail((*path, "equations", output), str(error))
        outputs = [block.outputs[0] for block in blocks]
        for output in dict.fromkeys(outputs):
            if outputs.count(output) > 1:
                self._fail(
                    (*path, "equations"), f'"{output}" has two equations; join them with "|"'
                )
        if not section.equations:
            self._fail(path, f'a {PLD} needs [glue.NAME.equations], such as "!x./CS" = "A9 & !AEN"')
        return GlueRow(PLD, "equations", tuple(blocks)) if blocks else None

    def _part(self, section: GlueSection, row: GlueRow) -> dict[str, tuple[str, ...]]:
        """Plan a part; return what its own pins are wired to."""
        path: Path = ("glue", section.name)
        inputs, outputs, pins = row.inputs, row.outputs, row.pins
        known_inputs, known_outputs, known_pins = set(inputs), set(outputs), set(pins)
        tied = dict.fromkeys(section.low, LOW) | dict.fromkeys(section.high, HIGH)
        # Wired from the other end: a net or another part names this input.
        others = [
            pin for pin in inputs
            if f"{section.name}.{pin}" in self._elsewhere and pin not in known_outputs
        ]  # fmt: skip
        wired = dict.fromkeys((*section.hosts, *others), ()) | section.pins
        # A name in an equation is the name of a wire.
        if row.part == PLD:
            wired = {pin: (pin,) for pin in pins if pin not in tied} | wired
        for place, name in enumerate(section.hosts):
            if name in section.pins or name in tied or name in others:
                self._fail(
                    (*path, "hosts", place),
                    f'"{name}" is wired or tied already; a host needs it open',
                )
        for key, names in (("low", section.low), ("high", section.high)):
            for place, name in enumerate(names):
                where = (*path, key, place)
                if name not in known_inputs or name in known_outputs:
                    self._no_pin(where, name, inputs, "input")
                elif name in wired or (key == "high" and name in section.low):
                    self._fail(where, f'"{name}" is wired or tied already; an input has one source')
        taps: dict[str, tuple[str, int]] = {}
        wide: list[str] = []
        for name, targets in list(wired.items()):
            where = (*path, "pins", name)
            inside = bundled(name)
            if inside and known_pins.issuperset(inside):
                self._bundle(where, name, inside, targets, row, wired, wide)
            elif name not in known_pins:
                self._no_pin(where, name, pins, "pin")
                del wired[name]
        for name, targets in list(wired.items()):
            tap = self._tap(targets[0]) if targets else None
            if tap is not None and len(targets) == 1 and name not in wide:
                if name in known_outputs:
                    self._fail(
                        (*path, "pins", name),
                        f'"{targets[0]}" is one wire of {DATA}, which outputs drive together: wire'
                        f' a bundle such as "Q0-Q7" to "{tap[0]}"',
                    )
                taps[name] = tap
                del wired[name]
        self._inputs |= {f"{section.name}.{pin}" for pin in inputs}
        have = {*wired, *taps, *tied, *(pin for name in wide for pin in bundled(name))}
        # Gates of a package that are not used need no inputs.
        blocks = [block for block in row.blocks if set(block.outputs) & have]
        if not blocks:
            self._fail(
                path,
                f"no output is wired: it does nothing; it has {listed(outputs)}; wire one in its"
                ' pins, or list it in "hosts" for hosts to see',
            )
        for block in blocks:
            lacking = [pin for pin in block.inputs if pin not in have and pin not in block.outputs]
            if lacking:
                self._fail(
                    path,
                    f"open inputs: {listed(lacking)}; wire each in [glue.{section.name}.pins], or"
                    ' tie it with "low" or "high"',
                )
        rows = self._pin_rows(blocks, wired, wide)
        self._plan.parts.append(
            Planned(section.name, section.delay, tuple(rows), tuple(blocks), taps, tied)
        )
        self._rows |= {f"{section.name}.{pin.name}": pin for pin in rows}
        inner = known_inputs & known_outputs
        self._inner |= {f"{section.name}.{pin}" for pin in inner if pin in wired}
        return wired

    def _pin_rows(
        self, blocks: list[Block], wired: Mapping[str, tuple[str, ...]], wide: list[str]
    ) -> list[PinRow]:
        rows: dict[str, PinRow] = {}
        in_bundle = {pin: name for name in wide for pin in bundled(name)}
        for block in blocks:
            for pin in block.outputs:
                name = in_bundle.get(pin, pin)
                both = pin in block.inputs or name in wide
                rows[name] = PinRow(
                    name, "io" if both else block.kind, width=8 if name in wide else 1
                )
            for pin in block.inputs:
                name = in_bundle.get(pin, pin)
                if name in wired and name not in rows:
                    rows[name] = PinRow(name, "in", width=8 if name in wide else 1)
        return list(rows.values())

    def _no_pin(self, where: Path, name: str, known: Iterable[str], what: str) -> None:
        self._fail(where, f'there is no {what} "{name}"; {among(name, known, "it has")}')

    def _bundle(
        self,
        where: Path,
        name: str,
        inside: tuple[str, ...],
        targets: tuple[str, ...],
        row: GlueRow,
        wired: dict[str, tuple[str, ...]],
        wide: list[str],
    ) -> None:
        """Wire eight pins at once: inputs wire by wire, outputs as one bundle."""
        for target in targets:
            if not self._wires(target):
                self._fail(where, f'found "{target}"; {name} together is wired to {DATA} of a chip')
                del wired[name]
                return
        if set(inside) & set(row.outputs):
            wide.append(name)
            return
        del wired[name]
        for number, pin in enumerate(inside):
            wired[pin] = tuple(
                f"{target.rpartition('.')[0]}.{self._wires(target)[number]}"
                for target in targets[:1]
            )

    def _wires(self, target: str) -> tuple[str, ...]:
        """Return the wires of a data bus by its name: ``x.D0-D7`` as chips call it; none if not."""
        known = target in self._rows or target in self._buses or target.endswith(f".{DATA}")
        return bundled(target.rpartition(".")[2]) if known else ()

    def _tap(self, target: str) -> tuple[str, int] | None:
        """Return the bundle and the number of its wire, if the name is that of one wire."""
        owner, dot, wire = target.rpartition(".")
        if not dot or target in self._rows:
            return None
        for name in (*self._buses, *self._rows):
            bundle = self._buses.get(name, (name,))[0]
            row, wires = self._rows.get(bundle), bundled(name.rpartition(".")[2])
            if name.startswith(f"{owner}.") and wire in wires and row and row.direction == "io":
                return bundle, wires.index(wire)
        return None

    # -- wires ----------------------------------------------------------------------------------

    def _wire(
        self, name: str, pins: Mapping[str, tuple[str, ...]], place: Callable[[str], Path]
    ) -> None:
        for pin, targets in pins.items():
            own = f"{name}.{pin}"
            if own not in self._rows:
                continue
            for target in targets:
                path = place(pin)
                if "." not in target:
                    self._join(f"={target}", own)
                elif target in self._rows or target in self._buses:
                    row = self._rows.get(target) or self._rows[self._buses[target][0]]
                    if row.width != self._rows[own].width:
                        self._fail(
                            path, f'"{target}" has {row.width} wires, "{pin}" another number'
                        )
                    elif row.wave:
                        self._fail(path, f'"{target}" is a waveform, too fast for glue to follow')
                    else:
                        self._join(target, own)
                else:
                    self._unknown(path, target)

    def _unknown(self, path: Path, target: str) -> None:
        owner = target.partition(".")[0]
        mine = [name for name in (*self._rows, *self._buses) if name.startswith(f"{owner}.")]
        if target in self._inputs:
            self._fail(path, f'"{target}" is an input of which no output is wired: it does nothing')
        elif mine:
            self._fail(path, f'there is no pin "{target}"; {among(target, mine, "there are")}')
        else:
            known = dict.fromkeys(name.partition(".")[0] for name in (*self._rows, *self._buses))
            there = among(owner, known, "there are")
            self._fail(path, f'nothing on the board is called "{owner}"; {there}')

    def _root(self, name: str) -> str:
        while self._joined.setdefault(name, name) != name:
            name = self._joined[name]
        return name

    def _join(self, one: str, other: str) -> None:
        first, second = self._root(one), self._root(other)
        # A wire is called by its own name, else by that of a pin that is not glue's.
        self._joined[max(first, second, key=self._rank)] = min(first, second, key=self._rank)

    def _rank(self, name: str) -> tuple[int, str]:
        if name.startswith("="):
            return 0, name
        return (2 if name.partition(".")[0] in self._glue else 1), name

    def _nets(self) -> None:
        groups: dict[str, list[str]] = {}
        for name in list(self._joined):
            groups.setdefault(self._root(name), []).append(name)
        named = {net.name: net for net in self._file.nets}
        added = []
        for root, names in groups.items():
            pins = [name for name in names if not name.startswith("=") and name in self._rows]
            own = [name[1:] for name in names if name.startswith("=")]
            self._plan.wires |= dict.fromkeys(pins, root.removeprefix("="))
            if len(own) > 1:
                self._fail(
                    ("glue",), f"glue joins the wires {listed(own)}, which have different names"
                )
            if not any(pin.partition(".")[0] in self._glue | self._cards for pin in pins):
                continue
            if any(pin.partition(".")[0] in self._glue for pin in pins):
                self._fights(pins)
            name = own[0] if own else root
            # A wire with one end is a misspelt name, unless an equation of the same part reads it.
            if len(pins) < 2 and pins[0] not in self._inner:
                owner = pins[0].partition(".")[0]
                self._fail(
                    ("cards" if owner in self._cards else "glue", owner),
                    f'nothing else is on wire "{name}"; did you mean another name? wires are'
                    f" {listed(sorted(other.removeprefix('=') for other in groups))}",
                )
            known = named.get(name)
            # The first pin says at which level the wire rests: a card's bus is pulled.
            mine = tuple(
                sorted(
                    pins,
                    key=lambda pin: (pin.partition(".")[0] not in self._cards, self._rank(pin)[0]),
                )
            )
            if known is None:
                added.append(NetSection(name=name, pins=mine))
            else:
                more = tuple(pin for pin in mine if pin not in known.pins)
                named[name] = NetSection(
                    name=name, pins=(*known.pins, *more), rest=known.rest, delay=known.delay
                )
        for name, net in named.items():
            if not net.pins:
                self._fail(("nets", name), "a net joins at least one pin, of glue perhaps")
        self._plan.nets = [*named.values(), *added]

    def _fights(self, pins: list[str]) -> None:
        outputs = [pin for pin in pins if self._rows[pin].direction == "out"]
        glue = [pin for pin in outputs if pin.partition(".")[0] in self._glue]
        if len(outputs) > 1 and glue:
            other = next(pin for pin in outputs if pin != glue[0])
            self._fail(
                ("glue", glue[0].partition(".")[0]),
                f'"{glue[0]}" and "{other}" are both outputs on one wire and would always fight;'
                " join them by a gate, or take an open-drain or three-state part",
            )


def _card_pin(card: str, pin: str) -> Path:
    """Return where the file says what a pin of a card is wired to."""
    return ("cards", card, "pins", pin)


def _card_part_pin(part: CardPart, pin: str) -> Path:
    """Return where the file says what a pin of a card's part is wired to."""
    return (*part.path, pin) if pin != DATA else part.path[:-1]


def _place(section: GlueSection, pin: str) -> Path:
    """Return where the file says what a pin of glue is wired to."""
    key = "equations" if section.part == PLD and pin not in section.pins else "pins"
    return ("glue", section.name, key, pin)
