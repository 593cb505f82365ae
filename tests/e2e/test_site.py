"""The documentation's site is built without a warning, and its links lead somewhere."""

import re
import subprocess
import sys
from html import unescape
from importlib.util import find_spec
from pathlib import Path
from urllib.parse import unquote

import pytest

ROOT = Path(__file__).parents[2]
NEEDED = ("sphinx", "myst_parser", "furo")


def lost_links(site: Path) -> list[str]:
    """Return the links of a site that lead to no file or heading of it."""
    pages = {path: path.read_text() for path in site.rglob("*.html")}
    marks = {path: set(re.findall(r'\bid="([^"]+)"', text)) for path, text in pages.items()}
    lost = []
    for path, text in pages.items():
        for link in set(re.findall(r'<a [^>]*?href="([^"]+)"', text)):
            file, _, mark = unquote(unescape(link)).partition("#")
            if re.match(r"[a-z]+:", file):
                continue
            place = (path.parent / file).resolve() if file else path
            if not place.exists() or (mark and mark not in marks.get(place, {mark})):
                lost.append(f"{path.relative_to(site)}: {link}")
    return sorted(lost)


def test_the_site_is_built_without_a_warning_and_its_links_lead_somewhere(tmp_path: Path) -> None:
    missing = [name for name in NEEDED if find_spec(name) is None]
    if missing:
        pytest.skip(f"needs {', '.join(missing)}: pip install '.[docs]'")
    command = re.search(r"^\S*(sphinx-build .*)$", (ROOT / "CONTRIBUTING.md").read_text(), re.M)
    assert command is not None
    arguments = command[1].replace("build/site", str(tmp_path / "site")).split()[1:]

    # Each page has the navigation of all pages: it takes less time to build without the parts of
    # modules in it. What links to them otherwise is looked at all the same.
    done = subprocess.run(
        [sys.executable, "-m", "sphinx", "-q", "-d", str(tmp_path / "trees"),
         "-D", "toc_object_entries=0", *arguments],
        cwd=ROOT, capture_output=True, text=True,
    )  # fmt: skip

    assert done.returncode == 0, done.stdout + done.stderr
    assert lost_links(tmp_path / "site") == []
    ledger = (tmp_path / "site" / "docs" / "made" / "lm628-ledger.html").read_text()
    assert "LM-BUS-14" in ledger
    assert "test_a_byte_counts_at_the_rising_edge_of_the_write_strobe" in ledger


def test_a_link_that_leads_nowhere_is_found(tmp_path: Path) -> None:
    (tmp_path / "a.html").write_text('<h1 id="top"></h1><a class="x" href="b.html#there">b</a>')
    (tmp_path / "b.html").write_text('<a href="a.html#top">a</a> <a href="#here">here</a>')

    assert lost_links(tmp_path) == ["a.html: b.html#there", "b.html: #here"]
