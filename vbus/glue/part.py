"""Parts of glue on a board: they follow their inputs, after their delay."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from typing import ClassVar, Final

from vbus.chips.base import Chip
from vbus.chips.tables import PinRow
from vbus.core.kernel import NEVER, Kernel
from vbus.core.signals import Net, Pin, Z
from vbus.core.signals.net import Watcher
from vbus.core.state import Names
from vbus.glue.logic import Levels
from vbus.glue.table import Block

Input = tuple[Pin, int]
"""Where an input is: a pin on its net, and the number of the wire if the net is a bundle."""

MOST_TURNS: Final = 200
"""How often glue follows in one go: more is a loop through a chip, which never settles."""


class GlueBlock:
    """One block of a part.

    Args:
        kernel: the board's time.
        row: what it does.
        delay: how long its outputs take to follow (ps).
        inputs: where its inputs are.
        outputs: its output pins, in the order of the row.
    """

    STATE: ClassVar[Names] = (
        "state", "levels", "driven", "queue: list[(i64, i64, i64), ...]",
    )  # fmt: skip
    WIRING: ClassVar[Names] = ("_timer", "delay", "inputs", "outputs")
    DERIVED: ClassVar[Names] = ("_was", "asleep")

    def __init__(
        self, kernel: Kernel, row: Block, delay: int, inputs: list[Input], outputs: list[Pin]
    ) -> None:
        self.row: Block = row
        self.inputs: list[Input] = inputs
        self.outputs: list[Pin] = outputs
        self.state: int = 0
        self.levels: int = 0
        self.driven: int = 0
        self.queue: list[tuple[int, int, int]] = []
        """Levels, and which are driven, that are on their way to the outputs, by instant."""
        self._kernel: Kernel = kernel
        self.delay: int = delay
        """How long its outputs take to follow (ps); a fault may have made it longer."""
        self._was: Levels = ()
        self.asleep: bool = False
        """Whether a card's path computes its outputs, until :meth:`stand` is called."""
        self._timer = kernel.timer(self._due) if delay else None

    def _now(self) -> Levels:
        return tuple([pin.net.value >> wire & 1 for pin, wire in self.inputs])

    def start(self) -> None:
        """Power comes up: outputs are where the inputs put them, a reset is asserted."""
        self._was = self._now()
        self.queue.clear()
        # A supervisor asserts its reset at power-on whatever its input is, and releases it by its
        # delay.
        if self.row.holds:
            _, self.levels, self.driven = self.row.function((0,), (0,), 0)
            self._drive(self.levels, self.driven)
            self._was = (0,)
            self.look()
            return
        self.state, self.levels, self.driven = self.row.function(self._was, self._was, 0)
        self._drive(self.levels, self.driven)

    def look(self) -> bool:
        """Follow the inputs, if they have moved; tell whether the outputs move with them."""
        if self.asleep:
            return False
        now = self._now()
        if now == self._was:
            return False
        was, self._was = self._was, now
        self.state, levels, driven = self.row.function(now, was, self.state)
        if levels == self.levels and driven == self.driven:
            return False
        self.levels, self.driven = levels, driven
        # A reset is asserted at once; only its release waits.
        asserts = self.row.holds and not now[0]
        if self._timer is None or not self.delay or asserts:
            self.queue.clear()
            self._drive(levels, driven)
            return True
        due = self._kernel.now + self.delay
        # A fault may have shortened the delay: an edge does not overtake those on their way.
        self.queue.append((max(due, self.queue[-1][0]) if self.queue else due, levels, driven))
        if self._timer.due == NEVER:
            self._timer.at(self.queue[0][0])
        return False

    def slow(self, by: int) -> None:
        """Let its outputs follow so much later than they do (ps); negative: earlier."""
        self.delay += by
        if self._timer is None:
            self._timer = self._kernel.timer(self._due, saved=False)
        if self.queue and self._timer.due == NEVER:
            self._timer.at(self.queue[0][0])

    def _due(self) -> None:
        while self.queue and self.queue[0][0] <= self._kernel.now:
            _, levels, driven = self.queue.pop(0)
            self._drive(levels, driven)
        if self.queue and self._timer is not None:
            self._timer.at(self.queue[0][0])

    def _drive(self, levels: int, driven: int) -> None:
        for pin in self.outputs:
            width = pin.net.width
            mask = (1 << width) - 1
            pin.drive(levels & mask if driven & mask else Z)
            levels >>= width
            driven >>= width

    def stand(self, state: int) -> None:
        """Take what it holds, and its inputs and outputs as they have come to stand."""
        self._was = self._now()
        self.state, self.levels, self.driven = self.row.function(self._was, self._was, state)
        self.asleep = False

    def after_load(self) -> None:
        """The nets have been loaded: edges are counted from here."""
        self._was = self._now()
        self.asleep = False
        if self.queue:  # of a part that a fault had made slow, perhaps
            self.slow(0)


class GluePart:
    """A part of glue: its pins, and the blocks of it that are used.

    Args:
        kernel: the board's time.
        name: its name on the board.
        pin_rows: its pins that are wired.
        blocks: what it does.
        delay: how long its outputs take to follow (ps).
        borrowed: inputs that have no pin of the part: pins of others, or wires of a bundle.
        inner: wires inside it, between its blocks.
    """

    STATE: ClassVar[Names] = ("blocks: parts",)
    WIRING: ClassVar[Names] = ("name", "pins")

    def __init__(
        self,
        kernel: Kernel,
        name: str,
        pin_rows: tuple[PinRow, ...],
        blocks: Iterable[Block],
        delay: int,
        borrowed: Mapping[str, Input],
        inner: tuple[PinRow, ...] = (),
    ) -> None:
        self.name: str = name
        self.pin_rows: tuple[PinRow, ...] = pin_rows
        self.pins: dict[str, Pin] = {}
        for row in (*pin_rows, *inner):
            net = Net(kernel, f"{name}.{row.name}", rest=row.rest, width=row.width)
            self.pins[row.name] = net.solder(row.name, open_drain=row.direction == "od")
        self.blocks: list[GlueBlock] = []
        for block in blocks:
            inputs = [borrowed.get(pin) or self._input(pin) for pin in block.inputs]
            outputs = list(dict.fromkeys(self._input(pin)[0] for pin in block.outputs))
            self.blocks.append(GlueBlock(kernel, block, delay, inputs, outputs))

    def _input(self, name: str) -> Input:
        """Return where a pin is: by itself, or a wire of a bundle such as D0-D7."""
        if name in self.pins:
            return self.pins[name], 0
        bundle = next(row.name for row in self.pin_rows if name in bundled(row.name))
        return self.pins[bundle], bundled(bundle).index(name)

    def ends(self, outputs: bool) -> set[int]:
        """Return which nets its blocks drive, or listen to."""
        if outputs:
            return {id(pin.net) for block in self.blocks for pin in block.outputs}
        return {id(pin.net) for block in self.blocks for pin, _ in block.inputs}


class Glue:
    """The glue of one board.

    Whatever moves, blocks are looked at in an order in which none comes before one it follows: so
    glue without delays settles at once, and no other part sees the levels between.

    Args:
        kernel: the board's time.
        swings: called with a net that moves what moves it, without end: glue has ceased to follow.
    """

    STATE: ClassVar[Names] = ("parts: parts",)
    WIRING: ClassVar[Names] = ("blocks", "order", "pins")
    DERIVED: ClassVar[Names] = ("_batch", "_turns")

    def __init__(self, kernel: Kernel, swings: Callable[[str], None]) -> None:
        self._kernel: Kernel = kernel
        self._swings: Callable[[str], None] = swings
        self._batch: int = -1
        self._turns: int = 0
        self.parts: list[GluePart] = []
        self.pins: dict[str, Pin] = {}
        """Pins of all parts, by "part.pin"."""
        self.order: list[tuple[str, int]] = []
        """Name of the part and number of the block, of all that follow one another, in order."""
        self.blocks: list[GlueBlock] = []
        """All blocks, in an order in which none comes before one it follows."""
        self._watcher: Watcher = Watcher(kernel, self._moved)

    def add(self, part: GluePart) -> None:
        """Put a part on the board: it follows its inputs from now on."""
        self.parts.append(part)
        for name, pin in part.pins.items():
            self.pins.setdefault(f"{part.name}.{name}", pin)
        for block in part.blocks:
            self.blocks.append(block)  # a board that runs already is not started again
            block.after_load()
            for net in dict.fromkeys(pin.net for pin, _ in block.inputs):
                if self._watcher not in net.watchers:
                    net.watch(self._watcher)

    def start(self) -> None:
        """Power comes up: put every output where its inputs have it."""
        rank = {place: number for number, place in enumerate(self.order)}
        placed = [
            (rank.get((part.name, place), -1), block)
            for part in self.parts
            for place, block in enumerate(part.blocks)
        ]
        placed.sort(key=lambda one: one[0])
        self.blocks = [block for _, block in placed]
        # A clear or preset may come from a block that starts later; and no clock has moved yet.
        for block in (*self.blocks, *self.blocks):
            block.start()
        for block in self.blocks:
            block.after_load()

    def around(self, pins: Iterable[Pin]) -> list[GluePart]:
        """Return the parts that pins of chips lead to, and those that lead to the pins."""
        nets = {id(pin.net) for pin in pins}
        found: set[str] = set()
        # Two searches: one in both directions at once would find all parts that share a bus.
        for outward in (True, False):
            known, before = set(nets), -1
            while len(known) > before:
                before = len(known)
                for part in self.parts:
                    if part.ends(not outward) & known:
                        found.add(part.name)
                        known |= part.ends(outward)
        return [part for part in self.parts if part.name in found]

    def leading_to(self, nets: Iterable[Net]) -> list[GlueBlock]:
        """Return the blocks that decide about the levels of some nets."""
        drivers: dict[int, list[GlueBlock]] = {}
        for block in self.blocks:
            for net in dict.fromkeys(pin.net for pin in block.outputs):
                drivers.setdefault(id(net), []).append(block)
        waiting, found = list(nets), dict[int, GlueBlock]()
        while waiting:
            for block in drivers.get(id(waiting.pop()), ()):
                if id(block) not in found:
                    found[id(block)] = block
                    waiting += [pin.net for pin, _ in block.inputs]
        return list(found.values())

    def behind(self, chips: Iterable[Chip]) -> list[Chip]:
        """Return the chips of which glue drives a strobe or the select."""
        nets = set().union(*(part.ends(outputs=True) for part in self.parts))
        return [chip for chip in chips if any(
            id(pin.net) in nets for pin in chip.bus_pins if pin is not chip.data_pin
        )]  # fmt: skip

    def _moved(self) -> None:
        # Turns are counted in one batch of changes: a loop shows as a batch without an end.
        if self._batch != self._kernel.batch:
            self._batch = self._kernel.batch
            self._turns = 0
        self._turns += 1
        if self._turns > MOST_TURNS:
            return
        moved = [block for block in self.blocks if block.look()]
        if self._turns == MOST_TURNS and moved:
            self._swings(moved[0].outputs[0].net.name)


def bundled(name: str) -> tuple[str, ...]:
    """Return the wires of a bundle by its name: D0 to D7 of ``D0-D7``; none if it is no bundle."""
    first, dash, last = name.partition("-")
    letters = first.rstrip("0123456789")
    if not dash or not last.startswith(letters):
        return ()
    low, high = first.removeprefix(letters), last.removeprefix(letters)
    # Eight wires: every data bus here is a byte.
    if not (low.isdecimal() and high.isdecimal() and int(high) - int(low) == 7):
        return ()
    return tuple(f"{letters}{number}" for number in range(int(low), int(high) + 1))
