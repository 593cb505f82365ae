"""First version of a saved LM628 or LM629."""

from typing import Any, Final

from vbus.state import Saved
from vbus.state.first import Adapter, fields, row

_AXIS: Final = (
    "profile", "pid", "count", "real", "real_change", "error", "following", "command", "flags",
    "mask", "motor_off", "port8", "threshold", "stop_on_error", "sip", "index", "start", "udf",
    "breakpoint", "breakpoint_side", "breakpoint_armed", "stuck",
)  # fmt: skip


def _save_axis(axis: Any, saved: Saved) -> tuple[Any, ...]:
    """What a waiting UDF has taken stands last, if LFIL has loaded other coefficients since.

    Behind it stands True while il limits the summation.
    """
    pid = saved["pid"]
    other = saved["udf"] and pid["sent"] != pid["loaded"]
    more = ((pid["sent"],) if other else ()) + ((True,) if pid["limited"] else ())
    return (*row(axis, saved, _AXIS), *more)


def _load_axis(axis: Any, old: Any) -> Saved:
    saved = fields(axis, old[: len(_AXIS)], _AXIS)
    more = old[len(_AXIS) :]
    pid = saved["pid"]
    pid["limited"] = more[-1:] == (True,)
    sent = more[:-1] if pid["limited"] else more
    pid["sent"] = sent[0] if sent else pid["loaded"]
    return saved


_KEPT: Final = (
    "axis", "host", "commands", "output", "encoder", "_mode", "_reset_end", "_fails_left", "_when",
    "_cycle", "_sample_at", "_course", "_still", "_outputs",
)  # fmt: skip

LAYOUTS: Final[dict[str, Any]] = {
    "Axis": Adapter(_save_axis, _load_axis),
    "LM628": (_KEPT, "_front", "_encoder_pins", "_reset_fell", "judged"),
    "LM628.KEPT": _KEPT,
    "OutputPins": "anchor",
    "Pid": (
        "kp", "ki", "kd", "il", "ds", "loaded", "sum", "term", "derivative", "last_error", "phase",
    ),
}  # fmt: skip
