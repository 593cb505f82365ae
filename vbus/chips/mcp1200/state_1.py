"""First version of a saved MCP-1200."""

from typing import Any, Final

from vbus.state.first import BITS

LAYOUTS: Final[dict[str, Any]] = {
    "Breakpoint": BITS, "Command": BITS, "Faults": BITS, "Following": BITS,
    "IntegralVelocity": BITS, "SampleTimer": BITS, "Trapezoid": BITS,
    "PidFilter": (
        ("_error_1", "_error_2", "_error_3", "_error_4", "_error_5", "_error_6", "_error_7",
         "_error_8"),
        "integral", "_velocity", "_saturated",
    ),
    "EncoderPins": ("*_levels", "*_since", "decoder"),
    "PositionCounter": "at_match", "RegisterFile": "image", "Writes": "_waiting",
    "Axis": (
        "state", "released", "_request", "writes", "_aiming", "_at_reset", "_at_sample",
        "_at_results", "_at_routine", "counter",
        ("registers", "loop", "timer", "encoder", "drive", "stepper", "pwm", "breakpoint", "host"),
    ),
}  # fmt: skip
