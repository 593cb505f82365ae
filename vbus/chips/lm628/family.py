"""The LM628 and LM629: what there is of them, and where."""

from typing import Final

from vbus.chips.family import Family

FAMILY: Final = Family(
    "lm628",
    chip="chip:LM628",
    home=__package__,
    title="LM628 and LM629",
    kind="motion controller",
    about=(
        "An LM628 or LM629 closes the position loop of a DC servo motor. The host loads a "
        "filter and a trajectory and starts the motion; in each sample, every 2048 clock "
        "periods, the chip reads the encoder, goes one step along a trapezoidal velocity "
        "profile, and computes the motor command. The LM628 gives the command to a converter of "
        "8 or 12 bits, the LM629 gives pulse width and sign to a bridge."
    ),
    datasheet="datasheet",
    packets="packets:Lm628Decoder",
    coverage="coverage:Lm628Exercises",
    access="host:Lm628Packets",
    host="host:Lm628",
    demo="demo:DEMO",
    demo_name="lm629",
    typical=("LM629N-8", "LM628N-8"),
    upsets="upsets:Lm628Upsets",
    cycle="datasheet:SAMPLE_CLK",
    reset_pin="/RST",
    reset_write=(0, 0x00),
    outputs=("HI",),
    addresses=(
        ("0", "/PS low", "status byte", "command"),
        ("1", "/PS high", "data byte", "data byte"),
    ),
    bits=(
        ("Status byte", "STATUS"),
        ("Signals register (RDSIGS)", "SIGNALS"),
        ("Trajectory control word (LTRJ)", "TRAJECTORY"),
        ("Filter control word (LFIL)", "FILTER"),
    ),
)
