"""Entry points are those that ``importlib.metadata`` finds."""

import sys
from collections.abc import Iterator
from importlib import metadata
from pathlib import Path
from zipfile import ZipFile

import pytest

from vbus.core.entry_points import EntryPoint, installed

Row = tuple[str, str, str]

TEXT = """\
[console_scripts]
acme = acme.tool:main

# parts
[vbus.chips]
ACME-1=acme.chip:Chips.one
  OLD = acme.old [extra]
"""


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    monkeypatch.setattr(sys, "path", [str(tmp_path / "absent"), str(tmp_path), *sys.path])
    installed.cache_clear()
    yield tmp_path
    installed.cache_clear()


def install(folder: Path, name: str, text: str) -> None:
    (folder / name).mkdir(parents=True)
    (folder / name / "METADATA").write_text(f"Name: {name.partition('-')[0]}\nVersion: 1.0\n")
    (folder / name / "entry_points.txt").write_text(text)


def as_python_finds_them() -> set[Row]:
    found = metadata.distributions()
    points: dict[str, list[Row]] = {}
    for package in found:
        rows = [(entry.name, entry.value, entry.group) for entry in package.entry_points]
        points.setdefault(package.name.lower().replace("_", "-"), rows)
    return {row for rows in points.values() for row in rows}


def test_they_are_those_that_python_finds(folder: Path) -> None:
    install(folder, "acme_parts-1.0.dist-info", TEXT)
    install(folder, "older.egg-info", "[vbus.plants]\nlathe = older:Lathe\n")
    (folder / "empty-1.0.dist-info").mkdir()
    (folder / "empty-1.0.dist-info" / "METADATA").write_text("Name: empty\nVersion: 1.0\n")
    here = {(entry.name, entry.value, entry.group) for entry in installed()}
    assert here == as_python_finds_them()
    assert EntryPoint("ACME-1", "acme.chip:Chips.one", "vbus.chips", "acme-parts") in installed()
    assert EntryPoint("lathe", "older:Lathe", "vbus.plants", "older") in installed()


def test_of_a_package_that_is_there_twice_the_first_counts(
    folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    install(folder, "acme_parts-2.0.dist-info", "[vbus.chips]\nACME-2 = acme:New\n")
    install(folder / "later", "Acme_Parts-1.0.dist-info", TEXT)
    monkeypatch.setattr(sys, "path", [*sys.path, str(folder / "later")])
    mine = [entry for entry in installed() if entry.package.lower() == "acme-parts"]
    assert mine == [EntryPoint("ACME-2", "acme:New", "vbus.chips", "acme-parts")]


def test_packages_in_zip_files_are_found_with_all_others(
    folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    install(folder, "acme-1.0.dist-info", TEXT)
    parts = folder / "parts.zip"
    with ZipFile(parts, "w") as packed:
        packed.writestr("lathe-1.0.dist-info/METADATA", "Name: lathe\nVersion: 1.0\n")
        packed.writestr("lathe-1.0.dist-info/entry_points.txt", "[vbus.plants]\nlathe = a:B\n")
    monkeypatch.setattr(sys, "path", [*sys.path, str(parts)])
    here = installed()
    assert {(entry.name, entry.value, entry.group) for entry in here} == as_python_finds_them()
    assert EntryPoint("lathe", "a:B", "vbus.plants", "lathe") in here
    assert EntryPoint("OLD", "acme.old [extra]", "vbus.chips", "acme") in here


def test_what_is_registered_is_loaded_by_its_path() -> None:
    here = __name__
    assert EntryPoint("a", f"{here}:EntryPoint.load", "g").load() is EntryPoint.load
    assert EntryPoint("a", f"{here} : EntryPoint [extra]", "g").load() is EntryPoint
    assert EntryPoint("a", here, "g").load() is sys.modules[here]
    with pytest.raises(AttributeError):
        EntryPoint("a", f"{here}:absent", "g").load()
