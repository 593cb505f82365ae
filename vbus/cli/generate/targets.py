"""What is generated, and from what."""

import re
from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path
from typing import Final

from vbus.chips.clauses import clauses_of
from vbus.chips.family import Family
from vbus.cli.generate import (
    board_file,
    chip_pages,
    command_line,
    documents,
    proofs,
    registers,
    sigrok,
    stubs,
)
from vbus.cli.generate.layout import ROOT, folder_of, own_families

HEADER: Final = "vbus/native/vbus.h"

_HEAD: Final = """\
# The C client

<!-- Made from vbus/native/vbus.h by vbus.cli.generate; change that. -->

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


Target = tuple[str, Callable[[], str]]
"""A file's path in the source tree, and what makes its text."""

_GENERATED: Final = '"""Made from the tables of the chip by vbus.cli.generate."""\n'

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


def client_targets(family: Family) -> list[Target]:
    """Return what is made of a chip family's tables, in its folder: numbers, and types of calls.

    Numbers are bits, and registers, if the rows say when each of them counts.
    """
    folder = folder_of(family)
    place = f"{folder.relative_to(ROOT) if folder.is_relative_to(ROOT) else folder}"
    made = f"{place}/generated"
    found: list[Target] = []
    if stubs.calls_class(family) is not None:
        found.append((f"{place}/calls.pyi", partial(stubs.calls, family)))
    counted = any(row.counts for row in family.registers)
    if counted or family.bits:
        found.append((f"{made}/__init__.py", lambda: _GENERATED))
        found.append((f"{made}/bits.py", partial(registers.bits, family)))
    if counted:
        found.append((f"{made}/registers.py", partial(registers.registers, family)))
    return found


def own_clients() -> list[Target]:
    """Return the types of the blocking client, and where hosts import each family's from."""
    found: list[Target] = [
        (f"vbus/client/{name}.pyi", partial(stubs.blocking, name)) for name in ("bus", "access")
    ]
    for family in own_families():
        found += client_targets(family)
        name = family.name
        found.append((f"vbus/client/{name}.py", partial(_module, family, _BLOCKING)))
        found.append((f"vbus/client/{name}.pyi", partial(stubs.client, family)))
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
    return f"# Made by vbus.cli.generate.\n{about}\n\n{body.format(home=family.home)}"


def family_targets(family: Family) -> list[Target]:
    """Return all that is made for one chip family, in the folder it is installed in.

    That is what its client needs, its pages, and its decoder for sigrok.
    """
    made = folder_of(family) / "generated"
    pages = [(f"{made}/{family.name}.md", partial(chip_pages.page, family))]
    if clauses_of(family.home):
        path = f"{made}/{family.name}-clauses.md"
        pages.append((path, partial(chip_pages.clause_page, family)))
    return [*client_targets(family), *pages, *sigrok.decoder_targets(family, f"{made}/sigrok")]


GROUPS: Final[dict[str, tuple[Callable[[], list[Target]], ...]]] = {
    "clients": (own_clients,),
    "documents": (lambda: DOCUMENTS, chip_pages.targets),
    "proofs": (proofs.targets,),
}
"""Groups by name; what stands later may be made from what stands earlier."""


def stale(targets: list[Target]) -> list[str]:
    """Return the paths whose file is not what would be made now."""
    return [path for path, make in targets if not _is(ROOT / path, make())]


def _is(path: Path, text: str) -> bool:
    return path.exists() and path.read_text() == text


def write(targets: list[Target]) -> list[str]:
    """Make the files that are stale; return their paths."""
    written = []
    for path, make in targets:
        text = make()
        if not _is(ROOT / path, text):
            (ROOT / path).parent.mkdir(parents=True, exist_ok=True)
            (ROOT / path).write_text(text)
            written.append(path)
    return written
