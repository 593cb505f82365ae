"""What README and docs tell people to type is typed here, in order, in one shell per page."""

import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
PAGES = [ROOT / "README.md", *sorted((ROOT / "docs").glob("*.md"))]
FENCE = re.compile(r"^```(\w*)\n(.*?)^```$", re.MULTILINE | re.DOTALL)
SAVE_AS = re.compile(r"(?:save this as|Save this as)\s+`([\w./-]+)`")


def steps(page: str) -> list[str]:
    """Return the page as shell commands: files to save, then commands to run, as they come."""
    commands = []
    end = 0
    for block in FENCE.finditer(page):
        before = page[end : block.start()]
        language, text = block.groups()
        named = SAVE_AS.findall(before)
        end = block.end()
        if named:
            commands.append(f"cat > {named[-1]} <<'END_OF_FILE'\n{text}END_OF_FILE\n")
        elif language == "sh" and "venv" not in text:
            commands.append(text)
    return commands


def run(page: Path, folder: Path) -> subprocess.CompletedProcess[str]:
    """Type a page's commands; a board of the README runs beside other pages, at ``$PTY``."""
    prelude = "" if page.name == "README.md" else steps((ROOT / "README.md").read_text())[0]
    if prelude:
        prelude = f"{prelude}mv board.toml first.toml\nvbus run first.toml &\n{WAIT}"
    script = "".join(
        f"{command}\n{WAIT if 'vbus run' in command else ''}" for command in steps(page.read_text())
    )
    return subprocess.run(
        ["bash", "-c", f"set -e -m\ntrap 'kill $(jobs -p)' EXIT\n{prelude}{script}"],
        cwd=folder,
        env={
            **os.environ,
            "PATH": f"{Path(sys.executable).parent}:{os.environ['PATH']}",
            "VBUS_RUNTIME": str(folder / "run"),
            "PTY": str(folder / "run" / "first"),
        },
        capture_output=True,
        text=True,
        timeout=120,
    )


WAIT = "until vbus ls --json | grep -q board; do :; done\n"


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_the_commands_of_a_page_work_as_printed(page: Path, tmp_path: Path) -> None:
    done = run(page, tmp_path)

    assert done.returncode == 0, done.stdout + done.stderr
    if page.name == "README.md":
        assert "status 80h\n" in done.stdout
        assert re.search(r"^(199\d|200\d) counts$", done.stdout, re.MULTILINE), done.stdout
        assert "LM629N-8" in done.stdout
    if page.name == "byte-protocol.md":
        assert " 44 84\n" in done.stdout
