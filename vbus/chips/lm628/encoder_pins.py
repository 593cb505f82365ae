"""The encoder front-end: edges on A, B and /IN where something drives these nets."""

from typing import ClassVar

from vbus.chips.base import Chip
from vbus.chips.lm628 import datasheet as ds
from vbus.chips.lm628.encoder import EncoderCounts
from vbus.chips.motion import quadrature as q
from vbus.chips.motion.input_limits import judge_inputs
from vbus.core.signals import LOW, Watcher
from vbus.core.state import Names


class FrontEndHost(Chip):
    """What the front-ends ask of their chip, beyond what every chip answers."""

    @property
    def powered(self) -> bool:
        """Whether supply is up."""
        raise NotImplementedError

    def index_seen(self, count: int) -> None:
        """The index has come at encoder ``count``; if armed, store its position (LM-POS-3)."""
        raise NotImplementedError

    def expect(self, when: int) -> None:
        """The front-end has something to do at instant ``when``."""
        raise NotImplementedError


class EncoderPins:
    """Pins 1 to 3 (LM-POS-1, LM-POS-3); silent while a plant has the encoder.

    Args:
        chip: the chip whose pins these are.
        encoder: takes the counts.
    """

    STATE: ClassVar[Names] = ("_low_from", "_low: bool")
    WIRING: ClassVar[Names] = ("_chip", "_encoder", "_inputs", "_pins", "_turn")

    def __init__(self, chip: FrontEndHost, encoder: EncoderCounts) -> None:
        self._chip: FrontEndHost = chip
        self._encoder: EncoderCounts = encoder
        self._inputs: q.Quadrature = encoder.inputs
        self._pins = (chip.pins["A"], chip.pins["B"], chip.pins["/IN"])
        self._turn: int = int(chip.settings["counts_per_turn"])
        # Where the index input went low, until it goes high or is declared grounded.
        self._low_from: int = 0
        self._low: bool = False
        watcher = Watcher(chip.kernel, self.look)
        for pin in self._pins:
            pin.net.watch(watcher)

    def preset(self) -> None:
        """Power is up: the levels there are now have been there for ever."""
        a, b, index = self._pins
        self._inputs.preset(a.value, b.value, index.value)
        self._low = index.value == LOW
        self._low_from = self._inputs.count

    def look(self) -> None:
        """Take in the levels as they are, unless no clock does it."""
        chip = self._chip
        if not chip.powered or self._encoder.plant is not None or chip.clock.stopped:
            return
        chip.advance()
        now = chip.kernel.now
        a, b, index = self._pins
        found = self._inputs.edge(now, a.value, b.value, index.value)
        late = bool(found) and chip.judged and judge_inputs(chip, ds.AC, self._inputs, found)
        self.settle(now, late)
        chip.touched()

    def settle(self, now: int, late: bool = False) -> None:
        """Take what has come of earlier edges by ``now``; ``late``: strict T3 loses the index."""
        chip = self._chip
        inputs = self._inputs
        while found := inputs.settle(now):
            if found & q.SKIPPED:
                chip.report(ds.DOUBLE_EDGE, when=inputs.at)
            if found & (q.INDEX_FELL | q.INDEX_ROSE):
                self._low = bool(found & q.INDEX_FELL)
                self._low_from = inputs.count
            way = abs(inputs.count - self._low_from)
            if self._low and way > self._turn:
                self._low = False
                chip.report(ds.INDEX_GROUNDED, way, self._turn, when=inputs.at)
            if found & q.ALL_LOW and not late:
                chip.index_seen(inputs.count)
