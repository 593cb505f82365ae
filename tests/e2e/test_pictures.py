"""The pictures of the documentation are what their script makes."""

import importlib.util
import re
from pathlib import Path
from types import ModuleType
from xml.etree import ElementTree

import matplotlib
import pytest

PICTURES = Path(__file__).parents[2] / "docs" / "pictures"


@pytest.fixture
def make() -> ModuleType:
    spec = importlib.util.spec_from_file_location("make", PICTURES / "make.py")
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def test_the_move_is_that_of_the_model(make: ModuleType, tmp_path: Path) -> None:
    make.move(tmp_path / "move.svg")
    drawn = (tmp_path / "move.svg").read_text()
    shown = (PICTURES / "move.svg").read_text()

    assert '<g id="x.real">' in shown
    # Another matplotlib draws the same with other bytes.
    if f"Matplotlib v{matplotlib.__version__}" in shown:
        assert drawn == shown, "run docs/pictures/make.py"


def test_the_terminal_shows_the_commands_of_the_tutorial(make: ModuleType) -> None:
    shown = (PICTURES / "session.svg").read_text()
    texts = [element.text for element in ElementTree.fromstring(shown) if element.text]

    assert [text[2:] for text in texts if text.startswith("$ ")] == list(make.COMMANDS)
    assert re.search(r"^stands at (199\d|200\d)$", "\n".join(texts), re.MULTILINE)
    page = make.TUTORIAL.read_text()
    for command in make.COMMANDS:
        assert f"\n{command}\n" in page


def test_a_line_appears_at_its_time(make: ModuleType) -> None:
    text = make.terminal([(0.5, "$ a < b"), (1.25, "c")])

    assert 'begin="0.50s"' in text
    assert 'begin="1.25s"' in text
    assert [element.text for element in ElementTree.fromstring(text) if element.text] == [
        "$ a < b", "c",
    ]  # fmt: skip
