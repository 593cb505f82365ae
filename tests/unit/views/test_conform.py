"""Silicon beside the model: captures of the model itself conform, spoiled ones do not."""

from functools import cache
from itertools import pairwise

import pytest

from tests.unit.views.captures import BOARDS, Shot, vcd
from vbus import plugins
from vbus.board.host_bus import HostBus
from vbus.chips.bus_watch import watch_by
from vbus.chips.packets import Cycle, Decoder, Packet
from vbus.core.errors import CaptureError
from vbus.core.kernel import MS, NS, US, Kernel
from vbus.core.signals import Net
from vbus.views.silicon.conform import Mismatch, Verdict
from vbus.views.silicon.outputs import OutputWatch

FAMILIES = pytest.mark.parametrize("family", sorted(BOARDS))


@cache
def text(family: str) -> str:
    return vcd(family)


def shot(family: str) -> Shot:
    return Shot(family, text(family))


def difference(verdict: Verdict) -> Mismatch:
    assert verdict.mismatch is not None
    return verdict.mismatch


# -- what conforms ------------------------------------------------------------------------------


@FAMILIES
@pytest.mark.parametrize("wish", ["auto", "start"])
def test_a_capture_of_the_model_conforms_to_the_model(family: str, wish: str) -> None:
    verdict = shot(family).compare(wish=wish)
    assert verdict.mismatch is None
    assert verdict.cycles > 10
    assert 0 < verdict.reads < verdict.cycles
    assert verdict.outputs
    assert verdict.ignored == 0


@pytest.mark.parametrize(
    ("family", "period"),
    [("lm628", 5 * NS), ("lm628", 41_667), ("mc1241a", 41_667), ("mcp1200", 5 * NS)],
)
def test_it_does_so_as_an_analyser_samples_it(family: str, period: int) -> None:
    whole = shot(family)
    expected = whole.compare()
    sampled: dict[int, int] = {}
    for when, levels in whole.samples:
        sampled[-(-when // period) * period] = levels
    whole.samples = sorted(sampled.items())
    verdict = whole.compare(slack=period + 200_000)
    assert verdict.mismatch is None
    assert (verdict.cycles, verdict.reads) == (expected.cycles, expected.reads)


def test_reads_and_writes_are_counted() -> None:
    verdict = shot("mcp1200").compare(wish="start")
    assert (verdict.cycles, verdict.reads) == (12, 7)


# -- what does not ------------------------------------------------------------------------------


def test_a_wrong_data_bit_is_found_in_its_read_with_both_packets() -> None:
    capture = shot("lm628")
    data = [pulse for pulse in capture.pulses("/RD") if _level(capture, "/PS", pulse[0])]
    begin, end = data[3]
    capture.change(begin, end, flip=1 << capture.wiring.data[0])
    found = difference(capture.compare())
    assert found.when == end
    assert found.where == "read at address 1H"
    assert found.clause == "LM-CMD-9"
    assert found.silicon == "00H in RDDP +0 cnt"
    assert found.model == "01H in RDDP +1 cnt"
    assert len(found.before) == 20
    assert " x r 1 00  <- the model gives 01\n    RDDP +0 cnt" in found.after[0]
    assert len(found.after) == 21


class Silent(Decoder):
    """Tells of no packet."""

    def take(self, cycle: Cycle) -> list[Packet]:
        return []

    def finish(self) -> list[Packet]:
        return []


def test_a_byte_at_the_end_that_differs_is_found_though_no_packet_tells_of_it(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr("vbus.circuit.stream.decoder_of", lambda *_: Silent())
    capture = shot("lm628")
    begin, end = capture.pulses("/RD")[-1]
    capture.change(begin, end, flip=1 << capture.wiring.data[7])
    found = difference(capture.compare())
    assert (found.when, found.silicon, found.model) == (end, "80H", "00H")


def _level(capture: Shot, pin: str, when: int) -> int:
    levels = next(levels for at, levels in capture.samples if at == when)
    return capture.wiring.level(pin, levels)


def test_the_cycles_before_the_difference_are_those_that_match() -> None:
    whole = shot("mcp1200").compare(wish="start")
    capture = shot("mcp1200")
    begin, end = capture.pulses("/OE")[-1]
    capture.change(begin, end, flip=1 << capture.wiring.data[7])
    verdict = capture.compare(wish="start")
    assert difference(verdict).silicon.startswith("FFH in read COMMAND_POSITION")
    assert (verdict.cycles, verdict.reads) == (whole.cycles - 1, whole.reads - 1)


def test_the_first_of_several_differences_is_told() -> None:
    capture = shot("lm628")
    reads = capture.pulses("/RD")
    data = [pulse for pulse in reads if _level(capture, "/PS", pulse[0])]
    status = next(pulse for pulse in reads if pulse[0] > data[4][1])
    for begin, end in (data[4], status):
        capture.change(begin, end, flip=1 << capture.wiring.data[7])
    assert difference(capture.compare()).when == data[4][1]


@FAMILIES
def test_a_write_that_never_reached_the_silicon_is_found_by_the_next_answers(family: str) -> None:
    capture = shot(family)
    pin = {"lm628": "/WR", "mc1241a": "~HostWrite", "mcp1200": "/CS"}[family]
    pulses = capture.pulses(pin)
    # LFIL's first data byte; a byte of the velocity; the command position's low byte
    place = {"lm628": 9, "mc1241a": 4, "mcp1200": 4}[family]
    begin, end = pulses[place]
    capture.change(begin, end, ones=1 << capture.bit(pin))
    found = difference(capture.compare(wish="start"))
    assert found.when > end


def test_a_status_that_stays_busy_too_long_is_found_at_that_poll() -> None:
    capture = shot("lm628")
    polls = [pulse for pulse in capture.pulses("/RD") if not _level(capture, "/PS", pulse[0])]
    seen = [{_byte(capture, when) for when in poll} for poll in polls]
    # Ready from its beginning to its end, and the one before it was not.
    busy, ready = {0x85}, {0x84}
    first = polls[next(n for n in range(1, len(polls)) if (seen[n - 1], seen[n]) == (busy, ready))]
    capture.change(*first, flip=1 << capture.wiring.data[0])
    found = difference(capture.compare())
    assert found.when == first[1]
    assert found.silicon.endswith("BUSY")
    assert not found.model.endswith("BUSY")
    assert found.clause == "LM-CMD-23"
    # One microsecond before the model was busy too.
    assert capture.compare(slack=2 * US).mismatch is None
    assert capture.compare(masks={0: 0x01}).mismatch is None
    assert capture.compare(masks={0: 0x01}).ignored > 0
    assert capture.compare(masks={0: 0x02}).mismatch is not None
    assert capture.compare(names=["RDSTAT"]).ignored == 1


def _byte(capture: Shot, when: int) -> int:
    return capture.wiring.byte(next(levels for at, levels in capture.samples if at == when))


def test_a_bus_that_floats_at_the_edge_has_been_read_before_it() -> None:
    capture = shot("lm628")
    begin, end = capture.pulses("/RD")[-1]
    capture.change(end, end, flip=0xFF << capture.wiring.data[0])
    assert capture.compare().mismatch is None
    before = max(when for when, _ in capture.samples if when < end)
    capture.change(begin, before, flip=1 << capture.wiring.data[5])
    assert difference(capture.compare()).silicon == "20H in RDSTAT 20H POSITION_ERROR"


def test_a_status_that_changes_within_the_slack_before_an_edge_may_be_either() -> None:
    def patient(port: HostBus) -> None:
        port.delay(US)
        port.write(0, 0x02)
        names = {name: 1 << n for n, name in enumerate(port.info().lines)}
        port.lines(names["x./CS"] | names["x./PS"] | names["x./RD"], 0)
        port.delay(100 * US)  # status is live (LM-BUS-3)
        port.lines(names["x./RD"], names["x./RD"])

    capture = Shot("lm628", vcd("lm628", patient))
    begin, end = capture.pulses("/RD")[0]
    moved = next(
        when for when, _ in capture.samples
        if begin < when < end and _byte(capture, begin) != _byte(capture, when)
    )  # fmt: skip
    capture.change(moved, end, flip=1 << capture.wiring.data[0])
    assert capture.compare(slack=end - moved + NS).mismatch is None
    assert difference(capture.compare(slack=end - moved - NS)).when == end


def test_a_pulse_too_short_to_be_sampled_may_be_missing() -> None:
    kernel = Kernel()
    net = Net(kernel, "x.HI", rest=0)
    pin = net.solder("HI")

    def pulse(width: int, slack: int) -> bool:
        output = OutputWatch("HI", net, slack)
        output.begin(kernel.now, 0, False)
        for level in (1, 0):
            pin.drive(level)
            kernel.run_until(kernel.now + width)
        kernel.run_until(kernel.now + US)
        found = output.compare(kernel.now, 0)
        net.unobserve(output)
        return found is None

    assert pulse(20 * NS, 20 * NS)
    assert not pulse(21 * NS, 20 * NS)


def test_edges_are_paired_in_the_order_they_came_in() -> None:
    kernel = Kernel()
    net = Net(kernel, "x.HI", rest=1)
    pin = net.solder("HI")
    output = OutputWatch("HI", net, 20 * NS)
    output.begin(0, 1, False)
    for when, level in ((50, 0), (80, 1), (110, 0)):
        kernel.run_until(when * NS)
        pin.drive(level)
    kernel.run_until(120 * NS)
    found = output.compare(kernel.now, 0)
    assert found == (50 * NS, "falls at 0.12us", "falls at 0.05us")


def test_who_drives_the_data_bus_and_when_it_is_idle() -> None:
    lm628, pmd, mcp = (
        watch_by(plugins.family(name).tables.BUS) for name in ("lm628", "mc1241a", "mcp1200")
    )
    # /CS /PS /RD /WR
    assert lm628.reading((0, 1, 0, 1))
    assert not lm628.reading((1, 1, 0, 1))
    assert not lm628.reading((0, 1, 1, 0))
    assert [lm628.idle(x) for x in ((1, 0, 0, 0), (0, 0, 1, 1), (0, 1, 0, 1), (0, 1, 1, 0))] == [
        True, True, False, False,
    ]  # fmt: skip
    # ~HostSlct HostCmd ~HostRead ~HostWrite
    assert pmd.reading((0, 0, 0, 1))
    for levels in ((1, 0, 0, 1), (0, 1, 0, 1), (0, 0, 1, 1), (0, 0, 0, 0)):
        assert not pmd.reading(levels)
    assert [pmd.idle(x) for x in ((1, 0, 0, 0), (0, 0, 1, 1), (0, 1, 0, 1), (0, 1, 1, 0))] == [
        True, True, False, False,
    ]  # fmt: skip
    # /ALE /CS /OE R/W
    assert mcp.reading((1, 1, 0, 1))
    assert mcp.reading((1, 0, 0, 1))
    assert not mcp.reading((1, 0, 0, 0))
    assert not mcp.reading((1, 0, 1, 1))
    assert [mcp.idle(x) for x in ((1, 1, 1, 0), (0, 1, 1, 1), (1, 0, 1, 1), (1, 1, 0, 1))] == [
        True, False, False, False,
    ]  # fmt: skip


def test_a_packet_that_is_ignored_may_differ() -> None:
    capture = shot("lm628")
    data = [pulse for pulse in capture.pulses("/RD") if _level(capture, "/PS", pulse[0])]
    for begin, end in data:
        capture.change(begin, end, flip=1 << capture.wiring.data[2])
    assert capture.compare(names=["LTRJ"]).mismatch is not None
    verdict = capture.compare(names=["RDDP"])
    assert verdict.mismatch is None
    assert verdict.ignored == len(data)


@pytest.mark.parametrize(("family", "pin"), [("lm628", "HI"), ("mc1241a", "HostRdy")])
def test_an_output_that_moves_late_is_found_at_its_edge(family: str, pin: str) -> None:
    capture = shot(family)
    bit = 1 << capture.bit(pin)
    rose = next(
        when for (_, before), (when, levels) in pairwise(capture.samples)
        if levels & bit and not before & bit
    )  # fmt: skip
    held = [(when, levels) for when, levels in capture.samples if rose <= when < rose + 5 * US]
    capture.change(rose, held[-1][0], zeros=bit)
    capture.samples = sorted({**dict(capture.samples), rose + 5 * US: held[-1][1] | bit}.items())
    found = difference(capture.compare())
    assert (found.when, found.where) == (rose, pin)
    assert found.silicon.startswith("rises at ")
    assert found.model == f"rises at {rose / US:.6f}".rstrip("0").rstrip(".") + "us"
    assert capture.compare(slack=5 * US).mismatch is None
    assert capture.compare(names=[pin]).mismatch is None


def test_a_byte_that_differs_is_found_where_its_packet_is_cut_off() -> None:
    capture = shot("lm628")
    data = [pulse for pulse in capture.pulses("/RD") if _level(capture, "/PS", pulse[0])]
    (begin, end), (following, _) = data[:2]
    capture.change(begin, end, flip=1 << capture.wiring.data[2])
    capture.samples = [sample for sample in capture.samples if sample[0] < following]
    assert difference(capture.compare()).when == end


def test_an_output_that_never_moves_is_found() -> None:
    capture = shot("lm628")
    bit = 1 << capture.bit("HI")
    capture.change(0, capture.samples[-1][0], zeros=bit)
    found = difference(capture.compare())
    assert (found.where, found.silicon) == ("HI", "stays as it is")
    assert found.model.startswith("rises at ")


def test_an_output_at_the_wrong_level_from_the_beginning_is_found() -> None:
    capture = shot("lm628")
    # After its reset an LM629 has something to tell (LM-RST-7).
    capture.change(0, capture.samples[-1][0], zeros=1 << capture.bit("HI"))
    found = difference(capture.compare(wish="start"))
    assert (found.where, found.silicon, found.when) == ("HI", "falls at 0us", 0)


def test_another_model_is_another_chip() -> None:
    capture = shot("lm628")
    slow = capture.compare(more='reset_time = "1.2 ms"\n')
    assert difference(slow).where == "HI"


# -- where it begins ----------------------------------------------------------------------------


def late(port: HostBus) -> None:
    """Leave the chip in some state, reset it by its pin, and ask it."""
    for _ in range(3):
        while port.read(0) & 1:
            pass
        port.write(0, 0x02)
    port.delay(MS)
    pin = port.pin_number("/RST")
    port.pin(pin, 0)
    port.delay(10 * US)
    port.pin(pin, 1)
    port.delay(3 * MS)
    port.read(0)
    port.write(0, 0x0C)
    port.delay(MS)
    port.read(1)
    port.read(1)


def test_the_first_hardware_reset_is_where_both_are_the_same() -> None:
    capture = Shot("lm628", vcd("lm628", late))
    reset, _ = capture.pulses("/RST")[0]
    # Before it the silicon was somewhere else.
    for begin, end in capture.pulses("/RD"):
        if end < reset:
            capture.change(begin, end, flip=1 << capture.wiring.data[6])
    verdict = capture.compare()
    assert verdict.mismatch is None
    assert (verdict.cycles, verdict.reads) == (4, 3)
    assert capture.compare(wish="start").mismatch is not None
    assert capture.compare(wish=reset - US).mismatch is None


@pytest.mark.parametrize(
    ("family", "address", "data"),
    [("lm628", 0, 0x00), ("mcp1200", 0x05, 0x00), ("mc1241a", 1, 0x39)],
)
def test_the_reset_of_the_host_is_where_both_are_the_same(
    family: str, address: int, data: int
) -> None:
    def host(port: HostBus) -> None:
        port.delay(MS)
        port.read(0)
        port.delay(MS)
        port.write(address, data)
        port.delay(5 * MS)
        port.read(0)

    verdict = Shot(family, vcd(family, host)).compare(wish="reset")
    assert (verdict.cycles, verdict.mismatch) == (2, None)


def test_a_capture_that_begins_inside_a_cycle_begins_with_the_next() -> None:
    capture = shot("lm628")
    write = capture.pulses("/WR")[0]
    middle = next(n for n, (when, _) in enumerate(capture.samples) if when == write[0])
    capture.samples = capture.samples[middle:]
    verdict = capture.compare(wish="start", names=["HI"])
    assert verdict.begin >= write[1]
    assert verdict.mismatch is None
    assert verdict.cycles == shot("lm628").compare().cycles - 1


def test_a_capture_without_a_reset_says_so_when_one_is_asked_for() -> None:
    with pytest.raises(CaptureError, match="there is no reset in the capture"):
        shot("mc1241a").compare(wish="reset")


def test_a_start_behind_the_end_is_refused() -> None:
    with pytest.raises(CaptureError, match="never idle from there on"):
        shot("mc1241a").compare(wish=10**15)


# -- the host -----------------------------------------------------------------------------------


def test_what_the_host_breaks_is_told_and_ac_limits_only_if_asked_for() -> None:
    def careless(port: HostBus) -> None:
        names = {name: 1 << n for n, name in enumerate(port.info().lines)}
        port.delay(US)
        port.lines(names["x./CS"] | names["x./PS"], 0)
        port.drive(0x02)
        for width in (200 * NS, 30 * NS):
            port.lines(names["x./WR"], 0)
            port.delay(width)
            port.lines(names["x./WR"], names["x./WR"])
            port.delay(US)

    capture = Shot("lm628", vcd("lm628", careless))
    rules = [v.rule for v in capture.compare().violations]
    assert rules == ["lm628.busy-write"]
    verdict = capture.compare(judged=True)
    assert {"lm628.T14", "lm628.busy-write"} <= {v.rule for v in verdict.violations}
    assert verdict.broken == len(verdict.violations)
    (narrow,) = [v for v in verdict.violations if v.rule == "lm628.T14"]
    assert narrow.measured == 30 * NS
