"""Faults of a wire between nodes: what they do to the edges that come to one of its ends."""

from vbus.core.kernel import Kernel
from vbus.core.options import Value
from vbus.core.signals import Z
from vbus.core.signals.wire import Later, WireEnd, Wrong


class WireFault(Wrong):
    """One fault of one end of a wire, while it acts.

    Args:
        end: the end.
        kernel: the node's time.
        name: the fault.
        values: its parameters.
    """

    def __init__(self, end: WireEnd, kernel: Kernel, name: str, values: dict[str, Value]) -> None:
        self._end: WireEnd = end
        self._kernel: Kernel = kernel
        self._name: str = name
        self._by: int = int(values.get("by", values.get("gap", 0)))

    def begin(self, again: bool = False) -> str:
        """Bend what comes from now on; return what is changed.

        Args:
            again: a saved state has it, with the levels as they are.
        """
        end = self._end
        end.wrongs.append(self)
        if not self.cuts():
            return f"edges of other nodes on {end.name}"
        if not again:
            for pin in end.far.values():
                pin.drive(Z)
            self._kernel.settle()
        return f"{end.name} is driven by no other node"

    def end(self) -> None:
        """Let edges come as they do; what was held back or cut off comes now."""
        self.leave()
        end = self._end
        if self.cuts():
            for node, (level, weak) in end.latest.items():
                end.arrive(node, level, weak)
        elif self._name == "wire_reordered":
            held, end.kept_back = end.kept_back, []
            for node, level, weak in held:
                end.arrive(node, level, weak)
        self._kernel.settle()

    def leave(self) -> None:
        """Bend nothing any more."""
        self._end.wrongs.remove(self)

    def cuts(self) -> bool:
        """Whether nothing that other nodes drive is seen."""
        return self._name == "wire_cut"

    def bend(self, node: int, after: int, level: int, weak: bool) -> list[Later]:
        """Return what becomes of an edge that would arrive so much later (ps)."""
        end, by = self._end, self._by
        if self._name == "wire_late":
            return [(after + by, level, weak)]
        if self._name == "wire_doubled":
            before = end.far[node]
            return [
                (after, level, weak), (after + by, before.level, before.open_drain),
                (after + 2 * by, level, weak),
            ]  # fmt: skip
        if self._name == "wire_reordered":
            for place, (other, kept, pulls) in enumerate(end.kept_back):
                if other == node:
                    del end.kept_back[place]
                    return [(after, level, weak), (after + by, kept, pulls)]
            end.kept_back.append((node, level, weak))
            return []
        return [(after, level, weak)] if self.cuts() else []
