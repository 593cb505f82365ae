"""Draws where each chip sits between its host and its motor: ``make.py`` writes the pictures."""

from collections.abc import Iterable
from html import escape
from typing import Final, NamedTuple

WIDTH, HEIGHT = 640, 330
_HOST, _CHIP, _POWER = (10, 96), (240, 142), (484, 146)
"""Left edge and width of each column."""

_ROWS: Final = (14, 128, 242)
"""Upper edge of each row of boxes."""

_BOX: Final = 74


class Drawing(NamedTuple):
    """What a picture says.

    Attributes:
        chip: names in the box of the chip.
        bus: lines between host and chip; what stands above the arrow, and below it.
        output: pins from the chip to what drives the motor.
        power: what drives the motor.
        motor: the motor.
        feedback: pins of the encoder at the chip; above the arrow, and below it.
        inputs: pins of switches, and of other parts.
        interrupt: pin that interrupts the host.
    """

    chip: tuple[str, ...]
    bus: tuple[str, str]
    output: tuple[str, ...]
    power: tuple[str, ...]
    motor: tuple[str, ...]
    feedback: tuple[str, str]
    inputs: tuple[str, ...]
    interrupt: str


DRAWINGS: Final = {
    "lm628": Drawing(
        ("LM628, LM629", "profile + PID"),
        ("D0-D7", "/CS /PS /RD /WR"),
        ("MAG, SIGN", "DAC0-DAC7"),
        ("Amplifier",),
        ("Brushed motor", "and load"),
        ("A, B", "/IN"),
        (),
        "HI",
    ),
    "mcp1200": Drawing(
        ("MCP-1200", "profile + filter"),
        ("DB0-DB7", "/ALE /CS /OE R/W"),
        ("PULSE, SIGN", "MC0-MC11"),
        ("Amplifier", "or step driver"),
        ("Motor", "and load"),
        ("CHA, CHB", "INDEX"),
        ("/LIMIT", "/STOP"),
        "",
    ),
    "mc1241a": Drawing(
        ("MC1241A", "profile +", "microsteps"),
        ("D0-D7", "~HostSlct ..."),
        ("PWM outputs", "or DAC bus"),
        ("Two bridges", "for each axis"),
        ("Stepper motor", "and load"),
        ("QuadA1, QuadB1", "~Index1"),
        ("~Home1", "PosLimit1", "NegLimit1"),
        "~HostIntrpt",
    ),
}
"""The picture of each chip family."""


def _box(column: tuple[int, int], row: int, lines: Iterable[str], fill: str) -> str:
    left, width = column
    rows = list(lines)
    top = _ROWS[row]
    first = top + _BOX / 2 - 10 * (len(rows) - 1) + 5
    texts = "".join(
        f'<text x="{left + width / 2:g}" y="{first + 20 * number:g}" text-anchor="middle"'
        f' font-weight="{"normal" if number else "bold"}">{escape(line)}</text>'
        for number, line in enumerate(rows)
    )
    return (
        f'<rect x="{left}" y="{top}" width="{width}" height="{_BOX}" rx="6" fill="{fill}"'
        f' stroke="#5b6472"/>{texts}'
    )


def _arrow(path: str, both: bool = False) -> str:
    start = ' marker-start="url(#tip)"' if both else ""
    return f'<path d="{path}" fill="none" stroke="#334155"{start} marker-end="url(#tip)"/>'


def _pins(x: float, y: float, text: str, anchor: str = "middle") -> str:
    return (
        f'<text x="{x:g}" y="{y:g}" text-anchor="{anchor}" font-family="monospace"'
        f' font-size="13">{escape(text)}</text>'
    )


def draw(drawing: Drawing) -> str:
    """Return the picture as SVG."""
    host, chip = (left + width for left, width in (_HOST, _CHIP))
    bus, feed = _ROWS[0] + _BOX / 2, _CHIP[0] + 100
    top, axis = _ROWS[0] + _BOX, _POWER[0] + _POWER[1] / 2
    encoder = _ROWS[2] + _BOX / 2
    parts = [
        _box(_HOST, 0, ("Host", "your driver"), "#e0ecff"),
        _box(_CHIP, 0, drawing.chip, "#fde8c8"),
        _box(_POWER, 0, drawing.power, "#eef1f5"),
        _box(_POWER, 1, drawing.motor, "#eef1f5"),
        _box(_POWER, 2, ("Encoder",), "#eef1f5"),
        _arrow(f"M{host + 3} {bus:g}H{_CHIP[0] - 3}", both=True),
        _pins((host + _CHIP[0]) / 2, bus - 10, drawing.bus[0]),
        _pins((host + _CHIP[0]) / 2, bus + 20, drawing.bus[1]),
        _arrow(f"M{chip} {bus:g}H{_POWER[0] - 3}"),
        _pins((chip + _POWER[0]) / 2, bus - 10, drawing.output[0]),
        _pins((chip + _POWER[0]) / 2, bus + 20, drawing.output[1]),
        _arrow(f"M{axis:g} {top}V{_ROWS[1] - 3}"),
        _arrow(f"M{axis:g} {_ROWS[1] + _BOX}V{_ROWS[2] - 3}"),
        _arrow(f"M{_POWER[0]} {encoder:g}H{feed}V{top + 3}"),
        _pins((feed + _POWER[0]) / 2, encoder - 10, drawing.feedback[0]),
        _pins((feed + _POWER[0]) / 2, encoder + 20, drawing.feedback[1]),
    ]
    if drawing.interrupt:
        low = top + 40
        parts += [
            _arrow(f"M{_CHIP[0] + 30} {top}V{low}H{_HOST[0] + 50}V{top + 3}"),
            _pins((host + _CHIP[0]) / 2, low - 6, drawing.interrupt),
        ]
    if drawing.inputs:
        left = _CHIP[0] + 60
        parts += [
            _arrow(f"M{left} {_ROWS[1] + 60}V{top + 3}"),
            f'<text x="{left}" y="{_ROWS[1] + 78}" text-anchor="middle">Switches</text>',
            *(
                _pins(left - 8, _ROWS[1] + 58 - 16 * number, pin, "end")
                for number, pin in enumerate(reversed(drawing.inputs))
            ),
        ]
    return "\n".join(
        [
            f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {WIDTH} {HEIGHT}"'
            ' font-family="sans-serif" font-size="15" fill="#1f2937">',
            '<defs><marker id="tip" viewBox="0 0 10 10" refX="8" refY="5" markerWidth="8"'
            ' markerHeight="8" orient="auto-start-reverse"><path d="M0 0L10 5L0 10z"'
            ' fill="#334155"/></marker></defs>',
            f'<rect width="{WIDTH}" height="{HEIGHT}" rx="8" fill="#ffffff"/>',
            *parts,
            "</svg>\n",
        ]
    )
