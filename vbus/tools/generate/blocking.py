"""Makes a blocking client's source from an asyncio one's."""

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
    (r"\.generated\.aio_calls\b", ".generated.calls"),
    (r"^(from [\w.]+)\.(access|host) import", r"\1.generated.\2 import"),
    (r", for asyncio\b", ", blocking"),
)


def blocking(source: str, name: str, origin: str = "") -> str:
    """Return what is blocking of asyncio source ``source``, as file ``name``.

    Its first line names ``origin``, the source; the file of the same name below ``aio`` if "".

    The source awaits every call and imports nothing of asyncio itself: what differs between the
    two worlds stands in ``ready.py``, which each has of its own.
    """
    for pattern, replacement in _CHANGES:
        source = re.sub(pattern, replacement, source, flags=re.MULTILINE)
    summary, line, rest = source.partition("\n")
    origin = origin or f"aio/{name.rpartition('/')[2]}"
    head = f"# Made from {origin} by vbus.tools.generate; change that file.\n"
    return formatted(head + summary + line + rest, name)
