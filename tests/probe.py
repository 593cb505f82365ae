"""What a test sees of the inside of a chip, and sets there, by the manual's names.

A test asks ``probe(chip).desired_position``; where the chip has it, this file alone says. Registers
that a family declares (``Family.values``) have their declared names, with ``_`` for a
space; an MCP-1200's register file has those of its data sheet in lower case. :data:`PLACES` has
what no register shows.
"""

from operator import attrgetter
from typing import Any

from vbus import plugins
from vbus.chips.base import Chip

PLACES = {
    "lm628": {
        "acceleration_waiting": "axis.profile.accel_loaded",
        "busy": "host.busy",
        "busy_end": "host.busy_end",
        "computed_at": "_when",
        "decoded_count": "encoder.count",
        "derivative": "axis.pid.derivative",
        "encoder_count": "axis.count",
        "error_sum": "axis.pid.sum",
        "filter_loaded": "axis.pid.loaded",
        "flags": "axis.flags",
        "forward": "axis.profile.forward",
        "full_position_error": "axis.following",
        "hold": "axis.profile.hold",
        "in_motion": "axis.moving",
        "last_error": "axis.pid.last_error",
        "motor_off": "axis.motor_off",
        "next_output_change": "output.next_change",
        "on_target": "axis.profile.done",
        "output_code": "output.code",
        "output_command": "output.command",
        "plant": "encoder.plant",
        "port8": "axis.port8",
        "real_change": "axis.real_change",
        "relative": "axis.profile.relative",
        "sip": "axis.sip",
        "start_waiting": "axis.start",
        "status_without_busy": "axis.status",
        "stop_on_error": "axis.stop_on_error",
        "stopping": "axis.profile.stopping",
        "stuck_part": "axis.stuck_part",
        "trajectory_loaded": "axis.profile.raw",
        "udf_waiting": "axis.udf",
        "velocity_mode": "axis.profile.velocity_mode",
        "words_due": "host.words_due",
        "worst_busy": "host.worst",
        "wrapped": "axis.profile.wrapped",
    },
    "mcp1200": {
        "command": "axis.loop.command",
        "command_velocity": "axis.loop.command.velocity",
        "compared": "axis.breakpoint.compare",
        "encoder_prepared": "axis.encoder.prepared",
        "integral": "axis.loop.pid.integral",
        "mc": "axis.loop.mc",
        "plant": "axis.encoder.plant",
        "position_at": "axis.counter.position",
        "pwm": "axis.registers.pwm",
        "pwm_frame_start": "axis.pwm.start",
        "read_register": "axis.host.read",
        "reset_register": "axis.registers.reset",
        "sample_period": "axis.timer.period",
        "sample_start": "axis.timer.start",
        "sampled": "axis.registers.sampled",
        "set_position": "axis.counter.preset",
        "show_pulse": "outputs.show_pulse",
    },
    "mc1241a": {
        "active": "axes.{}.active",
        "auto_stop": "axes.{}.auto_stop",
        "auto_update": "axes.{}.auto_update",
        "buffer": "axes.{}.buffer",
        "capture_armed": "axes.{}.encoder._armed",
        "curve": "axes.{}.profile._curve",
        "cycle_boundary": "cycles.boundary",
        "cycles_computed": "cycles.run_count",
        "events": "axes.{}.events",
        "follow_encoders": "cycles.follow_encoders",
        "in_motion": "axes.{}.profile.in_motion",
        "interrupting_axis": "interrupts.axis",
        "last_driven": "port.last_driven",
        "limits_armed": "axes.{}.limits.armed",
        "next_output_change": "output.due",
        "profile_position": "axes.{}.profile.position",
        "profile_velocity": "axes.{}.profile.velocity",
        "set_capture_source": "axes.{}.encoder.set_source",
        "skipping": "cycles.skipping",
        "smooth_stop_buffered": "axes.{}.buffer.smooth_stop",
        "stepper": "axes.{}.stepper",
        "stop_buffered": "axes.{}.buffer.stop",
        "two_phase": "axes.{}.stepper.two_phase",
    },
}


def _way(place: str) -> str:
    """Return a place as attributes and numbers: ``axes[{}].mode`` as ``axes.{}.mode``."""
    return place.replace("[", ".").replace("]", "").removesuffix("()")


class Probe:
    """The inside of one axis of a chip.

    Args:
        chip: the chip, of any part of its family; it is neither asked to advance nor changed.
        axis: which of its axes, from 1.
    """

    def __init__(self, chip: Chip, axis: int = 1) -> None:
        family = plugins.family(chip.FAMILY)
        named = {row.name.lower(): f"axis.registers.{row.name.lower()}" for row in family.registers}
        rows = [row for row in family.values.rows if row.group]
        named |= {row.name.replace(" ", "_"): _way(row.place) for row in rows}
        assert not named.keys() & PLACES[chip.FAMILY].keys()
        named |= PLACES[chip.FAMILY]
        self.__dict__.update(_chip=chip, _axis=axis, _places=named)

    def _holder(self, name: str) -> tuple[Any, str]:
        if name not in self._places:
            raise AttributeError(f"{self._chip.FAMILY}: tests/probe.py has no place for {name!r}")
        *way, last = self._places[name].format(self._axis - 1).split(".")
        part: Any = self._chip
        for step in way:
            part = part[int(step)] if step.isdigit() else getattr(part, step)
        return part, last

    def __getattr__(self, name: str) -> Any:
        part, last = self._holder(name)
        return part[int(last)] if last.isdigit() else getattr(part, last)

    def __setattr__(self, name: str, value: Any) -> None:
        part, last = self._holder(name)
        if last.isdigit():
            part[int(last)] = value
        else:
            setattr(part, last, value)

    def parameter(self, row: Any) -> Any:
        """Return what a command that is a mere parameter loads or reads (``row.parameter``)."""
        chip: Any = self._chip
        if getattr(row, "scope", "") == "g":
            return attrgetter(row.parameter)(chip.shared)
        axis = chip.axes[self._axis - 1] if hasattr(chip, "axes") else chip.axis
        return attrgetter(row.parameter)(axis)


def probe(chip: Chip, axis: int = 1) -> Probe:
    """Look into a chip."""
    return Probe(chip, axis)
