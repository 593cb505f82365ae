"""First version of saved faults."""

from typing import Any, Final

LAYOUTS: Final[dict[str, Any]] = {
    "Acts": ("axes", "courses"),
    "FaultyPlant": (
        "count", "anchor", "shown", "_pulses", "_low", "_before", "+_stood", "+_touched", "*inner",
    ),
}  # fmt: skip
