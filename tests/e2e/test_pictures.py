"""The pictures of the documentation are what their script makes."""

import importlib.util
import re
from pathlib import Path
from types import ModuleType
from xml.etree import ElementTree

import matplotlib
import pytest

from vbus import plugins
from vbus.cli.generate.layout import own_families

ROOT = Path(__file__).parents[2]
PICTURES = ROOT / "docs" / "pictures"


def script(name: str) -> ModuleType:
    """Return a script of the pictures as a module."""
    spec = importlib.util.spec_from_file_location(name, PICTURES / f"{name}.py")
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@pytest.fixture
def make() -> ModuleType:
    return script("make")


def test_the_move_is_that_of_the_model(make: ModuleType, tmp_path: Path) -> None:
    make.move(tmp_path / "move.svg")
    drawn = (tmp_path / "move.svg").read_text()
    shown = (PICTURES / "move.svg").read_text()

    assert '<g id="x.real">' in shown
    # Another matplotlib draws the same with other bytes.
    if f"Matplotlib v{matplotlib.__version__}" in shown:
        assert drawn == shown, "run docs/pictures/make.py"


def frames(text: str) -> list[list[str]]:
    """Return the lines of each frame of a terminal."""
    groups = ElementTree.fromstring(text).iter("{http://www.w3.org/2000/svg}g")
    return [[element.text or "" for element in group] for group in groups]


def test_the_terminal_shows_the_commands_of_the_readme(make: ModuleType) -> None:
    shown = frames((PICTURES / "session.svg").read_text())

    typed = [[line[2:] for line in lines if line.startswith("$ ")] for lines in shown]
    assert typed == [list(commands) for commands in make.STEPS]
    lines = [line for frame in shown for line in frame]
    assert any(re.fullmatch(r"(199\d|200\d) counts", line) for line in lines)
    page = make.README.read_text()
    for commands in make.STEPS:
        for command in commands:
            assert f"\n{command}\n" in page


def test_a_frame_is_whole_and_each_is_shown_alone_in_its_turn(make: ModuleType) -> None:
    text = make.terminal([["$ a < b", "c"], ["$ d"], ["$ e"]])

    assert frames(text) == [["$ a < b", "c"], ["$ d"], ["$ e"]]
    assert re.findall(r'<g opacity="(\d)"', text) == ["1", "0", "0"]
    whole = 3 * make.SHOWN
    delays = [int(delay) for delay in re.findall(r"animation-delay:(-?\d+)s", text)]
    for second in range(whole):
        begun = [(second - delay) % whole < make.SHOWN for delay in delays if second >= delay]
        assert begun == [number == second // make.SHOWN for number in range(3)]
    assert frames(make.terminal([["$ a"], ["$ d"]], only=1)) == [["$ d"]]


def test_a_frame_that_is_too_high_is_refused(make: ModuleType) -> None:
    with pytest.raises(ValueError, match="lines in a frame"):
        make.terminal([["$ a", *(["x"] * make.ROWS)]])


@pytest.mark.parametrize("family", [one.name for one in own_families()])
def test_the_picture_of_a_chip_is_up_to_date_and_names_its_pins(family: str) -> None:
    chips = script("chips")
    drawing = chips.DRAWINGS[family]

    assert (PICTURES / f"{family}.svg").read_text() == chips.draw(drawing), (
        "run docs/pictures/make.py"
    )
    pins = {pin.name for pin in plugins.chip_of(plugins.family(family)).PINS}
    named = [*drawing.feedback, *drawing.inputs, *drawing.bus, drawing.interrupt]
    for name in re.findall(r"[^ ,]+", " ".join(named).replace("...", "")):
        assert name in pins


def test_the_scope_is_on_the_first_page() -> None:
    assert (PICTURES / "scope.png").read_bytes().startswith(b"\x89PNG")
    for page in (ROOT / "README.md", ROOT / "docs" / "index.md"):
        assert "pictures/scope.png)" in page.read_text()
