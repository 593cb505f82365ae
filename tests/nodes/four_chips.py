"""A machine of four chips on four nodes, and what its hosts do in 20 ms; and twice as many."""

import re

BOARD = """\
[board]
name = "four"
time = "lockstep"
power_on = "done"

[nodes.a]
[nodes.b]
[nodes.c]
[nodes.d]

[chips.x]
part = "LM629N-8"
clock = "8 MHz"
plant = "x_motor"
node = "a"

[chips.y]
part = "LM629N-6"
clock = "6 MHz"
plant = "none"
node = "b"

[chips.m]
part = "MCP-1200"
clock = "8 MHz"
plant = "m_motor"
node = "c"

[chips.p]
part = "MC1241A"
clock = "25 MHz"
plants = ["p_first", "none"]
node = "d"

[plants.x_motor]
model = "dc_motor"

[plants.m_motor]
model = "ideal"

[plants.p_first]
model = "ideal"

[nets]
"/SYNC" = { pins = ["m./SYNC", "p.~HostIntrpt"], delay = "200 us" }
"TRIG" = { pins = ["m.TRIG", "y./IN", "p.~Home1"], delay = "250 us" }
"DONE" = { pins = ["x.HI", "p.PosLimit1"], delay = "300 us" }
"READY" = { pins = ["y.HI", "p.NegLimit1"], delay = "220 us" }
"""

US = 1_000_000


class Script:
    """Writes a scenario the way hosts would make it; instants in microseconds."""

    def __init__(self) -> None:
        self.lines: list[str] = []

    def line(self, at: float, text: str) -> None:
        self.lines.append(f"{at:.3f}us {text}")

    def lm(self, at: float, chip: str, command: int, *words: int, read: int = 0) -> float:
        """One LM629 command with data words; the busy time is waited for, not polled."""
        self.line(at, f"{chip} w 0 {command:x}")
        at += 40
        for word in words:
            self.line(at, f"{chip} w 1 {word >> 8 & 255:x} {word & 255:x}")
            at += 40
        for _ in range(read):
            self.line(at, f"{chip} r 1 2")
            at += 40
        return at

    def pmd(self, at: float, command: int, *words: int, read: int = 0) -> float:
        """One MC1241A packet."""
        self.line(at, f"p w 1 {command:x}")
        at += 80
        for word in words:
            self.line(at, f"p w 0 {word >> 8 & 255:x} {word & 255:x}")
            at += 80
        for _ in range(read + 1):
            self.line(at, "p r 0 2")
            at += 80
        return at

    def mcp(self, at: float, *pairs: int) -> float:
        """Registers of the MCP-1200, address and byte in turn."""
        for address, data in zip(pairs[::2], pairs[1::2], strict=True):
            self.line(at, f"m w {address:x} {data:x}")
            at += 5
        return at


def scenario(end_ms: int = 20) -> str:
    """Return the scenario: both LM629 start at one instant, TRIG and /SYNC go between nodes."""
    s = Script()
    for chip in "xy":
        at = s.lm(100.125, chip, 0x1E, 0x000F, 300, 10, 2000, 100)
        at = s.lm(at, chip, 0x04)
        at = s.lm(at, chip, 0x1C, 0x0048)
        at = s.lm(at, chip, 0x21, 0, 150)
        at = s.lm(at, chip, 0x03)
        s.lm(at, chip, 0x1F, 0x00AA, 0, 4000, 8, 0, 0, 400)
    s.mcp(150.5, 0x04, 0x00, 0x02, 0x11, 0x01, 0x08, 0x61, 64, 0x63, 8, 0x05, 0x03)
    s.mcp(400.5, 0x3F, 0, 0x3E, 0, 0x3D, 60, 0x28, 12, 0x26, 0x40, 0x27, 0)
    s.mcp(500.5, 0x29, 0, 0x2A, 1, 0x2B, 0)
    s.mcp(1_700.5, 0x00, 0x08)
    at = s.pmd(120.25, 0x01)
    at = s.pmd(at, 0x74)
    at = s.pmd(at, 0x68, 0x0100)
    at = s.pmd(at, 0x77, 0x4000)
    at = s.pmd(at, 0x65)
    at = s.pmd(at, 0x10, 1, 0)
    at = s.pmd(at, 0x11, 20, 0)
    at = s.pmd(at, 0x12, 0, 0x8000)
    at = s.pmd(at, 0x16, 0, 40)
    at = s.pmd(at, 0x18)
    at = s.pmd(at, 0x2F, 0xFF)
    s.line(3_000, "x+y w 0 1")
    s.pmd(max(at, 3_000), 0x5B, 3)
    at = 4_000.0
    while at < 1000 * end_ms - 2_500:
        s.line(at, "x r 0")
        s.line(at, "y r 0")
        s.lm(at + 10, "x", 0x0A, read=2)
        s.lm(at + 15, "y", 0x09, read=2)
        s.line(at + 20, "m r 14 1")
        s.line(at + 25, "m r 13 1")
        s.line(at + 30, "m r 2e 1")
        s.line(at + 35, "m r 7 1")
        after = s.pmd(at + 30, 0x37, read=2)
        after = s.pmd(after, 0x36, read=2)
        s.pmd(after, 0x32, 0)
        s.mcp(at + 900, 0x07, 0)
        at += 2_000
    s.lm(at, "y", 0x1D, 0)
    s.line(at + 100, "y pin HI 1")
    s.line(at + 700, "y pin HI z")
    s.line(at + 800, "m pin TRIG 0")
    s.line(at + 1_100, "m pin TRIG z")
    s.lines.append(f"end {end_ms}ms")
    return "\n".join(s.lines) + "\n"


TWIN = {"a": "e", "b": "f", "c": "g", "d": "h", "x": "u", "y": "v", "m": "n", "p": "q"}
"""Nodes and chips of the second four, by those of the first."""


def _twins(text: str, names: str) -> str:
    """Return the same of the other four chips."""
    return re.sub(names, lambda found: TWIN.get(found[0], found[0]), text)


def eight() -> str:
    """Return a machine of eight nodes: four more with the same chips, on the same wires."""
    parts, _, nets = BOARD.partition("[nets]\n")
    more = _twins(parts[parts.index("[nodes.a]") :], r"\b[abcdxymp](?=[\"\]_])")
    wires = re.sub(r"\[(.*?)\]", lambda pins: f"[{pins[1]}, {_inputs(pins[1])}]", nets)
    return f"{parts}{more}[nets]\n{wires}"


def _inputs(pins: str) -> str:
    """Return the same pins of the other four, but for outputs, which would fight."""
    inputs = [pin for pin in pins.split(", ") if not pin.endswith(('.HI"', '.~HostIntrpt"'))]
    return _twins(", ".join(inputs), r"\b[xymp](?=\.)")


def eight_scenario() -> str:
    """Return what hosts do there: the same at all, a little later at the other four."""
    lines = scenario().splitlines()
    later = []
    for line in lines:
        at, chip, *rest = line.split(" ", 2)
        if chip in TWIN:
            later.append(f"{float(at.removesuffix('us')) + 3.75:.3f}us {TWIN[chip]} {rest[0]}")
    return "\n".join([*later, *lines, ""])
