"""``python -m tests.fuzz --keep DIRECTORY``: coverage-guided fuzzing of every target in turn.

Needs atheris (``pip install atheris``). What reaches something new goes into the directory given by
``--keep``, and from there, as little of it as reaches the same, into the corpus by ``--merge``.
"""

import argparse
import os
import sys
from pathlib import Path

import atheris

with atheris.instrument_imports(include=["vbus"]):
    from tests.fuzz.targets import TARGETS, tried

CORPUS = Path(__file__).parent / "corpus"


def fuzz(target: str, asked: argparse.Namespace) -> None:
    """Fuzz one target; does not return."""
    corpus, keep = CORPUS / target, asked.keep / target
    for directory in (corpus, keep):
        directory.mkdir(parents=True, exist_ok=True)
    options = [f"-max_len={asked.longest}", "-timeout=10", "-rss_limit_mb=1500"]
    if asked.merge:
        options += ["-merge=1", str(corpus), str(keep)]
    else:
        options += [f"-max_total_time={asked.seconds}", f"-artifact_prefix={asked.keep}/{target}-"]
        options += [str(keep), str(corpus)]
    atheris.Setup([sys.argv[0], *options], lambda data: tried(target, data) and None)
    atheris.Fuzz()


def main() -> bool:
    """Fuzz one target after the other; tell whether one has failed."""
    parser = argparse.ArgumentParser(prog="python -m tests.fuzz")
    parser.add_argument("targets", nargs="*", metavar="TARGET", help=", ".join(TARGETS))
    parser.add_argument("--seconds", type=int, default=60, help="how long for each (60)")
    parser.add_argument("--longest", type=int, default=400, help="bytes of an input (400)")
    parser.add_argument("--keep", type=Path, required=True, help="directory for what is found")
    parser.add_argument(
        "--merge", action="store_true", help="take from there what the corpus lacks"
    )
    asked = parser.parse_args()
    failed = []
    for target in asked.targets or TARGETS:
        child = os.fork()
        if not child:
            fuzz(target, asked)
        if os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]):
            failed.append(target)
    print(f"failed: {', '.join(failed) or 'none'}")
    return bool(failed)


if __name__ == "__main__":
    sys.exit(main())
