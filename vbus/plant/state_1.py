"""First version of saved plants."""

from typing import Any, Final

_COURSE: Final = ("count", "_base", "_pieces", "*_points")
_SHAFT: Final = ("period", "velocity", "+_resting", *_COURSE)

LAYOUTS: Final[dict[str, Any]] = {
    "DcMotor": ("current", *_SHAFT),
    "IdealPlant": ("_steps", "+_three", "+_resting", *_COURSE),
    "StepperMotor": ("_steps", "+_three", *_SHAFT),
}
