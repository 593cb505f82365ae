"""The documentation as a site: ``sphinx-build -W --keep-going -c docs . build/site``.

The pages are the Markdown files as they lie in the tree, so that their links hold on a forge and
here. Made on the way are the pages of the Python interface and the ledgers of the chips.
"""

import pkgutil
import re
import shutil
from importlib import import_module
from pathlib import Path
from typing import Final

from sphinx.application import Sphinx

from vbus.tools.generate.layout import own_families
from vbus.tools.generate.ledger import ledger
from vbus.version import __version__

ROOT: Final = Path(__file__).resolve().parents[1]
MADE: Final = ROOT / "docs" / "made"
"""Pages made on the way; git leaves them out."""

PACKAGES: Final = (
    "vbus.board", "vbus.chips", "vbus.client", "vbus.faults", "vbus.kernel", "vbus.plant",
    "vbus.protocols", "vbus.signals", "vbus.state", "vbus.testing", "vbus.transports",
)  # fmt: skip
"""What programs and parts of other packages may use."""

project = "vbus"
author = "The vbus developers"
copyright = "The vbus developers, Apache License 2.0"
version = release = __version__
root_doc = "docs/index"
include_patterns = [
    "*.md",
    "docs/**",
    "firmware_host_examples/*/README.md",
    "tests/*/README.md",
    "vbus/chips/*/NOTES.md",
]
exclude_patterns = [".*", "build", "dist", "**/__pycache__", "docs/site"]
source_suffix = {".md": "markdown", ".rst": "restructuredtext"}
extensions = ["myst_parser", "sphinx.ext.autodoc", "sphinx.ext.napoleon"]

myst_heading_anchors = 4
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
        if package == "vbus.client":
            modules += [
                f"{family.home}.generated.{name}"
                for family in own_families()
                for name in ("host", "calls")
            ]
        lines = []
        for module in modules:
            found = import_module(module)
            if getattr(found, "__path__", None) and module != package:
                continue
            lines += [module, ("-" if lines else "=") * len(module), ""]
            lines += [f".. automodule:: {module}", ""]
        (MADE / f"{package}.rst").write_text("\n".join(lines))


def list_pages(app: Sphinx, name: str, content: list[str]) -> None:
    """Give the first page its table of contents: the links of each of its sections.

    The pages that are made follow in the sections that are named after them.
    """
    if name != root_doc:
        return
    made = {
        "Reference": [f"made/{package}" for package in PACKAGES],
        "Chips": [f"made/{family.name}-ledger" for family in own_families()],
    }
    first, *sections = re.split(r"^## ", content[0], flags=re.MULTILINE)
    text = first
    for section in sections:
        title = section.partition("\n")[0]
        links = re.findall(r"\]\(([\w./-]+)\.md\)", section)
        lines = ["```{toctree}", ":hidden:", f":caption: {title}", ""]
        lines += [f"/docs/{link}" if "../" not in link else f"/{link[3:]}" for link in links]
        lines += [f"/docs/{link}" for link in made.get(title, [])]
        text += f"## {section.rstrip()}\n\n" + "\n".join([*lines, "```", "", ""])
    content[0] = text


def lead_folders(app: Sphinx, name: str, content: list[str]) -> None:
    """Lead links to a folder to the README in it; without one there is nothing to be seen here."""
    here = (ROOT / name).parent

    def link(match: re.Match[str]) -> str:
        text, target = match.groups()
        if not (here / target).is_dir():
            return match[0]
        return f"[{text}]({target}/README.md)" if (here / target / "README.md").exists() else text

    content[0] = re.sub(r"\[([^\]]+)\]\(([\w./-]+)\)", link, content[0])


def setup(app: Sphinx) -> None:
    """Take part in the build."""
    app.connect("builder-inited", make_pages)
    app.connect("source-read", list_pages)
    app.connect("source-read", lead_folders)
