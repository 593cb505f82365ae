"""``python -m tests.planted``: what comes of each mistake; with ``--campaign`` campaigns, too.

A campaign is made of each mistake that the driver's own tests do not find, and campaigns.toml is
written anew. It is as long as its number of runs says, so the machine's load decides nothing.
"""

import json
import sys
import tempfile
from multiprocessing import get_context
from pathlib import Path

from msgspec.structs import asdict

from tests.planted.campaigns import FILE, campaign, not_found
from tests.planted.suite import MISTAKES, driver_tests, run


def main(arguments: list[str]) -> None:
    """Run all mistakes, or the campaigns of those that are not found."""
    total = sum(map(len, MISTAKES.values()))
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        if arguments != ["--campaign"]:
            for driver, rows in MISTAKES.items():
                for number, row in enumerate(rows, 1):
                    outcome = run(driver_tests(driver, number), folder)
                    found = outcome.red or sorted(outcome.rules) or ["silent"]
                    print(f"{driver}: {row['what']}: {'; '.join(found)}")
            return
        lines, left = ["# Written by: python -m tests.planted --campaign"], 0
        rows = not_found()
        with get_context("fork").Pool() as pool:
            found = pool.starmap(campaign, [(*row, folder) for row in rows], chunksize=1)
        for (driver, _), row in zip(rows, found, strict=True):
            print(f"{driver}: {row.what}: {row.verdict} {row.says}".rstrip())
            # A text of JSON is one of TOML, too.
            cells = [f"{key} = {json.dumps(text)}" for key, text in asdict(row).items() if text]
            lines += ["", f"[[{json.dumps(driver)}]]", *cells]
            left += not row.world
    FILE.write_text("\n".join(lines) + "\n")
    print(f"{total - left} of {total} are found: {1 - left / total:.1%}")


main(sys.argv[1:])
