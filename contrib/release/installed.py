#!/usr/bin/env python3
"""Install vbus in each way people do, run it there, and say what was tried and what could not be.

    contrib/release/installed.py                 everything; wheels are built for each Python found
    contrib/release/installed.py pipx no-gcc     these ways alone (--list names them)
    contrib/release/installed.py --wheels dist   with wheels that were built before

A way ends with ``ok``, ``FAILED`` or ``not tried`` and why; exit code 1 if one has failed.
"""

import argparse
import contextlib
import os
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Callable
from functools import cached_property
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
PYTHONS = ("3.11", "3.12", "3.13", "3.14")
LEFT_OUT = (".git", ".venv*", "build", "dist", "__pycache__", ".*_cache", "*.egg-info")
# The user "nobody" of Linux: may write to no folder of others.
UNPRIVILEGED = 65534


class NotHere(Exception):
    """This machine cannot try it; the text says why."""


class Failed(Exception):
    """It does not work; the text says what came out."""


def run(*command: str | Path, cwd: Path | None = None, user: int | None = None, **more: str) -> str:
    """Run a command away from the source tree; return what it prints."""
    # PYTHONPATH or a VBUS_PURE of the caller would decide what is tried.
    environment = {n: text for n, text in os.environ.items() if n[:5] not in ("VBUS_", "PYTHO")}
    done = subprocess.run(
        list(map(str, command)), cwd=cwd or "/", env={**environment, **more}, user=user, group=user,
        extra_groups=None if user is None else [], text=True,
        stdout=subprocess.PIPE, stderr=subprocess.STDOUT,
    )  # fmt: skip
    if done.returncode:
        lines = "\n    ".join(done.stdout.strip().splitlines()[-12:])
        shown = " ".join(map(str, command))
        raise Failed(f"{shown}: exit code {done.returncode}\n    {lines}")
    return done.stdout


def python(version: str) -> str:
    """Return a Python of a version that runs here."""
    # First that of the system: it is what people have.
    places = [shutil.which(f"python{version}")]
    pyenv = Path(os.environ.get("PYENV_ROOT", Path.home() / ".pyenv")) / "versions"
    places += [str(p) for p in sorted(pyenv.glob(f"{version}.*/bin/python{version}"), reverse=True)]
    for place in filter(None, places):
        if not subprocess.run(
            [place, "-c", "import venv, ensurepip"], capture_output=True
        ).returncode:
            return place
    raise NotHere(f"there is no Python {version}")


def tool(name: str, folder: Path) -> Path:
    """Return a tool of Python's, installed for the purpose if need be."""
    found = shutil.which(name)
    if found and not subprocess.run([found, "--version"], capture_output=True).returncode:
        return Path(found)
    made = folder / f"{name}-tool"
    run(sys.executable, "-m", "venv", made)
    run(made / "bin" / "pip", "install", "-q", name)
    return made / "bin" / name


def moves(vbus: Path, core: str, user: int | None = None, home: Path | None = None) -> str:
    """See a motor move under an installed vbus with a core; return what it says of itself."""
    more = {"HOME": str(home), "XDG_RUNTIME_DIR": str(home)} if home else {}
    said = run(vbus, "--version", user=user, **more).strip()
    if not said.endswith(f"({core} core)"):
        raise Failed(f"{said}; wanted the {core} core")
    run(vbus, "demo", "lm629", "--json", user=user, **more)
    return said


class Ways:
    """The ways, each in a folder of its own."""

    def __init__(self, folder: Path, wheels: Path | None) -> None:
        self.folder = folder
        self.wheels = folder / "wheels"
        if wheels is not None:
            shutil.copytree(wheels, self.wheels)
        self.wheels.mkdir(exist_ok=True)

    @cached_property
    def sources(self) -> Path:
        """All is built from this copy, whatever happens to the tree meanwhile."""
        place = self.folder / "sources"
        shutil.copytree(ROOT, place, ignore=shutil.ignore_patterns(*LEFT_OUT))
        return place

    def wheel(self, version: str) -> Path:
        """Return a wheel for a Python, as the release script builds it."""
        tag = f"cp{version.replace('.', '')}"
        if not (found := list(self.wheels.glob(f"vbus-*-{tag}-*.whl"))):
            venv = self.folder / f"build-{version}"
            run(python(version), "-m", "venv", venv)
            run(venv / "bin" / "pip", "install", "-q", "build")
            script = self.sources / "contrib" / "release" / "release.py"
            run(venv / "bin" / "python", script, "wheel", self.wheels, cwd=self.wheels)
            found = list(self.wheels.glob(f"vbus-*-{tag}-*.whl"))
        if not found:
            raise Failed(f"no wheel for Python {version}")
        return found[0]

    def here(self) -> Path:
        """Return a wheel for the Python that runs this."""
        return self.wheel(f"{sys.version_info[0]}.{sys.version_info[1]}")

    def tree(self, name: str) -> Path:
        """Return a copy of the sources."""
        place = self.folder / name
        shutil.copytree(self.sources, place)
        return place

    def venv(self, name: str, *what: str | Path, version: str = "", **more: str) -> Path:
        """Install something in a new environment; return its vbus."""
        place = self.folder / name
        run(python(version) if version else sys.executable, "-m", "venv", place)
        run(place / "bin" / "pip", "install", "-q", *what, **more)
        return place / "bin" / "vbus"

    def of_python(self, version: str) -> str:
        """A wheel of the release script, for a Python."""
        return moves(self.venv(f"py{version}", self.wheel(version), version=version), "compiled")

    def read_only(self) -> str:
        """A source tree that nobody may write to, as a user who is not root."""
        tree = self.tree("read-only")
        for path in (tree, *tree.rglob("*")):
            path.chmod(0o555 if path.is_dir() else 0o444)
        before = sorted(tree.rglob("*"))
        place, user, program, _ = self.home("reader")
        run(program, "-m", "venv", place / "v", user=user, HOME=str(place))
        run(place / "v" / "bin" / "pip", "install", "-q", tree, user=user, HOME=str(place))
        if sorted(tree.rglob("*")) != before:
            raise Failed("the tree has changed")
        return moves(place / "v" / "bin" / "vbus", "compiled", user, place)

    def home(self, name: str) -> tuple[Path, int | None, str, str]:
        """Return a folder of a user who is not root, the user, and a Python of theirs.

        The user is None if who runs this is not root. Of the Python it returns program and version.
        """
        place = self.folder / name
        place.mkdir()
        here = f"{sys.version_info[0]}.{sys.version_info[1]}"
        if os.getuid():
            return place, None, sys.executable, here
        os.chown(place, UNPRIVILEGED, UNPRIVILEGED)
        system = [(f"/usr/bin/python{version}", version) for version in PYTHONS]
        for program, version in ((sys.executable, here), *system):
            with contextlib.suppress(OSError):  # it is not there, or in a folder of root's
                command = [program, "-c", "import venv, ensurepip"]
                if not subprocess.run(command, user=UNPRIVILEGED, capture_output=True).returncode:
                    return place, UNPRIVILEGED, program, version
        raise NotHere(f"a user without root may run neither {sys.executable} nor one in /usr/bin")

    def umlauts(self) -> str:
        """Sources and environment in a folder with a space and umlauts in its name."""
        tree = self.tree("Prüf stand äöü")
        run(sys.executable, "-m", "venv", ".venv", cwd=tree)
        run(tree / ".venv" / "bin" / "pip", "install", "-q", ".", cwd=tree)
        return moves(tree / ".venv" / "bin" / "vbus", "compiled")

    def pipx(self) -> str:
        """``pipx install`` of a wheel."""
        home = {f"PIPX_{n}": str(self.folder / "pipx" / n.lower()) for n in ("HOME", "BIN_DIR")}
        run(tool("pipx", self.folder), "install", "--python", sys.executable, self.here(), **home)
        return moves(Path(home["PIPX_BIN_DIR"]) / "vbus", "compiled")

    def uv(self) -> dict[str, str]:
        """Where uv keeps what it installs; not where the user of this machine has it."""
        place = self.folder / "uv"
        return {"UV_TOOL_DIR": str(place / "tools"), "UV_TOOL_BIN_DIR": str(place / "bin"),
                "UV_CACHE_DIR": str(place / "cache"), "UV_PYTHON_DOWNLOADS": "never"}  # fmt: skip

    def uv_tool(self) -> str:
        """``uv tool install`` of a wheel."""
        uv = tool("uv", self.folder)
        run(uv, "tool", "install", "--python", sys.executable, self.here(), **self.uv())
        return moves(self.folder / "uv" / "bin" / "vbus", "compiled")

    def uvx(self) -> str:
        """``uvx`` with a wheel, without installing anything."""
        uv = tool("uv", self.folder)
        start = (uv, "tool", "run", "--python", sys.executable, "--from", self.here(), "vbus")
        said = run(*start, "--version", **self.uv()).strip().splitlines()[-1]
        if not said.endswith("(compiled core)"):
            raise Failed(said)
        run(*start, "demo", "lm629", "--json", **self.uv())
        return said

    def no_gcc(self) -> str:
        """The sources where no C compiler is: interpreted, and says so."""
        vbus = self.venv("no-gcc", self.tree("no-gcc-tree"), CC="/nowhere/cc")
        said = moves(vbus, "interpreted")
        doctor = subprocess.run([vbus, "doctor"], cwd="/", capture_output=True, text=True).stdout
        if "there was no C compiler (/nowhere/cc)" not in doctor:
            raise Failed(f"doctor does not say why:\n{doctor}")
        return said

    def no_root(self) -> str:
        """A wheel, by a user who is not root."""
        place, user, program, version = self.home("user")
        wheel = shutil.copy(self.wheel(version), place)
        run(program, "-m", "venv", place / "v", user=user, HOME=str(place))
        run(place / "v" / "bin" / "pip", "install", "-q", wheel, user=user, HOME=str(place))
        return moves(place / "v" / "bin" / "vbus", "compiled", user, place)

    def all(self) -> dict[str, Callable[[], str]]:
        """Return each way by its name."""
        ways: dict[str, Callable[[], str]] = {
            f"python{version}": lambda version=version: self.of_python(version)  # type: ignore[misc]
            for version in PYTHONS
        }
        return ways | {
            "no-root": self.no_root, "pipx": self.pipx, "uv-tool": self.uv_tool, "uvx": self.uvx,
            "no-gcc": self.no_gcc, "umlauts": self.umlauts, "read-only": self.read_only,
        }  # fmt: skip


def main() -> int:
    """Try what is asked for."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("ways", nargs="*", help="ways to try; all if none is named")
    parser.add_argument("--wheels", type=Path, help="a folder of wheels that were built before")
    parser.add_argument("--list", action="store_true", help="name the ways")
    options = parser.parse_args()
    bad = 0
    with tempfile.TemporaryDirectory(prefix="vbus-installed-") as folder:
        os.chmod(folder, 0o755)
        ways = Ways(Path(folder), options.wheels.resolve() if options.wheels else None).all()
        if options.list:
            print("\n".join(ways))
            return 0
        if unknown := [name for name in options.ways if name not in ways]:
            parser.error(f"no way {', '.join(unknown)}; there are {', '.join(ways)}")
        for name in options.ways or ways:
            try:
                print(f"{name:12} ok: {ways[name]()}", flush=True)
            except NotHere as why:
                print(f"{name:12} not tried: {why}", flush=True)
            except Failed as why:
                bad += 1
                print(f"{name:12} FAILED: {why}", flush=True)
    return 1 if bad else 0


if __name__ == "__main__":
    sys.exit(main())
