"""Makes the page of the C client from the comments of its header."""

import re
from collections.abc import Iterator
from typing import Final

from vbus.tools.generate.layout import ROOT

HEADER: Final = "vbus/native/vbus.h"

_HEAD: Final = """\
# The C client

<!-- Made from vbus/native/vbus.h by vbus.tools.generate; change that. -->

[`vbus.h`](../vbus/native/vbus.h) and [`vbus.c`](../vbus/native/vbus.c) come with the package:
`vbus cflags` prints the compiler's options for them. See also
[Bring your driver](bring-your-driver.md).
"""
_SECTION: Final = re.compile(r"^/\* --- (.+?) -+ \*/$", re.MULTILINE)
_CODE: Final = re.compile(r"^ {4,}", re.MULTILINE)


def c_interface() -> str:
    """Return the page: what stands in the header, section by section."""
    text = (ROOT / HEADER).read_text()
    first, *rest = _SECTION.split(text)
    opening = first[: first.index("*/")].removeprefix("/* ")
    lines = [_HEAD, *_opening(opening)]
    for title, body in zip(rest[::2], rest[1::2], strict=True):
        body = body.partition("#ifdef __cplusplus")[0].strip()
        lines += [f"## {title[:1].upper()}{title[1:]}", "", "```c", body, "```", ""]
    return "\n".join(lines).rstrip("\n") + "\n"


def _opening(comment: str) -> Iterator[str]:
    """Give the header's first comment as Markdown; what is indented is code."""
    for paragraph in re.sub(r"(?m)^ \* ?", "", comment).strip().split("\n\n"):
        if _CODE.match(paragraph):
            yield from ("```c", _CODE.sub("", paragraph), "```", "")
        else:
            yield from (paragraph.replace("*", "\\*"), "")
