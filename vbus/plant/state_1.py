"""First version of saved plants."""

from typing import Any, Final

from vbus.state.fields import Saved
from vbus.state.first import Adapter, fields, row

_COURSE: Final = ("count", "_base", "_pieces", "*_points")
_SHAFT: Final = ("period", "velocity", "+_resting", *_COURSE)
_DC_MOTOR: Final = ("current", *_SHAFT)
# The first version had none that was solved exactly: its course follows from its beginning.
_SOLVED: Final = ("_volts", "_began", "_departed", "+_solved", *_DC_MOTOR)


def _dc_motor(motor: Any) -> tuple[str, ...]:
    return _SOLVED if motor.solved_exactly else _DC_MOTOR


def _save(motor: Any, saved: Saved) -> tuple[Any, ...]:
    return row(motor, saved, _dc_motor(motor))


def _load(motor: Any, old: Any) -> Saved:
    return fields(motor, old, _dc_motor(motor))


LAYOUTS: Final[dict[str, Any]] = {
    "DcMotor": Adapter(_save, _load),
    "IdealPlant": ("_steps", "+_three", "+_resting", *_COURSE),
    "StepperMotor": ("_steps", "+_three", *_SHAFT),
}
