#!/usr/bin/env python3
"""Get what runs vbus in a browser: ``python docs/live/get.py [FOLDER]``, by default build/live.

Pyodide, which is Python for browsers, comes from npm, and what vbus imports there from the index of
Python packages, by ``npm`` and ``pip`` as they are configured. Where FOLDER has it,
``sphinx-build`` puts it on the site: nothing is loaded from elsewhere then.
"""

import json
import shutil
import subprocess
import sys
import tarfile
import tempfile
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
PYODIDE = "pyodide@314.0.7"
FILES = (
    "pyodide.mjs", "pyodide.asm.mjs", "pyodide.asm.wasm", "python_stdlib.zip", "pyodide-lock.json",
)  # fmt: skip
PACKAGES = ("msgpack>=1.0.8", "msgspec>=0.19", "mypy_extensions>=1.0")


def get(folder: Path) -> None:
    """Get all of it into a folder, which is made anew.

    Raises:
        SystemExit: npm is not there, or it or pip fails; says why.
    """
    npm = shutil.which("npm")
    if npm is None:
        sys.exit("docs/live/get.py: npm is not there (Debian: npm); the site is built without it")
    with tempfile.TemporaryDirectory() as scratch:
        place = Path(scratch)
        run(npm, "pack", "--silent", "--pack-destination", place, PYODIDE)
        new = place / "new"
        new.mkdir()
        with tarfile.open(next(place.glob("pyodide-*.tgz"))) as packed:
            for name in FILES:
                file = packed.extractfile(f"package/{name}")
                assert file is not None
                (new / name).write_bytes(file.read())
        about = json.loads((new / "pyodide-lock.json").read_text())["info"]
        version = about["python"].rpartition(".")[0]
        run(
            sys.executable, "-m", "pip", "download", "-q", "--no-deps", "--only-binary", ":all:",
            "--python-version", version, "--implementation", "cp", "--abi",
            f"cp{version.replace('.', '')}", "--platform",
            f"pyemscripten_{about['abi_version']}_wasm32", "-d", new, *PACKAGES,
        )  # fmt: skip
        shutil.rmtree(folder, ignore_errors=True)
        shutil.copytree(new, folder)


def run(*command: str | Path) -> None:
    """Run a command; end with what it printed if it fails."""
    done = subprocess.run(command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True)
    if done.returncode:
        sys.exit(f"{' '.join(map(str, command))}: exit code {done.returncode}\n{done.stdout}")


if __name__ == "__main__":
    get(Path(sys.argv[1]) if sys.argv[1:] else ROOT / "build" / "live")
