"""Board files that tests of several files use; what a test adds stands in the test."""

from typing import Final

ALONE: Final = """\
[board]
time = "lockstep"
power_on = "done"
[chips.x]
part = "LM629N-8"
clock = "8 MHz"
plant = "none"
"""
"""One LM629 without a motor, in lockstep, and no host."""

BENCH: Final = (
    ALONE.replace("[board]\n", '[board]\nname = "bench"\n')
    + """\
[[hosts]]
transport = "unix:$VBUS_RUNTIME/x"
"""
)
"""One LM629 without a motor, in lockstep, at a Unix socket of the runtime directory."""

AXIS: Final = """\
[board]
time = "{time}"
power_on = "done"
[chips.x]
part = "LM629N-8"
clock = "8 MHz"
plant = "motor"
[plants.motor]
model = "{model}"
"""
"""One LM629 with a motor, and no host: say ``time`` and ``model`` by ``format``."""
