# SPDX-License-Identifier: GPL-3.0-or-later
# Made by vbus.tools.generate from its own template; change that, or the generator.
"""sigrok's part: channels in, annotations out."""

import sigrokdecode as srd

from .decoder import Mcp1200Decoder
from .watch import Mcp1200Watch

CONTROL = (('ale', '/ALE'), ('cs', '/CS'), ('oe', '/OE'), ('rw', 'R/W'))
CYCLE, PACKET, STATUS, PROBLEM = range(4)
ROWS = {"packet": PACKET, "status": STATUS}


class Decoder(srd.Decoder):
    """Bus cycles of one chip, and what they say."""

    api_version = 3
    id = "vbus_mcp1200"
    name = "MCP-1200"
    longname = "MCP-1200 motion controller (vbus)"
    desc = "Host bus of the MCP-1200 motion controller."
    license = "gplv3+"
    inputs = ["logic"]
    outputs = []
    tags = ["Embedded/industrial"]
    channels = tuple(
        {"id": key, "name": pin, "desc": pin} for key, pin in CONTROL
    ) + tuple({"id": f"d{n}", "name": f"D{n}", "desc": f"Data line {n}"} for n in range(8))
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
        self.watch = Mcp1200Watch()
        self.packets = Mcp1200Decoder()

    def start(self):
        """Register what is put out."""
        self.out = self.register(srd.OUTPUT_ANN)

    def decode(self):
        """Go from change to change."""
        count = len(CONTROL)
        pins = self.wait()
        edges = [{number: "e"} for number in range(count + 8)]
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
