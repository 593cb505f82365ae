"""Bookmarks: instants with a text, kept with a recording."""

from typing import Any, Final, TypeGuard

MOST: Final = 1000
"""Bookmarks of a recording."""
LONGEST: Final = 200
"""Characters of a text."""
DIGITS: Final = 24
"""Digits of an instant at most."""

Bookmark = dict[str, str]
"""``at``, an instant in ps from the begin of the recording as a decimal, and ``text``."""


def is_bookmark(value: Any) -> TypeGuard[Bookmark]:
    """Whether something a page or a file has said is a bookmark."""
    if not isinstance(value, dict) or set(value) != {"at", "text"}:
        return False
    at, text = value["at"], value["text"]
    return (
        isinstance(at, str) and at.isascii() and at.isdigit() and len(at) <= DIGITS
        and isinstance(text, str) and 0 < len(text) <= LONGEST and text.isprintable()
    )  # fmt: skip


def place(bookmark: Bookmark) -> tuple[int, str]:
    """Return what bookmarks are put in order by."""
    return int(bookmark["at"]), bookmark["text"]
