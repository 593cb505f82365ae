"""First version of a saved MC1241A or MC1141A."""

from typing import Any, Final

from vbus.chips.mc1241a.datasheet import S_CURVE
from vbus.chips.mc1241a.microstep import STEPS
from vbus.chips.mc1241a.profile import DONE, RUNNING
from vbus.state import Saved
from vbus.state.first import BITS, Adapter, fields, from_tuple, row, to_tuple

_PLAIN_1: Final = (
    "events", "+motor_on", "auto_stop", "auto_update", "+_update_pending", "+position_given",
    "+_position_taken",
)  # fmt: skip
_PLAIN_2: Final = (
    "interrupt_mask", "breakpoint_mode", "breakpoint_value", "start_velocity", "step_ratio",
    "position_error_limit", "position_error", "_error_offset",
)  # fmt: skip
_PARTS: Final = ("buffer", "_taken", "active", "profile", "limits", "encoder", "stepper")


def _save_axis(axis: Any, saved: Saved) -> tuple[Any, ...]:
    given, taken = saved["motor_command_given"], saved["_motor_command_taken"]
    command = saved["_motor_command_from"] | int(given) << 2 | int(taken) << 3
    plain = (*row(axis, saved, _PLAIN_1), command, *row(axis, saved, _PLAIN_2))
    return (plain, *row(axis, saved, _PARTS))


def _load_axis(axis: Any, old: Any) -> Saved:
    plain, *parts = old
    here = len(_PLAIN_1)
    saved = fields(axis, plain[:here], _PLAIN_1)
    saved |= fields(axis, plain[here + 1 :], _PLAIN_2)
    saved |= fields(axis, parts, _PARTS)
    command = plain[here]
    saved["_motor_command_from"] = command & 3
    given, taken = command & 4 != 0, command & 8 != 0
    if not command:
        # Of the earliest states the buffers tell what was given; in others they agree.
        active = saved["active"]["motor_command"]
        given = saved["buffer"]["motor_command"] != active
        taken = saved["_taken"]["motor_command"] != active
    saved["motor_command_given"], saved["_motor_command_taken"] = given, taken
    return saved


_MICROSTEPS: Final = ("_from", "_moved", "_held_slot", "_held_a", "_held_b")


def _save_stepper(stepper: Any, saved: Saved) -> tuple[Any, ...]:
    """A shift's fraction stands above its whole usteps."""
    shift = saved["_shift"] >> 32 | (saved["_shift"] & (1 << 32) - 1) << 8
    return (int(saved["two_phase"]), shift, *row(stepper, saved, _MICROSTEPS))


def _load_stepper(stepper: Any, old: Any) -> Saved:
    saved = fields(stepper, old[2:], _MICROSTEPS)
    saved["two_phase"] = bool(old[0])
    saved["_shift"] = (old[1] & STEPS - 1) << 32 | old[1] >> 8
    return saved


_PROFILE: Final = (
    "mode", "position", "velocity", "moved", "_state", "+_smooth", "_destination", "_turns",
    "_sign", "_start",
)  # fmt: skip


def _save_profile(profile: Any, saved: Saved) -> tuple[Any, ...]:
    """Numbers of a long move are wider than 64 bits: the curve is a text."""
    curve = to_tuple(profile._curve, saved["_curve"])
    return (*row(profile, saved, _PROFILE), " ".join(str(number) for number in curve))


def _load_profile(profile: Any, old: Any) -> Saved:
    saved = fields(profile, old[:-1], _PROFILE)
    curve = from_tuple(profile._curve, tuple(int(number) for number in old[-1].split()))
    saved["_curve"] = curve
    if saved["mode"] == S_CURVE and saved["_state"] == RUNNING and curve["rise"] == 0:
        # The earliest states kept a move that could not begin in motion for ever (NOTES 21).
        saved["_state"] = DONE
    return saved


LAYOUTS: Final[dict[str, Any]] = {
    "Axis": Adapter(_save_axis, _load_axis),
    "Commands": "current",
    "Cycles": (
        "shared", "_driven", "motors",
        ("_origin", "_slot", "boundary", "_reset_since", "_slot_start", "_slot_end"),
    ),
    "Encoder": (
        (
            "+_wired", "+_home_wired", "*_levels", "_seen", "_mechanics_seen", "count", "_zero",
            "_read", "counted", "actual", "+wrapped", "_turn", "_capture_source", "+_armed",
            "_captured", "+_fresh",
        ),
        "_decoder", "_home_filter",
    ),
    "HostPins": BITS, "HostPort": BITS, "LimitDetector": BITS, "Shared": BITS,
    "MC1241A": (
        ("_wake", "_hold_at", "+held", "+_adapter_read", "busy_stretch", "commands"),
        "cycles", "interrupts", "port", "output", "host_pins", "axes",
    ),
    "Microstepper": Adapter(_save_stepper, _load_stepper),
    "Profile": Adapter(_save_profile, _load_profile),
}  # fmt: skip
