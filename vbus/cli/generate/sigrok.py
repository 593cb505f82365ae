"""Makes the sigrok decoders: their tables, copies of the decoders here, and sigrok's own part."""

import inspect
import re
from collections.abc import Callable
from functools import partial
from importlib import import_module
from typing import Any, Final

from vbus.chips.bus_watch import BusTable
from vbus.chips.family import Family
from vbus.chips.packets import Decoder
from vbus.chips.tables import CommandTable, RegisterMap

_HEAD: Final = (
    "# SPDX-License-Identifier: GPL-3.0-or-later\n"
    "# Made by vbus.cli.generate from {}; change that, or the generator.\n"
)
_COPIES: Final = {
    "vbus.core.row_table": "row_table",
    "vbus.chips.tables": "tables",
    "vbus.chips.packets": "packets",
    "vbus.chips.bus_watch": "bus_watch",
}
"""Modules of vbus that a decoder brings with it, and what they are called there."""

_PD: Final = '''"""sigrok's part: channels in, annotations out."""

import sigrokdecode as srd

from .decoder import {packets}
from .watch import BUS, watch_by

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
        self.watch = watch_by(BUS)
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


def _names(family: Family) -> tuple[str, str]:
    """Return the short name and the long one of a decoder."""
    short, _, _ = (family.title or family.name).partition(" and ")
    return short, f"{(family.title or family.name).replace(' and ', '/')} {family.kind}".rstrip()


def _pd(family: Family, bus: BusTable, packets: type[Decoder]) -> str:
    name, title = _names(family)
    plain = (re.sub(r"\W", "", pin).lower() for pin in bus.lines)
    text = _PD.format(
        packets=packets.__name__,
        control=tuple(zip(family.channels or plain, bus.lines, strict=True)),
        family=family.name,
        name=name,
        title=title,
    )
    return _HEAD.format("its own template") + text


def _init(family: Family) -> str:
    _, title = _names(family)
    return _HEAD.format("its own template") + (
        f'"""\nThe host bus of the {title}.\n\n'
        "Shows bus cycles, packets with their values in the manual's words, and status reads.\n"
        f'"""\n\nfrom .pd import Decoder\n'
    )


def _source(module: str) -> tuple[str, str]:
    """Return the path of a module, as imports have it, and its text."""
    found = inspect.getsource(import_module(module))
    return f"{module.replace('.', '/')}.py", found


def _copy(module: str) -> str:
    """Return a module's source with its imports made relative."""
    path, text = _source(module)
    # sigrok loads a decoder from its own folder: an absolute import would need vbus in its Python.
    text = re.sub(r"from [\w.]+ import datasheet as ds", "from . import tables as ds", text)
    text = text.replace(
        "from vbus.core.signals import HIGH, LOW, Z\n", "\nHIGH, LOW, Z = 1, 0, -1\n"
    )
    # Copies import each other by their names there.
    for home, name in _COPIES.items():
        text = text.replace(f"from {home} import", f"from .{name} import")
    return _HEAD.format(path) + text


def _decoder(family: Family, packets: type[Decoder]) -> str:
    """Return a copy of the decoder, or one of the register map alone."""
    if family.packets:
        return _copy(packets.__module__)
    return _HEAD.format("its register map") + (
        f'"""{family.title}: its registers."""\n\nfrom . import tables as ds\n'
        f"from .packets import packets_of\n\nPackets = packets_of({family.name!r}, ds.REGISTERS)\n"
    )


def _tables(family: Family, packets: type[Decoder]) -> str:
    """Return the rows of the datasheet that the decoder uses."""
    source = _decoder(family, packets)
    # Only tables that the decoder reads: the rest of a datasheet module imports half of vbus.
    used = sorted(set(re.findall(r"\bds\.([A-Z][A-Z0-9_]*)", source)))
    path, rows = _source("vbus.chips.tables")
    rows = rows.replace("from vbus.core.signals import HIGH\n", "\nHIGH = 1\n")
    rows = rows.replace("from vbus.core.row_table import", "from .row_table import")
    datasheet = family.tables
    if datasheet is not None:
        path += f" and {datasheet.__name__.replace('.', '/')}.py"
    lines = [f"{name} = {_literal(getattr(datasheet, name))}" for name in used]
    return _HEAD.format(path) + rows + "\n\n" + "\n".join(lines) + "\n"


def _watch(bus: BusTable) -> str:
    """Return the bus table of the chip."""
    return _HEAD.format("its datasheet.py") + (
        f"from .bus_watch import BusTable, Strobe, watch_by\n\nBUS = {bus!r}\n"
    )


def _literal(value: Any) -> str:
    if isinstance(value, CommandTable | RegisterMap):
        size = f"    {value.size},\n" if isinstance(value, RegisterMap) else ""
        rows = "".join(f"    {row!r},\n" for row in value)
        return f"{type(value).__name__}(\n{size}{rows})"
    # Sorted: the repr of a set differs from run to run.
    if isinstance(value, frozenset):
        return f"frozenset({sorted(value)!r})"
    return repr(value)


def decoder_targets(family: Family, folder: str) -> list[tuple[str, Callable[[], str]]]:
    """Return the files of a family's decoder below ``folder``; none if its bus is not known."""
    bus = getattr(family.tables, "BUS", None)
    packets = family.load("packets", Decoder)
    if bus is None or packets is None:
        return []
    folder = f"{folder}/vbus_{family.name}"
    return [
        (f"{folder}/__init__.py", partial(_init, family)),
        (f"{folder}/pd.py", partial(_pd, family, bus, packets)),
        (f"{folder}/tables.py", partial(_tables, family, packets)),
        *(
            (f"{folder}/{name}.py", partial(_copy, home))
            for home, name in _COPIES.items()
            if name != "tables"
        ),
        (f"{folder}/watch.py", partial(_watch, bus)),
        (f"{folder}/decoder.py", partial(_decoder, family, packets)),
    ]
