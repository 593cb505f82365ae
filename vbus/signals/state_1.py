"""First version of saved wires."""

from typing import Any, Final

LAYOUTS: Final[dict[str, Any]] = {
    "Net": ("value", "*history"), "WireEnd": ("value", "*history"),
}  # fmt: skip
