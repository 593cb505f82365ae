"""First version of saved wire formats."""

from typing import Any, Final

LAYOUTS: Final[dict[str, Any]] = {"FrameReader": "_bytes"}
