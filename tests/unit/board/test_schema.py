"""The JSON Schema of board files says what the reader says, as far as a schema can."""

import json
import re
import tomllib
from pathlib import Path
from typing import Any

import pytest

from vbus.boardfile.schema import schema

ROOT = Path(__file__).parents[3]
BLOCK = re.compile(r"^```toml\n(.*?)^```", re.MULTILINE | re.DOTALL)
FILES = sorted(
    path
    for folder in ("docker", "examples", "firmware_host_examples", "tests/frozen")
    for path in (ROOT / folder).rglob("*.toml")
    if "\n[chips" in path.read_text()
)
PAGES = [ROOT / "README.md", *sorted((ROOT / "docs").rglob("*.md"))]
BOARD = """
[chips.x]
part = "LM629N-8"
clock = "8 MHz"
plant = "motor"

[plants.motor]
model = "dc_motor"
"""


@pytest.fixture(scope="module")
def checker() -> Any:
    made = json.loads(json.dumps(schema()))
    # Here: its import takes more than a second of a processor, and each worker collects each file.
    import jsonschema

    kind = jsonschema.validators.validator_for(made)
    kind.check_schema(made)
    return kind(made)


def wrong(checker: Any, text: str) -> list[str]:
    """Return where a board file is wrong, and what its innermost error says."""
    found = checker.iter_errors(tomllib.loads(text))
    return [f"{'.'.join(map(str, error.absolute_path))}: {error.message}" for error in found]


@pytest.mark.parametrize("path", FILES, ids=lambda path: str(path.relative_to(ROOT)))
def test_a_board_file_of_the_examples_is_valid(checker: Any, path: Path) -> None:
    assert wrong(checker, path.read_text()) == []


@pytest.mark.parametrize("page", PAGES, ids=lambda path: str(path.relative_to(ROOT)))
def test_the_board_files_of_a_page_are_valid(checker: Any, page: Path) -> None:
    for block in BLOCK.findall(page.read_text()):
        if "[chips" in block:
            assert wrong(checker, block) == []


@pytest.mark.parametrize(
    ("change", "where"),
    [
        (('clock = "8 MHz"', 'clock = "8 mHz"'), "chips.x.clock"),
        (('clock = "8 MHz"', "clock = 8"), "chips.x.clock"),
        (('clock = "8 MHz"\n', ""), "chips.x"),
        (('plant = "motor"', 'plant = "motor"\nclok = 1'), "chips.x"),
        (('plant = "motor"', 'plant = "motor"\nbusy_clk = 801'), "chips.x.busy_clk"),
        (('"dc_motor"', '"dc_motor"\nlines = 500'), "plants.motor"),
        (('"dc_motor"', '"dc_motor"\n[plants.motor.switches.hom]\nfirst=0\nlast=1'),
         "plants.motor.switches"),
        (("[chips.x]", 'board.time = "lockstepp"\n[chips.x]'), "board.time"),
        (("[chips.x]", 'board.rate = "fast"\n[chips.x]'), "board.rate"),
        (("[chips.x]", '[[hosts]]\nprotocol = "byte"\n[chips.x]'), "hosts.0"),
        (("[chips.x]", '[[faults]]\nfault = "jam"\nshare = 1.0\n[chips.x]'), "faults.0"),
        (("[chips.x]", 'violations.lm628.busy-write = "strct"\n[chips.x]'),
         "violations.lm628"),
        (("[chips.x]", "[chip.x]"), ""),
        (("[chips.x]", 'scope.certificate = "a"\n[chips.x]'), "scope"),
    ],
)  # fmt: skip
def test_a_mistake_is_found_at_its_place(checker: Any, change: tuple[str, str], where: str) -> None:
    assert wrong(checker, BOARD) == []

    errors = wrong(checker, BOARD.replace(*change, 1))

    assert errors
    assert {error.partition(":")[0] for error in errors} == {where}


@pytest.mark.parametrize(
    "text",
    [
        'clock = " 8.5e0 MHz "',
        'clock = "8_000_000Hz"',
        'clock = "8 MHz"\nbusy_clk = 1',
        'clock = "8 MHz"\nplants = ["motor"]',
    ],
)
def test_what_the_reader_takes_is_valid(checker: Any, text: str) -> None:
    assert wrong(checker, BOARD.replace('clock = "8 MHz"', text)) == []


def test_the_part_decides_which_settings_there_are(checker: Any) -> None:
    other = BOARD.replace("LM629N-8", "MCP-1200").replace('plant = "motor"', "busy_clk = 120")

    (error,) = wrong(checker, other)

    assert error.startswith("chips.x: ")
    assert "busy_clk" in error


def test_a_part_of_a_package_that_is_not_installed_is_left_to_the_reader(checker: Any) -> None:
    assert wrong(checker, BOARD.replace("LM629N-8", "XY-1")) == []


def test_a_section_has_no_keys_but_its_own() -> None:
    board = schema()["properties"]["board"]
    assert board["additionalProperties"] is False
    assert board["properties"]["seed"]["minimum"] == 0
