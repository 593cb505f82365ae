"""Recordings for the page, written from the format alone: not by the encoder the project has."""

import base64
import json
import math
import struct
import zlib
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import vbus

PAGE = Path(next(iter(vbus.__path__))) / "views" / "scope" / "page"
DATA = (
    '<script type="application/json" id="description">{description}</script>\n'
    '<script type="application/octet-stream" id="recording">{recording}</script>\n'
)
MAIN = '<script type="module" src="page/main.js"></script>'

MS = 1_000_000_000
SECOND = 1000 * MS
SAMPLE = 256_000_000
"""Period of an LM629's samples at 8 MHz (ps)."""

COMMAND, WRITTEN, READ, STATUS, VIOLATION, OTHER = range(6)


def varints(values: Iterable[int]) -> bytes:
    coded = bytearray()
    before = 0
    for value in values:
        step = value - before
        before = value
        left = 2 * step if step >= 0 else -2 * step - 1
        while left > 127:
            coded.append(left % 128 + 128)
            left //= 128
        coded.append(left)
    return bytes(coded)


def column(values: Sequence[Any], kind: int) -> bytes:
    payload = {
        0: lambda: struct.pack(f"<{len(values)}d", *values),
        1: lambda: struct.pack(f"<{len(values)}i", *values),
        2: lambda: varints(values),
        3: lambda: bytes(values),
        4: lambda: json.dumps(values).encode(),
    }[kind]()
    return struct.pack("<B3xI", kind, len(payload)) + payload + bytes(-len(payload) % 8)


def frame(kind: int, lane: int, rows: int, first: int, *columns: bytes) -> bytes:
    return struct.pack("<BBHIQ", kind, len(columns), lane, rows, first) + b"".join(columns)


def samples(
    lane: int, ticks: Sequence[int], values: Sequence[float], types: tuple[int, int] = (2, 2)
) -> bytes:
    first = ticks[0]
    return frame(
        1, lane, len(ticks), first,
        column([tick - first for tick in ticks], types[0]), column(values, types[1]),
    )  # fmt: skip


def now(instant: int) -> bytes:
    return frame(5, 0xFFFF, 0, instant)


@dataclass
class Recording:
    """A description and the frames that go with it."""

    board: str = "bench"
    origin: int = 0
    live: bool = False
    control: bool = False
    axes: list[dict[str, Any]] = field(default_factory=list)
    lanes: list[dict[str, Any]] = field(default_factory=list)
    frames: list[bytes] = field(default_factory=list)
    labels: list[str] = field(default_factory=list)
    chips: list[dict[str, Any]] = field(default_factory=list)
    end: int = 0

    def axis(self, name: str, counts_per_rev: int | None = 2000) -> None:
        row = {"name": name, "part": "LM629N-8", "counts_per_rev": counts_per_rev}
        self.axes.append({**row, "counts": "counts"})

    def lane(
        self, axis: str | None, name: str, kind: str, title: str = "", *,
        unit: str = "", scale: float = 1.0, tick: int = 1, shape: str = "steps",
    ) -> int:  # fmt: skip
        number = len(self.lanes)
        self.lanes.append({
            "id": number, "axis": axis, "name": name, "title": title or name, "kind": kind,
            "unit": unit, "scale": scale, "tick": tick, "shape": shape,
        })  # fmt: skip
        return number

    def packets(self, lane: int, rows: Sequence[tuple[int, int, str, int]]) -> None:
        """Add packets: when each begins and ends, its label and its kind."""
        new = [label for label in dict.fromkeys(row[2] for row in rows) if label not in self.labels]
        if new:
            self.labels += new
            self.frames.append(frame(3, 0xFFFF, len(new), 0, column(new, 4)))
        places = {label: place for place, label in enumerate(self.labels)}
        first = rows[0][0]
        self.frames.append(
            frame(
                2, lane, len(rows), first,
                column([begin - first for begin, *_ in rows], 2),
                column([end - begin for begin, end, *_ in rows], 2),
                column([places[label] for _, _, label, _ in rows], 2),
                column([kind for *_, kind in rows], 3),
            )
        )  # fmt: skip

    def register(self, chip: str, name: str, rows: Sequence[tuple[int, int]], **more: Any) -> None:
        """Add a register of a chip with what it holds from when on."""
        lane = self.lane(None, f"{chip}: {name}", "register", name)
        self.frames.append(samples(lane, [at for at, _ in rows], [value for _, value in rows]))
        known = next((each for each in self.chips if each["name"] == chip), None)
        if known is None:
            known = {
                "name": chip, "part": "LM629N-8", "title": "LM628 and LM629", "kind": "controller",
                "registers": [], "addresses": [["0", "/PS low", "status byte", "command"]],
                "commands": [],
            }  # fmt: skip
            self.chips.append(known)
        known["registers"].append(
            {
                "lane": lane, "name": name, "title": name, "clause": "", "group": "status",
                "unit": "", "fraction": 0, "digits": 0, "moves": False, "fields": [], **more,
            }
        )  # fmt: skip

    def tables(self, words: Sequence[Any] = (), clauses: Sequence[Any] = ()) -> None:
        """Add what stands in tables: the chips so far, what values mean, clauses."""
        for kind, rows in ((6, self.chips), (7, words), (8, clauses)):
            self.frames.append(frame(kind, 0xFFFF, len(rows), 0, column(rows, 4)))

    def marks(self, lane: int, rows: Sequence[tuple[int, dict[str, Any]]]) -> None:
        first = rows[0][0]
        told = [
            {"rule": None, "clause": None, "label": None, "kind": "host", **mark}
            for _, mark in rows
        ]
        ticks = column([tick - first for tick, _ in rows], 2)
        self.frames.append(frame(4, lane, len(rows), first, ticks, column(told, 4)))

    def description(self) -> str:
        return json.dumps(
            {
                "format": 1, "vbus": "0.0", "board": self.board, "time": "lockstep",
                "live": self.live, "control": self.control, "origin": str(self.origin),
                "now": str(self.end), "axes": self.axes, "lanes": self.lanes,
            }
        )  # fmt: skip

    def page(self) -> str:
        """Return the page with the recording in it."""
        packer = zlib.compressobj(6, zlib.DEFLATED, -15)
        packed = packer.compress(b"".join([*self.frames, now(self.end)])) + packer.flush()
        data = DATA.format(
            description=self.description().replace("</", "<\\/"),
            recording=base64.b64encode(packed).decode(),
        )
        return (PAGE / "index.html").read_text().replace(MAIN, data + MAIN)


def sine(count: int, size: float, turns: float) -> list[int]:
    return [round(size * math.sin(2 * math.pi * turns * n / count)) for n in range(count)]


def bench() -> Recording:
    """Return four seconds of two axes: a circle, a step with overshoot, pins, packets, marks."""
    recording = Recording()
    count = 4 * SECOND // SAMPLE
    recording.end = count * SAMPLE
    ticks = list(range(count))
    for axis in "xy":
        recording.axis(axis)
    for turn, axis in enumerate("xy"):
        phase = turn * math.pi / 2
        desired = [round(2000 * math.sin(2 * math.pi * n / count * 2 + phase)) for n in ticks]
        error = [round(40 * math.sin(2 * math.pi * n / count * 5) * (n / count)) for n in ticks]
        real = [a - b for a, b in zip(desired, error, strict=True)]
        for name, title, values in (
            ("desired", "desired position", desired),
            ("real", "real position", real),
            ("error", "following error", error),
        ):
            lane = recording.lane(axis, name, "number", title, unit="counts", tick=SAMPLE)
            for at in range(0, count, 4096):
                part = slice(at, at + 4096)
                recording.frames.append(samples(lane, ticks[part], values[part]))
        lane = recording.lane(axis, "velocity", "number", "velocity", unit="counts/s", tick=SAMPLE)
        speed = [round(6283 * math.cos(2 * math.pi * n / count * 2 + phase)) for n in ticks]
        recording.frames.append(samples(lane, ticks, speed))
        lane = recording.lane(axis, "output", "number", "motor output", unit="%", tick=SAMPLE,
                              scale=100 / 128)  # fmt: skip
        recording.frames.append(samples(lane, ticks, [value // 100 for value in speed]))
    step = recording.lane(None, "step", "number", "step response", unit="V", tick=MS,
                          scale=0.001, shape="points")  # fmt: skip
    response = [
        0 if n < 1000 else round(5000 * (1 - math.exp(-(n - 1000) / 80)
                                         * math.cos((n - 1000) / 60)))
        for n in range(4000)
    ]  # fmt: skip
    recording.frames.append(samples(step, list(range(4000)), response))
    bus = recording.lane(None, "x bus", "packets", "x: packets")
    rows = []
    words = ("LTRJ acceleration 17, velocity 343597, position 2000", "STT", "RDRP 1234",
             "RDSTAT 00H", "LFIL kp 100, ki 0, kd 1500")  # fmt: skip
    kinds = (WRITTEN, COMMAND, READ, STATUS, WRITTEN)
    at = 10 * MS
    for n in range(1500):
        length = (12 if n % 5 in (0, 4) else 3) * 1_500_000
        kind = VIOLATION if n == 700 else kinds[n % 5]
        rows.append((at, at + length, words[n % 5], kind))
        at += 2_500_000_000 + (n % 7) * 1_000_000
    recording.packets(bus, rows)
    line = recording.lane(None, "x./HI", "line", "x./HI")
    edges = [n * 100 * MS + (n % 3) * MS for n in range(40)]
    recording.frames.append(samples(line, edges, [n % 2 if n < 30 else (2, 0, 1)[n % 3]
                                                  for n in range(40)]))  # fmt: skip
    fast = recording.lane(None, "x.PWM", "line", "x.PWM")
    recording.frames.append(samples(fast, [n * 64_000_000 for n in range(62500)],
                                    [n % 2 for n in range(62500)]))  # fmt: skip
    marks = recording.lane(None, "violations", "marks", "violations")
    recording.marks(marks, [
        (rows[700][0], {"text": "data written while busy", "kind": "violation",
                        "rule": "lm628.busy-write", "clause": "LM-BUS-7", "label": rows[700][2]}),
        (3 * SECOND, {"text": "reset too short", "kind": "violation",
                      "rule": "lm628.reset-width", "clause": "LM-RST-2"}),
    ])  # fmt: skip
    faults = recording.lane(None, "faults", "marks", "faults")
    recording.marks(faults, [(SECOND, {"text": "encoder loses A", "kind": "fault"})])
    return recording
