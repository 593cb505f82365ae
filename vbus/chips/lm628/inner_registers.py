"""The registers behind the commands, where the chip keeps them."""

from typing import Final

from vbus.chips.family import InnerRegister
from vbus.chips.lm628 import datasheet as ds
from vbus.chips.tables import REPORTED

_STATUS: Final = "status"
_POSITION: Final = "position"
_TRAJECTORY: Final = "trajectory"
_FILTER: Final = "filter"
_MASK: Final = tuple(bit for bit in ds.STATUS if bit.mask & ds.INTERRUPTS)
_CONTROL: Final = tuple(bit for bit in ds.TRAJECTORY if bit.number >= 8)
_ACCELERATION: Final = "cnt/sample/sample"
_VELOCITY: Final = "cnt/sample"


def _filter(name: str, number: int, title: str) -> tuple[InnerRegister, ...]:
    """Return a filter parameter as it is loaded, and as it is used since the last UDF."""
    return (
        InnerRegister(f"{name} loaded", f"axis.pid.loaded.{number}", _FILTER, "LM-CMD-19",
                      f"{title}, as LFIL loaded it"),
        InnerRegister(name, f"axis.pid.{name}", _FILTER, "LM-CMD-5", f"{title}, in use"),
    )  # fmt: skip


REGISTERS: Final = (
    InnerRegister("status byte", "status", _STATUS, "LM-STA-1", "what RDSTAT reads",
                  digits=2, fields=ds.STATUS),
    InnerRegister("signals register", "axis.signals", _STATUS, "LM-STA-2", "what RDSIGS reads",
                  digits=4, fields=ds.SIGNALS),
    InnerRegister("interrupt mask", "axis.mask", _STATUS, "LM-CMD-17",
                  "flags that raise HI, as MSKI enables them", digits=2, fields=_MASK),
    InnerRegister("real position", "axis.real", _POSITION, "LM-CMD-11", "what RDRP reads", "cnt"),
    InnerRegister("desired position", "axis.profile.position", _POSITION, "LM-CMD-9",
                  "what RDDP reads, with its fraction", "cnt", 16),
    InnerRegister("position error", "axis.error", _POSITION, "LM-TRJ-17",
                  "desired less real position, of the last sample", "cnt"),
    InnerRegister("real velocity", "axis.real_velocity", _POSITION, "LM-CMD-12",
                  "what RDRV reads", _VELOCITY),
    InnerRegister("desired velocity", "axis.profile.velocity", _POSITION, "LM-CMD-8",
                  "what RDDV reads", _VELOCITY, 16),
    InnerRegister("index position", "axis.index", _POSITION, "LM-CMD-10", "what RDIP reads", "cnt"),
    InnerRegister("breakpoint", "axis.breakpoint", _POSITION, "LM-CMD-21",
                  "as SBPA or SBPR set it", "cnt"),
    InnerRegister("breakpoint armed", "axis.breakpoint_armed", _POSITION, "LM-POS-5",
                  "whether it can be reached", words=("no", "yes")),
    InnerRegister("error threshold", "axis.threshold", _POSITION, "LM-CMD-15",
                  "as LPEI or LPES loaded it", "cnt"),
    InnerRegister("trajectory control word", "axis.profile.control", _TRAJECTORY, "LM-TRJ-1",
                  "bits 12 to 8 of the last LTRJ", digits=4, fields=_CONTROL),
    InnerRegister("acceleration loaded", "axis.profile.raw.0", _TRAJECTORY, "LM-TRJ-1",
                  "as LTRJ loaded it", _ACCELERATION, 16),
    InnerRegister("acceleration", "axis.profile.accel", _TRAJECTORY, "LM-TRJ-3",
                  "in use since STT", _ACCELERATION, 16),
    InnerRegister("velocity loaded", "axis.profile.raw.1", _TRAJECTORY, "LM-TRJ-1",
                  "as LTRJ loaded it", _VELOCITY, 16),
    InnerRegister("velocity", "axis.profile.top", _TRAJECTORY, "LM-TRJ-3",
                  "the limit in use since STT", _VELOCITY, 16),
    InnerRegister("position loaded", "axis.profile.raw.2", _TRAJECTORY, "LM-TRJ-1",
                  "as LTRJ loaded it", "cnt", digits=8),
    InnerRegister("target position", "axis.profile.target", _TRAJECTORY, "LM-AMB-5",
                  "where the motion under way goes", "cnt"),
    *_filter("kp", 1, "proportional coefficient"),
    *_filter("ki", 2, "integral coefficient"),
    *_filter("kd", 3, "derivative coefficient"),
    *_filter("il", 4, "integration limit"),
    *_filter("ds", 0, "derivative interval less one sample"),
    InnerRegister("integration sum", "axis.pid.term", _FILTER, "LM-CMD-14", "what RDSUM reads",
                  counts=REPORTED),
    InnerRegister("motor command", "axis.command", _FILTER, "LM-PID-7", "what the filter gives",
                  counts=REPORTED),
)  # fmt: skip
