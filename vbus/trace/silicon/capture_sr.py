"""Captures as sigrok session files: a zip archive of samples at a constant rate."""

import configparser
import zipfile
import zlib
from collections.abc import Iterator
from typing import BinaryIO, Final

from vbus.errors import CaptureError
from vbus.kernel import SECOND
from vbus.trace.silicon.capture import Capture, Sample, frequency, ordered, period_of

_BLOCK: Final = 1 << 20
"""Bytes read at a time."""
_RUN: Final = 4096
"""Samples compared at a time: most of a capture is nothing happening."""


def read_sr(file: BinaryIO, name: str) -> Capture:
    """Read a sigrok session file (version 2) as it goes by.

    Raises:
        CaptureError: it is none, or has no logic samples.
    """
    try:
        archive = zipfile.ZipFile(file)
        version = archive.read("version").strip()
        text = archive.read("metadata").decode()
    except (zipfile.BadZipFile, KeyError, OSError, zlib.error, UnicodeDecodeError) as error:
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
    hertz = frequency(device.get("samplerate", ""))
    unit = device.getint("unitsize", 0) if device.get("unitsize", "").isdigit() else 0
    probes = {
        int(key[5:]): value
        for key, value in device.items()
        if key.startswith("probe") and key[5:].isdigit()
    }
    if not hertz or not unit or not probes:
        raise CaptureError(f"{name}: its metadata lack samplerate, unitsize or the probes' names")
    channels = [probes.get(n, f"probe{n}") for n in range(1, max(probes) + 1)]
    if len(channels) > 8 * unit:
        raise CaptureError(f"{name}: {len(channels)} probes do not fit into {unit} bytes")
    parts = _parts(archive, device["capturefile"])
    if not parts:
        raise CaptureError(f"{name}: the samples, {device['capturefile']}, are missing")
    samples = _samples(archive, parts, unit, hertz, (1 << len(channels)) - 1, name)
    return Capture(channels, period_of(hertz), ordered(samples, name))


def _parts(archive: zipfile.ZipFile, stem: str) -> list[str]:
    """Return the members that hold the samples, in order."""
    names = archive.namelist()
    if stem in names:
        return [stem]
    numbers = [
        int(name[len(stem) + 1 :])
        for name in names
        if name.startswith(f"{stem}-") and name[len(stem) + 1 :].isdigit()
    ]
    return [f"{stem}-{number}" for number in sorted(numbers)]


def _samples(
    archive: zipfile.ZipFile, parts: list[str], unit: int, hertz: int, mask: int, name: str
) -> Iterator[Sample]:
    number = 0
    current = b""
    rest = b""
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
    except (zipfile.BadZipFile, zlib.error, EOFError, OSError) as error:
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
