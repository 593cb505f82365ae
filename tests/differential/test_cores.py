"""The compiled core and the interpreted one do the same, bit for bit, whatever a host does.

``VBUS_DIFFERENTIAL=1000000`` in the environment asks for that many bus operations of each chip.
"""

import os
import subprocess
import sys
from pathlib import Path

import pytest

import vbus

DRIVER = Path(__file__).with_name("drive.py")
OPERATIONS = int(os.environ.get("VBUS_DIFFERENTIAL", "40000"))
SEED = int(os.environ.get("VBUS_DIFFERENTIAL_SEED", "1"))


def start(family: str, pure: str) -> subprocess.Popen[str]:
    home = str(Path(next(iter(vbus.__path__))).parent)
    return subprocess.Popen(
        [sys.executable, DRIVER, family, str(SEED), str(OPERATIONS)],
        stdout=subprocess.PIPE,
        text=True,
        env={**os.environ, "PYTHONPATH": home, "VBUS_PURE": pure},
    )


@pytest.mark.core("compiled")
@pytest.mark.parametrize("family", ["lm628", "mc1241a", "mcp1200"])
def test_both_cores_give_the_same_replies_violations_states_and_traces(family: str) -> None:
    compiled, interpreted = start(family, "0"), start(family, "1")
    with compiled, interpreted:
        assert compiled.stdout is not None
        assert interpreted.stdout is not None
        try:
            assert compiled.stdout.readline() == "compiled\n"
            assert interpreted.stdout.readline() == "interpreted\n"
            stretches = 0
            for fast, slow in zip(compiled.stdout, interpreted.stdout, strict=True):
                # The line names the board's seed, and how many operations led here.
                assert fast == slow
                stretches += 1
        finally:
            compiled.kill()
            interpreted.kill()
    assert stretches == OPERATIONS // 1000
