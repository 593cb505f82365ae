"""First version of a saved board: ``(parts, time, chips, wires, levels, ports, *faults)``."""

from typing import Any, Final

from vbus.errors import SnapshotError
from vbus.signals import LOW
from vbus.state import Saved
from vbus.state.first import Adapter, from_tuple, to_tuple


def parts_and_faults(saved: Any) -> tuple[Any, Any]:
    """Return the chips and the faults of a saved board, of either version.

    Raises:
        SnapshotError: it is no saved board.
    """
    try:
        if isinstance(saved, tuple):
            parts, broken = saved[0], saved[6] if len(saved) > 6 else None
        else:
            parts, broken = saved["parts"], saved.get("faults")
        return [tuple(pair) for pair in parts], broken
    except (TypeError, KeyError, IndexError, AttributeError):
        raise SnapshotError("this is no saved board") from None


def _save(board: Any, saved: Saved) -> tuple[Any, ...]:
    ports = list(zip(board.ports, saved["ports"], strict=True))
    return (
        saved["parts"],
        (
            to_tuple(board.kernel, saved["kernel"]), saved["tail"],
            tuple(kept["strobes"]["watches"] for _, kept in ports),
        ),
        _all(board.chips, saved["chips"]), saved["wires"], saved["levels"],
        tuple(to_tuple(port, kept) for port, kept in ports),
        *((to_tuple(board.faults, saved["faults"]),) if "faults" in saved else ()),
    )  # fmt: skip


def _all(parts: list[Any], saved: Any) -> tuple[Any, ...]:
    return tuple(to_tuple(part, kept) for part, kept in zip(parts, saved, strict=True))


def _load(board: Any, old: Any) -> Saved:
    parts, (kernel, tail, strobes), chips, wires, levels, ports = old[:6]
    return {
        "parts": parts, "levels": levels, "tail": tail, "wires": wires,
        "kernel": from_tuple(board.kernel, kernel, "kernel"), "glue": _glue(board, levels),
        "ports": tuple(
            {**from_tuple(port, kept, port.label), "strobes": {"watches": watches}}
            for port, kept, watches in zip(board.ports, ports, strobes, strict=True)
        ),
        "chips": tuple(
            from_tuple(chip, kept, chip.name) for chip, kept in zip(board.chips, chips, strict=True)
        ),
    }  # fmt: skip


def _glue(board: Any, levels: Any) -> Saved:
    """Return the state of glue, which was that of the interrupts of cards: what they drive."""
    driven = dict(zip(map(id, board.pins), levels, strict=False))
    return {
        "parts": tuple(
            {
                "blocks": tuple(
                    {"state": int(low), "levels": int(not low), "driven": -1, "queue": ()}
                    for block in part.blocks
                    for low in [driven.get(id(block.outputs[0])) == LOW]
                )
            }
            for part in board.glue.parts
        )
    }  # fmt: skip


LAYOUTS: Final[dict[str, Any]] = {
    "Board": Adapter(_save, _load),
    "HostBus": ("*selection", "*clock", "*polls", "claimed", "*pins"),
}
