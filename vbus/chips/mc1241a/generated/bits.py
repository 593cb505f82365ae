# Made from the datasheet's tables by vbus.cli.generate; change these or the generator.
"""The bits of the words and registers of the MC1241A and MC1141A."""

from typing import Final

MOTION_COMPLETE: Final = 0x01
WRAP: Final = 0x02
BREAKPOINT: Final = 0x04
CAPTURE: Final = 0x08
MOTION_ERROR: Final = 0x10
POSITIVE_LIMIT: Final = 0x20
NEGATIVE_LIMIT: Final = 0x40
COMMAND_ERROR: Final = 0x80
MOTOR_ON: Final = 0x100
AXIS_ON: Final = 0x200
IN_MOTION: Final = 0x400
AXIS_2: Final = 0x1000
AUTO_STOP: Final = 0x80
AUTO_UPDATE_OFF: Final = 0x400
