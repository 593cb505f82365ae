"""Pin maps of a board file: the wiring a host is told, and every message when one is wrong."""

import pytest

from vbus.board.build import build, pin_map_of
from vbus.board.config import read_board_text
from vbus.board.pin_maps import roles
from vbus.boardfile.source import BoardFileError
from vbus.chips.base import Chip
from vbus.chips.lm628.chip import LM628
from vbus.chips.mc1241a.chip import MC1241A
from vbus.chips.mcp1200.chip import MCP1200
from vbus.core.kernel import Clock, Kernel

BOARD = """\
[chips.x]
part = "LM629N-8"
clock = "8 MHz"
plant = "none"
[chips.y]
part = "LM629N-8"
clock = "8 MHz"
plant = "none"
[buses.main]
chips = ["x", "y"]
[[hosts]]
transport = "unix:/tmp/uno.sock"
pinmap = "uno"
[pinmaps.uno]
low = []
[pinmaps.uno.pins]
PD4 = "D0"
PD5 = "D1"
PD6 = "D2"
PD7 = "D3"
RB0 = "D4"
PB1 = "D5"
PB4 = "D6"
PB5 = "D7"
PC0 = ["/RD", "!/WR"]
PC1 = "/PS"
PC2 = "x./CS"
PC3 = "y./CS"
PC4 = "/RST"
PD2 = "y.HI"
"""
TARGETS = "D0, D1, D2, D3, D4, D5, D6, D7, /CS, /PS, /RD, /WR, /RST, HI, A, B, /IN, SIGN, MAG"


def wiring(text: str) -> list[str]:
    file, source = read_board_text(text)
    board = build(file, source)
    host = file.hosts[0]
    port = board.open_port("host", host.chips or None, pin_map=pin_map_of(file, host.pinmap))
    return port.info().wiring.split()


def test_the_host_is_told_each_wire_by_the_numbers_of_its_session() -> None:
    told = wiring(BOARD)

    assert told[:4] == ["0d0=D4", "1d0=D4", "0d1=D5", "1d1=D5"]
    assert "0d4=B0" in told
    assert told[16:22] == ["0r=C0", "1r=C0", "0w=!C0", "1w=!C0", "0a0=C1", "1a0=C1"]
    assert told[22:24] == ["0s=C2", "1s=C3"]
    assert told[24:] == ["p0=C4", "p7=C4", "o3=D2"]


def test_pins_tied_are_told_as_levels() -> None:
    told = wiring(
        BOARD.replace("low = []", 'low = ["x./CS"]\nhigh = ["!y./CS"]')
        .replace('PC2 = "x./CS"\n', "")
        .replace('PC3 = "y./CS"\n', "")
    )

    assert "0s=0" in told
    assert "1s=!1" in told


def test_a_pin_on_a_joined_net_is_told_once() -> None:
    told = wiring(BOARD + '[nets]\nreset = ["x./RST", "y./RST"]\n')

    assert [wire for wire in told if wire.startswith("p")] == ["p0=C4"]


def test_a_map_may_mean_some_of_the_chips() -> None:
    text = BOARD.replace("low = []", 'chips = ["x"]').replace('PC3 = "y./CS"\n', "")
    told = wiring(text.replace('PD2 = "y.HI"\n', ""))

    assert all(wire[0] in "0p" for wire in told)
    assert "0s=C2" in told


def test_a_host_without_a_pin_map_is_told_nothing() -> None:
    assert wiring(BOARD.replace('pinmap = "uno"\n', "")) == []


@pytest.mark.parametrize(
    ("cls", "part", "expected"),
    [
        (LM628, "LM629N-8", {"/CS": "s", "/PS": "a0", "/RD": "r", "/WR": "w"}),
        (
            MC1241A, "MC1241A",
            {"~HostSlct": "s", "~HostWrite": "w", "~HostRead": "r", "HostCmd": "a0"},
        ),
        (MCP1200, "MCP-1200", {"/ALE": "l", "/CS": "s", "/OE": "r", "R/W": "w"}),
    ],
)  # fmt: skip
def test_the_role_of_each_bus_pin_follows_from_the_chips_own_cycles(
    cls: type[Chip], part: str, expected: dict[str, str]
) -> None:
    found = roles(cls("x", part, Kernel(), Clock(8_000_000)))

    assert {name: role for name, role in found.items() if role[0] != "d"} == expected
    assert [found[f"D{number}"] for number in range(8)] == [f"d{number}" for number in range(8)]


MISTAKES = [
    ("PD4 =", "XD4 =", 'b.toml:17: pinmaps.uno.pins.XD4: "XD4" is no port bit; write PB3 (AVR,'
     " STM32) or RB3 (PIC), with ports A to L and bits 0 to 15, or IRQ5, an interrupt input of a"
     " processor"),
    ("PD4 =", "PD16 =", 'b.toml:17: pinmaps.uno.pins.PD16: "PD16" is no port bit; write PB3 (AVR,'
     " STM32) or RB3 (PIC), with ports A to L and bits 0 to 15, or IRQ5, an interrupt input of a"
     " processor"),
    ("PB1 =", "PB0 =", "b.toml:22: pinmaps.uno.pins.PB0: PB0 is the same port bit as RB0; write"
     " one of them"),
    ('"/PS"', '"/SP"', 'b.toml:26: pinmaps.uno.pins.PC1: no chip of this map has a pin "/SP";'
     f' did you mean "/PS"? there are {TARGETS}'),
    ('"x./CS"', '"x.CS"', 'b.toml:27: pinmaps.uno.pins.PC2: "x" has no pin "CS"; did you mean'
     f' "/CS"? it has {TARGETS}'),
    ('"x./CS"', '"z./CS"', "b.toml:27: pinmaps.uno.pins.PC2: there is no [chips.z]; this file"
     " has x, y"),
    ('"D1"', '"D0"', 'b.toml:18: pinmaps.uno.pins.PD5: "x.D0" is wired to PD4 already; a pin has'
     ' one source'),
    ('"y.HI"', '"HI"', 'b.toml:30: pinmaps.uno.pins.PD2: "y.HI" and "x.HI" are outputs, which fight'
     " on one wire; join them by a gate of [glue.NAME], and wire its output to the port bit"),
    ('PC1 = "/PS"\n', "", 'b.toml:14: pinmaps.uno: "x" cannot be reached: /PS is not wired; wire'
     ' each to a port bit, or tie it with "low" or "high"'),
    ("low = []", 'low = ["/RD"]', 'b.toml:15: pinmaps.uno.low[1]: "x./RD" is wired to PC0'
     " already; a pin has one source"),
    ("low = []", 'chips = ["x", "q"]', "b.toml:15: pinmaps.uno.chips[2]: there is no [chips.q];"
     " this file has x, y"),
    ("low = []", "lo = []", 'b.toml:15: pinmaps.uno.lo: unknown key; did you mean "low"? allowed'
     " are chips, high, low, pins"),
    ('"/PS"', "3", "b.toml:26: pinmaps.uno.pins.PC1: found 3; write a list of names, such as"
     ' ["x"]'),
    ('pinmap = "uno"', 'pinmap = "one"', "b.toml:13: hosts[1].pinmap: there is no [pinmaps.one];"
     " this file has uno"),
    ('pinmap = "uno"', 'pinmap = "uno"\nchips = ["x"]', 'b.toml:13: hosts[1].pinmap: pin map "uno"'
     ' is wired to "y", which is not among the chips of this host: x'),
    ('pinmap = "uno"', 'pinmap = "uno"\ncard = "c"\n[cards.c]\ndecode = "direct"\nchips = ["x"]',
     'b.toml:13: hosts[1].pinmap: a host has either a "card" or a "pinmap": addresses or port'
     ' bits; both only if the card is the memory bus of the microcontroller ("memory = true"),'
     " or the map has only interrupt inputs (IRQ5)"),
]  # fmt: skip


@pytest.mark.parametrize(("old", "new", "message"), MISTAKES)
def test_a_mistake_is_named_with_its_line_and_what_is_allowed(
    old: str, new: str, message: str
) -> None:
    text = BOARD.replace(old, new, 1)
    assert text != BOARD

    with pytest.raises(BoardFileError) as caught:
        read_board_text(text, "b.toml")

    assert message in str(caught.value).splitlines()


def test_a_map_of_nothing_is_refused() -> None:
    text = BOARD[: BOARD.index("[pinmaps.uno.pins]")]

    with pytest.raises(BoardFileError, match=r"pinmaps\.uno: it wires nothing; write pins such as"):
        read_board_text(text, "b.toml")


def test_a_waveform_is_too_fast_for_a_port_bit() -> None:
    text = """\
[chips.m]
part = "MC1241A"
clock = "20 MHz"
plants = ["none"]
[pinmaps.uno.pins]
PB0 = "m.PWMMag1A"
"""
    with pytest.raises(BoardFileError, match=r'"m\.PWMMag1A" is a waveform, too fast'):
        read_board_text(text, "b.toml")


GLUED = (
    BOARD.replace('PC2 = "x./CS"', 'PC2 = "u1.1A"').replace('PC3 = "y./CS"', 'PC3 = "u1.1/G"')
    + """
[glue.u1]
part = "74HC139"
low = ["1B"]
hosts = ["1A", "1/G"]
[glue.u1.pins]
1Y0 = "x./CS"
1Y1 = "y./CS"
"""
)


def test_before_glue_the_host_is_told_lines_and_the_bus_in_place_of_roles() -> None:
    told = wiring(GLUED)

    assert told[:8] == [
        "0b0=D4", "0b1=D5", "0b2=D6", "0b3=D7", "0b4=B0", "0b5=B1", "0b6=B4", "0b7=B5",
    ]  # fmt: skip
    file, source = read_board_text(GLUED)
    port = build(file, source).open_port("host")
    lines = [f"c{port.line_number(f'main.{name}')}" for name in ("/RD", "/WR", "/PS")]
    sides = [f"p{port.pin_number(f'u1.{name}')}" for name in ("1A", "1/G")]
    assert told[8:13] == [
        f"{lines[0]}=C0", f"{lines[1]}=!C0", f"{lines[2]}=C1", f"{sides[0]}=C2", f"{sides[1]}=C3",
    ]  # fmt: skip


def test_chips_of_the_same_map_without_glue_are_decoded_by_the_host_as_ever() -> None:
    told = wiring(GLUED.replace('1Y1 = "y./CS"\n', "").replace('"u1.1/G"', '["u1.1/G", "y./CS"]'))

    assert {"1s=C3", "1r=C0", "1d0=D4"} <= set(told)
    assert not [wire for wire in told if wire.startswith(("0s", "0r", "1b"))]


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ('"u1.1A"', '["u1.1A", "x./CS"]', '"x./CS" is driven by glue; wire the port bit to the'),
        ('"u1.1A"', '"u1.1X"', '"u1" has no pin "1X"; it has 1Y0, 1Y1, 1Y2, 1Y3, 1A, 1/G;'
         ' list a further pin of it in "hosts" of [glue.u1]'),
        ('"u1.1A"', '"u2.1A"', 'there is no [chips.u2]'),
        ('PC1 = "/PS"\n', "", '"x" cannot be reached: /PS is not wired'),
    ],
)  # fmt: skip
def test_a_mistake_in_a_map_with_glue_is_named(old: str, new: str, message: str) -> None:
    assert old in GLUED
    with pytest.raises(BoardFileError) as told:
        read_board_text(GLUED.replace(old, new))
    assert message in str(told.value)
