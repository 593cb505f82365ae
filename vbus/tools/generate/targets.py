"""What is generated, and from what."""

import re
from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path
from typing import Final

from vbus.chips.clauses import clauses_of
from vbus.chips.family import Family
from vbus.tools.generate import (
    board_file,
    calls,
    chip_pages,
    command_line,
    documents,
    faults,
    proofs,
    registers,
    sigrok,
)
from vbus.tools.generate.layout import ROOT, folder_of, formatted, own_families

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


Target = tuple[str, Callable[[], str]]
"""A file's path in the source tree, and what makes its text."""

_CLIENT: Final = ROOT / "vbus" / "client"
_GENERATED: Final = '"""Made from the tables of the chip by vbus.tools.generate."""\n'

DOCUMENTS: Final[list[Target]] = [
    ("ARCHITECTURE.md", documents.architecture),
    ("docs/add-a-chip.md", documents.add_a_chip),
    *board_file.targets(),
    ("docs/byte-protocol.md", documents.byte_protocol),
    ("docs/c-client.md", c_interface),
    ("docs/command-line.md", command_line.command_line),
    ("docs/faults.md", faults.faults),
    ("docs/index.md", documents.landing),
    ("docs/text-protocol.md", documents.text_protocol),
]
"""Pages with tables in them."""


def client_targets(family: Family) -> list[Target]:
    """Return the client of a chip family, in its folder: calls from its tables, and all blocking.

    There is none for a family without a table of commands or registers.
    """
    if not (family.commands or family.registers):
        return []
    folder = folder_of(family)
    place = f"{folder.relative_to(ROOT) if folder.is_relative_to(ROOT) else folder}"
    made = f"{place}/generated"
    sources = [path for name in ("access", "host") if (path := folder / f"{name}.py").exists()]
    return [
        (f"{made}/__init__.py", lambda: _GENERATED),
        (f"{made}/aio_calls.py", partial(calls.calls, family)),
        (f"{made}/calls.py", partial(_calls, family, f"{made}/calls.py")),
        *((f"{made}/{path.name}", partial(_host, path, made)) for path in sources),
        *_numbers(family, made),
    ]


def _numbers(family: Family, made: str) -> list[Target]:
    """Return bits as numbers, and registers, if the rows say when each of them counts."""
    found: list[Target] = []
    counted = any(row.counts for row in family.registers)
    if counted or family.bits:
        found.append((f"{made}/bits.py", partial(registers.bits, family)))
    if counted:
        found.append((f"{made}/registers.py", partial(registers.registers, family)))
    return found


def _calls(family: Family, name: str) -> str:
    return blocking(calls.calls(family), name, "aio_calls.py")


def _host(path: Path, made: str) -> str:
    return blocking(path.read_text(), f"{made}/{path.name}", path.name)


def own_clients() -> list[Target]:
    """Return the clients of the families of this source tree, and where hosts import them from."""
    found = []
    for family in own_families():
        found += client_targets(family)
        for world, module in (("aio/", "host"), ("", "generated.host")):
            path = f"vbus/client/{world}{family.name}.py"
            found.append((path, partial(_reexport, family, f"{family.home}.{module}")))
    return found


def _reexport(family: Family, module: str) -> str:
    return (
        "# Made by vbus.tools.generate.\n"
        f'"""The client of the {family.title}."""\n\nfrom {module} import *  # noqa: F403\n'
    )


def family_targets(family: Family) -> list[Target]:
    """Return all that is made for one chip family, in the folder it is installed in.

    That is its client, its pages, and its decoder for sigrok.
    """
    made = folder_of(family) / "generated"
    pages = [(f"{made}/{family.name}.md", partial(chip_pages.page, family))]
    if clauses_of(family.home):
        path = f"{made}/{family.name}-clauses.md"
        pages.append((path, partial(chip_pages.clause_page, family)))
    return [*client_targets(family), *pages, *sigrok.decoder_targets(family, f"{made}/sigrok")]


def blocking_sources() -> list[Target]:
    """Return the blocking counterpart of every asyncio source, made from the file as it is now."""
    sources = sorted(
        path
        for path in (_CLIENT / "aio").glob("*.py")
        if path.stem not in {"ready", "__init__", *(one.name for one in own_families())}
    )
    return [(f"vbus/client/{path.name}", partial(_blocking, path)) for path in sources]


def _blocking(path: Path) -> str:
    return blocking(path.read_text(), f"vbus/client/{path.name}")


GROUPS: Final[dict[str, tuple[Callable[[], list[Target]], ...]]] = {
    "clients": (own_clients, blocking_sources),
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
