"""The page's modules keep to the types their comments give; nothing is compiled from them."""

import json
import shutil
import subprocess
from pathlib import Path

import pytest

from tests.browser.recordings import PAGE

TYPESCRIPT = "typescript@5.9"
MODULES = sorted(PAGE.glob("*.js"))
LIVE = Path(__file__).parents[2] / "docs" / "live" / "live.js"


def compiler(folder: Path) -> str:
    """Return the path of tsc: the one that is installed, or npm's."""
    found = shutil.which("tsc")
    if found is not None:
        return found
    npm = shutil.which("npm")
    if npm is None:
        pytest.skip("needs tsc or npm")
    command = [npm, "install", "--silent", "--no-audit", "--no-fund", "--prefer-offline"]
    done = subprocess.run([*command, "--prefix", folder, TYPESCRIPT], capture_output=True)
    if done.returncode:
        pytest.skip("needs typescript from npm")
    return str(folder / "node_modules" / ".bin" / "tsc")


def test_modules_keep_to_their_types(tmp_path: Path) -> None:
    options = {
        "allowJs": True, "checkJs": True, "noEmit": True, "strict": True, "skipLibCheck": True,
        "noUnusedLocals": True, "noUnusedParameters": True,
        "target": "es2023", "module": "es2022", "moduleResolution": "bundler", "types": [],
        "lib": ["es2023", "dom", "dom.iterable", "dom.asynciterable"],
    }  # fmt: skip
    settings = {"compilerOptions": options, "files": [str(module) for module in (*MODULES, LIVE)]}
    (tmp_path / "tsconfig.json").write_text(json.dumps(settings))
    command = [compiler(tmp_path), "--project", str(tmp_path)]
    done = subprocess.run(command, capture_output=True, text=True, timeout=120)
    assert done.stdout == ""
    assert done.returncode == 0


@pytest.mark.parametrize("module", MODULES, ids=lambda module: module.name)
def test_a_module_can_be_put_into_one_file(module: Path) -> None:
    for line in module.read_text().splitlines():
        if line.startswith("export "):
            assert line.split()[1] in {"class", "const", "function", "async"}
        assert not line.startswith("export default")
        assert not line.startswith("await "), "in one file it stands inside a function"
