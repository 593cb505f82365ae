"""The MCP-1200: what there is of it, and where."""

from typing import Final

from vbus.chips.family import Family

FAMILY: Final = Family(
    "mcp1200",
    chip="chip:MCP1200",
    home=__package__,
    title="MCP-1200",
    kind="motion controller",
    about=(
        "An MCP-1200 controls one servo or stepper motor from 128 byte-wide registers. The host "
        "writes a goal and limits; the chip makes a trapezoidal or S-curve profile, filters the "
        "position error in each sample, and drives an amplifier by PWM or a parallel port of 12 "
        "bits, or a stepper driver by step pulses. The part extends the HCTL-1100."
    ),
    datasheet="datasheet",
    packets="packets:Mcp1200Decoder",
    coverage="coverage:Mcp1200Exercises",
    access="host:Mcp1200Access",
    host="host:Mcp1200",
    demo="demo:DEMO",
    demo_name="mcp1200",
    typical=("MCP-1200",),
    upsets="upsets:Mcp1200Upsets",
    limits={"limit+": "/LIMIT", "limit-": "/LIMIT"},
    cycle="datasheet:SAMPLE_CLK",
    reset="datasheet:RESET_CLK",
    reset_pin="/RESET",
    reset_write=(0x05, 0x00),
    reset_name="soft reset",
    outputs=("PROF", "IDLE", "BUSY"),
    addresses=(("00H to 7FH", "address latched by /ALE or /CS", "register byte", "register byte"),),
    compatibility={"hctl-1100": "compatible:Hctl1100Uses"},
    kept=frozenset({"tDOEH", "tOF", "tOR", "tEP"}),
)
