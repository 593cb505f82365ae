"""Planted mistakes: how many make the driver's own test red, or are named by a rule."""

import os
import re
import tomllib
from pathlib import Path
from typing import Any, Final

import pytest

from tests.left_out import require
from tests.planted.suite import DRIVERS, HERE, Outcome, run_c, run_python, unusual

MISTAKES: Final[dict[str, list[dict[str, str]]]] = tomllib.loads(
    (HERE / "mistakes.toml").read_text()
)
RED: Final = "red"
SILENT: Final = "silent"
STEP: Final = 1 if os.environ.get("VBUS_PLANTED") == "all" else 3
"""All rows take two minutes of a processor: a usual run takes every third of a driver."""
ROWS: Final = [
    pytest.param(driver, number, row, id=f"{driver}: {row['what']}")
    for driver, rows in MISTAKES.items()
    for number, row in enumerate(rows, 1)
    if number % STEP == 0
]

UNUSUAL: Final = re.findall(r"^def (test_\w+)", (DRIVERS / "unusual.py").read_text(), re.M)


@pytest.fixture(scope="session")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Where programs are compiled to, once."""
    return tmp_path_factory.mktemp("planted")


def run(driver: str, number: int, row: dict[str, Any], folder: Path) -> Outcome:
    """Run the tests of a driver with a mistake; with number 0 of the right one."""
    program, _, chip = driver.partition(" ")
    if chip:
        require("gcc")
        return run_c(chip, number, folder)
    return run_python(program, (row["before"], row["after"]) if number else None, folder)


@pytest.mark.parametrize("driver", MISTAKES)
def test_the_right_driver_passes_and_nothing_is_noted(driver: str, folder: Path) -> None:
    assert run(driver, 0, {}, folder) == Outcome()


@pytest.mark.parametrize(("driver", "number", "row"), ROWS)
def test_a_mistake_comes_to_what_the_table_says(
    driver: str, number: int, row: dict[str, str], folder: Path
) -> None:
    outcome = run(driver, number, row, folder)
    if row["comes_to"] == RED:
        assert outcome.red
    else:
        assert not outcome.red
        assert row["comes_to"] in (SILENT, *outcome.rules)


@pytest.mark.parametrize("name", UNUSUAL)
def test_what_a_right_driver_may_do_is_no_violation(name: str, folder: Path) -> None:
    outcome, noted = unusual(name, folder)
    assert outcome.red == []
    assert outcome.rules - {"mc1241a.checksum-unread"} == noted


@pytest.mark.parametrize("driver", MISTAKES)
def test_four_in_five_mistakes_of_each_driver_are_found(driver: str) -> None:
    rows = MISTAKES[driver]
    found = [row for row in rows if row["comes_to"] != SILENT]
    assert len(found) >= 0.8 * len(rows)


def test_a_hundred_mistakes_are_planted() -> None:
    assert sum(map(len, MISTAKES.values())) >= 100
