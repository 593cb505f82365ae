"""The DC-8: what there is of it, and where."""

from vbus.chips.family import Family

FAMILY = Family(
    "dc8",
    chip="chip:DC8",
    home=__package__,
    title="DC-8",
    kind="down counter",
    datasheet="datasheet",
    bus="bus:Dc8Watch",
    clock="1 MHz",
    strobes=("/RD", "/WR"),
    outputs=("DONE",),
)
