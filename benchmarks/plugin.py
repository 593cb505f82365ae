"""What the pytest plug-in costs: a suite of small tests, and a pytest that does not use it.

A hundred small tests of a board run with the plug-in's defaults and, turn about, with what judges
and keeps a test taken away: violations, budget and journal. The ratio is that of the medians. What
a pytest pays that does not use vbus is the import of the plug-in, in a process of its own.

    python benchmarks/plugin.py [--rounds N]
"""

import argparse
import os
import statistics
import subprocess
import sys
import tempfile
from pathlib import Path

TESTS = """\
import pytest


@pytest.mark.parametrize("number", range(100))
def test_a_move(vbus_lm629, number):
    axis = vbus_lm629.host
    axis.check_reset()
    axis.load_filter(kp=300, kd=2000)
    axis.load_trajectory(acc=400, vel=4 << 16, pos=200 + number, start=True)
    while not axis.status() & 0x04:
        vbus_lm629.bus.delay("1 ms")
    assert abs(axis.rdrp() - 200 - number) < 10
"""
IMPORT = """\
import pytest, time
from importlib.metadata import distributions
list(package.entry_points for package in distributions())  # as pytest has done before
began = time.process_time()
import vbus.testing.plugins.plugin
print(time.process_time() - began)
"""
BARE = """\
from vbus.testing import bench


class NoJournal:
    def __init__(self, *of):
        pass

    def close(self):
        pass


class Bare(bench.TestedBoard):
    def __init__(self, *of):
        super().__init__(*of)
        self.watch.close()


bench.Journal = NoJournal
bench.TestedBoard = Bare
"""


def run(folder: Path, *options: str) -> float:
    """Run pytest in a folder; return the seconds of processor time it took."""
    before = os.times()
    subprocess.run(
        [sys.executable, "-m", "pytest", "-q", "-p", "no:cacheprovider", *options],
        cwd=folder,
        check=True,
        stdout=subprocess.DEVNULL,
    )
    after = os.times()
    used = after.children_user + after.children_system
    return used - before.children_user - before.children_system


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--rounds", type=int, default=7)
    rounds = parser.parse_args().rounds
    whole: list[float] = []
    bare: list[float] = []
    with tempfile.TemporaryDirectory() as name:
        for part in ("whole", "bare"):
            folder = Path(name) / part
            folder.mkdir()
            (folder / "test_it.py").write_text(TESTS)
        (Path(name) / "bare" / "conftest.py").write_text(BARE)
        for _ in range(rounds):
            whole.append(run(Path(name) / "whole"))
            bare.append(run(Path(name) / "bare"))
    with_all, without = statistics.median(whole), statistics.median(bare)
    print(f"100 small tests: {with_all:.2f} s, bare {without:.2f} s: {with_all / without:.3f} x")
    imports = [
        float(subprocess.check_output([sys.executable, "-c", IMPORT])) for _ in range(2 * rounds)
    ]
    print(f"a pytest that does not use it: {statistics.median(imports) * 1e3:.1f} ms")


if __name__ == "__main__":
    main()
