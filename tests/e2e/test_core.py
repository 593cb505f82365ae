"""Which core runs, how to choose it, and wheels built with and without a compiler."""

import ast
import importlib.util
import os
import re
import subprocess
import sys
import zipfile
from pathlib import Path
from types import ModuleType

import pytest

import vbus
from vbus.compiled import is_compiled

HOME = Path(next(iter(vbus.__path__))).parent
ROOT = Path(__file__).parents[2]
SLOWER = "50 to 170 times slower in samples and some ten times on the bus"


def command(*arguments: str, pure: str = "") -> subprocess.CompletedProcess[str]:
    environment = {**os.environ, "PYTHONPATH": str(HOME), "VBUS_PURE": pure}
    return subprocess.run(
        [sys.executable, "-m", "vbus", *arguments],
        cwd=HOME, env=environment, capture_output=True, text=True, timeout=60,
    )  # fmt: skip


def test_doctor_says_which_core_runs_and_why() -> None:
    core = command("doctor").stdout.partition("core: ")[2].splitlines()[0]
    assert core == ("compiled" if is_compiled() else "interpreted: it runs from its source tree")


@pytest.mark.core("compiled")
def test_vbus_pure_chooses_the_interpreted_core() -> None:
    assert command("--version", pure="0").stdout.endswith("(compiled core)\n")
    assert command("--version", pure="1").stdout.endswith("(interpreted core)\n")
    assert "core: interpreted: VBUS_PURE asks for it" in command("doctor", pure="1").stdout
    where = "import vbus.core.kernel.kernel as k, vbus.chips.lm628.pid as p"
    where += "; print(k.__file__, p.__file__)"
    done = subprocess.run(
        [sys.executable, "-c", where],
        cwd=HOME, env={**os.environ, "PYTHONPATH": str(HOME), "VBUS_PURE": "1"},
        capture_output=True, text=True, check=True,
    )  # fmt: skip
    assert [Path(file).suffix for file in done.stdout.split()] == [".py", ".py"]


def build(folder: Path, **environment: str) -> subprocess.CompletedProcess[str]:
    clean = {name: text for name, text in os.environ.items() if not name.startswith("VBUS_")}
    return subprocess.run(
        [
            *(sys.executable, "-m", "pip", "wheel", "-v", "--no-deps", "--no-build-isolation"),
            *("-w", folder, ROOT),
        ],
        env={**clean, **environment}, cwd=folder, capture_output=True, text=True, timeout=300,
    )  # fmt: skip


@pytest.mark.slow
@pytest.mark.core("compiled")
@pytest.mark.skipif(
    os.environ.get("VBUS_REQUIRE_ALL") != "1",
    reason="builds wheels, with build tools from a package index; VBUS_REQUIRE_ALL=1 does it",
)
def test_without_a_compiler_a_pure_wheel_results_and_says_so(tmp_path: Path) -> None:
    done = build(tmp_path, CC="/nowhere/cc")
    assert done.returncode == 0, done.stderr
    [wheel] = tmp_path.glob("*.whl")
    assert wheel.name == f"vbus-{vbus.__version__}-py3-none-any.whl"
    reason = "there was no C compiler (/nowhere/cc)"
    assert f"the core of this wheel is interpreted, {SLOWER}: {reason}" in (
        done.stdout + done.stderr
    )
    with zipfile.ZipFile(wheel) as content:
        assert content.read("vbus/compiled/reason.txt").decode() == f"{reason}\n"
        content.extractall(tmp_path / "installed")
    environment = {**os.environ, "PYTHONPATH": str(tmp_path / "installed")}
    shown = subprocess.run(
        [sys.executable, "-m", "vbus", "doctor"],
        cwd=tmp_path / "installed", env=environment, capture_output=True, text=True, timeout=60,
    )  # fmt: skip
    assert f"warn  core: interpreted: {reason}\n      it is {SLOWER}: install gcc" in (shown.stdout)

    done = build(tmp_path, CC="/nowhere/cc", VBUS_NEED_COMPILED="1")
    assert done.returncode != 0
    assert f"vbus: no compiled core: {reason}. VBUS_NEED_COMPILED makes that an error" in (
        done.stdout + done.stderr
    )


@pytest.fixture
def hook() -> ModuleType:
    spec = importlib.util.spec_from_file_location("hook", ROOT / "vbus" / "compiled" / "hook.py")
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def test_each_file_that_is_compiled_is_in_one_unit_at_most(hook: ModuleType) -> None:
    listed = hook.core_files(ROOT)
    assert len(listed) > 50
    for pattern in hook.COMPILED:
        assert list((ROOT / "vbus").glob(pattern)), pattern
    units = hook.units(ROOT)
    for name in hook.SAMPLED:
        assert list((ROOT / "vbus").glob(f"chips/*/{name}")), name
    in_units = [name for unit in units for name in unit]
    assert set(in_units) <= set(listed)
    assert len(in_units) == len(set(in_units)) > 50
    assert all(len(unit) > 3 for unit in units)


def test_no_compiled_class_inherits_from_an_interpreted_one(hook: ModuleType) -> None:
    """Its attributes would be looked up by name: strobes of an LM629 took 1.4 times as long so."""
    compiled = hook.core_files(ROOT)
    found = []
    for name in compiled:
        tree = ast.parse((ROOT / name).read_text())
        modules = {
            alias.asname or alias.name: node.module.replace(".", "/")
            for node in tree.body
            if isinstance(node, ast.ImportFrom) and str(node.module).startswith("vbus.")
            for alias in node.names
        }  # a package says itself where what it names comes from, and is compiled nowhere
        found += [
            (name, made.name, base.id)
            for made in tree.body
            if isinstance(made, ast.ClassDef)
            for base in made.bases
            if isinstance(base, ast.Name) and base.id in modules
            if (ROOT / f"{modules[base.id]}.py").is_file()
            if f"{modules[base.id]}.py" not in compiled
        ]
    assert not found


def test_all_pages_and_messages_have_one_figure_for_the_interpreted_core(hook: ModuleType) -> None:
    assert hook.SLOWER == SLOWER
    pages = [ROOT / "README.md", *sorted((ROOT / "docs").glob("*.md"))]
    pages += [*sorted((ROOT / "docker").iterdir()), ROOT / "vbus" / "cli" / "run" / "doctor.py"]
    figures = {
        figure
        for page in pages
        if page.is_file()
        for figure in re.findall(r"(\S+ \S+ \S+)\s+times slower", page.read_text())
    }
    assert figures == {"50 to 170"}
