"""Captures in which a level is unknown (x or z): not driven, or not known yet."""

from functools import cache

import pytest

from tests.unit.views.captures import BOARDS, Shot, vcd
from vbus.core.errors import CaptureError
from vbus.core.kernel import NS
from vbus.views.silicon.capture import UNKNOWN
from vbus.views.silicon.conform import Mismatch, Verdict

FAMILIES = pytest.mark.parametrize("family", sorted(BOARDS))
READ = {"lm628": "/RD", "mc1241a": "~HostRead", "mcp1200": "/OE"}
WRITE = {"lm628": "/WR", "mc1241a": "~HostWrite", "mcp1200": "/CS"}


@cache
def text(family: str) -> str:
    return vcd(family)


def shot(family: str) -> Shot:
    return Shot(family, text(family))


def data(capture: Shot, bits: int = 0xFF) -> int:
    """Return channels of the data bus, as unknown."""
    channels = capture.wiring.data
    return sum(1 << UNKNOWN + channels[bit] for bit in range(8) if bits >> bit & 1)


def difference(verdict: Verdict) -> Mismatch:
    assert verdict.mismatch is not None
    return verdict.mismatch


@FAMILIES
def test_a_chip_that_no_longer_drives_the_bus_does_not_agree(family: str) -> None:
    capture = shot(family)
    for begin, end in capture.pulses(READ[family])[2:]:
        capture.change(begin, end, ones=data(capture))
    first = capture.pulses(READ[family])[2]
    found = difference(capture.compare(wish="start"))
    assert found.when == first[1]
    assert found.silicon.startswith("D")
    assert " are not driven (x or z) in " in found.silicon
    assert found.model[2] == "H"
    assert " are not driven; the model gives " in found.after[0]


def test_one_line_that_is_not_driven_is_named() -> None:
    capture = shot("lm628")
    begin, end = capture.pulses("/RD")[-1]
    capture.change(begin, end, ones=data(capture, 0x20))
    found = difference(capture.compare())
    assert found.silicon == "D5 is not driven (x or z) in RDSTAT"
    assert capture.compare(masks={0: 0x20}).mismatch is None
    assert capture.compare(masks={0: 0x20}).ignored == 1
    assert capture.compare(names=["RDSTAT"]).mismatch is None


@FAMILIES
def test_a_bus_that_nothing_drives_between_cycles_is_no_difference(family: str) -> None:
    capture = shot(family)
    expected = capture.compare(wish="start")
    used = [(0, 0)]
    for pin in (READ[family], WRITE[family], *(["/ALE"] if family == "mcp1200" else [])):
        used += capture.pulses(pin)
    instants = [when for when, _ in capture.samples]
    for when in instants:
        before = max((at for at in instants if at < when), default=0)
        if all(not (begin <= when < end or begin <= before < end) for begin, end in used):
            capture.change(when, when, ones=data(capture))
    assert capture.compare(wish="start") == expected


@FAMILIES
def test_a_byte_the_chip_takes_must_be_known(family: str) -> None:
    capture = shot(family)
    begin, end = capture.pulses(WRITE[family])[3]
    capture.change(begin, end, ones=data(capture, 0x11))
    with pytest.raises(CaptureError, match=r"the chip takes a byte of which DB?0, DB?4 are unknow"):
        capture.compare(wish="start")


def test_an_address_the_chip_latches_must_be_known() -> None:
    capture = shot("mcp1200")
    for begin, end in capture.pulses("/ALE"):
        capture.change(begin, end, ones=data(capture, 0x80))  # no bit of an address
    assert capture.compare(wish="start").mismatch is None
    begin, end = capture.pulses("/ALE")[3]
    capture.change(begin, end, ones=data(capture, 0x01))
    with pytest.raises(CaptureError, match="the chip takes a byte of which DB0, DB7 are unknown"):
        capture.compare(wish="start")


def test_a_write_that_is_not_known_is_no_reset() -> None:
    capture = shot("lm628")
    writes = capture.pulses("/WR")
    begin, end = writes[0]  # 00H
    capture.change(begin, end, ones=data(capture))
    with pytest.raises(CaptureError, match="there is no reset in the capture"):
        capture.compare(wish="reset")


@FAMILIES
def test_what_is_unknown_at_the_beginning_is_no_edge(family: str) -> None:
    """A simulator's capture: all lines are x until somebody has driven them."""
    capture = shot(family)
    expected = capture.compare(wish="start")
    begin = capture.samples[0]
    every = (1 << len(capture.channels)) - 1
    later = [(when + 100 * NS, levels) for when, levels in capture.samples]
    capture.samples = [(0, every << UNKNOWN), (begin[0] + 100 * NS, begin[1]), *later[1:]]
    verdict = capture.compare(wish="start")
    assert (verdict.mismatch, verdict.cycles) == (None, expected.cycles)
    assert verdict.begin == 100 * NS


def test_lines_may_become_known_one_after_the_other() -> None:
    capture = shot("lm628")
    expected = capture.compare(wish="start")
    when, levels = capture.samples[0]
    strobe = 1 << UNKNOWN + capture.bit("/WR")
    reset = 1 << UNKNOWN + capture.bit("/RST")
    unknown = levels & ~(1 << capture.bit("/WR") | 1 << capture.bit("/RST"))
    capture.samples = [
        (when, unknown | strobe | reset), (when + 1000, levels & ~1 << capture.bit("/RST") | reset),
        *((at + 2000, value) for at, value in capture.samples),
    ]  # fmt: skip
    verdict = capture.compare(wish="start")
    assert (verdict.mismatch, verdict.cycles) == (None, expected.cycles)


def test_a_control_line_that_is_never_known_is_named() -> None:
    capture = shot("lm628")
    capture.change(0, capture.samples[-1][0], ones=1 << UNKNOWN + capture.bit("/PS"))
    with pytest.raises(CaptureError, match="the level of /PS is unknown \\(x or z\\) all along"):
        capture.compare()


def test_an_output_that_is_driven_no_more_is_a_difference() -> None:
    capture = shot("lm628")
    bit = 1 << UNKNOWN + capture.bit("HI")
    when = capture.samples[len(capture.samples) // 2][0]
    capture.change(when, capture.samples[-1][0], ones=bit)
    found = difference(capture.compare())
    assert (found.where, found.when) == ("HI", when)
    assert found.silicon.startswith("is driven no more (x or z) at ")
    assert capture.compare(names=["HI"]).mismatch is None


def test_an_output_that_is_never_known_is_a_difference() -> None:
    capture = shot("lm628")
    capture.change(0, capture.samples[-1][0], ones=1 << UNKNOWN + capture.bit("HI"))
    found = difference(capture.compare(wish="start"))
    assert (found.where, found.silicon) == ("HI", "is unknown (x or z) after the reset")


def test_files_say_what_is_unknown() -> None:
    capture = shot("lm628")
    begin, end = capture.pulses("/RD")[-1]
    capture.change(begin, end, ones=data(capture))
    again = Shot("lm628", capture.text())
    assert difference(again.compare()).silicon == "D0-D7 are not driven (x or z) in RDSTAT"
