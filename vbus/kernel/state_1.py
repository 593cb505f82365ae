"""First version of saved time."""

from typing import Any, Final

LAYOUTS: Final[dict[str, Any]] = {"Clock": "courses", "Kernel": ("now", "*dues")}
