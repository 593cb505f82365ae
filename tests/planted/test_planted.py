"""Planted mistakes: how many make the driver's own test red, or are named by a rule."""

import os
from pathlib import Path
from typing import Final

import pytest

from tests.left_out import require
from tests.planted.campaigns import not_found, read, tried
from tests.planted.suite import MISTAKES, RED, SILENT, UNUSUAL, Outcome, driver_tests, run, unusual
from vbus.campaign.world import read_world

STEP: Final = 1 if os.environ.get("VBUS_PLANTED") == "all" else 3
"""All rows take two minutes of a processor: a usual run takes every third of a driver."""
ROWS: Final = [
    pytest.param(driver, number, row, id=f"{driver}: {row['what']}")
    for driver, rows in MISTAKES.items()
    for number, row in enumerate(rows, 1)
    if number % STEP == 0
]

SHOWN: Final = {driver: {row.what: row for row in rows} for driver, rows in read().items()}


@pytest.fixture(scope="session")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Where programs are compiled to, once."""
    return tmp_path_factory.mktemp("planted")


def outcome_of(driver: str, number: int, folder: Path) -> Outcome:
    """Run the tests of a driver with a mistake; with number 0 of the right one."""
    if driver.startswith("drivers.c"):
        require("gcc")
    return run(driver_tests(driver, number), folder)


@pytest.mark.parametrize("driver", MISTAKES)
def test_the_right_driver_passes_and_nothing_is_noted(driver: str, folder: Path) -> None:
    assert outcome_of(driver, 0, folder) == Outcome()


@pytest.mark.parametrize(("driver", "number", "row"), ROWS)
def test_a_mistake_comes_to_what_the_table_says(
    driver: str, number: int, row: dict[str, str], folder: Path
) -> None:
    outcome = outcome_of(driver, number, folder)
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


@pytest.mark.parametrize(("driver", "number"), not_found())
def test_a_campaign_shows_of_a_mistake_what_the_table_says(
    driver: str, number: int, folder: Path
) -> None:
    row = SHOWN[driver][MISTAKES[driver][number - 1]["what"]]
    if not row.world:
        return  # whole campaigns are made by hand
    if driver.startswith("drivers.c"):
        require("gcc")
    world = read_world(row.world)
    right, wrong = (
        next(test for test in tried(driver, one, folder) if test.name == row.test)
        for one in (0, number)
    )
    assert wrong.shown(row.what, world) == row
    assert not wrong.signs(world) <= right.signs(world)


def test_with_campaigns_95_in_100_mistakes_are_found() -> None:
    rows = [row for rows in MISTAKES.values() for row in rows]
    missed = [what for rows in SHOWN.values() for what, row in rows.items() if not row.world]
    assert sum(map(len, SHOWN.values())) == len(not_found())
    assert len(rows) - len(missed) >= 0.95 * len(rows)
