"""Frames read again, from what the format says alone."""

import base64
import json
import re
import struct
import zlib
from array import array
from collections import defaultdict
from dataclasses import dataclass
from typing import Any


@dataclass(frozen=True)
class Frame:
    kind: int
    lane: int
    rows: int
    first: int
    columns: list[list[Any]]


def column(type_: int, data: bytes) -> list[Any]:
    if type_ == 0:
        return array("d", data).tolist()
    if type_ == 1:
        return array("i", data).tolist()
    if type_ == 2:
        return _sums(data)
    return list(data) if type_ == 3 else json.loads(data)


def _sums(data: bytes) -> list[int]:
    found = []
    total = number = place = 0
    for byte in data:
        number |= (byte & 0x7F) << place
        place += 7
        if byte < 0x80:
            total += number >> 1 ^ -(number & 1)
            found.append(total)
            number = place = 0
    assert place == 0
    return found


def frames(data: bytes) -> list[Frame]:
    found = []
    at = 0
    while at < len(data):
        kind, columns, lane, rows, first = struct.unpack_from("<BBHIQ", data, at)
        at += 16
        values = []
        for _ in range(columns):
            type_, zeros, size = struct.unpack_from("<B3sI", data, at)
            assert zeros == bytes(3)
            values.append(column(type_, data[at + 8 : at + 8 + size]))
            assert len(values[-1]) == rows
            end = at + 8 + size
            at += 8 + (size + 7) // 8 * 8
            assert data[end:at] == bytes(at - end)
        found.append(Frame(kind, lane, rows, first, values))
    assert at == len(data)
    return found


class Seen:
    """What a page knows after some frames."""

    def __init__(self, description: dict[str, Any], data: bytes) -> None:
        self.description = description
        self.names = {
            lane["id"]: f"{lane['axis']}.{lane['name']}" if lane["axis"] else lane["name"]
            for lane in description["lanes"]
        }
        self.drawn = [
            self.names[lane["id"]] for lane in description["lanes"] if lane["kind"] != "register"
        ]
        self.labels: list[str] = []
        self.cycles: list[str] = []
        self.chips: list[dict[str, Any]] = []
        self.words: dict[tuple[int, int], str] = {}
        self.clauses: list[dict[str, Any]] = []
        self.rows: dict[str, list[tuple[Any, ...]]] = defaultdict(list)
        self.now = -1
        for frame in frames(data):
            if frame.kind == 3:
                self.labels += frame.columns[0]
                self.cycles += frame.columns[1]
            elif frame.kind == 6:
                self.chips = frame.columns[0]
            elif frame.kind == 7:
                self.words |= {(lane, value): text for lane, value, text in frame.columns[0]}
            elif frame.kind == 8:
                self.clauses += frame.columns[0]
            elif frame.kind == 5:
                assert (frame.rows, frame.lane) == (0, 0xFFFF)
                self.now = frame.first
            else:
                ticks = [frame.first + tick for tick in frame.columns[0]]
                assert ticks == sorted(ticks)
                others = frame.columns[1:]
                self.rows[self.names[frame.lane]] += zip(ticks, *others, strict=True)

    def register(self, chip: str, name: str) -> dict[str, Any]:
        """What is told of a register."""
        (known,) = (one for one in self.chips if one["name"] == chip)
        (row,) = (one for one in known["registers"] if one["name"] == name)
        return row

    def held(self, chip: str, name: str) -> list[tuple[int, int]]:
        """What a register held, from when on."""
        return [
            (at, value) for at, value in self.rows[self.names[self.register(chip, name)["lane"]]]
        ]

    def packets(self, lane: str) -> list[tuple[int, int, str, int]]:
        return [(at, span, self.labels[n], kind) for at, span, n, kind, _ in self.rows[lane]]


def of_page(page: bytes) -> Seen:
    text = page.decode()
    told = re.search(r'<script type="application/json" id="description">(.*?)</script>', text)
    data = re.search(r'<script type="application/octet-stream" id="recording">(.*?)</script>', text)
    assert told is not None
    assert data is not None
    inflated = zlib.decompress(base64.b64decode(data[1]), -zlib.MAX_WBITS)
    return Seen(json.loads(told[1]), inflated)
