# Made from the datasheet's tables by vbus.cli.generate; change these or the generator.
"""The bits of the words and registers of the MCP-1200."""

from typing import Final

F0: Final = 0x01
F1: Final = 0x02
F2: Final = 0x04
F3: Final = 0x08
F4: Final = 0x10
F5: Final = 0x20
UNIPOLAR: Final = 0x04
PID: Final = 0x08
S_CURVE: Final = 0x10
HIGH_RESOLUTION: Final = 0x20
DIAGNOSTIC_PWM: Final = 0x40
DIAGNOSTIC_DAC: Final = 0x80
EXTENDED: Final = 0x01
STEP_MODE: Final = 0x02
STEP_LOW: Final = 0x04
BREAK_ENABLE: Final = 0x10
BREAK_REPEAT: Final = 0x20
SIGN_INHIBIT: Final = 0x40
PWM_BIAS: Final = 0x80
TRIG_LATCH: Final = 0x01
TRIG_CAPTURE: Final = 0x02
TRIG_INPUT: Final = 0x04
INDEX_LATCH: Final = 0x08
INDEX_CAPTURE: Final = 0x10
INDEX_RISING: Final = 0x20
BUSY_ON_PROF: Final = 0x40
INTERPOLATOR_BUSY: Final = 0x80
BUSY: Final = 0x01
DIRECTION: Final = 0x02
IN_POSITION: Final = 0x04
TIMER_OK: Final = 0x08
ERROR_OK: Final = 0x10
BREAKPOINT_OK: Final = 0x20
STOP_OK: Final = 0x40
LIMIT_OK: Final = 0x80
