"""No silent outcome of an example or a client is new: a short campaign beside its baseline."""

import json
import re
from pathlib import Path

import pytest

from tests.examples.campaigns import BASELINES, EXAMPLES_RUN, EXPLAINED, NAMES, SLOW, campaign
from tests.left_out import require

WORLDS = 4
"""Some two seconds of a processor for each; baselines are of more worlds of the same order."""


@pytest.mark.parametrize("name", [name for name in NAMES if name not in SLOW])
def test_a_campaign_has_no_silent_outcome_that_its_baseline_has_not(
    name: str, tmp_path: Path
) -> None:
    if name in EXAMPLES_RUN:
        require(EXAMPLES_RUN[name].needs)
        if "--cpu" in EXAMPLES_RUN[name].options:
            pytest.importorskip("unicorn")
    done = campaign(name, tmp_path, WORLDS, "--baseline", str(BASELINES / f"{name}.json"))
    assert done.returncode == 0, done.stdout + done.stderr


@pytest.mark.parametrize("name", NAMES)
def test_each_silent_outcome_that_is_known_has_its_sentence(name: str) -> None:
    keys = json.loads((BASELINES / f"{name}.json").read_text())["keys"]
    bare = [key for key in map(" ".join, keys)
            if not any(re.fullmatch(pattern, key) for pattern, _ in EXPLAINED)]  # fmt: skip
    assert not bare


def test_no_sentence_explains_nothing() -> None:
    every = [" ".join(key) for name in NAMES
             for key in json.loads((BASELINES / f"{name}.json").read_text())["keys"]]  # fmt: skip
    idle = [pattern for pattern, _ in EXPLAINED
            if not any(re.fullmatch(pattern, key) for key in every)]  # fmt: skip
    assert not idle


def test_a_driver_waits_for_the_slowest_chip(tmp_path: Path) -> None:
    done = campaign("lm629_portio", tmp_path, 12, "--only", "specimen")
    assert "nothing is broken" not in done.stdout


def test_an_interrupt_that_comes_twice_ends_no_move(tmp_path: Path) -> None:
    """A line that moves once more wakes the handler, which looks for what has ended."""
    done = campaign("lm629_interrupts", tmp_path, 40, "--only", "interrupt", "-j", "1")
    assert done.returncode == 0, done.stdout + done.stderr
    assert "silent" not in done.stdout.partition("\n")[2]
