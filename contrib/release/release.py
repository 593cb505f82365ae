#!/usr/bin/env python3
"""What a release is made of; the workflow calls each step, and each runs on any machine.

    release.py check v0.2.0       the tag is a version, and CHANGELOG.md has it with its date
    release.py stamp v0.2.0       write the tag's version into vbus/version.py
    release.py sdist dist         build the source distribution: all that git tracks, no more
    release.py wheel dist         build a wheel for this Python (--pure: without the compiled core)
    release.py try dist           install what lies there in a new environment, and run it
    release.py sbom dist          print a CycloneDX list of what lies there and what it needs
    release.py notes v0.2.0       print what the changelog says of it

Building needs ``build`` (pip install build); with --here it takes hatchling and mypy from this
environment instead of fetching them. The list needs ``cyclonedx-python-lib``; what vbus needs are
the versions that a new environment gets, with --here those of this one.
"""

import argparse
import contextlib
import hashlib
import importlib.metadata
import json
import os
import re
import subprocess
import sys
import tarfile
import tempfile
import uuid
import venv
from collections.abc import Iterator
from datetime import UTC, datetime
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
TAG = re.compile(r"v(\d+\.\d+\.\d+(?:(?:a|b|rc)\d+)?)")
HEADING = re.compile(r"^## (\S+) \(([^)]+)\)$", re.MULTILINE)
VERSION = re.compile(r'^__version__ = "([^"]+)"$', re.MULTILINE)
MADE = frozenset({"PKG-INFO"})
"""What a source distribution has besides what git tracks."""


class Wrong(Exception):
    """A release cannot be made so; the text says why."""


def version_of(tag: str) -> str:
    """Return the version a tag names."""
    match = TAG.fullmatch(tag)
    if match is None:
        raise Wrong(f'"{tag}" is no tag of a release; write one like v1.2.3 or v1.2.3rc1')
    return match[1]


def notes(version: str, changelog: str) -> tuple[str, str]:
    """Return the date of a version in the changelog, and what it says of it."""
    headings = list(HEADING.finditer(changelog))
    for place, heading in enumerate(headings):
        if heading[1] == version:
            end = headings[place + 1].start() if place + 1 < len(headings) else len(changelog)
            return heading[2], changelog[heading.end() : end].strip()
    known = ", ".join(heading[1] for heading in headings) or "none"
    raise Wrong(f"CHANGELOG.md says nothing of {version}; it has {known}")


def check(tag: str) -> str:
    """Return the version of a tag that may be released."""
    version = version_of(tag)
    date, text = notes(version, (ROOT / "CHANGELOG.md").read_text())
    # Until then it says "not released", which must not be published.
    if not re.fullmatch(r"\d{4}-\d{2}-\d{2}", date):
        raise Wrong(f"CHANGELOG.md: {version} is ({date}); write its date, such as (2027-01-31)")
    if not text:
        raise Wrong(f"CHANGELOG.md says nothing below {version}")
    return version


def stamp(version: str, path: Path) -> None:
    """Write a version into the file that has it."""
    text, count = VERSION.subn(f'__version__ = "{version}"', path.read_text())
    if count != 1:
        raise Wrong(f"{path} has no line for the version")
    path.write_text(text)


def tracked() -> set[str]:
    """Return the files git tracks."""
    listed = run("git", "ls-files", "-z", "--cached", "--others", "--exclude-standard")
    return {name for name in listed.split("\0") if name and (ROOT / name).exists()}


def compare(archive: Path) -> None:
    """Compare a source distribution with what git tracks."""
    with tarfile.open(archive) as file:
        # Below the folder of name and version that every archive begins with.
        names = {name.partition("/")[2] for name in file.getnames()} - MADE
    there = tracked()
    told = [f"lacks {name}" for name in sorted(there - names)]
    told += [f"has {name}, which git does not" for name in sorted(names - there)]
    if told:
        raise Wrong(f"{archive.name} " + "; ".join(told))


def build(kind: str, target: Path, here: bool) -> Path:
    """Build a distribution into a folder; return it."""
    place = str(target.resolve())
    if here:
        run(sys.executable, "-m", "hatchling", "build", "-t", kind, "-d", place)
    else:
        run(sys.executable, "-m", "build", f"--{kind}", "--outdir", place, str(ROOT))
    return max(target.glob("vbus-*"), key=lambda path: path.stat().st_mtime)


@contextlib.contextmanager
def installed(folder: Path) -> Iterator[Path]:
    """Install vbus from a folder in a new environment; give the folder of its programs."""
    with tempfile.TemporaryDirectory() as place:
        venv.create(place, with_pip=True)
        programs = Path(place) / "bin"
        wheels = sorted(str(wheel) for wheel in folder.resolve().glob("vbus-*.whl"))
        if not wheels:
            raise Wrong(f"{folder} has no wheel")
        run(str(programs / "python"), "-m", "pip", "install", "--quiet",
            "--find-links", str(folder.resolve()),
            # Of several wheels pip chooses the one for this Python.
            wheels[0] if len(wheels) == 1 else "vbus")  # fmt: skip
        yield programs


def try_wheels(folder: Path) -> None:
    """Install vbus from a folder in a new environment, and let a motor move."""
    with installed(folder) as programs:
        for command in (["--version"], ["demo", "lm629", "--json"]):
            print(run(str(programs / "vbus"), *command).strip())


# -- what a release consists of -------------------------------------------------------------------


def needed(paths: list[str] | None = None) -> list[tuple[str, str, list[str]]]:
    """Return vbus and all it needs: name, version, and the names of what each needs itself.

    Args:
        paths: where distributions are; this environment if not given.
    """
    context = {} if paths is None else {"path": paths}
    there = {_plain(it.name): it for it in importlib.metadata.distributions(**context)}
    found: dict[str, tuple[str, str, list[str]]] = {}
    todo = ["vbus"]
    for name in todo:
        if name in found or name not in there:
            continue  # what this Python or machine does without is not installed
        wants = [_plain(text) for text in there[name].requires or () if "extra ==" not in text]
        needs = sorted({want for want in wants if want in there})
        found[name] = there[name].name, there[name].version, needs
        todo += needs
    if not found:
        raise Wrong("vbus is not installed there")
    return list(found.values())


def _plain(requirement: str) -> str:
    """Return the name of a requirement, as PyPI spells all that are the same."""
    match = re.match(r"[\w.-]+", requirement)
    return re.sub(r"[-_.]+", "-", match[0] if match else "").lower()


def bill(folder: Path, needs: list[tuple[str, str, list[str]]], when: int) -> str:
    """Return the CycloneDX list of a release: its files with their hashes, and what it needs.

    Args:
        folder: has the distributions.
        needs: vbus and what :func:`needed` found beside it.
        when: seconds since 1970: the same files make the same list.
    """
    from cyclonedx.model import HashAlgorithm, HashType
    from cyclonedx.model.bom import Bom
    from cyclonedx.model.component import Component, ComponentType
    from cyclonedx.model.license import LicenseExpression
    from cyclonedx.output.json import JsonV1Dot6
    from packageurl import PackageURL

    def package(name: str, version: str) -> Component:
        url = PackageURL("pypi", None, _plain(name), version)
        return Component(name=name, version=version, type=ComponentType.LIBRARY, purl=url,
                         bom_ref=str(url))  # fmt: skip

    packages = {_plain(name): package(name, version) for name, version, _ in needs}
    whole = packages["vbus"]
    whole.type = ComponentType.APPLICATION
    whole.licenses.add(LicenseExpression("Apache-2.0"))
    files = []
    for path in sorted(folder.glob("vbus-*")):
        content = hashlib.sha256(path.read_bytes()).hexdigest()
        files.append(
            Component(name=path.name, type=ComponentType.FILE, bom_ref=f"file:{path.name}",
                      hashes=[HashType(alg=HashAlgorithm.SHA_256, content=content)])
        )  # fmt: skip
    if not files:
        raise Wrong(f"{folder} has no distribution")
    bom = Bom(components=[it for it in packages.values() if it is not whole] + files)
    bom.metadata.component = whole
    bom.metadata.timestamp = datetime.fromtimestamp(when, UTC)
    names = "".join(f"{it.name} {next(iter(it.hashes)).content}\n" for it in files)
    bom.serial_number = uuid.uuid5(uuid.NAMESPACE_URL, names)
    for name, _, wants in needs:
        own = files if _plain(name) == "vbus" else []
        bom.register_dependency(packages[_plain(name)], [*own, *(packages[it] for it in wants)])
    return str(JsonV1Dot6(bom).output_as_string(indent=2))


def sbom(folder: Path, here: bool) -> str:
    """Return the list of what lies in a folder, as of the commit that is checked out."""
    when = int(run("git", "log", "-1", "--format=%ct"))
    if here:
        return bill(folder, needed(), when)
    with installed(folder) as programs:
        code = "import json, sysconfig; print(json.dumps(sysconfig.get_paths()['purelib']))"
        place = json.loads(run(str(programs / "python"), "-c", code))
        return bill(folder, needed([place]), when)


def run(*command: str) -> str:
    """Run a command at the top of the tree; return what it prints."""
    done = subprocess.run(command, cwd=ROOT, stdout=subprocess.PIPE, text=True)
    if done.returncode:
        raise Wrong(f"{' '.join(command)}: exit code {done.returncode}\n{done.stdout}")
    return done.stdout


def main() -> int:
    """Do one step."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    steps = ["check", "stamp", "sdist", "wheel", "try", "sbom", "notes"]
    parser.add_argument("step", choices=steps)
    parser.add_argument("what", help="the tag, or the folder distributions are in")
    parser.add_argument("--pure", action="store_true", help="a wheel without the compiled core")
    parser.add_argument("--here", action="store_true", help="with what is installed here")
    given = parser.parse_args()
    try:
        if given.step == "check":
            print(check(given.what))
        elif given.step == "stamp":
            stamp(version_of(given.what), ROOT / "vbus" / "version.py")
        elif given.step == "notes":
            print(notes(version_of(given.what), (ROOT / "CHANGELOG.md").read_text())[1])
        elif given.step == "try":
            try_wheels(Path(given.what))
        elif given.step == "sbom":
            print(sbom(Path(given.what), given.here))
        else:
            folder = Path(given.what)
            folder.mkdir(parents=True, exist_ok=True)
            if given.step == "wheel":
                for name in (
                    ("VBUS_PURE",) if given.pure else ("VBUS_NEED_COMPILED", "VBUS_RELEASE")
                ):
                    os.environ[name] = "1"
            made = build(given.step, folder, given.here)
            if given.step == "sdist":
                compare(made)
            print(made)
    except Wrong as error:
        print(f"release.py: {error}", file=sys.stderr)
        return 1
    return 0


if __name__ == "__main__":
    sys.exit(main())
