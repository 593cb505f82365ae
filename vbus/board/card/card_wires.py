"""The wires that cycles on a card's bus move, and what was seen on them while one was played."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise, product
from typing import ClassVar, Final

from msgspec import Struct

from vbus.board.card.card_bus import BYTE, CardBus, CardCycle, Levels, WireState
from vbus.board.pin_maps import ADDRESS, READ, SELECT, WRITE, roles
from vbus.chips.base import Chip
from vbus.circuit.circuit import Circuit
from vbus.circuit.glue_cycles import Ended
from vbus.core.kernel import Kernel
from vbus.core.kernel.kernel import Task
from vbus.core.signals import HIGH, LOW, Net, Pin, Z
from vbus.core.state import Names
from vbus.glue import logic
from vbus.glue.part import GlueBlock

MOST_UNKNOWN: Final = 8
"""Inputs of one block that may carry unknown data together: each combination is tried."""
MOST_TURNS: Final = 20
"""So often wires move in one batch where no chip and glue move each other without end."""
_LONG_AGO: Final = -(1 << 62)


class CardWires:
    """What cycles of one connector move, and what decides about them.

    Args:
        board: the board, with all its wires.
        bus: the connector.

    Attributes:
        nets: the wires a cycle moves.
        outside: the other wires that decide what comes of one.
        blocks: the glue that follows those it moves.
        behind: the chips with a pin on them.
        edged: whether one of these wants the edges of its strobes.
        closed: whether nothing but cycles and hosts can move a wire that decides.
        pins: what drives the nets: connector, glue, the data pins of chips.
    """

    WIRING: ClassVar[Names] = ("*",)

    def __init__(self, board: Circuit, bus: CardBus) -> None:
        self.bus: CardBus = bus
        self.watched: list[GlueBlock] = []
        glue = board.glue
        moving = {id(pin.net): pin.net for pin in bus.moving.values()}
        before = -1
        # Glue that a cycle moves moves further glue.
        while len(moving) > before:
            before = len(moving)
            self.blocks: list[GlueBlock] = [
                block for block in glue.blocks
                if any(id(pin.net) in moving for pin, _ in block.inputs)
            ]  # fmt: skip
            moving |= {id(pin.net): pin.net for block in self.blocks for pin in block.outputs}
        self.nets: list[Net] = list(moving.values())
        self.place: dict[int, int] = {key: place for place, key in enumerate(moving)}
        self.behind: list[Chip] = [
            chip for chip in board.chips
            if chip is not bus and any(id(pin.net) in moving for pin in chip.pins.values())
        ]  # fmt: skip
        seen = {id(row.chip) for row in board.through.rows} if board.through is not None else set()
        # One such chip is enough: the wires to all of them are the same.
        self.edged: bool = any(
            chip.on_levels is None or id(chip) not in seen for chip in self.behind
        )
        self.roles: dict[str, dict[str, str]] = {chip.name: roles(chip) for chip in self.behind}
        self._find_outside(board)
        # In the order in which strobes reach them: what is on the bus itself comes before glue.
        made = {id(pin): pin for pin in bus.moving.values()}
        made |= {id(pin): pin for block in self.blocks for pin in block.outputs}
        self.made: int = len(made)
        """So many of the pins are the connector's and the glue's."""
        made |= {id(c.data_pin): c.data_pin for c in self.behind if id(c.bus_net) in moving}
        self.pins: list[Pin] = list(made.values())
        self.pin_place: dict[int, int] = {key: place for place, key in enumerate(made)}
        self.on: list[list[int]] = [
            [number for number, pin in enumerate(self.pins) if pin.net is net] for net in self.nets
        ]
        heard = {id(p.net) for c in self.behind for p in c.pins.values()} if self.edged else set()
        self.heard: list[bool] = [id(net) in heard for net in self.nets]
        self.bridges: list[tuple[int, int]] = []
        self.lookers: list[tuple[int, list[tuple[int, int]]]] = []
        for number, block in enumerate(self.blocks):
            if _is_bridge(block):
                one, other = (self.pin_place[id(pin)] for pin in block.outputs)
                self.bridges += [(one, other), (other, one)]
            elif data := [
                (place, self.place[id(pin.net)]) for place, (pin, _) in enumerate(block.inputs)
                if pin.net.width == 8 and id(pin.net) in moving
            ]:  # fmt: skip
                self.lookers.append((number, data))
        self.blind: dict[object, bool] = {}

    def _find_outside(self, board: Circuit) -> None:
        """Find the nets that decide and that no cycle moves, with what decides about those."""
        nets = {id(net): net for net in self.nets}
        nets |= {id(pin.net): pin.net for block in self.blocks for pin, _ in block.inputs}
        for chip in self.behind:
            nets |= {
                id(chip.pins[name].net): chip.pins[name].net
                for name in self.roles[chip.name] if name in chip.pins
            }  # fmt: skip
        self.watched = board.glue.leading_to(nets.values())
        nets |= {id(pin.net): pin.net for block in self.watched for pin, _ in block.inputs}
        self.outside: list[Net] = [net for key, net in nets.items() if key not in self.place]
        data = {id(chip.data_pin) for chip in board.chips}
        self.closed: bool = not any(block.row.holds for block in self.watched) and not any(
            pin.on_heard is not None and id(pin) not in data
            for net in nets.values() for pin in net.pins
        )  # fmt: skip

    def foreign(self) -> tuple[object, ...]:
        """Return what others drive onto the wires that cycles move."""
        return tuple([
            (place, pin.level) for place, net in enumerate(self.nets) for pin in net.pins
            if pin.level != Z and id(pin) not in self.pin_place
        ])  # fmt: skip

    def state(self) -> WireState:
        """Return how all stands now."""
        shot = Shot.of(self, 0, 0)
        nets = [
            BYTE if self.floats(shot, place) else level for place, level in enumerate(shot.nets)
        ]
        return self.standing(shot, nets, shot.pins)

    def standing(self, shot: Shot, nets: Sequence[int], pins: Sequence[int]) -> WireState:
        """Return what puts the wires that no chip hears the edges of to these levels."""
        return WireState(
            [(net, level) for net, level, heard in zip(self.nets, nets, self.heard, strict=True)
             if not heard],
            [(pin, level) for pin, level in zip(self.pins[: self.made], pins, strict=False)
             if not self.heard[self.place[id(pin.net)]]],
            list(zip(self.blocks, shot.states, strict=True)),
        )  # fmt: skip

    def drivers(self, shot: Shot, place: int) -> list[int]:
        """Return which pins drive a net."""
        return [number for number in self.on[place] if shot.pins[number] != Z]

    def floats(self, shot: Shot, place: int) -> bool:
        """Whether a data bus has what was left there."""
        net = self.nets[place]
        return net.width == 8 and net.rest == Z and not self.drivers(shot, place)


def _is_bridge(block: GlueBlock) -> bool:
    """Whether a block is a transceiver between two data buses, wire by wire."""
    if block.row.function is not logic.transceiver or block.delay or len(block.outputs) != 2:
        return False
    sides = [block.inputs[2:10], block.inputs[10:18]]
    return all(
        pin.net.width == 8 and side == [(pin, wire) for wire in range(8)]
        for side, pin in zip(sides, block.outputs, strict=True)
    )


class Shot(Struct):
    """How all stood at the end of a batch of changes."""

    batch: int
    when: int
    pins: list[int]
    nets: list[int]
    states: list[int]
    foreign: tuple[object, ...]
    clash: bool

    @classmethod
    def of(cls, wires: CardWires, batch: int, when: int) -> Shot:
        """Return how all stands now."""
        return cls(
            batch, when, [pin.level for pin in wires.pins], [net.value for net in wires.nets],
            [block.state for block in wires.blocks], wires.foreign(),
            any(net.clashing for net in wires.nets),
        )  # fmt: skip


class CardRecord(Task):
    """Watches the wires while a cycle is played, and says what it came to.

    Args:
        wires: the wires.
        kernel: the board's time.
        write: whether it is a write.
        data: the byte that is written.
        when: its latching edge (ps).

    Attributes:
        lost: whether something else moved what decides: the next such cycle is watched again.
        by_byte: whether the byte that is written decides what the cycle comes to.
    """

    WIRING: ClassVar[Names] = ("*",)

    def __init__(self, wires: CardWires, kernel: Kernel, write: bool, data: int, when: int) -> None:
        self._wires: CardWires = wires
        self._kernel: Kernel = kernel
        self._write: bool = write
        self._data: int = data
        self._when: int = when
        self._pending: bool = False
        self._turns: int = 0
        self._heard: bool = False
        """Whether a chip has heard one of its lines move in this batch."""
        self._restless: bool = False
        """Whether wires move without end, or in turns of one batch between which a chip looks."""
        self._shots: list[Shot] = [Shot.of(wires, -1, kernel.now)]
        self._sources: set[int] = set()
        self.lost: bool = False
        self.by_byte: bool = False

    def pin_moved(self) -> None:
        """A wire moves: look once all that moves with it has."""
        if not self._pending:
            self._pending = True
            self._kernel.soon(self)

    def run(self) -> None:
        """Look."""
        self._pending = False
        wires, last = self._wires, self._shots[-1]
        shot = Shot.of(wires, self._kernel.batch, self._kernel.now)
        if shot.batch == last.batch:
            self._shots.pop()
            self._turns += 1
        else:
            self._turns, self._heard = 0, False
        moved = [
            place for place, (net, heard) in enumerate(zip(wires.nets, wires.heard, strict=True))
            if heard and (
                bool(wires.drivers(last, place)) != bool(now := wires.drivers(shot, place))
                and all(one < wires.made for one in wires.drivers(last, place) + now)
                if net.width == 8 else last.nets[place] != shot.nets[place]
            )
        ]  # fmt: skip
        late = self._turns > 1 or any(wires.nets[place].width == 8 for place in moved)
        self._restless |= (self._heard and bool(moved) and late) or self._turns > MOST_TURNS
        self._heard = self._heard or any(wires.nets[place].width != 8 for place in moved)
        self._shots.append(shot)

    # -- what it came to ------------------------------------------------------------------------

    def cycle(self, value: int, ended: list[tuple[int, list[Ended]]] | None) -> CardCycle | None:
        """Return what the cycle came to as its strobe rose; None: the wires alone do not say.

        Args:
            value: the byte that was read.
            ended: the cycles at chips that were reported, with the instants.
        """
        wires, shots = self._wires, self._shots
        bus = wires.bus
        strobe = wires.pin_place[id(bus.pins[bus.write_strobe if self._write else bus.read_strobe])]
        rise = next(
            (number for number, (last, shot) in enumerate(pairwise(shots), 1)
             if last.pins[strobe] == LOW and shot.pins[strobe] == HIGH), 0,
        )  # fmt: skip
        if (
            not rise
            or self._restless
            or any(shot.clash or shot.foreign != shots[0].foreign for shot in shots)
            or any(block.queue for block in wires.watched)
            or self._left_unseen()
        ):
            return None
        under = shots[rise - 1]
        answers = [
            number for number in range(wires.made, len(wires.pins)) if under.pins[number] != Z
        ]
        if len(answers) > (not self._write):
            return None
        self._sources = {wires.pin_place[id(bus.data_pin)]} if self._write else set(answers)
        self.by_byte = self._write and (bus.latches or not self._blind(self._sources))
        if (self.by_byte or not self._write) and not self._blind(
            set() if self._write else self._sources
        ):
            return None
        carried = self._through(under, set(self._sources))
        host = wires.drivers(under, wires.place[id(bus.bus_net)])
        answered = bool(answers) and bool(host) and carried.issuperset(host)
        if not self._write and not answered:
            unknown = self._through(under, set(self._sources), floating=True)
            if unknown.intersection(host) or wires.floats(under, wires.place[id(bus.bus_net)]):
                return None
            if answers and not wires.edged:
                return None
        made = (
            self._steps(rise) if wires.edged else self._calls(rise, answers, carried, ended or [])
        )
        if made is not None:
            made.answer = value
            if wires.edged and answered:
                made.source = wires.pins[answers[0]].net
        return made

    def _left_unseen(self) -> bool:
        """Whether a data bus is let go of as the data changes: a transceiver may have seen both."""
        wires = self._wires
        data = wires.pin_place[id(wires.bus.data_pin)]
        return any(
            was.pins[data] != shot.pins[data] and wires.drivers(was, place)
            and wires.floats(shot, place)
            for was, shot in pairwise(self._shots) for place in range(len(wires.nets))
        )  # fmt: skip

    def _through(self, shot: Shot, found: set[int], floating: bool = False) -> set[int]:
        """Add the transceivers that pass on what these pins drive, and what floats if asked."""
        wires = self._wires
        for _ in wires.bridges:
            for one, other in wires.bridges:
                place = wires.place[id(wires.pins[one].net)]
                drivers = wires.drivers(shot, place)
                if shot.pins[other] != Z and (
                    found.issuperset(drivers) if drivers
                    else floating and wires.floats(shot, place)
                ):  # fmt: skip
                    found.add(other)
        return found

    def _unknown(self, shot: Shot, sources: set[int]) -> set[int]:
        """Return the data buses with a byte that may be another one next time."""
        wires = self._wires
        pins = self._through(shot, {one for one in sources if shot.pins[one] != Z}, floating=True)
        nets = {wires.place[id(wires.pins[one].net)] for one in pins}
        return nets | {place for place in range(len(wires.nets)) if wires.floats(shot, place)}

    def _blind(self, sources: set[int], begin: int = 0) -> bool:
        """Whether the glue does the same whatever these pins, and floating buses, carry."""
        wires = self._wires
        if not wires.lookers:
            return True
        # The first one twice: bytes that stand there before the cycle may be others, too.
        shots = [self._shots[0], *self._shots][begin:]
        unknown = [self._unknown(shot, sources) for shot in shots]
        for (was, shot), (before, now) in zip(pairwise(shots), pairwise(unknown), strict=True):
            for number, data in wires.lookers:
                places = [place for place, net in data if net in now or net in before]
                if places and not self._same(number, was, shot, places):
                    return False
        return True

    def _same(self, number: int, was: Shot, shot: Shot, places: list[int]) -> bool:
        """Whether one block does the same whatever is at these inputs."""
        wires = self._wires
        block = wires.blocks[number]
        state = was.states[number]
        levels, earlier = (
            [
                (one.nets[wires.place[id(pin.net)]] if id(pin.net) in wires.place
                 else pin.net.value) >> wire & 1
                for pin, wire in block.inputs
            ]
            for one in (shot, was)
        )  # fmt: skip
        for place in places:
            levels[place] = earlier[place] = 0
        key = (number, state, *levels, *earlier)
        known = wires.blind.get(key)
        if known is None:
            found = set()
            tried = product((0, 1), repeat=len(places)) if len(places) <= MOST_UNKNOWN else ()
            for bits, other in product(tried, (0, 1)):
                for place, bit in zip(places, bits, strict=True):
                    levels[place], earlier[place] = bit, bit ^ other
                made, high, driven = block.row.function(tuple(levels), tuple(earlier), state)
                found.add((made, high if block.delay else high & driven, driven))
            known = wires.blind[key] = len(found) == 1
        return known

    def _calls(
        self,
        rise: int,
        answers: list[int],
        carried: set[int],
        ended: list[tuple[int, list[Ended]]],
    ) -> CardCycle | None:
        """Return the whole cycles at chips that come to the same as their strobes."""
        wires = self._wires
        known = {chip.name: chip for chip in wires.behind}
        chips: list[Chip] = []
        places: list[int] = []
        for when, cycles in ended:
            for name, write, address, data in cycles:
                if when != self._when or write != self._write or known[name] in chips:
                    return None
                chip = known[name]
                if id(chip.bus_net) not in wires.place:
                    return None
                chips.append(chip)
                places.append(address)
                bus = wires.place[id(chip.bus_net)]
                for number, shot in enumerate(self._shots[rise - 1 :]):
                    # It holds what it takes; nothing else comes as it lets go.
                    drivers = wires.drivers(shot, bus)
                    if not carried.issuperset(drivers) or bool(drivers) != (write or not number):
                        return None
                if (write and data != self._data) or not self._in_time(chip, address, rise):
                    return None
        if not self._write and [id(chip.data_pin) for chip in chips] != [
            id(wires.pins[one]) for one in answers
        ]:
            return None
        first, last = self._shots[0], self._shots[-1]
        for chip in wires.behind:
            for name, role in wires.roles[chip.name].items():
                if role in (READ, WRITE) and LOW in (
                    self._value(chip.pins[name].net, first),
                    self._value(chip.pins[name].net, last),
                ):  # a select may be its strobe then
                    return None
            for name, pin in chip.pins.items():
                if name not in wires.roles[chip.name] and pin is not chip.data_pin:
                    if self._since(pin.net, len(self._shots) - 1) != _LONG_AGO:
                        return None
        fall = 0
        if answers:
            driven = [shot.pins[answers[0]] != Z for shot in self._shots[:rise]]
            begun = rise - driven[::-1].index(False)
            fall = self._when - self._shots[begun].when
        return CardCycle(chips, places, fall)

    def _since(self, net: Net, last: int) -> int:
        """Return since when a net had had its level at one of the shots (ps)."""
        place = self._wires.place.get(id(net))
        while place is not None and last:
            if self._shots[last].nets[place] != self._shots[last - 1].nets[place]:
                return self._shots[last].when
            last -= 1
        return _LONG_AGO

    def _value(self, net: Net, shot: Shot) -> int:
        place = self._wires.place.get(id(net))
        return net.value if place is None else shot.nets[place]

    def _in_time(self, chip: Chip, address: int, rise: int) -> bool:
        """Whether a chip had all its lines at least as long as in a whole cycle of its own."""
        under, after = self._shots[rise - 1], self._shots[rise]
        wanted = dict.fromkeys(
            (pin for pin, role in self._wires.roles[chip.name].items()
             if role in (READ, WRITE, SELECT)), (0, HIGH),
        )  # fmt: skip
        for offset, name, level in chip.strobes(self._write, address, self._data):
            if offset < 0:
                wanted[name] = offset, level
            elif level == Z and offset > self._wires.bus.hold_ps:
                return False
        for name, (offset, level) in wanted.items():
            net = chip.pins[name].net
            if offset and self._since(net, rise - 1) > self._when + offset:
                return False
            if self._value(net, under) != level:
                return False
        return all(
            self._value(chip.pins[name].net, under) == self._value(chip.pins[name].net, after)
            for name, role in self._wires.roles[chip.name].items()
            if role[0] == ADDRESS
        )

    def _steps(self, rise: int) -> CardCycle | None:
        """Return what moves the wires to chips that want every edge."""
        wires, shots = self._wires, self._shots
        found: list[list[int]] = []
        for shot in shots:
            carried = self._through(
                shot, {one for one in self._sources if shot.pins[one] != Z}
            ) if self._sources else set()  # fmt: skip
            unknown = self._through(shot, set(carried), floating=True)
            if any(
                not (self._write and one in carried)
                and wires.heard[wires.place[id(wires.pins[one].net)]]
                for one in unknown
                if one < wires.made
            ):
                return None
            if self._write and any(level != Z for level in shot.pins[wires.made :]):
                return None
            found.append([
                BYTE if self._write and not self.by_byte and one in carried else level
                for one, level in enumerate(shot.pins[: wires.made])
            ])  # fmt: skip
        last = shots[-1]
        if shots[-1].when > self._when or rise != len(shots) - 1:
            return None
        nets = list(last.nets)
        for place, heard in enumerate(wires.heard):
            if heard:
                continue
            levels = {found[-1][one] for one in wires.on[place] if found[-1][one] != Z}
            if BYTE in levels:
                nets[place] = BYTE
            if wires.floats(last, place):
                return None
        unknown = self._through(
            last, set(self._sources) if not self._write else set(), floating=True
        )
        if any(one < wires.made for one in unknown):
            return None
        steps: list[tuple[int, Levels]] = []
        for number, (was, now) in enumerate(pairwise(found), 1):
            moved = [
                (pin, level) for pin, old, level in zip(wires.pins, was, now, strict=False)
                if old != level and wires.heard[wires.place[id(pin.net)]]
            ]  # fmt: skip
            if moved or number == rise:
                steps.append((shots[number].when - self._when, moved))
        made = CardCycle()
        made.steps, made.after = steps, wires.standing(last, nets, found[-1])
        return made

    # -- how it ended -------------------------------------------------------------------------

    def finish(self, cycle: CardCycle, after: WireState) -> bool:
        """Note what a cycle at chips has left, as the wires rest now; False: that is not known."""
        wires, shots = self._wires, self._shots
        if (
            any(block.queue for block in wires.watched)
            or not self._blind(set() if self.by_byte else self._sources, begin=1)
            or self._left_unseen()
        ):
            return False
        last = shots[-1]
        for place, net in enumerate(wires.nets):
            if not wires.floats(last, place):
                continue
            for shot in reversed(shots):
                if drivers := wires.drivers(shot, place):
                    carried = self._through(shot, set(self._sources))
                    byte = carried.issuperset(drivers)
                    cycle.floating.append((net, BYTE if byte else shot.nets[place]))
                    break
        cycle.after = after
        return True
