# SPDX-License-Identifier: GPL-3.0-or-later
# Made by vbus.tools.generate from its own template; change that, or the generator.
"""sigrok's part: channels in, annotations out."""

import sigrokdecode as srd

from .decoder import Lm628Decoder
from .watch import Lm628Watch

CONTROL = (('cs', '/CS'), ('ps', '/PS'), ('rd', '/RD'), ('wr', '/WR'))
CYCLE, PACKET, STATUS, PROBLEM = range(4)
ROWS = {"packet": PACKET, "status": STATUS}


class Decoder(srd.Decoder):
    """Bus cycles of one chip, and what they say."""

    api_version = 3
    id = "vbus_lm628"
    name = "LM628"
    longname = "LM628/LM629 motion controller (vbus)"
    desc = "Host bus of the LM628/LM629 motion controller."
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
        self.watch = Lm628Watch()
        self.packets = Lm628Decoder()

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
