"""What is made for this source tree, and from what."""

import re
from collections.abc import Callable, Iterator
from functools import partial
from typing import Final

from contrib.generate import blocking, board_file, command_line, documents, proofs
from vbus.chips.family import Family
from vbus.cli.generate.chip_pages import clause_page, page
from vbus.cli.generate.layout import ROOT, Target, own_families
from vbus.cli.generate.targets import client_targets

HEADER: Final = "vbus/native/vbus.h"

_HEAD: Final = """\
# The C client

<!-- Made from vbus/native/vbus.h by contrib.generate; change that. -->

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
        # The closing brace of extern "C" is no part of a section.
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


DOCUMENTS: Final[list[Target]] = [
    ("ARCHITECTURE.md", documents.architecture),
    ("docs/add-a-chip.md", documents.add_a_chip),
    *board_file.targets(),
    ("docs/byte-protocol.md", documents.byte_protocol),
    ("docs/c-client.md", c_interface),
    ("docs/command-line.md", command_line.command_line),
    ("docs/faults.md", board_file.faults),
    ("docs/index.md", documents.landing),
    ("docs/text-protocol.md", documents.text_protocol),
]
"""Pages with tables in them."""


def own_clients() -> list[Target]:
    """Return the types of the blocking client, and where hosts import each family's from."""
    found: list[Target] = [
        (f"vbus/client/{name}.pyi", partial(blocking.blocking, name)) for name in ("bus", "access")
    ]
    for family in own_families():
        found += client_targets(family)
        name = family.name
        found.append((f"vbus/client/{name}.py", partial(_module, family, _BLOCKING)))
        found.append((f"vbus/client/{name}.pyi", partial(blocking.client, family)))
        found.append((f"vbus/client/aio/{name}.py", partial(_module, family, _ASYNCIO)))
    return found


_BLOCKING: Final = """\
from {home} import host
from vbus.client.blocking import export

export(host, globals())
"""
_ASYNCIO: Final = "from {home}.host import *  # noqa: F403\n"


def _module(family: Family, body: str) -> str:
    about = f'"""The client of the {family.title}."""'
    return f"# Made by contrib.generate.\n{about}\n\n{body.format(home=family.home)}"


def chip_pages() -> list[Target]:
    """Return the pages of each chip family."""
    return [
        target
        for family in own_families()
        for target in (
            (f"docs/chips/{family.name}.md", partial(page, family)),
            (f"docs/chips/{family.name}-clauses.md", partial(clause_page, family)),
        )
    ]


GROUPS: Final[dict[str, tuple[Callable[[], list[Target]], ...]]] = {
    "clients": (own_clients,),
    "documents": (lambda: DOCUMENTS, chip_pages),
    "proofs": (proofs.targets,),
}
"""Groups by name; what stands later may be made from what stands earlier."""
