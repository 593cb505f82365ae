"""The DC-8: what there is of it, and where."""

from vbus.chips.family import Family

FAMILY = Family(
    "dc8",
    chip="chip:DC8",
    home=__package__,
    title="DC-8",
    kind="down counter",
    datasheet="datasheet",
    clock="1 MHz",
    outputs=("DONE",),
)
