"""Documentation that is made from tables is up to date, and its examples work."""

import re
from pathlib import Path

import pytest

from contrib.generate.targets import DOCUMENTS
from vbus.board.build import build
from vbus.board.config import read_board_text
from vbus.boardfile.schema import schema
from vbus.cli.generate.layout import ROOT, Target, stale
from vbus.nodes.machine import build_nodes

BLOCK = re.compile(r"^```toml\n(.*?)^```", re.MULTILINE | re.DOTALL)
BLOCKS = [
    (path.relative_to(ROOT), number, match[1])
    for path in [*sorted((ROOT / "docs").rglob("*.md")), ROOT / "README.md"]
    # A page that registers a chip of its own is tried as a whole, in tests/e2e/test_documents.py.
    if '[project.entry-points."vbus.chips"]' not in path.read_text()
    for number, match in enumerate(BLOCK.finditer(path.read_text()), 1)
]


@pytest.mark.parametrize("target", DOCUMENTS, ids=lambda target: target[0])
def test_a_page_made_from_tables_is_up_to_date(target: Target) -> None:
    assert stale([target]) == [], 'run "python -m contrib.generate documents"'


@pytest.mark.parametrize(
    ("page", "number", "text"), BLOCKS, ids=[f"{page} {number}" for page, number, _ in BLOCKS]
)
def test_a_board_file_in_the_documentation_can_be_loaded(
    page: Path, number: int, text: str
) -> None:
    if "[chips" in text:
        file, source = read_board_text(text, f"{page}, example {number}")
        assert build_nodes(file, source) if file.nodes else build(file, source).chips


def test_every_kind_of_section_has_a_page_that_begins_with_an_example() -> None:
    overview = (ROOT / "docs" / "board-file.md").read_text()
    for name in schema()["properties"]:
        page = (ROOT / "docs" / "board-file" / f"{name}.md").read_text()
        start, fence, rest = page.partition("```toml\n")
        assert fence, name
        assert "\n|" not in start, name
        assert re.search(rf"^\[+{name}\b", rest.partition("```")[0], re.MULTILINE), name
        assert f"](board-file/{name}.md)" in overview
