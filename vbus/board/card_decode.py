"""What a cycle on a card's bus comes to, worked out from the glue without playing it."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from itertools import product

from msgspec import Struct

from vbus.board.card_bus import CardBus
from vbus.board.card_cycle import CardCycle, NotFixed, RestingWires
from vbus.board.card_edges import EdgeSteps, steps_of
from vbus.board.card_timing import MOST_UNKNOWN, CardTiming, has_clock, outputs, pin_of
from vbus.board.pin_maps import ADDRESS, DATA, READ, SELECT, WRITE, roles
from vbus.chips.base import Chip
from vbus.glue import logic
from vbus.glue.card_buses import LATCH
from vbus.glue.logic import Levels, Outcome
from vbus.glue.part import Glue, GlueBlock
from vbus.signals import HIGH, LOW, Net, Pin, Z


class Phase(Struct):
    """Levels in one part of a cycle: of nets and pins, by identity, and what each block gives."""

    nets: dict[int, int]
    pins: dict[int, int]
    outcomes: list[tuple[Levels, Outcome]]
    floating: set[int]
    """Nets that nobody drives and nothing pulls: they keep what was there."""


class CardDecoder:
    """Works out cycles of one connector.

    Args:
        bus: the connector.
        glue: the glue of the board.
        chips: its chips.

    Attributes:
        nets: the wires a cycle moves, and those that decide what comes of it.
        behind: the chips with a pin on a wire that a cycle moves.
        closed: whether nothing on the board but cycles and hosts can move such a wire.
    """

    def __init__(self, bus: CardBus, glue: Glue, chips: list[Chip]) -> None:
        self._bus: CardBus = bus
        self._data: Net = bus.bus_net
        self._moving: dict[int, Net] = {id(pin.net): pin.net for pin in bus.moving.values()}
        self._blocks: list[GlueBlock] = []
        self._find_blocks(glue)
        # In the order in which strobes reach them: what is on the bus itself comes before glue.
        self._driven: dict[int, Pin] = {id(pin): pin for pin in bus.moving.values()} | {
            id(pin): pin for block in self._blocks for pin in block.outputs
        }
        self.behind: list[Chip] = [
            chip for chip in chips
            if chip is not bus and any(id(pin.net) in self._moving for pin in chip.pins.values())
        ]  # fmt: skip
        self.edged: list[Chip] = [chip for chip in self.behind if chip.on_levels is None]
        heard = {id(pin.net) for chip in self.edged for pin in chip.bus_pins}
        if self.edged:
            heard.add(id(self._data))
        self._roles: dict[str, dict[str, str]] = {
            chip.name: {pin: r for pin, r in roles(chip).items() if r[0] != DATA}
            for chip in self.behind
        }
        self.edge_nets: list[Net] = [
            net for key, net in self._moving.items() if key in heard
        ]  # fmt: skip
        self._edge_pins: list[Pin] = [
            pin for pin in self._driven.values() if id(pin.net) in heard
        ]  # fmt: skip
        self.nets: list[Net] = []
        self.closed: bool = True
        self._find_nets(glue, chips)
        self._edges: list[int] = [
            number for number, block in enumerate(self._blocks) if has_clock(block)
        ]  # fmt: skip
        self._timing: CardTiming = CardTiming(
            bus, self._moving, self._blocks, self._roles, self.behind
        )

    @property
    def blocks(self) -> list[GlueBlock]:
        """The glue that cycles move, in order."""
        return self._blocks

    def _find_blocks(self, glue: Glue) -> None:
        found: set[int] = set()
        before = -1
        while len(found) > before:
            before = len(found)
            for block in glue.blocks:
                if any(id(pin.net) in self._moving for pin, _ in block.inputs):
                    found.add(id(block))
                    self._moving |= {id(pin.net): pin.net for pin in block.outputs}
        self._blocks = [block for block in glue.blocks if id(block) in found]

    def _find_nets(self, glue: Glue, chips: list[Chip]) -> None:
        """Find the nets that decide, with whatever drives those."""
        nets = dict(self._moving)
        for block in self._blocks:
            nets |= {id(pin.net): pin.net for pin, _ in block.inputs}
        for chip in self.behind:
            for name in self._roles[chip.name]:
                nets[id(chip.pins[name].net)] = chip.pins[name].net
        data = {id(chip.data_pin) for chip in chips}
        drivers: dict[int, list[GlueBlock]] = {}
        for block in glue.blocks:
            for pin in block.outputs:
                drivers.setdefault(id(pin), []).append(block)
        seen = {id(block): block for block in self._blocks}
        waiting = list(nets.values())
        while waiting:
            net = waiting.pop()
            for pin in net.pins:
                if pin.on_heard is not None and id(pin) not in data:
                    self.closed = False
                for block in drivers.get(id(pin), ()):
                    if id(block) not in seen:
                        seen[id(block)] = block
                        for other, _ in block.inputs:
                            if id(other.net) not in nets:
                                nets[id(other.net)] = other.net
                                waiting.append(other.net)
        self._watched: list[GlueBlock] = list(seen.values())
        if any(block.row.holds for block in self._watched):
            self.closed = False
        self.nets = list(nets.values())

    # -- what decides ---------------------------------------------------------------------------

    def settled(self) -> bool:
        """Whether nothing is on its way through a delay."""
        return not any(block.queue for block in self._watched)

    def context(self) -> tuple[int, ...]:
        """Return all that decides, but for address, strobes and what follows them."""
        levels = [net.value for net in self.nets if id(net) not in self._moving]
        levels += [
            pin.level for net in self._moving.values() for pin in net.pins
            if id(pin) not in self._driven
        ]  # fmt: skip
        return (*levels, *(block.state for block in self._blocks))

    def clocks(self) -> tuple[int, ...]:
        """Return the inputs of registers and resets as they stand."""
        return self._clocks({id(net): net.value for net in self._moving.values()})

    def _clocks(self, nets: Mapping[int, int]) -> tuple[int, ...]:
        found = [
            nets[id(pin.net)]
            for number in self._edges
            for pin, _ in self._blocks[number].inputs
            if id(pin.net) in nets and pin.net.width == 1
        ]
        for chip in self.behind:
            known = self._roles[chip.name]
            found += [
                nets[id(pin.net)] for name, pin in chip.pins.items()
                if id(pin.net) in nets and name not in known and pin not in chip.bus_pins
            ]  # fmt: skip
        return tuple(found)

    # -- one cycle ------------------------------------------------------------------------------

    def cycle(self, address: int, write: bool) -> CardCycle:
        """Return what a cycle comes to: ``address`` is counted from the card's base."""
        try:
            refusal = self._timing.refusal()
            if refusal:
                raise NotFixed(refusal)
            return self._cycle(address, write)
        except NotFixed as error:
            return CardCycle(why=str(error))

    def _cycle(self, address: int, write: bool) -> CardCycle:
        idle = self._phase(address, "", {})
        under = self._phase(
            address, self._bus.write_strobe if write else self._bus.read_strobe, idle.nets
        )
        for net in self._moving.values():
            if id(net) in idle.floating and (net.width == 1 or net is self._data):
                raise NotFixed(f"nobody drives {net.name}")
        clocks = self._clocks(idle.nets)
        if clocks != self._clocks(under.nets):
            raise NotFixed("a register or a reset follows the strobe")
        for block, (now, before), (later, after) in zip(
            self._blocks, idle.outcomes, under.outcomes, strict=True
        ):
            if block.delay and before != after:
                raise NotFixed("the strobe goes through a delay")
            self._blind(block, now, before)
            self._blind(block, later, after)
        if self.edged:
            if not self.closed:
                raise NotFixed("an output of a chip decides, and it may move in a cycle")
            for chip in self.edged:
                if write and LOW in (
                    self._pin(chip, self._strobe(chip, False), phase) for phase in (idle, under)
                ):
                    raise NotFixed(f"{chip.name} is strobed the other way")
                if not write and any(self._selected(chip, phase, True) for phase in (idle, under)):
                    # What it takes, and whether a pin drives that, the strobes alone tell.
                    raise NotFixed(f"{chip.name} takes a byte in a read")
                if write and chip.bus_net is not self._data and id(chip.bus_net) in under.floating:
                    raise NotFixed(f"what was there stays on {chip.bus_net.name}")
            steps = self._steps(write, idle, under)
            return CardCycle(steps=steps, rest=self._rest(idle, clocks))
        return self._levels_cycle(write, idle, under, clocks)

    def _levels_cycle(
        self, write: bool, idle: Phase, under: Phase, clocks: tuple[int, ...]
    ) -> CardCycle:
        for chip in self.behind:
            if self._selected(chip, idle, False) or self._selected(chip, idle, True):
                raise NotFixed(f"{chip.name} is selected without a strobe")
            if self._selected(chip, under, not write):
                raise NotFixed(f"{chip.name} is strobed the other way")
            select, *strobes = (
                (self._pin(chip, name, idle), self._pin(chip, name, under))
                for name in (
                    self._select(chip),
                    self._strobe(chip, False),
                    self._strobe(chip, True),
                )
            )
            if select == (LOW, HIGH) or (LOW, HIGH) in strobes:
                raise NotFixed(f"{chip.name} is let go as the strobe falls")
        reached = [chip for chip in self.behind if self._selected(chip, under, write)]
        places = [self._place(chip, under) for chip in reached]
        if places != [self._place(chip, idle) for chip in reached]:
            raise NotFixed("an address line follows the strobe")
        answer = 0xFF
        if write:
            for chip in reached:
                for phase in (idle, under):  # also while it is held after the strobe
                    if chip.bus_net not in self._written(phase):
                        raise NotFixed(f"what is written is not held for {chip.name}")
        else:
            answer = self._answer(reached, idle, under)
        kept = self._kept(reached, write, idle, under)
        return CardCycle(reached, places, answer, kept, rest=self._rest(idle, clocks))

    def _steps(self, write: bool, idle: Phase, under: Phase) -> EdgeSteps:
        """Return how the wires move to chips that want every edge."""
        source = self._data
        carrying: tuple[set[int], set[int]] = (set(), set())
        for number, phase in enumerate((idle, under)):
            for block, start, to in self._bridges(phase):
                through = {id(pin) for pin in block.outputs if pin.net is to}
                if write and start is self._data:
                    carrying[number].update(through)
                elif not write and number and to is self._data:
                    if source is not self._data or any(
                        phase.pins.get(id(pin), pin.level) != Z and id(pin) not in through
                        for pin in self._data.pins
                    ):
                        raise NotFixed("two drive the data bus")
                    if any(chip.bus_net is self._data for chip in self.edged):
                        raise NotFixed("a chip before a transceiver sees what comes through it")
                    source = start
                elif to is not self._data and start is not self._data:
                    raise NotFixed("data goes through two transceivers")
            if write:
                carrying[number].add(id(self._bus.data_pin))
        for _, start, to in self._bridges(idle):
            if not write and to is self._data and start is not self._data:
                raise NotFixed("a transceiver drives the bus without a strobe")
        return steps_of(self._bus, self._edge_pins, (idle.pins, under.pins), carrying, source)

    def _kept(
        self, reached: list[Chip], write: bool, idle: Phase, under: Phase
    ) -> list[tuple[Net, int]]:
        """Return what is left on data buses that are not pulled."""
        found: list[tuple[Net, int]] = []
        for key, net in self._moving.items():
            if net.rest != Z:
                continue
            if key not in idle.floating:
                found.append((net, idle.nets[key]))
            elif write:
                raise NotFixed("what is written may stay on a data bus that floats")
            elif any(net is chip.bus_net for chip in reached):
                found.append((net, -1))
            elif key not in under.floating:
                found.append((net, under.nets[key]))
        return found

    def _phase(self, address: int, strobe: str, before: Mapping[int, int]) -> Phase:
        """Return the levels while an address stands, and maybe a strobe is low."""
        bus = self._bus
        where = bus.where(address)
        pins = {id(pin): where >> n & 1 for n, pin in enumerate(bus.address_pins)}
        pins |= {id(bus.pins[name]): HIGH for name in (bus.read_strobe, bus.write_strobe)}
        if bus.row.latched:
            pins[id(bus.pins[LATCH])] = LOW
        pins[id(bus.data_pin)] = Z
        if strobe:
            pins[id(bus.pins[strobe])] = LOW
        for pin in self._driven.values():
            pins.setdefault(id(pin), Z)
        for block in self._blocks:
            for pin, level in zip(
                block.outputs, outputs(block, block.levels, block.driven), strict=True
            ):
                pins[id(pin)] = level
        nets = {key: self._level(net, pins, before) for key, net in self._moving.items()}
        outcomes: list[tuple[Levels, Outcome]] = [((), (0, 0, 0))] * len(self._blocks)
        for _ in range(8):
            moved = False
            for number, block in enumerate(self._blocks):
                now = tuple(
                    nets.get(id(pin.net), pin.net.value) >> wire & 1 for pin, wire in block.inputs
                )
                outcome = block.row.function(now, now, block.state)
                if outcome[0] != block.state:
                    raise NotFixed("a latch follows the bus")
                outcomes[number] = now, outcome
                for pin, level in zip(block.outputs, outputs(block, *outcome[1:]), strict=True):
                    if pins[id(pin)] == level or (pin.open_drain and pins[id(pin)] + level == 0):
                        continue
                    pins[id(pin)] = Z if pin.open_drain and level == HIGH else level
                    level = self._level(pin.net, pins, before)
                    moved = moved or level != nets[id(pin.net)]
                    nets[id(pin.net)] = level
            if not moved:
                floating = {
                    key for key, net in self._moving.items()
                    if net.rest == Z and all(pins.get(id(p), p.level) == Z for p in net.pins)
                }  # fmt: skip
                return Phase(nets, pins, outcomes, floating)
        raise NotFixed("the glue does not settle")

    def _level(self, net: Net, pins: Mapping[int, int], before: Mapping[int, int]) -> int:
        level = Z
        for pin in net.pins:
            mine = pins.get(id(pin), pin.level)
            if mine != Z:
                level = mine if level == Z else level & mine
        if level != Z:
            return level
        return before.get(id(net), net.value) if net.rest == Z else net.rest

    def _fights(self, net: Net, pins: Mapping[int, int]) -> bool:
        levels = {
            mine: None for pin in net.pins
            if (mine := pins.get(id(pin), pin.level)) != Z and not pin.open_drain
        }  # fmt: skip
        return len(levels) > 1

    def _blind(self, block: GlueBlock, now: Levels, outcome: Outcome) -> None:
        """Make sure that a block does not look at data; transceivers pass it on."""
        wires = [place for place, (pin, _) in enumerate(block.inputs) if pin.net.width == 8]
        wires = [place for place in wires if id(block.inputs[place][0].net) in self._moving]
        if not wires or block.row.function is logic.transceiver:
            return
        if len(wires) > MOST_UNKNOWN:
            raise NotFixed("glue looks at data")
        for bits in product((0, 1), repeat=len(wires)):
            levels = list(now)
            for place, bit in zip(wires, bits, strict=True):
                levels[place] = bit
            tried = tuple(levels)
            state, levels_out, driven = block.row.function(tried, tried, block.state)
            if (state, levels_out & driven, driven) != (
                outcome[0], outcome[1] & outcome[2], outcome[2],
            ) or (block.delay and levels_out != outcome[1]):  # fmt: skip
                raise NotFixed("glue looks at data")

    # -- chips ----------------------------------------------------------------------------------

    def _pin(self, chip: Chip, name: str, phase: Phase) -> int:
        net = chip.pins[name].net
        return phase.nets.get(id(net), net.value)

    def _select(self, chip: Chip) -> str:
        return pin_of(self._roles[chip.name], SELECT)

    def _strobe(self, chip: Chip, write: bool) -> str:
        return pin_of(self._roles[chip.name], WRITE if write else READ)

    def _selected(self, chip: Chip, phase: Phase, write: bool) -> bool:
        wanted = (self._select(chip), self._strobe(chip, write))
        return all(self._pin(chip, name, phase) == LOW for name in wanted)

    def _place(self, chip: Chip, phase: Phase) -> int:
        return sum(
            self._pin(chip, name, phase) << int(role[1:])
            for name, role in self._roles[chip.name].items()
            if role[0] == ADDRESS
        )

    def _bridges(self, phase: Phase) -> Iterator[tuple[GlueBlock, Net, Net]]:
        """Give the transceivers that are on: from which data bus, to which."""
        for block, (_, outcome) in zip(self._blocks, phase.outcomes, strict=True):
            if block.row.function is not logic.transceiver or not outcome[2]:
                continue
            sides = [block.inputs[2:10], block.inputs[10:18]]
            for side in sides:
                pin = side[0][0]
                if pin.net.width != 8 or [w for p, w in side if p.net is pin.net] != [*range(8)]:
                    raise NotFixed("a transceiver's wires are not those of one data bus")
            ends = [side[0][0].net for side in sides]
            if block.delay:
                raise NotFixed("data goes through a delay")
            yield (block, *(ends if outcome[2] == 0xFF00 else ends[::-1]))  # type: ignore[misc]

    def _written(self, phase: Phase) -> list[Net]:
        """Return the data buses behind transceivers that what is written reaches."""
        found = [self._data]
        for block, source, to in self._bridges(phase):
            others = [p for p in to.pins if p not in block.outputs and p.level != Z]
            if source is self._data and not others:
                found.append(to)
        return found

    def _answer(self, reached: list[Chip], idle: Phase, phase: Phase) -> int:
        """Return what is read if no chip answers; make sure that no more than one drives."""
        if len(reached) > 1:
            raise NotFixed("several chips answer")
        on = list(self._bridges(phase))
        if reached:
            bus = reached[0].bus_net
            through = {id(p) for b, source, to in on if source is bus for p in b.outputs
                       if p.net is self._data and to is self._data}  # fmt: skip
            if bus is not self._data and not through:
                raise NotFixed(f"{reached[0].name} does not reach the bus")
            if any(idle.pins.get(id(p), p.level) != Z for p in bus.pins):
                raise NotFixed(f"a transceiver turns on {reached[0].name} as its read ends")
            for net in (bus, self._data):
                for pin in net.pins:
                    if phase.pins.get(id(pin), pin.level) != Z and id(pin) not in through:
                        raise NotFixed("two drive the data bus")
            return 0xFF
        if self._fights(self._data, phase.pins):
            raise NotFixed("two drive the data bus")
        if any(id(net) in phase.floating & idle.floating for _, net, _ in on):
            raise NotFixed("what is read was left on a data bus that floats")
        return phase.nets[id(self._data)]

    def _rest(self, idle: Phase, clocks: tuple[int, ...]) -> RestingWires:
        for net in self._moving.values():
            if self._fights(net, idle.pins):
                raise NotFixed(f"two drive {net.name}")
        return RestingWires(
            [
                (net, idle.nets[key])
                for key, net in self._moving.items()
                if net.rest != Z and net not in self.edge_nets
            ],
            [
                (pin, idle.pins[key])
                for key, pin in self._driven.items()
                if pin not in self._edge_pins
            ],
            [
                (block, outcome[1], outcome[2], now)
                for block, (now, outcome) in zip(self._blocks, idle.outcomes, strict=True)
            ],
            clocks,
        )
