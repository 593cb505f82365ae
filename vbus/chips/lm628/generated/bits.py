# Made from the datasheet's tables by vbus.cli.generate; change these or the generator.
"""The bits of the words and registers of the LM628 and LM629."""

from typing import Final

MOTOR_OFF: Final = 0x80
BREAKPOINT: Final = 0x40
POSITION_ERROR: Final = 0x20
WRAPAROUND: Final = 0x10
INDEX: Final = 0x08
TRAJECTORY_COMPLETE: Final = 0x04
COMMAND_ERROR: Final = 0x02
BUSY: Final = 0x01
HOST_INTERRUPT: Final = 0x8000
ACCELERATION_LOADED: Final = 0x4000
UDF_EXECUTED: Final = 0x2000
FORWARD: Final = 0x1000
VELOCITY_MODE: Final = 0x800
ON_TARGET: Final = 0x400
STOP_ON_ERROR: Final = 0x200
PORT8: Final = 0x100
SIP: Final = 0x01
STOP_SMOOTHLY: Final = 0x400
STOP_ABRUPTLY: Final = 0x200
TURN_OFF: Final = 0x100
LOAD_ACCELERATION: Final = 0x20
RELATIVE_ACCELERATION: Final = 0x10
LOAD_VELOCITY: Final = 0x08
RELATIVE_VELOCITY: Final = 0x04
LOAD_POSITION: Final = 0x02
RELATIVE_POSITION: Final = 0x01
LOAD_KP: Final = 0x08
LOAD_KI: Final = 0x04
LOAD_KD: Final = 0x02
LOAD_IL: Final = 0x01
