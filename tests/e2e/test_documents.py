"""What README and docs tell people to type is typed here, and prints what they show."""

import os
import re
import shutil
import socket
from pathlib import Path

import pytest

from tests.e2e.pages import (
    ROOT,
    Block,
    Command,
    Typist,
    blocks_of,
    lacking,
    pattern,
    say_what_is_left_out,
)
from tests.waiting import Starved

PAGES = [ROOT / "README.md", ROOT / "CONTRIBUTING.md", *sorted((ROOT / "docs").rglob("*.md"))]
SOURCES = (
    "README.md", "CONTRIBUTING.md", "docker.md", "install.md", "viewers.md", "wiring.md",
)  # fmt: skip
"""Pages that are typed in the source tree; there pytest collects alone, for it runs already."""
NOT_SOURCES = (".git", ".venv*", "build", "__pycache__", ".*_cache", ".hypothesis")


@pytest.mark.parametrize("page", PAGES, ids=lambda page: str(page.relative_to(ROOT)))
def test_the_commands_of_a_page_work_as_printed(page: Path, tmp_path: Path) -> None:
    typist = Typist(tmp_path)
    if page.name in SOURCES:
        ignore = shutil.ignore_patterns(*NOT_SOURCES)
        shutil.copytree(ROOT, tmp_path / "sources", ignore=ignore)
        typist = Typist(tmp_path / "sources", PYTEST_ADDOPTS="--collect-only")

    # What takes minutes is typed once: VBUS_TYPED names pages of which .ci/run types it.
    name = str(page.relative_to(ROOT))
    typist.type(page.read_text(), name in os.environ.get("VBUS_TYPED", "").split())

    if page.name == "README.md":
        assert "status 80h\n" in typist.printed
        assert re.search(r"^(199\d|200\d) counts$", typist.printed, re.MULTILINE), typist.printed
        assert "LM629N-8" in typist.printed
    if page.name == "time.md":
        hashes = re.findall(r"^([0-9a-f]{64})  \d+ events$", typist.printed, re.MULTILINE)
        assert len(hashes) == 2
        assert len(set(hashes)) == 1
    say_what_is_left_out(typist)


PAGE = """\
Save this
as `a.txt`:

```toml
a = 1
```

```sh
cat a.txt
```

```output
...
a = ...
```

```console
$ echo one \\
    two
one two
$ true
```
"""


def test_a_page_is_files_commands_and_what_they_print(tmp_path: Path) -> None:
    saved, shell, console = blocks_of(PAGE)

    assert (saved.line, shell.line, console.line) == (4, 8, 17)
    assert shell.commands == (Command("cat a.txt\n", "...\na = ...\n"),)
    assert console.commands == (
        Command("echo one \\\n    two\n", "one two\n"),
        Command("true\n", ""),
    )
    Typist(tmp_path).type(PAGE)
    assert (tmp_path / "a.txt").read_text() == "a = 1\n"
    with pytest.raises(AssertionError, match=r"line 8: cat a\.txt\nprinted\na = 1\n"):
        Typist(tmp_path).type(PAGE.replace("a = ...", "b = ..."))
    with pytest.raises(AssertionError, match="line 17: true\nprinted\n\nand the page shows\nx\n"):
        Typist(tmp_path).type(PAGE.replace("true\n", "true\nx\n"))
    with pytest.raises(AssertionError, match="line 1: false\nended with 1:\n"):
        Typist(tmp_path).type("```sh\nfalse\n```\n")
    with pytest.raises(ValueError, match="line 1: a block without a language"):
        blocks_of("```\nprinted\n```\n")


@pytest.mark.parametrize("code", [0, 3])
def test_what_serves_is_interrupted_where_the_page_says_so(code: int, tmp_path: Path) -> None:
    serving = f"trap 'exit {code}' INT; echo ready; while :; do sleep 0.1; done"
    page = f"```console\n$ {serving}\nready\n$ echo done\ndone\n^C\n```\n"

    if code == 0:
        Typist(tmp_path).type(page)
    else:
        with pytest.raises(AssertionError, match="ended with 3"):
            Typist(tmp_path).type(page)


def test_a_page_that_leaves_something_running_is_found(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("tests.e2e.pages.LEAVING", 0.1)

    with pytest.raises(Starved, match=r"the end of \{\d+: 'sleep 60'\}"):
        Typist(tmp_path).type("```sh\nsleep 60 &\n```\n")


@pytest.mark.parametrize(
    ("printed", "shown", "same"),
    [
        ("a\nb\n", "a\nb\n", True),
        ("a 17 b\n", "a ... b\n", True),
        ("a\nb\nc\n", "a\n...\nc\n", True),
        ("a\n", "a\n...\n", True),
        ("a\nb\n", "a\n", False),
        ("a.b\n", "axb\n", False),
    ],
)
def test_three_dots_stand_for_anything(printed: str, shown: str, same: bool) -> None:
    assert bool(pattern(shown).fullmatch(printed)) is same


def test_what_a_machine_lacks_is_looked_for_on_it(monkeypatch: pytest.MonkeyPatch) -> None:
    def lacks(text: str) -> str:
        return lacking(Block(1, (Command(text),)))

    monkeypatch.setenv("PATH", "")
    monkeypatch.delenv("VBUS_REQUIRE_ALL", raising=False)

    assert lacks("vbus ls\n") == ""
    assert lacks("cat docker/compose.yaml\n") == ""
    assert lacks("docker ps\n") == "no docker on this machine"
    assert lacks("x | sigrok-cli -i x.vcd\n") == "no sigrok-cli on this machine"
    assert lacks("contrib/release/release.py wheel dist\n").startswith(
        "it compiles or installs for"
    )
    monkeypatch.setenv("VBUS_REQUIRE_ALL", "1")
    assert lacks("contrib/release/release.py wheel dist\n") == ""


def test_a_port_of_a_page_that_another_program_has_leaves_the_page_out(tmp_path: Path) -> None:
    with socket.create_server(("127.0.0.1", 0)) as taken:
        port = taken.getsockname()[1]
        typist = Typist(tmp_path)
        typist.type(f"```sh\nfalse 127.0.0.1:{port} 127.0.0.1:0\n```\n")
    assert typist.left_out == [f"port {port} of this machine cannot be had: Address already in use"]


def test_pages_are_typed_with_the_installation_that_is_named(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "installed" / "vbus").mkdir(parents=True)
    (tmp_path / "installed" / "vbus" / "__init__.py").write_text("print('as installed')")
    monkeypatch.setenv("VBUS_INSTALLED", str(tmp_path / "installed"))
    page = """```console\n$ python3 -c "import vbus"\nas installed\n```\n"""
    Typist(tmp_path).type(page)
    monkeypatch.delenv("VBUS_INSTALLED")
    with pytest.raises(AssertionError, match="the page shows"):
        Typist(tmp_path).type(page)
