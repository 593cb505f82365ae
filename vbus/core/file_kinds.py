"""What a file is that was given in the place of another: by how it begins."""

import re
from pathlib import Path
from typing import Final, NamedTuple

_PLAIN: Final = frozenset(b"\t\n\r" + bytes(range(32, 127)))
HEAD: Final = 4096
"""Bytes of a file by which its kind is known."""


class _FileKind(NamedTuple):
    """A kind of file.

    Attributes:
        begins: how one begins: a pattern, compiled when a file is in the place of another.
        what: what it is called.
        use: what to do with one, ``{}`` being its name.
        guarded: whether only an output of this kind may replace one.
    """

    begins: bytes
    what: str
    use: str
    guarded: bool = False


_KINDS: Final = (
    _FileKind(rb"vbus journal ", "a journal of vbus", '"vbus explain {}" reads it', True),
    _FileKind(
        rb"vbus (machine )?snapshot\n", "a snapshot of vbus", '"vbus snap info {}" reads it', True
    ),
    _FileKind(rb"\d+ \d+ \S[^\n]*\n", "a trace of nodes", '"vbus trace {}" reads it'),
    _FileKind(
        rb"\x7fELF", "a program (ELF)", '"vbus exec --board FILE -- {}" runs it on a board', True
    ),
    _FileKind(
        rb"\s*\$(date|version|comment|timescale|scope|var)\b", "a waveform (VCD)",
        '"vbus conform CHIP {}" compares a capture with the model; GTKWave and Surfer show it',
    ),
    _FileKind(
        rb"PK\x03\x04", "a zip archive, as captures of sigrok (.sr) are",
        '"vbus conform CHIP {}" compares a capture with the model',
    ),
    _FileKind(
        rb"\xa1\xb2[\xc3\x3c][\xd4\x4d]|[\xd4\x4d][\xc3\x3c]\xb2\xa1|\x0a\x0d\x0d\x0a",
        "a capture of network packets (pcap)", "vbus reads none",
    ),
    _FileKind(rb"\x89MCAP0\r\n", "an MCAP file", "Foxglove shows it"),
    _FileKind(rb"\x1f\x8b", "compressed (gzip)", "gunzip it first"),
    _FileKind(rb"\s*<(!doctype html|!DOCTYPE html|html)", "a page (HTML)", "a browser shows it"),
    _FileKind(
        rb"(\s|#[^\n]*\n)*\[+(board|chips|plants|hosts|nodes)\b", "a board file (TOML)",
        '"vbus run {}" runs it, "vbus check {}" names its mistakes', True,
    ),
    _FileKind(
        rb"(\s|#[^\n]*\n)*\[+suppress\b", "a list of accepted violations (TOML)",
        "it goes with --suppress", True,
    ),
    _FileKind(rb"\s*[{\[]", "JSON, or like it", ""),
)  # fmt: skip


def looks_like(name: object, head: bytes) -> str:
    """Return what a file looks like, and what to do with it.

    Args:
        name: of the file, as people write it.
        head: its first :data:`HEAD` bytes, or all there are.
    """
    if not head:
        return "it is empty"
    kind = _kind_of(head)
    if kind is not None:
        use = kind.use.format(name, name)
        return f"it looks like {kind.what}" + (f"; {use}" if use else "")
    try:
        text = head[: HEAD - 4].decode()
    except UnicodeDecodeError:
        return _other_text(head)
    if not all(letter.isprintable() or letter.isspace() for letter in text):
        return _binary(head)
    first = next(iter(text.strip().splitlines()), "")
    return f'it looks like text, and begins with "{first[:20]}"'


def _kind_of(head: bytes) -> _FileKind | None:
    return next((kind for kind in _KINDS if re.match(kind.begins, head, re.DOTALL)), None)


def no_text(name: object, data: bytes) -> str:
    """Return why bytes are refused that should be text.

    Args:
        name: of the file, as people write it.
        data: all of it.
    """
    head = data[:HEAD]
    seems = foreign(name, head) or _other_text(head)
    return f"this is no UTF-8 text: {seems}"


def _other_text(head: bytes) -> str:
    """Return what bytes look like that are no UTF-8 text, and begin like no other kind."""
    plain = sum(byte in _PLAIN for byte in head)
    # In Latin-1 a text of Western Europe has fewer than a fifth of other bytes.
    if plain > 0.8 * len(head):
        return "it looks like text in another encoding; save it as UTF-8"
    return _binary(head)


def _binary(head: bytes) -> str:
    return f"it looks like binary data of another program, and begins with {head[:4].hex(' ')}"


def foreign(name: object, head: bytes) -> str:
    """Return what a file looks like that should be TOML; empty if it may be meant as that."""
    kind = _kind_of(head)
    meant = kind is None or not kind.use or kind.what.endswith("(TOML)")
    return "" if meant else looks_like(name, head)


def is_none(name: object, head: bytes, wanted: str, made: str) -> str:
    """Return a sentence about a file that is not what it should be.

    Args:
        name: of the file, as people write it.
        head: its first :data:`HEAD` bytes, or all there are.
        wanted: what it should be.
        made: where such a file comes from.
    """
    return f"{name} is no {wanted}: {looks_like(name, head)}; {made}"


def not_replaced(head: bytes, begins: bytes) -> str:
    """Return why an output does not replace a file; empty if it may.

    Board files, programs, journals and snapshots are not lost to a name given by mistake.

    Args:
        head: the first :data:`HEAD` bytes of the file, or all there are.
        begins: how the output begins, if that is known.
    """
    kind, new = _kind_of(head), _kind_of(begins)
    guarded = kind is not None and kind.guarded
    if not head or kind is new or not (guarded or (new is not None and new.guarded)):
        return ""
    seems = f"it looks like {kind.what}" if kind else "it is a file of another kind"
    return f"{seems}, and is not replaced; give another name, or delete the file first"


def unwritable(path: str | Path, error: OSError) -> str:
    """Return why a file cannot be written, and what to do."""
    reason = f"cannot be written: {error.strerror}"
    folder = Path(path).parent
    if isinstance(error, IsADirectoryError):
        return f"{reason}; name a file in it, such as {Path(path) / 'FILE'}"
    if isinstance(error, FileNotFoundError) and not folder.is_dir():
        return f"{reason}; there is no folder {folder}: make it first"
    return reason


def unreadable(path: str | Path, error: OSError) -> str:
    """Return why a file cannot be read, and what to do."""
    if isinstance(error, IsADirectoryError):
        return "cannot be read: it is a directory; name a file in it"
    reason = f"cannot be read: {error.strerror}"
    if not isinstance(error, FileNotFoundError):
        return reason
    # Imported for a mistake alone: it takes 1 ms.
    from difflib import get_close_matches

    folder = Path(path).parent
    if not folder.is_dir():
        return f"{reason}; there is no folder {folder} either"
    there = sorted(entry.name for entry in folder.iterdir() if entry.is_file())
    close = get_close_matches(Path(path).name, there, n=1)
    return reason + (f'; did you mean "{folder / close[0]}"?' if close else "; check its name")
