"""Each chip tells when its next sample is, while there is one that changes anything."""

import pytest

from vbus.board.build import load_board_text
from vbus.chips.base import SAMPLE
from vbus.core.kernel import MS, NEVER, US

BOARD = '[chips.x]\npart = "{}"\nclock = "{}"\nplant = "none"\n'


@pytest.mark.parametrize(
    ("part", "clock", "first"),
    [("LM629N-8", "8 MHz", 256 * US), ("MC1241A", "25 MHz", 2 * MS)],
)
def test_a_chip_that_wakes_has_samples_and_one_that_rests_has_none(
    part: str, clock: str, first: int
) -> None:
    board = load_board_text(BOARD.format(part, clock))
    (chip,) = board.chips
    chip.advance()
    assert chip.due(SAMPLE) == first
    assert not chip.resting()
    board.run_until(10 * MS)
    assert chip.due(SAMPLE) == NEVER
    assert chip.resting()


@pytest.mark.spec("MCP-SMP-5")
def test_an_mcp1200_has_samples_in_control_mode_and_none_before() -> None:
    board = load_board_text(BOARD.format("MCP-1200", "10 MHz"))
    (chip,) = board.chips
    board.run_until(1 * MS)
    assert chip.due(SAMPLE) == NEVER
    port = board.open_port("h")
    for address, data in ((0x22, 0x01), (0x0E, 0x10), (0x0D, 0x00), (0x0C, 0x00), (0x05, 0x03)):
        port.write(address, data)
    seen = []
    for _ in range(4):
        seen.append(chip.due(SAMPLE))
        board.run_until(seen[-1])
    # The sample period after a reset is 416 us; what a sample gives shows 100 us after its start.
    assert seen == [1280 * US, 1380 * US, 1696 * US, 1796 * US]
