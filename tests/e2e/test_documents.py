"""What README and docs tell people to type is typed here, in order, in one shell per page."""

import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from tests.waiting import Starved

ROOT = Path(__file__).parents[2]
EXAMPLES = ROOT / "firmware_host_examples"
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


def run(commands: list[str], folder: Path) -> subprocess.CompletedProcess[str]:
    """Type commands in a fresh shell in ``folder``, where vbus is installed, and nothing else."""
    environment = {
        **os.environ,
        "PATH": f"{Path(sys.executable).parent}:{os.environ['PATH']}",
        "XDG_RUNTIME_DIR": str(folder),
    }
    environment.pop("VBUS_RUNTIME", None)
    try:
        done = subprocess.run(
            ["bash", "-c", "set -e\ntrap 'jobs -p | xargs -r kill' EXIT\n" + "".join(commands)],
            cwd=folder, env=environment, capture_output=True, text=True, timeout=100,
        )  # fmt: skip
        if in_vain := re.search(r"^vbus: \w+ has not ended within .*", done.stderr, re.MULTILINE):
            logs = [log.read_text() for log in folder.rglob("*.log")]
            raise Starved("\n".join([in_vain[0], *logs]))
        return done
    finally:
        for board in folder.rglob("boards/*.sock"):
            home = {**environment, "VBUS_RUNTIME": str(board.parents[1])}
            subprocess.run([sys.executable, "-m", "vbus", "stop", board.stem], env=home)


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_the_commands_of_a_page_work_as_printed(page: Path, tmp_path: Path) -> None:
    done = run(steps(page.read_text()), tmp_path)

    assert done.returncode == 0, done.stdout + done.stderr
    if page.name == "README.md":
        assert "status 80h\n" in done.stdout
        assert re.search(r"^(199\d|200\d) counts$", done.stdout, re.MULTILINE), done.stdout
        assert "LM629N-8" in done.stdout
    if page.name == "time.md":
        hashes = re.findall(r"^([0-9a-f]{64})  \d+ events$", done.stdout, re.MULTILINE)
        assert len(hashes) == 2
        assert len(set(hashes)) == 1
    if page.name == "byte-protocol.md":
        assert " 44 84\n" in done.stdout


@pytest.mark.parametrize(
    "page", sorted(EXAMPLES.glob("*/README.md")), ids=lambda page: page.parent.name
)
def test_the_commands_of_an_example_work_as_printed(page: Path, tmp_path: Path) -> None:
    lacking = "avr-gcc" in page.read_text() and shutil.which("avr-gcc") is None
    if lacking and os.environ.get("VBUS_REQUIRE_ALL") != "1":
        pytest.skip("needs gcc-avr, and what else the page names")
    shutil.copytree(EXAMPLES, tmp_path / "examples")

    done = run(steps(page.read_text()), tmp_path / "examples" / page.parent.name)

    assert done.returncode == 0, done.stdout + done.stderr
    expected = (page.parent / "expected.txt").read_text()
    assert expected in done.stdout or "diff" in page.read_text()
    if page.parent.name == "firmware_project":
        whole, broken, *reported = re.split(r"(?<= in )\d.*s\b", done.stdout)
        assert whole.endswith("\n9 passed in ")
        assert broken.endswith("\n4 failed, 5 deselected in ")
        assert broken.count("\nx broke lm628.busy-write at 21") == 4
        assert reported[0].endswith("\n2 passed, 7 deselected in ")
        assert reported[1].endswith("\n2 failed, 7 deselected in ")
        hangs = "HostStuck: the host hangs: it polled 10000 times and was told nothing new"
        assert reported[1].count(f"\nE   vbus.server.host_limits.{hangs}") == 2
        assert reported[1].count('under:   x.reset_status = "C4"') == 2
