"""First version of saved states of what several chips share."""

from typing import Any, Final

from vbus.state.first import BITS

LAYOUTS: Final[dict[str, Any]] = {
    "Quadrature": (
        "count", "direction", "at", "dwell", "pulse", "_state", "_since", "_a_since", "_b_since",
        "*_a", "*_b", "*_index",
    ),
    "SCurve": BITS,
}  # fmt: skip
