"""No silent outcome of an example or a client is new: a short campaign beside its baseline."""

from pathlib import Path

import pytest

from tests.examples.campaigns import BASELINES, CPUS, NAMES, campaign
from tests.left_out import require

WORLDS = 6
"""Some three seconds of a processor for each; baselines are of more worlds of the same order."""
COMPILERS = {"lm629_vme_68000": "m68k-linux-gnu-gcc", "mc1241a_dos": "nasm"}


@pytest.mark.parametrize("name", NAMES)
def test_a_campaign_has_no_silent_outcome_that_its_baseline_has_not(
    name: str, tmp_path: Path
) -> None:
    require(COMPILERS.get(name, "g++"))
    if name in CPUS:
        pytest.importorskip("unicorn")
    done = campaign(name, tmp_path, WORLDS, "--baseline", str(BASELINES / f"{name}.json"))
    assert done.returncode == 0, done.stdout + done.stderr
