"""A release: what its script refuses, a complete source distribution, files that a forge reads."""

import hashlib
import importlib.util
import io
import json
import os
import re
import subprocess
import sys
import tarfile
import tomllib
from pathlib import Path
from types import ModuleType

import pytest

from tests.schemas import mistakes

ROOT = Path(__file__).parents[2]
CHANGELOG = "# Changelog\n\n## 0.3.0 (unreleased)\n\nNew.\n\n## 0.2.0 (2026-12-01)\n\nA.\n\n* B\n\n"
MACHINE_READ = {
    "vendor.github-workflows": ".github/workflows/*.yml",
    "vendor.github-issue-forms": ".github/ISSUE_TEMPLATE/[!c]*.yml",
    "vendor.github-issue-config": ".github/ISSUE_TEMPLATE/config.yml",
    "vendor.citation-file-format": "CITATION.cff",
}


def script(name: str) -> ModuleType:
    """Return a script of the release as a module."""
    spec = importlib.util.spec_from_file_location(name, ROOT / "contrib" / "release" / f"{name}.py")
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@pytest.fixture
def release() -> ModuleType:
    return script("release")


def test_a_tag_is_a_version_that_the_changelog_has_with_its_date(
    release: ModuleType, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.setattr(release, "ROOT", tmp_path)
    (tmp_path / "CHANGELOG.md").write_text(CHANGELOG)

    assert release.check("v0.2.0") == "0.2.0"
    assert release.notes("0.2.0", CHANGELOG) == ("2026-12-01", "A.\n\n* B")
    for tag, reason in {
        "0.2.0": "is no tag of a release",
        "v0.2": "is no tag of a release",
        "v0.3.0": "0.3.0 is (unreleased); write its date",
        "v0.4.0": "says nothing of 0.4.0; it has 0.3.0, 0.2.0",
    }.items():
        with pytest.raises(release.Wrong, match=reason.replace("(", r"\(").replace(")", r"\)")):
            release.check(tag)


def test_the_version_of_the_tag_is_the_one_of_the_package(
    release: ModuleType, tmp_path: Path
) -> None:
    file = tmp_path / "version.py"
    file.write_text((ROOT / "vbus" / "version.py").read_text())

    release.stamp("9.8.7rc1", file)

    names: dict[str, str] = {}
    exec(file.read_text(), names)
    assert names["__version__"] == "9.8.7rc1"
    assert "version" not in tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]


def test_the_changelog_speaks_of_the_version_this_is(release: ModuleType) -> None:
    from vbus.version import __version__

    assert release.notes(__version__, (ROOT / "CHANGELOG.md").read_text())[1]


def test_the_source_distribution_has_all_that_git_tracks(tmp_path: Path) -> None:
    if not (ROOT / ".git").exists():
        pytest.skip("needs a clone: git tells what belongs to it")

    done = subprocess.run(
        [sys.executable, ROOT / "contrib" / "release" / "release.py", "sdist", tmp_path, "--here"],
        cwd=ROOT, capture_output=True, text=True,
    )  # fmt: skip

    assert done.returncode == 0, done.stdout + done.stderr
    assert done.stdout.strip().endswith(".tar.gz")


def test_a_source_distribution_that_lacks_a_file_is_refused(
    release: ModuleType, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    archive = tmp_path / "vbus-1.tar.gz"
    with tarfile.open(archive, "w:gz") as file:
        for name in ("vbus-1/a.py", "vbus-1/PKG-INFO", "vbus-1/c.log"):
            file.addfile(tarfile.TarInfo(name), io.BytesIO())
    monkeypatch.setattr(release, "tracked", lambda: {"a.py", "b.py"})

    with pytest.raises(release.Wrong, match=r"lacks b\.py; has c\.log, which git does not"):
        release.compare(archive)


@pytest.mark.parametrize(("schema", "pattern"), MACHINE_READ.items(), ids=MACHINE_READ)
def test_what_a_forge_reads_is_valid(schema: str, pattern: str) -> None:
    files = sorted(ROOT.glob(pattern))
    assert files

    assert mistakes(schema, *files) == ""


def test_workflows_call_steps_the_script_has(release: ModuleType) -> None:
    text = "".join(path.read_text() for path in (ROOT / ".github" / "workflows").glob("*.yml"))
    steps = set(re.findall(r"release\.py (\w+)", text))

    assert steps == {"check", "stamp", "sdist", "wheel", "try", "sbom", "notes"}
    for step in steps:
        assert f"release.py {step} " in (release.__doc__ or "")


def test_wheels_are_made_for_every_python_that_is_tested() -> None:
    settings = tomllib.loads((ROOT / "pyproject.toml").read_text())["tool"]["cibuildwheel"]
    workflow = (ROOT / ".github" / "workflows" / "ci.yml").read_text()

    for build in settings["build"].split():
        number = build.removeprefix("cp3").removesuffix("-*")
        assert f'"3.{number}"' in workflow
    assert settings["environment"] == {"VBUS_NEED_COMPILED": "1", "VBUS_RELEASE": "1"}


def test_workflows_have_no_finding_of_medium_or_high_severity() -> None:
    done = subprocess.run(
        [Path(sys.executable).with_name("zizmor"), "--offline", "--no-progress",
         "--min-severity", "medium", ROOT / ".github" / "workflows"],
        capture_output=True, text=True,
    )  # fmt: skip

    assert done.returncode == 0, done.stdout + done.stderr


def test_a_release_lists_its_files_and_what_it_needs(release: ModuleType, tmp_path: Path) -> None:
    # Here: its import takes more than a second of a processor, and each worker collects each file.
    from cyclonedx.schema import SchemaVersion
    from cyclonedx.validation.json import JsonStrictValidator

    (tmp_path / "vbus-1.2.3.tar.gz").write_bytes(b"sources")
    (tmp_path / "vbus-1.2.3-py3-none-any.whl").write_bytes(b"wheel")
    needs = release.needed()

    text = release.bill(tmp_path, needs, 1_790_000_000)

    validator = JsonStrictValidator(SchemaVersion.V1_6)
    assert validator.validate_str(text) is None
    assert validator.validate_str(text.replace('"sha-256"', '"sum"').replace("SHA-256", "sum"))
    assert text == release.bill(tmp_path, needs, 1_790_000_000)
    found = json.loads(text)
    assert found["metadata"]["component"]["purl"] == f"pkg:pypi/vbus@{needs[0][1]}"
    hashes = {one["name"]: one["hashes"][0]["content"]
              for one in found["components"] if one["type"] == "file"}  # fmt: skip
    assert hashes == {
        "vbus-1.2.3.tar.gz": hashlib.sha256(b"sources").hexdigest(),
        "vbus-1.2.3-py3-none-any.whl": hashlib.sha256(b"wheel").hexdigest(),
    }
    there = {one["name"].lower() for one in found["components"] if one["type"] == "library"}
    asked = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]["dependencies"]
    names = {re.split(r"[><=]", one)[0].replace("_", "-") for one in asked}
    assert names <= {name.replace("_", "-") for name in there}
    assert "markdown-it-py" in there  # what rich needs
    assert not there & {"matplotlib", "pytest"}
    with pytest.raises(release.Wrong, match="has no distribution"):
        release.bill(tmp_path / "none", needs, 0)


def test_the_second_command_of_the_readme_leaves_the_core_of_the_first_alone() -> None:
    first, second = re.findall(
        r"^python3 -m venv (\S+) && .*$", (ROOT / "README.md").read_text(), re.M
    )
    contributing = (ROOT / "CONTRIBUTING.md").read_text()

    assert first != second
    assert f"{second}/bin/pip install -e" in contributing
    assert f"{first}/bin" not in contributing


def test_each_way_to_install_is_tried_by_a_script_that_names_it() -> None:
    listed = subprocess.run(
        [sys.executable, ROOT / "contrib" / "release" / "installed.py", "--list"],
        capture_output=True, text=True, check=True,
    ).stdout.split()  # fmt: skip
    wheels = tomllib.loads((ROOT / "pyproject.toml").read_text())["tool"]["cibuildwheel"]["build"]

    pythons = {f"cp{name.removeprefix('python').replace('.', '')}-*" for name in listed[:4]}
    assert pythons == set(wheels.split())
    assert {"no-root", "pipx", "uv-tool", "uvx", "no-gcc", "umlauts", "read-only"} < set(listed)
    assert "contrib/release/installed.py" in (ROOT / ".github" / "workflows" / "ci.yml").read_text()


@pytest.mark.skipif(os.getuid() != 0, reason="needs root, who may run what others may not")
def test_a_python_in_a_folder_of_roots_is_not_tried_by_another_user(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    installed = script("installed")
    hidden = tmp_path / "of-root"
    hidden.mkdir(mode=0o700)
    (hidden / "python3").symlink_to(sys.executable)
    monkeypatch.setattr(sys, "executable", str(hidden / "python3"))
    monkeypatch.setattr(installed, "PYTHONS", ("0.0",))

    with pytest.raises(installed.NotHere, match="may run neither"):
        installed.Ways(tmp_path, None).home("user")
