"""First version of saved register files."""

from typing import Any, Final

LAYOUTS: Final[dict[str, Any]] = {"RegisterFile": "bytes"}
