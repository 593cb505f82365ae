"""Makes the sigrok decoders: their tables, copies of the decoders here, and sigrok's own part."""

import importlib
import re
from collections.abc import Callable
from functools import partial
from typing import Any, Final

from vbus.chips.tables import CommandTable, RegisterMap
from vbus.tools.generate.layout import ROOT
from vbus.trace.bus_watch import WATCHES
from vbus.trace.decode import FAMILIES, decoder_of

_HEAD: Final = (
    "# SPDX-License-Identifier: GPL-3.0-or-later\n"
    "# Made by vbus.tools.generate from {}; change that, or the generator.\n"
)
_CHANNELS: Final = {
    "lm628": ("cs", "ps", "rd", "wr"),
    "mc1241a": ("slct", "cmd", "read", "write"),
    "mcp1200": ("ale", "cs", "oe", "rw"),
}
"""sigrok's names of the control lines, in the order of the watch's."""
_TITLES: Final = {
    "lm628": ("LM628", "LM628/LM629 motion controller"),
    "mc1241a": ("MC1241A", "MC1241A/MC1141A stepper motion controller"),
    "mcp1200": ("MCP-1200", "MCP-1200 motion controller"),
}

_PD: Final = '''"""sigrok's part: channels in, annotations out."""

import sigrokdecode as srd

from .decoder import {packets}
from .watch import {watch}

CONTROL = {control!r}
CYCLE, PACKET, STATUS, PROBLEM = range(4)
ROWS = {{"packet": PACKET, "status": STATUS}}


class Decoder(srd.Decoder):
    """Bus cycles of one chip, and what they say."""

    api_version = 3
    id = "vbus_{family}"
    name = "{name}"
    longname = "{title} (vbus)"
    desc = "Host bus of the {title}."
    license = "gplv3+"
    inputs = ["logic"]
    outputs = []
    tags = ["Embedded/industrial"]
    channels = tuple(
        {{"id": key, "name": pin, "desc": pin}} for key, pin in CONTROL
    ) + tuple({{"id": f"d{{n}}", "name": f"D{{n}}", "desc": f"Data line {{n}}"}} for n in range(8))
    annotations = (
        ("cycle", "Bus cycle"),
        ("packet", "Packet"),
        ("status", "Status read"),
        ("problem", "Cut, unknown or unexpected"),
    )
    annotation_rows = (
        ("cycles", "Bus cycles", (CYCLE,)),
        ("packets", "Packets", (PACKET, PROBLEM)),
        ("statuses", "Status reads", (STATUS,)),
    )

    def __init__(self):
        """Begin anew."""
        self.reset()

    def reset(self):
        """Forget everything."""
        self.watch = {watch}()
        self.packets = {packets}()

    def start(self):
        """Register what is put out."""
        self.out = self.register(srd.OUTPUT_ANN)

    def decode(self):
        """Go from change to change."""
        count = len(CONTROL)
        pins = self.wait()
        edges = [{{number: "e"}} for number in range(count + 8)]
        while True:
            levels = tuple(pins[:count])
            data = sum(level << bit for bit, level in enumerate(pins[count : count + 8]))
            for cycle in self.watch.change(self.samplenum, levels, data):
                self.put(cycle.when, cycle.when, self.out, [CYCLE, [str(cycle)]])
                for packet in self.packets.feed(cycle):
                    row = ROWS.get(packet.kind, PROBLEM)
                    text = [packet.text, packet.name]
                    self.put(packet.begin, packet.end, self.out, [row, text])
            pins = self.wait(edges)
'''


def _pd(family: str) -> str:
    name, title = _TITLES[family]
    text = _PD.format(
        packets=type(decoder_of(family)).__name__,
        watch=WATCHES[family].__name__,
        control=tuple(zip(_CHANNELS[family], WATCHES[family].PINS, strict=True)),
        family=family,
        name=name,
        title=title,
    )
    return _HEAD.format("its own template") + text


def _init(family: str) -> str:
    _, title = _TITLES[family]
    return _HEAD.format("its own template") + (
        f'"""\nThe host bus of the {title}.\n\n'
        "Shows bus cycles, packets with their values in the manual's words, and status reads.\n"
        f'"""\n\nfrom .pd import Decoder\n'
    )


def _copy(path: str) -> str:
    """Return a source file with imports of vbus made relative."""
    text = (ROOT / path).read_text()
    tables = "from . import tables as ds"
    text = re.sub(r"from vbus\.chips\.\w+ import datasheet as ds", tables, text)
    text = text.replace("from vbus.chips.tables import", "from .tables import")
    text = text.replace("from vbus.trace.packets import", "from .packets import")
    return _HEAD.format(path) + text


def _tables(family: str) -> str:
    """Return the rows of the datasheet that the decoder uses."""
    source = (ROOT / "vbus" / "trace" / f"{family}_packets.py").read_text()
    used = sorted(set(re.findall(r"\bds\.([A-Z][A-Z0-9_]*)", source)))
    sheet = importlib.import_module(f"vbus.chips.{family}.datasheet")
    rows = (ROOT / "vbus" / "chips" / "tables.py").read_text()
    rows = rows.replace("from vbus.signals import HIGH\n", "HIGH = 1\n")
    lines = [f"{name} = {_literal(getattr(sheet, name))}" for name in used]
    source_name = f"vbus/chips/tables.py and vbus/chips/{family}/datasheet.py"
    return _HEAD.format(source_name) + rows + "\n\n" + "\n".join(lines) + "\n"


def _literal(value: Any) -> str:
    if isinstance(value, CommandTable | RegisterMap):
        size = f"    {value.size},\n" if isinstance(value, RegisterMap) else ""
        rows = "".join(f"    {row!r},\n" for row in value)
        return f"{type(value).__name__}(\n{size}{rows})"
    if isinstance(value, frozenset):
        return f"frozenset({sorted(value)!r})"
    return repr(value)


def targets() -> list[tuple[str, Callable[[], str]]]:
    """Return the files of all decoders."""
    made: list[tuple[str, Callable[[], str]]] = []
    for family in FAMILIES:
        folder = f"contrib/sigrok/vbus_{family}"
        made += [
            (f"{folder}/__init__.py", partial(_init, family)),
            (f"{folder}/pd.py", partial(_pd, family)),
            (f"{folder}/tables.py", partial(_tables, family)),
            (f"{folder}/packets.py", partial(_copy, "vbus/trace/packets.py")),
            (f"{folder}/watch.py", partial(_copy, "vbus/trace/bus_watch.py")),
            (f"{folder}/decoder.py", partial(_copy, f"vbus/trace/{family}_packets.py")),
        ]
    return made
