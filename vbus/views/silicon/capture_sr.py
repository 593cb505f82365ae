"""Captures as sigrok session files: a zip archive of samples at a constant rate."""

import configparser
import lzma
import zipfile
import zlib
from collections.abc import Iterator
from typing import BinaryIO, Final

from vbus.core.errors import CaptureError
from vbus.core.kernel import SECOND
from vbus.views.silicon.capture import Capture, Sample, frequency, ordered, period_of

LARGEST_TEXT: Final = 1 << 20
"""Bytes of a session's metadata, unpacked; its samples go by in blocks."""
# 512 channels: no analyser has more.
LARGEST_UNIT: Final = 64
"""Bytes of a sample."""
_DAMAGE: Final = (
    zipfile.BadZipFile, zlib.error, lzma.LZMAError, EOFError, OSError,
    NotImplementedError, RuntimeError,  # packed in an unknown way, or encrypted
    ValueError,  # members that begin before the file, or in the midst of a character
)  # fmt: skip
# Large beside the cost of a call, small beside memory.
_BLOCK: Final = 1 << 20
"""Bytes read at a time."""
# Halved down to one sample where something happens: 12 comparisons for each change.
_RUN: Final = 4096
"""Samples compared at a time: most of a capture is nothing happening."""


def read_sr(file: BinaryIO, name: str) -> Capture:
    """Read a sigrok session file (version 2) as it goes by.

    Raises:
        CaptureError: it is none, or has no logic samples.
    """
    try:
        archive = zipfile.ZipFile(file)
        version = _member(archive, "version").strip()
        text = _member(archive, "metadata").decode()
    except (*_DAMAGE, KeyError) as error:
        raise CaptureError(f"{name}: this is no sigrok session file: {error}") from None
    if version != b"2":
        raise CaptureError(
            f"{name}: a sigrok session file of version {version.decode('ascii', 'replace')};"
            " version 2 can be read"
        )
    metadata = configparser.ConfigParser(interpolation=None)
    try:
        metadata.read_string(text)
    except configparser.Error as error:
        raise CaptureError(f"{name}: its metadata make no sense: {error}") from None
    sections = (metadata[title] for title in metadata.sections())
    device = next((section for section in sections if "capturefile" in section), None)
    if device is None:
        raise CaptureError(f"{name}: there are no logic samples in it")
    hertz = frequency(device.get("samplerate", ""), name)
    unit = _number(device.get("unitsize", ""))
    probes = {
        _number(key[5:]): value
        for key, value in device.items()
        if key.startswith("probe") and _number(key[5:])
    }
    if not hertz or not unit or not probes:
        raise CaptureError(f"{name}: its metadata lack samplerate, unitsize or the probes' names")
    if unit > LARGEST_UNIT:
        raise CaptureError(f"{name}: samples of {unit} bytes; there are at most {LARGEST_UNIT}")
    if max(probes) > 8 * unit:
        raise CaptureError(f"{name}: {max(probes)} probes do not fit into {unit} bytes")
    channels = [probes.get(n, f"probe{n}") for n in range(1, max(probes) + 1)]
    parts = _parts(archive, device["capturefile"])
    if not parts:
        raise CaptureError(f"{name}: the samples, {device['capturefile']}, are missing")
    samples = _samples(archive, parts, unit, hertz, (1 << len(channels)) - 1, name)
    return Capture(channels, period_of(hertz), ordered(samples, name))


def _member(archive: zipfile.ZipFile, name: str) -> bytes:
    """Return a small member of the archive.

    Raises:
        zipfile.BadZipFile: it unpacks to more than it may.
    """
    with archive.open(name) as stream:
        text = stream.read(LARGEST_TEXT + 1)
    if len(text) > LARGEST_TEXT:
        raise zipfile.BadZipFile(f"its {name} unpacks to more than {LARGEST_TEXT} bytes")
    return text


def _parts(archive: zipfile.ZipFile, stem: str) -> list[str]:
    """Return the members that hold the samples, in order."""
    names = archive.namelist()
    if stem in names:
        return [stem]
    numbers = [_number(name[len(stem) + 1 :]) for name in names if name.startswith(f"{stem}-")]
    return [f"{stem}-{number}" for number in sorted(filter(None, numbers))]


def _number(text: str) -> int:
    """Return a number from 1 on; 0 if the text is none, or none that a capture has."""
    return int(text) if text.isdecimal() and len(text) <= 9 else 0


def _samples(
    archive: zipfile.ZipFile, parts: list[str], unit: int, hertz: int, mask: int, name: str
) -> Iterator[Sample]:
    """Give the samples that differ from the one before: instant (ps), and the channels as bits.

    Raises:
        CaptureError: the archive is damaged.
    """
    number = 0  # of the first sample of this block
    current = b""
    rest = b""  # the beginning of a sample that a block has cut
    try:
        for part in parts:
            with archive.open(part) as stream:
                while block := stream.read(_BLOCK):
                    data = rest + block
                    whole = len(data) // unit
                    for place in _changes(data, unit, whole, current):
                        current = data[place * unit : (place + 1) * unit]
                        when = (number + place) * SECOND // hertz
                        yield when, int.from_bytes(current, "little") & mask
                    number += whole
                    rest = data[whole * unit :]
    except _DAMAGE as error:
        raise CaptureError(f"{name}: damaged after {number} samples: {error}") from None


def _changes(data: bytes, unit: int, count: int, current: bytes) -> Iterator[int]:
    """Give the numbers of the samples that differ from the one before."""
    place = 0
    while place < count:
        run = current * _RUN
        size = _RUN if current else 0
        while size:
            if data[place * unit : (place + size) * unit] == run:
                place += size
            else:
                size >>= 1
                run = run[: size * unit]
        if place < count:
            current = data[place * unit : (place + 1) * unit]
            yield place
            place += 1
