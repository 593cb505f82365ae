"""The MC1241A and MC1141A: what there is of them, and where."""

from typing import Final

from vbus.chips.family import Family

FAMILY: Final = Family(
    "mc1241a",
    chip="chip:MC1241A",
    home=__package__,
    title="MC1241A and MC1141A",
    kind="stepper motion controller",
    about=(
        "An MC1241A (two axes) or MC1141A (one axis) controls stepper motors in microsteps, 64 "
        "to a full step. The host sends packets, a command and its data words; the chip set "
        "makes S-curve, trapezoidal or velocity profiles, or follows another axis in gear, and "
        "gives the command of each phase as PWM or to a DAC. Encoders say where each motor "
        "stands, so the chip set notices a stall."
    ),
    datasheet="datasheet",
    packets="packets:Mc1241aDecoder",
    coverage="coverage:Mc1241aExercises",
    access="host:Mc1241aPackets",
    host="host:Mc1241a",
    demo="demo:DEMO",
    demo_name="mc1241a",
    typical=("MC1241A", "MC1141A"),
    clock="25 MHz",
    plant="stepper",
    upsets="upsets:Mc1241aUpsets",
    limits={"limit+": "PosLimit{}", "limit-": "NegLimit{}"},
    cycle="datasheet:CYCLE_CLK",
    reset_pin="~Reset",
    reset_write=(1, 0x39),
    outputs=("HostRdy", "~HostIntrpt"),
    channels=("slct", "cmd", "read", "write"),
    addresses=(
        ("0", "HostCmd low", "data byte", "data byte"),
        ("1", "HostCmd high", "status byte", "command"),
        ("2", "plug-in card only", "–", "resets the chip set"),
    ),
    bits=(
        ("Axis status word (GET_STATUS)", "STATUS_BITS"),
        ("Axis mode word (GET_MODE)", "MODE_BITS"),
    ),
    kept=frozenset({"T11", *(f"T{number}" for number in range(19, 28))}),
)
