"""One node's end of a wire that goes on at other nodes."""

from typing import ClassVar

from mypy_extensions import mypyc_attr

from vbus.core.kernel.kernel import Kernel
from vbus.core.signals.net import HIGH, Net, Pin, Z
from vbus.core.state import Names

Drive = tuple[int, int, int, bool]
"""What an end began to drive: instant (ps), rank of the wire, level, whether open drain only."""


Later = tuple[int, int, bool]
"""What another node drives: how much later it arrives (ps), level, whether it pulls low only."""


@mypyc_attr(allow_interpreted_subclasses=True)
class Wrong:
    """Something that is wrong with an end of a wire."""

    WIRING: ClassVar[Names] = ("*",)

    def cuts(self) -> bool:
        """Whether nothing that other nodes drive is seen."""
        return False

    def bend(self, node: int, after: int, level: int, weak: bool) -> list[Later]:
        """Return what becomes of an edge that would arrive so much later (ps)."""
        raise NotImplementedError


class WireEnd(Net):
    """The part of a wire that lies on one node.

    What this node's own pins drive is sent to the other ends, where it arrives after the wire's
    delay; what the other ends drive arrives here at pins of its own, one for each node. So an
    open-drain wire works as it does in copper, only later.

    Args:
        kernel: the node's time.
        name: the wire's name.
        rank: the wire's place among those of the board.
        outbox: takes each change of what this end drives.
        rest: level read while no pin drives it.
        width: number of wires.

    Attributes:
        far: what each other node drives, by its rank.
        wrongs: what is wrong with it, in the order in which it went wrong.
        latest: what has come from each other node, whatever is wrong here: level, and whether it
            pulls low only.
        kept_back: edges that wait for the one after them: node, level, whether it pulls low only.
    """

    STATE: ClassVar[Names] = (
        *Net.STATE, "sent", "weak: bool", "driven_far: list[(i64, i64, bool)]",
        "come_so_far: list[(i64, i64, bool)]", "kept_back: list[(i64, i64, bool), ...]",
    )  # fmt: skip
    WIRING: ClassVar[Names] = ("_outbox", "far", "rank")
    DERIVED: ClassVar[Names] = ("latest", "wrongs")

    def __init__(
        self,
        kernel: Kernel,
        name: str,
        rank: int,
        outbox: list[Drive],
        *,
        rest: int = HIGH,
        width: int = 1,
    ) -> None:
        super().__init__(kernel, name, rest=rest, width=width)
        self.rank: int = rank
        self.far: dict[int, Pin] = {}
        self.latest: dict[int, tuple[int, bool]] = {}
        self.kept_back: list[tuple[int, int, bool]] = []
        self.wrongs: list[Wrong] = []
        self.sent: int = Z
        self.weak: bool = False
        self._outbox: list[Drive] = outbox

    @property
    def heard(self) -> bool:
        """An end is always listened to: by the other ends."""
        return True

    def add_far(self, node: int, name: str) -> None:
        """Solder the pin at which node ``node`` arrives."""
        self.far[node] = self.solder(name)
        self.latest[node] = (Z, False)

    def resolve(self) -> None:
        """Compute the level here, and what must be sent to the other ends."""
        super().resolve()
        far = self.far.values()
        level = Z
        weak = True
        for pin in self.pins:
            # What has come from other ends is not sent back: two ends would hold a wire for ever.
            if pin.level != Z and pin not in far:
                level = pin.level if level == Z else level & pin.level
                weak = weak and pin.open_drain
        weak = weak and level != Z
        if level != self.sent or weak != self.weak:
            self.sent = level
            self.weak = weak
            self._outbox.append((self.kernel.now, self.rank, level, weak))

    def come(self, node: int, level: int, weak: bool) -> list[Later]:
        """Take what node ``node`` drives; return how much later what is to :meth:`arrive`."""
        self.latest[node] = (level, weak)
        events: list[Later] = [(0, level, weak)]
        for wrong in self.wrongs:
            events = [new for event in events for new in wrong.bend(node, *event)]
        return events

    def arrive(self, node: int, level: int, weak: bool) -> None:
        """What node ``node`` drives reaches this end now."""
        # Noted in come() all the same: when the cut is mended the end drives what has come last.
        if any(wrong.cuts() for wrong in self.wrongs):
            return
        pin = self.far[node]
        pin.open_drain = weak
        pin.drive(level)

    @property
    def driven_far(self) -> list[tuple[int, int, bool]]:
        """What the other ends drive: number of the node, level, and whether it pulls low only."""
        return [(node, pin.level, pin.open_drain) for node, pin in self.far.items()]

    @driven_far.setter
    def driven_far(self, ends: list[tuple[int, int, bool]]) -> None:
        for node, level, weak in ends:
            self.far[node].level = level
            self.far[node].open_drain = weak

    @property
    def come_so_far(self) -> list[tuple[int, int, bool]]:
        """:attr:`latest`, node by node."""
        return [(node, level, weak) for node, (level, weak) in self.latest.items()]

    @come_so_far.setter
    def come_so_far(self, ends: list[tuple[int, int, bool]]) -> None:
        self.latest = {node: (level, weak) for node, level, weak in ends}
