"""AC limits of encoder inputs: what an edge at the nets has broken."""

from vbus.chips.base import Chip
from vbus.chips.motion.quadrature import INDEX_INSIDE, SHORT_DWELL, SHORT_PULSE, Quadrature
from vbus.chips.strobes import AcTable


def judge_inputs(chip: Chip, ac: AcTable, inputs: Quadrature, found: int) -> bool:
    """File what an edge of A, B or index has broken (T1 to T3); tell whether the index is lost.

    Args:
        chip: whose inputs they are.
        ac: its limits.
        inputs: the decoder that took the edge.
        found: what it found.
    """
    lost = False
    for bit, symbol, measured in (
        (SHORT_DWELL, "T2", inputs.dwell),
        (SHORT_PULSE, "T1", inputs.pulse),
        (INDEX_INSIDE, "T3", -1),
    ):
        if found & bit:
            lost = chip.report(ac.rules[symbol], measured, ac.minimum(symbol, chip.clock))
    return lost and bool(found & INDEX_INSIDE)
