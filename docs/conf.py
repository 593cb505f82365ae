"""The documentation as a site: ``sphinx-build -W --keep-going -c docs . build/site``.

The pages are the Markdown files as they lie in the tree, so that their links hold on a forge and
here. Made on the way are the pages of the Python interface and the ledgers of the chips.
"""

import pkgutil
import re
import shutil
import sys
import zipfile
from collections.abc import Sequence
from functools import cache
from importlib import import_module
from importlib.metadata import distribution
from pathlib import Path
from typing import Any, Final

from pygments.lexers.special import TextLexer
from sphinx.addnodes import toctree
from sphinx.application import Sphinx
from sphinx.environment import BuildEnvironment

from vbus.cli.generate.layout import own_families
from vbus.version import __version__

ROOT: Final = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT))

from contrib.generate.ledger import ledger  # noqa: E402

MADE: Final = ROOT / "docs" / "made"
"""Pages made on the way; git leaves them out."""

PACKAGES: Final = (
    "vbus.board", "vbus.board.card", "vbus.board.check", "vbus.chips",
    "vbus.client", "vbus.faults", "vbus.core.kernel", "vbus.plant",
    "vbus.protocols", "vbus.core.signals", "vbus.core.state", "vbus.testing",
    "vbus.testing.checks", "vbus.testing.plugins", "vbus.transports",
)  # fmt: skip
"""What programs and parts of other packages may use."""

CONTENTS: Final = ROOT / "docs" / "contents.md"
MADE_PAGES: Final = {
    "Reference": [f"made/{package}" for package in PACKAGES],
    "Chips": [f"made/{family.name}-ledger" for family in own_families()],
}
"""Pages that are made, by the section of the list of all pages in which they stand."""

LIVE: Final = ROOT / "build" / "live"
"""What ``docs/live/get.py`` gets: Python for browsers."""

LIVE_MARK: Final = "<!-- run it here -->"
LIVE_BLOCK: Final = """\
**Run it here.** Change the board or the driver, and run them in this page: the same `vbus`, in a
Python that runs in your browser. Time moves by bus cycles alone, so the same driver gives the same
hash as on any other machine.

```{raw} html
<div id="live"><noscript>This takes JavaScript.</noscript></div>
<style>
#live textarea, #live iframe { width: 100%; box-sizing: border-box; }
#live textarea { font: 0.85em monospace; }
#live iframe { height: 40rem; border: 1px solid; }
#live output { display: block; overflow-wrap: anywhere; }
</style>
<script type="module" src="../_static/live/live.js"></script>
```
"""
NOT_LIVE: Final = """\
*This copy of the site was built without what runs the board in a browser; it takes `npm`
([contributing](../CONTRIBUTING.md)).*
"""
"""What stands in the place of the mark on the site, and what does where nothing was got."""

project = "vbus"
author = "The vbus developers"
copyright = "The vbus developers, Apache License 2.0"
version = release = __version__
root_doc = "docs/index"
include_patterns = [
    "*.md",
    "docs/**",
    "firmware_host_examples/*/README.md",
    "tests/README.md",
    "tests/*/README.md",
    "vbus/chips/*/NOTES.md",
]
exclude_patterns = [".*", "build", "dist", "**/__pycache__", "docs/site"]
source_suffix = {".md": "markdown", ".rst": "restructuredtext"}
extensions = ["myst_parser", "sphinx.ext.autodoc", "sphinx.ext.napoleon"]

myst_heading_anchors = 4
autodoc_use_type_comments = False  # none are used, and looking for them is a twentieth of the time
autodoc_default_options = {"members": True, "member-order": "bysource"}
napoleon_use_ivar = True
default_role = "literal"
smartquotes = False
# Types in signatures go by names that several modules have; roles are checked by a test.
suppress_warnings = ["ref.python"]

html_theme = "furo"
html_title = f"vbus {release}"
html_extra_path = ["site"]
html_copy_source = False


def make_pages(app: Sphinx) -> None:
    """Make the pages that follow from modules and tables."""
    shutil.rmtree(MADE, ignore_errors=True)
    MADE.mkdir()
    for family in own_families():
        # Links of a ledger are those of its chip's pages, which lie elsewhere.
        text = ledger(family).replace("](", "](../chips/")
        (MADE / f"{family.name}-ledger.md").write_text(text)
    for package in PACKAGES:
        names = [module.name for module in pkgutil.iter_modules(import_module(package).__path__)]
        modules = [package, *(f"{package}.{name}" for name in names if name != "aio")]
        lines = []
        for module in modules:
            found = import_module(module)
            if getattr(found, "__path__", None) and module != package:
                continue
            lines += [module, ("-" if lines else "=") * len(module), ""]
            lines += [f".. automodule:: {module}", ""]
        (MADE / f"{package}.rst").write_text("\n".join(lines))


def list_pages(app: Sphinx, name: str, content: list[str]) -> None:
    """Give the lists of pages their tables of contents, from the links of each of their sections.

    The first page has that of the list of all pages; pages that are made follow in the sections
    that are named after them. The page of the board file has its sections.
    """
    if name == root_doc:
        sections = re.split(r"^## ", CONTENTS.read_text(), flags=re.MULTILINE)[1:]
        content[0] += "".join(
            _tree(section, title, MADE_PAGES.get(title, []))
            for section in sections
            for title in [section.partition("\n")[0]]
        )
    if name == "docs/board-file":
        content[0] += _tree(content[0].partition("## Sections")[2].partition("\n## ")[0])


def _tree(text: str, caption: str = "", made: Sequence[str] = ()) -> str:
    """Return a table of contents of the pages that a text links to, and of pages that are made."""
    lines = ["", "", "```{toctree}", ":hidden:", *([f":caption: {caption}"] if caption else []), ""]
    for title, link in re.findall(r"(?:\[([^\[\]]+))?\]\(([\w./-]+)\.md\)", text):
        page = f"/docs/{link}" if "../" not in link else f"/{link[3:]}"
        # The README has the title of the first page.
        lines.append(f"{title} <{page}>" if page == "/README" else page)
    return "\n".join([*lines, *(f"/docs/{page}" for page in made), "```", ""])


def lead_folders(app: Sphinx, name: str, content: list[str]) -> None:
    """Lead links to a folder to the README in it; without one there is nothing to be seen here."""
    here = (ROOT / name).parent

    def link(match: re.Match[str]) -> str:
        text, target = match.groups()
        if not (here / target).is_dir():
            return match[0]
        return f"[{text}]({target}/README.md)" if (here / target / "README.md").exists() else text

    content[0] = re.sub(r"\[([^\]]+)\]\(([\w./-]+)\)", link, content[0])


def add_live(app: Sphinx, name: str, content: list[str]) -> None:
    """Put where a board and a driver run in the browser into the page that has a place for it."""
    content[0] = content[0].replace(LIVE_MARK, LIVE_BLOCK if LIVE.is_dir() else NOT_LIVE)


def remember_names(app: Sphinx, env: BuildEnvironment) -> None:
    """Look up each name of a type once, now that all are known, and no name that no object has.

    Sphinx compares each one with the ends of all names: a tenth of the time of the site.
    """
    python = env.domains.python_domain
    ends = {name.rpartition(".")[2] for name in python.objects}
    find = cache(python.find_obj)

    def found(*asked: Any) -> Any:
        return find(*asked) if asked[3].removesuffix("()").rpartition(".")[2] in ends else []

    python.find_obj = found  # type: ignore[method-assign]


def keep_titles(
    app: Sphinx, name: str, template: str, context: dict[str, Any], doctree: object
) -> None:
    """Give the theme the tree of all pages without the headings in them, which it does not show.

    For each page, Sphinx copies all headings of all pages to leave them out: a third of the time
    of the site.
    """
    if "toctree" not in context:
        return
    env, tree = app.env, context["toctree"]

    def of_titles(**options: Any) -> Any:
        whole, env.tocs = env.tocs, titles(env)
        try:
            return tree(**options)
        finally:
            env.tocs = whole

    context["toctree"] = of_titles


@cache
def titles(env: BuildEnvironment) -> dict[str, Any]:
    """Return each page's table of contents: its title, and the tables of other pages in it."""
    tables = {name: table.deepcopy() for name, table in env.tocs.items()}
    for item in (item for table in tables.values() for item in table.children if len(item) > 1):
        if others := list(item.findall(toctree)):
            item[1][:] = others
        else:
            item.pop(1)
    return tables


def write_live(app: Sphinx, error: Exception | None) -> None:
    """Put what runs them on the site, if it was got."""
    if error is None and app.builder.format == "html" and LIVE.is_dir():
        live_files(LIVE, Path(app.outdir) / "_static" / "live")


def live_files(got: Path, folder: Path) -> None:
    """Write what the script of a live page loads: Pyodide, and packages for it with vbus.

    Args:
        got: what ``docs/live/get.py`` got.
        folder: is made anew.
    """
    shutil.rmtree(folder, ignore_errors=True)
    shutil.copytree(got, folder, ignore=shutil.ignore_patterns("*.whl"))
    shutil.copy(ROOT / "docs" / "live" / "live.js", folder)
    with zipfile.ZipFile(folder / "packages.zip", "w", zipfile.ZIP_DEFLATED) as packed:
        for wheel in sorted(got.glob("*.whl")):
            with zipfile.ZipFile(wheel) as unpacked:
                for name in unpacked.namelist():
                    packed.writestr(name, unpacked.read(name))
        packed.write(ROOT / "docs" / "live" / "live.py", "live.py")
        for file in sorted((ROOT / "vbus").rglob("*.*")):
            if file.suffix in (".py", ".toml", ".js", ".css", ".html"):
                packed.write(file, file.relative_to(ROOT))
        # Chips and motors are found by what an installation has registered.
        for name in ("METADATA", "entry_points.txt"):
            text = distribution("vbus").read_text(name) or ""
            packed.writestr(f"vbus-{__version__}.dist-info/{name}", text)


def setup(app: Sphinx) -> None:
    """Take part in the build."""
    app.add_lexer("mermaid", TextLexer)  # forges draw such a figure; here its text is shown
    app.connect("builder-inited", make_pages)
    app.connect("source-read", list_pages)
    app.connect("source-read", lead_folders)
    app.connect("source-read", add_live)
    app.connect("env-updated", remember_names)
    app.connect("html-page-context", keep_titles, priority=100)  # before that of the theme
    app.connect("build-finished", write_live)
