"""Makes the blocking twin of an asyncio source file."""

import re
from typing import Final

from vbus.tools.generate.layout import formatted

_CHANGES: Final = (
    (r"\basync (def|with|for)\b", r"\1"),
    (r"\bawait ", ""),
    (r"\b__a(enter|exit)__\b", r"__\1__"),
    (r"\basynccontextmanager\b", "contextmanager"),
    (r"\bAsyncIterator\b", "Iterator"),
    (r"\bAsyncGenerator\b", "Generator"),
    (r"\bvbus\.client\.aio\b", "vbus.client"),
    (r", for asyncio\b", ", blocking"),
)


def blocking(source: str, name: str) -> str:
    """Return the blocking twin of asyncio source ``source``, as file ``name``.

    The source awaits every call and imports nothing of asyncio itself: what differs between the
    two worlds stands in ``ready.py``, which each has of its own.
    """
    for pattern, replacement in _CHANGES:
        source = re.sub(pattern, replacement, source)
    summary, line, rest = source.partition("\n")
    head = f"# Made from aio/{name.rpartition('/')[2]} by vbus.tools.generate; change that file.\n"
    return formatted(head + summary + line + rest, name)
