"""One node's end of a wire that goes on at other nodes."""

from typing import ClassVar

from vbus.kernel.kernel import Kernel
from vbus.signals.net import HIGH, Net, Pin, Z
from vbus.state import Names

Drive = tuple[int, int, int, bool]
"""What an end began to drive: instant (ps), rank of the wire, level, whether open drain only."""


class WireEnd(Net):
    """The part of a wire that lies on one node.

    What this node's own pins drive is told to the other ends, where it arrives after the wire's
    delay; what the other ends drive arrives here at pins of its own, one for each node. So an
    open-drain wire works as it does in copper, only later.

    Args:
        kernel: the node's time.
        name: the wire's name.
        rank: the wire's place among those of the board.
        outbox: takes each change of what this end drives.
        rest: level read while nobody drives it.
        width: number of wires.

    Attributes:
        far: what each other node drives, by its rank.
    """

    __slots__ = ("_outbox", "far", "rank", "sent", "weak")
    STATE: ClassVar[Names] = (
        *Net.STATE, "sent", "weak: bool", "driven_far: list[(i64, i64, bool)]",
    )  # fmt: skip
    WIRING: ClassVar[Names] = ("_outbox", "far", "rank")

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

    def resolve(self) -> None:
        """Work out the level here, and what the other ends must be told."""
        super().resolve()
        far = self.far.values()
        level = Z
        weak = True
        for pin in self.pins:
            if pin.level != Z and pin not in far:
                level = pin.level if level == Z else level & pin.level
                weak = weak and pin.open_drain
        weak = weak and level != Z
        if level != self.sent or weak != self.weak:
            self.sent = level
            self.weak = weak
            self._outbox.append((self._kernel.now, self.rank, level, weak))

    def arrive(self, node: int, level: int, weak: bool) -> None:
        """What node ``node`` drives reaches this end now."""
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
