"""A capture of a card's bus beside the board that its file describes, glue and chips."""

import pytest

from tests.unit.glue.test_cards import LATCH, WIRED, Slot, move
from vbus.board.build import load_board_text
from vbus.board.card.card_bus import CardBus
from vbus.core.errors import CaptureError
from vbus.core.kernel import MS
from vbus.core.signals import Net, Observer
from vbus.views.silicon.capture import Sample
from vbus.views.silicon.card_watch import CardWatch, tie_others
from vbus.views.silicon.channel_map import Wiring, wiring_of
from vbus.views.silicon.conform import CaptureTolerance, Conform, Verdict
from vbus.views.silicon.start import find_start, watch_of

LOW = [f"A{number}" for number in range(4)]
CHANNELS = [*LOW, "A9", "/IOR", "/IOW", *(f"D{bit}" for bit in range(8))]
"""What the analyser's probes are at."""


class Analyser(Observer):
    """Records the lines of a card's connector."""

    def __init__(self, slot: Slot) -> None:
        self.samples: list[Sample] = []
        self._slot: Slot = slot
        bus = slot.board.chip("slot")
        self._nets: list[tuple[Net, int]] = [
            (bus.data_pin.net, int(name[1:])) if name[0] == "D" else (bus.pins[name].net, 0)
            for name in CHANNELS
        ]
        for net in dict.fromkeys(net for net, _ in self._nets):
            net.observe(self)

    def edge(self, when: int, net: str, level: int) -> None:
        self.look(when)

    def look(self, when: int) -> None:
        bits = sum((net.value >> wire & 1) << n for n, (net, wire) in enumerate(self._nets))
        if self.samples and self.samples[-1][0] == when:
            self.samples.pop()
        self.samples.append((when, bits))


@pytest.fixture(scope="module")
def capture() -> list[Sample]:
    """Both axes have been moved on the card, and their positions read."""
    slot = Slot(WIRED)
    analyser = Analyser(slot)
    analyser.look(0)
    slot.outb(LATCH, 0x01)
    slot.port.delay(4 * MS)
    move(slot, 0x300, 50)
    move(slot, 0x302, -30)
    slot.port.delay(60 * MS)
    assert (slot.position(0x300), slot.position(0x302)) == (50, -30)
    slot.port.delay(MS)
    return analyser.samples


def wired(text: str, channels: list[str]) -> tuple[CardBus, Wiring]:
    bus = load_board_text(text).chip("slot")
    assert isinstance(bus, CardBus)
    wiring = wiring_of(channels, "slot", bus.pin_rows, watch_of(bus), {})
    tie_others(bus, wiring)
    return bus, wiring


def compared(samples: list[Sample], text: str = WIRED) -> Verdict:
    board = load_board_text(text)
    _, wiring = wired(text, CHANNELS)
    bus = board.chip("slot")
    run = Conform(board, bus, wiring, CaptureTolerance(200_000), judged=True)
    return run.run(samples, find_start(samples, wiring, bus, "start"))


def test_a_capture_of_a_card_conforms_to_the_board_it_was_made_on(capture: list[Sample]) -> None:
    verdict = compared(capture)
    assert verdict.mismatch is None
    assert verdict.cycles > 300
    assert 200 < verdict.reads < verdict.cycles
    assert verdict.broken == 0


def test_another_wiring_is_found_where_it_first_shows(capture: list[Sample]) -> None:
    """With the selects exchanged the status of the wrong chip comes: busy, or not."""
    changed = WIRED.replace('x./CS" = "!Y0', 'x./CS" = "!Y1').replace(
        'y./CS" = "!Y1', 'y./CS" = "!Y0'
    )
    assert compared(capture, changed).mismatch is None  # all chips are alike
    alone = WIRED.replace('"!y./CS" = "!Y1 | !Y2"', '"!y./CS" = "!Y1 & !Y2"')
    found = compared(capture, alone).mismatch
    assert found is not None
    assert (found.silicon, found.model) == ("84H in read 302H 84H", "FFH in read 302H FFH")


def test_a_wrong_bit_is_found_in_its_read(capture: list[Sample]) -> None:
    data, strobe = 1 << CHANNELS.index("D0"), 1 << CHANNELS.index("/IOR")
    falls = [n for n in range(1, len(capture)) if capture[n - 1][1] & ~capture[n][1] & strobe]
    spoilt = list(capture)
    begin = falls[100]
    end = next(n for n in range(begin, len(capture)) if capture[n][1] & strobe)
    for number in range(begin, end + 1):
        when, bits = spoilt[number]
        spoilt[number] = when, bits ^ data
    found = compared(spoilt).mismatch
    assert found is not None
    assert found.when == capture[end][0]


def test_accesses_elsewhere_are_passed_over_if_the_lines_that_tell_were_captured() -> None:
    bus, wiring = wired(WIRED, CHANNELS)
    watch = CardWatch(bus, wiring)
    assert list(watch.PINS) == ["/IOR", "/IOW", *LOW, "A9"]
    low, idle = (0, 1, 0, 1, 0, 0), (1, 1, 0, 1, 0, 0)
    assert not watch.edges(9, (*low, 0), (*idle, 0), 0x12, 0x34)
    (cycle,) = watch.edges(9, (*low, 1), (*idle, 1), 0x12, 0x34)
    assert (cycle.write, cycle.address, cycle.data) == (False, 2, 0x34)
    assert watch.reading((*low, 1))
    assert not watch.reading((*low, 0))
    assert wiring.tied["A8"] == 1
    assert wiring.tied["A7"] == 0


def test_lines_that_tell_the_ports_apart_are_needed() -> None:
    with pytest.raises(CaptureError, match="the capture has no channel for A2; it has"):
        wired(WIRED, [name for name in CHANNELS if name != "A2"])
