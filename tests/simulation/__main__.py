"""``python -m tests.simulation --seeds 10000``: so many runs; one that fails can be repeated."""

import argparse
import os
import sys
import time
from collections import Counter
from concurrent.futures import ProcessPoolExecutor
from functools import partial

from tests.simulation.failures import failures
from tests.simulation.run import simulate
from vbus.transports.states import SESSION, TERMINAL

if __name__ == "__main__":
    parser = argparse.ArgumentParser(prog="python -m tests.simulation")
    parser.add_argument("--seeds", type=int, default=200, help="how many runs (200)")
    parser.add_argument("--first", type=int, default=0, help="the first seed (0)")
    parser.add_argument("--jobs", type=int, default=os.cpu_count(), help="how many at a time")
    parser.add_argument(
        "--failures", nargs="?", type=int, const=sys.maxsize, metavar="N",
        help="make N further runs of each seed, in which one call fails; without N, one for every "
        "way in which a call may fail (some 1,000 for a seed)",
    )  # fmt: skip
    asked = parser.parse_args()
    if asked.failures is not None and asked.failures < 1:
        parser.error("--failures: at least 1 run")
    began = time.monotonic()
    seeds = range(asked.first, asked.first + asked.seeds)
    counts: Counter[str] = Counter()
    moves: Counter[str] = Counter()
    failed = 0
    with ProcessPoolExecutor(asked.jobs) as pool:
        made = partial(failures, most=asked.failures) if asked.failures else simulate
        for outcome in pool.map(made, seeds, chunksize=4):
            counts.update(outcome.counts)
            moves.update(outcome.moves)
            if outcome.wrong:
                failed += 1
                print(f"seed {outcome.seed}: {outcome.wrong}")
                also = "" if not asked.failures else f" --failures {asked.failures}"
                print(f"  again: python -m tests.simulation --first {outcome.seed} --seeds 1{also}")
            elif asked.seeds == 1:
                print(f"seed {outcome.seed}: {outcome.digest}")
    for machine in () if asked.failures else (SESSION, TERMINAL):
        for row in machine.rows:
            print(f"{moves[', '.join((machine.name, *row))]:9} {machine.name}: {', '.join(row)}")
    told = ", ".join(f"{number} {what}" for what, number in counts.items())
    print(f"{len(seeds)} seeds, {failed} failed; {told}; {time.monotonic() - began:.0f} s")
    sys.exit(bool(failed))
