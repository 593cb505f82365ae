"""Looks for a legal LM629 that a driver cannot live with: hunt.py DRIVER."""

import sys
from pathlib import Path

from vbus.testing.hostile import find_weakness
from vbus.testing.limits import Limits
from vbus.testing.programs import ProgramOutcome

BOARD = Path(__file__).parent / "board.toml"


def judge(outcome: ProgramOutcome) -> str:
    """The driver comes to an end, and has read the right position."""
    if outcome.stuck:
        return f"the driver hangs: {outcome.stuck}"
    if outcome.output != "at 100\n":
        return f"the driver says {outcome.output.strip()!r}, and not 'at 100'"
    return ""


driver = [str(Path(sys.argv[1]).resolve()), "{link}"]
weakness = find_weakness(BOARD, driver, judge, Limits(cycles=10_000), examples=30)
print(weakness if weakness else "no weakness found")
sys.exit(weakness is not None)
