"""What the first minute of a newcomer takes: the README's two commands, in parts.

    python benchmarks/first_minute.py                both commands, and their requirements alone
    python benchmarks/first_minute.py --first        the first command alone

Everything is made anew in a folder outside the source tree, with an empty cache of pip. Each row
has seconds of the wall and of processors; on a busy machine the latter, divided by two, are the
least that two quiet processors take. Rows that stand further in are parts of what follows or comes
before: ``gcc -c`` and links are of pip's build. ``requirements alone`` is a bare environment and
``pip install`` of what the command installs besides vbus. The first line names the machine.
"""

import argparse
import os
import resource
import shlex
import shutil
import subprocess
import sys
import tempfile
import time
import tomllib
from pathlib import Path
from typing import NamedTuple

ROOT = Path(__file__).resolve().parents[1]
TARGET_S = {"first": 75.0, "second": 90.0}
LEFT_OUT = (".git", ".venv*", "build", "dist", "__pycache__", ".*_cache", "*.egg-info")


class Took(NamedTuple):
    """Seconds of the wall, and of processors (user and system); 0: not measured."""

    wall: float
    processor: float = 0.0


def timed(command: str, folder: Path, **environment: str) -> Took:
    """Run a command of a shell in a folder; end with its output if it fails."""
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    begun = time.monotonic()
    done = subprocess.run(
        ["bash", "-euo", "pipefail", "-c", command], cwd=folder,
        env={**os.environ, "PIP_NO_CACHE_DIR": "1", **environment},
        stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True,
    )  # fmt: skip
    wall = time.monotonic() - begun
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    if done.returncode:
        sys.exit(f"{command}: exit code {done.returncode}\n{done.stdout}")
    used = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
    return Took(wall, used)


def show(part: str, took: Took, note: str = "") -> None:
    """Print a row."""
    used = f"{took.processor:7.1f} s" if took.processor else ""
    print(f"{part:44} {took.wall:7.1f} s {used:9}  {note}".rstrip(), flush=True)


def blocks() -> tuple[list[str], list[str]]:
    """Return the README's first two commands, each cut where a shell would."""
    text = (ROOT / "README.md").read_text().split("```sh\n")
    first, second = (block.partition("\n```")[0].split(" && ") for block in text[1:3])
    return first, second


def requirements(extra: str = "") -> str:
    """Return what vbus needs to run, with an extra, as arguments of a shell."""
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
    extras = project["optional-dependencies"]
    found, names = list(project["dependencies"]), [extra] if extra else []
    while names:
        for text in extras[names.pop()]:
            if text.startswith("vbus["):
                names += text[5:-1].split(",")
            else:
                found.append(text)
    return shlex.join(found)


COMPILER = """#!/bin/sh
begun=$(date +%s.%N)
{gcc} "$@"
code=$?
kind=link
for word; do [ "$word" = -c ] && kind=compile; done
case "$*" in */probe.*) kind=probe ;; esac
echo "$kind $begun $(date +%s.%N)" >> {log}
exit $code
"""


def compiler(folder: Path) -> tuple[Path, Path]:
    """Return a C compiler that notes when each call began and ended, and its notes."""
    program, log = folder / "gcc", folder / "calls"
    program.write_text(COMPILER.format(gcc=shutil.which("gcc") or "gcc", log=log))
    program.chmod(0o755)
    return program, log


def calls(log: Path, kind: str) -> tuple[float, float]:
    """Return when the first call of a kind began, and when the last ended."""
    rows = [line.split() for line in log.read_text().splitlines()]
    times = [(float(begun), float(ended)) for name, begun, ended in rows if name == kind]
    return min(begun for begun, _ in times), max(ended for _, ended in times)


def first(folder: Path) -> Took:
    """Measure the first command, part by part."""
    tree = folder / "tree"
    shutil.copytree(ROOT, tree, ignore=shutil.ignore_patterns(*LEFT_OUT))
    venv, install, demo = blocks()[0]
    whole = []
    whole.append(timed(venv, tree))
    show("first: venv", whole[-1])
    build = tomllib.loads((ROOT / "pyproject.toml").read_text())["build-system"]["requires"]
    needs = shlex.join(build)
    pip = f"{tree}/.venv/bin/pip install -q --target build"
    show("  build requirements, alone", timed(f"{pip} {needs}", folder))
    made = {"PYTHONPATH": str(folder / "build"), "MADE": str(folder)}
    show("  mypyc, alone", timed(f".venv/bin/python -c {shlex.quote(MYPYC)}", tree, **made))
    program, log = compiler(folder)
    whole.append(timed(install, tree, CC=str(program)))
    show("first: pip install", whole[-1])
    compiled = calls(log, "compile")
    linked = calls(log, "link")
    show("  gcc -c", Took(compiled[1] - compiled[0]))
    show("  links", Took(max(linked[1] - compiled[1], 0.0)), "after gcc -c")
    whole.append(timed(demo, tree))
    show("first: demo", whole[-1])
    return Took(sum(took.wall for took in whole), sum(took.processor for took in whole))


MYPYC = """
import importlib.util, os, pathlib
spec = importlib.util.spec_from_file_location("hook", "vbus/compiled/hook.py")
hook = importlib.util.module_from_spec(spec)
spec.loader.exec_module(hook)
hook.generate(pathlib.Path.cwd(), pathlib.Path(os.environ["MADE"]))
"""


def second(folder: Path) -> Took:
    """Measure the set-up of the second command, in the tree of the first."""
    took = timed(" && ".join(blocks()[1][:-1]), folder / "tree")
    show("second: set-up", took)
    return took


def alone(folder: Path, extra: str) -> Took:
    """Measure an environment, and what a command installs in it besides vbus."""
    place = folder / f"alone{extra}"
    took = timed(
        f"python3 -m venv {place} && {place}/bin/pip install -q {requirements(extra)}", folder
    )
    show(f"requirements alone{f', with {extra}' if extra else ''}", took)
    return took


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--first", action="store_true", help="the first command alone")
    options = parser.parse_args()
    load = f"load {os.getloadavg()[0]:.1f}"
    print(f"{os.cpu_count()} processors, {load}, Python {sys.version.split()[0]}")
    print(f"{'part':44} {'wall':>9} {'processor':>9}")
    with tempfile.TemporaryDirectory(prefix="first-minute-") as place:
        folder = Path(place)
        names = ("first",) if options.first else ("first", "second")
        for name, measure, extra in (("first", first, ""), ("second", second, "test")):
            if name not in names:
                continue
            took = measure(folder)
            bare = alone(folder, extra)
            show(
                f"{name}, whole", took,
                f"target {TARGET_S[name]:.0f} s; {took.wall / bare.wall:.2f} times the"
                f" requirements alone, {took.processor / bare.processor:.2f} in processor time",
            )  # fmt: skip


if __name__ == "__main__":
    main()
