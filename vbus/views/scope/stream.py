"""What pages are sent of a board: buffered for those that come later, or cannot follow."""

from typing import Any, Final

from vbus.views.scope.frames import HEAD, LASTING, MARKS, NOW, frame, numbers, texts
from vbus.views.scope.lanes import GAP_MARK, GAPS

MOST_KEPT: Final = 1 << 28
"""Bytes stored of a board that runs: 256 MB; older ones are left out, with a mark."""
MESSAGE: Final = 1 << 20
"""Bytes from which on what a page has missed goes in several messages: it draws between them."""


class Stream:
    """Frames in their order. Each page has a place in it; a slow page delays no other.

    Where there are too many the oldest are left out, but for labels and tables, which later frames
    need. A page that has missed some gets a mark.

    Args:
        description: what a page gets first.
        most: bytes stored; None for all.
    """

    def __init__(self, description: dict[str, Any], most: int | None = MOST_KEPT) -> None:
        self.description: dict[str, Any] = description
        self._most: int | None = most
        self._kept: dict[int, bytes] = {}
        """Frames by their number."""
        self._size: int = 0
        self._first: int = 0
        """Number of the oldest that is buffered."""
        self._lasting: list[tuple[int, bytes]] = []
        """Frames that last and are older, each with its number."""
        self._begin: int = 0
        """The instant (ps) up to which frames are left out."""
        lanes = (lane["id"] for lane in description.get("lanes", ()) if lane["name"] == GAPS)
        self._gaps: int | None = next(lanes, None)

    @property
    def end(self) -> int:
        """The place behind the latest."""
        return self._first + len(self._kept)

    def add(self, frames: bytes) -> None:
        """Take whole frames; those that last come by themselves."""
        self._kept[self.end] = frames
        self._size += len(frames)
        # The latest stays whatever its size: else a page that asks would get nothing.
        while self._most is not None and self._size > self._most and len(self._kept) > 1:
            oldest = self._kept.pop(self._first)
            # A packet names a label by its number: without it the packet has no text.
            if oldest[0] in LASTING:
                self._lasting.append((self._first, oldest))
            else:
                self._begin = max(self._begin, _now(oldest))
            self._size -= len(oldest)
            self._first += 1

    def after(self, place: int) -> tuple[bytes, int]:
        """Return a message with what has come since a place, and the place behind it."""
        message = bytearray()
        if place < self._first:
            for number, lasting in self._lasting:
                message += lasting if number >= place else b""
            message += self._gap()
            place = self._first
        while place < self.end and len(message) < MESSAGE:
            message += self._kept[place]
            place += 1
        return bytes(message), place

    def _gap(self) -> bytes:
        """Return the mark of what is left out, if there is a lane for it."""
        if self._gaps is None or not self._begin:
            return b""
        kept = f"{(self._most or 0) >> 20} MiB"
        text = f"all before {self._begin * 1e-12:.3f} s is left out: the scope keeps {kept}"
        mark = {"text": text, "kind": GAP_MARK, "rule": None, "clause": None, "label": None}
        return frame(MARKS, self._gaps, 1, self._begin, numbers([0]), texts([mark]))


def _now(frames: bytes) -> int:
    """Return how far time had come when frames were made (ps); 0 if they do not end with that."""
    if len(frames) < HEAD.size:
        return 0
    kind, columns, _, _, first = HEAD.unpack_from(frames, len(frames) - HEAD.size)
    return int(first) if (kind, columns) == (NOW, 0) else 0
