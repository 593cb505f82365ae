"""MC1241A: two microstepped axes, an S-curve, and moves started by one MULTI_UPDATE."""

from typing import Final

from vbus.client import Bus
from vbus.client.demo import Demo, Step
from vbus.client.mc1241a import Mc1241a

_BOARD: Final = """\
[chips.xy]
part = "MC1241A"
clock = "25 MHz"
plants = ["first", "second"]

[plants.first]
model = "stepper"
encoder_lines = 500

[plants.second]
model = "stepper"
encoder_lines = 500
"""

_TURN: Final = 12_800
"""Microsteps in a turn: 200 full steps of 64."""
_COUNTS: Final = 2000
"""Encoder counts in a turn."""
_AMPLITUDE: Final = 24_000
_RATIO: Final = _COUNTS * 256 // _TURN


def _host(bus: Bus) -> None:
    chip = Mc1241a(bus, checked=True)

    step = Step(bus, "look at version and status after reset")
    step.found("version", 0x4A10, chip.get_vrsn(), digits=4)
    step.found("status of axis 2", 0x1300, chip.set_2(), digits=4)
    step.found("status of axis 1", 0x0300, chip.set_1(), digits=4)

    step = Step(bus, "both axes: two phases, current, encoder ratio")
    for axis in (2, 1):
        chip.select(axis)
        chip.set_phase_2()
        chip.set_step_ratio(_RATIO)
        chip.set_buf_mtr_cmd(_AMPLITUDE)
    chip.multi_update(0x3)
    bus.delay("50ms")
    step.found("motor command", _AMPLITUDE, chip.get_mtr_cmd())

    step = Step(bus, "axis 1: two turns in an S-curve")
    chip.set_prfl_s_crv()
    chip.set_pos(2 * _TURN)
    chip.set_vel(18 << 16)
    chip.set_max_acc(0x1000)
    chip.set_jerk(0x0020_0000)
    chip.update()
    chip.wait_event(longest="10s", every="2ms")
    bus.delay("50ms")
    step.found("target position", 2 * _TURN, chip.get_trgt_pos())
    step.found("actual position", 2 * _COUNTS, chip.get_actl_pos(), tolerance=2)

    step = Step(bus, "both axes started by one MULTI_UPDATE, in opposite directions")
    _together(chip, _TURN, -_TURN)
    for axis, counts in ((1, _COUNTS), (2, -_COUNTS)):
        chip.select(axis)
        step.found(f"actual position, {axis}", counts, chip.get_actl_pos(), tolerance=2)

    step = Step(bus, "both axes home")
    _together(chip, 0, 0)
    for axis in (1, 2):
        chip.select(axis)
        step.found(f"actual position, {axis}", 0, chip.get_actl_pos(), tolerance=2)


def _together(chip: Mc1241a, first: int, second: int) -> None:
    for axis, position in ((1, first), (2, second)):
        chip.select(axis)
        chip.set_prfl_trap()
        chip.set_pos(position)
        chip.set_vel(15 << 16)
        chip.set_acc(0x1000)
        chip.clr_status()
    chip.multi_update(0x3)
    for axis in (1, 2):
        chip.select(axis)
        chip.wait_event(longest="10s", every="2ms")
    chip.bus.delay("50ms")


DEMO: Final = Demo(
    title="MC1241A and two stepper motors",
    board=_BOARD,
    chip="xy",
    shown={
        "target 1": 30_000, "actual 1": 4700, "error 1": 20,
        "target 2": 30_000, "actual 2": 4700, "error 2": 20, "status 1": 0,
    },
    host=_host,
    rest=(0, 0),
)  # fmt: skip
