"""What is generated, and from what."""

from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Final

from vbus.tools.generate import (
    board_file,
    chip_pages,
    documents,
    faults,
    lm628,
    mc1241a,
    mcp1200,
    proofs,
    sigrok,
)
from vbus.tools.generate.layout import ROOT
from vbus.tools.generate.twins import blocking

Target = tuple[str, Callable[[], str]]
"""A file's path in the source tree, and what makes its text."""

_CLIENT: Final = ROOT / "vbus" / "client"

FAMILIES: Final[list[Target]] = [
    ("vbus/client/aio/lm628_commands.py", lm628.from_datasheet),
    ("vbus/client/aio/mc1241a_commands.py", mc1241a.from_datasheet),
    ("vbus/client/aio/mcp1200_registers.py", mcp1200.from_datasheet),
]
"""Calls made from the tables of each chip family; add a family here."""

DOCUMENTS: Final[list[Target]] = [
    ("docs/board-file.md", board_file.board_file),
    ("docs/byte-protocol.md", documents.byte_protocol),
    ("docs/faults.md", faults.faults),
    ("docs/text-protocol.md", documents.text_protocol),
]
"""Pages with tables in them."""


def twins() -> list[Target]:
    """Return the blocking twin of every asyncio source, made from the file as it is now."""
    sources = sorted(
        path
        for path in (_CLIENT / "aio").glob("*.py")
        if path.name not in ("ready.py", "__init__.py")
    )
    return [(f"vbus/client/{path.name}", partial(_twin, path)) for path in sources]


def _twin(path: Path) -> str:
    return blocking(path.read_text(), f"vbus/client/{path.name}")


GROUPS: Final[dict[str, tuple[Callable[[], list[Target]], ...]]] = {
    "clients": (lambda: FAMILIES, twins),
    "documents": (lambda: DOCUMENTS, chip_pages.targets),
    "proofs": (proofs.targets,),
    "sigrok": (sigrok.targets,),
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
