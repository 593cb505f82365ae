"""What the page of each example tells people to type is typed here, and prints what it shows.

Beside ``test_documents.py``, because a file is the work of one worker: together the two would be a
sixth of a run.
"""

import re
import shutil
from pathlib import Path

import pytest

from tests.e2e.pages import ROOT, Typist, say_what_is_left_out

EXAMPLES = ROOT / "firmware_host_examples"
ELSEWHERE = ("rose_six_axes",)
"""Examples whose page is typed by a test of their own, in ``tests/examples``."""


@pytest.mark.parametrize(
    "page",
    [page for page in sorted(EXAMPLES.glob("*/README.md")) if page.parent.name not in ELSEWHERE],
    ids=lambda page: page.parent.name,
)
def test_the_commands_of_an_example_work_as_printed(page: Path, tmp_path: Path) -> None:
    shutil.copytree(EXAMPLES, tmp_path / "examples")
    typist = Typist(tmp_path / "examples" / page.parent.name)

    typist.type(page.read_text())

    expected = (page.parent / "expected.txt").read_text()
    assert expected in typist.printed or "diff" in page.read_text()
    if page.parent.name == "lm629_arduino":  # on an AVR, and compiled for the PC
        assert typist.left_out or typist.printed.count(expected) == 2
    if page.parent.name == "firmware_project":
        whole, broken, *reported = re.split(r"(?<=ed in )\d.*s\b", typist.printed)
        assert whole.endswith("\n9 passed in ")
        assert broken.endswith("\n4 failed, 5 deselected in ")
        assert broken.count("\nx broke lm628.busy-write at 21") == 4
        assert reported[0].endswith("\n2 passed, 7 deselected in ")
        assert reported[1].endswith("\n2 failed, 7 deselected in ")
        hangs = "HostStuck: the host hangs: it polled 10000 times and read nothing new"
        assert reported[1].count(f"\nE   vbus.serve.host_limits.{hangs}") == 2
        assert reported[1].count('under:   x.reset_status = "C4"') == 2
    say_what_is_left_out(typist)
