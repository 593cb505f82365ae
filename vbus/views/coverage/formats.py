"""A coverage as text, as a page of HTML and as Cobertura XML, and the difference between two."""

from collections.abc import Callable
from html import escape
from pathlib import PurePath
from typing import Final
from xml.etree import ElementTree

from vbus.chips.packets import cited
from vbus.core.errors import VbusError
from vbus.core.values.settings import suggestion
from vbus.version import __version__
from vbus.views.coverage.coverage import Coverage
from vbus.views.coverage.tables import COUNTED, Item, items


def _place(item: Item) -> str:
    title = f"  {item.title}" if item.title else ""
    return f"{item.name}{title}{cited(item.clause)}"


def as_text(coverage: Coverage, every: bool = False, each: bool = True) -> str:
    """Return what was exercised and, item by item, what was not.

    Args:
        coverage: what to show.
        every: list also what was exercised, with how often.
        each: list items at all; False shows the groups alone.
    """
    lines: list[str] = []
    for family in coverage.families():
        done, total = coverage.share(family)
        lines.append(f"{family}: {done} of {total} exercised, {coverage.shown(family)}")
        if not total:
            lines.append("  no tables of this family: nothing can be counted")
        for name, found in coverage.groups(family).items():
            some = [(item, count) for item, count in found if count]
            none = [item for item, count in found if not count]
            lines.append(f"  {name}: {len(some)} of {len(found)}")
            if not each:
                continue
            # Broken rules are listed always: there is no list of the others.
            listed = every or name not in COUNTED
            lines += [f"    {count:>7} x {_place(item)}" for item, count in some if listed]
            if name in COUNTED:
                lines += [f"      never {_place(item)}" for item in none]
    if not lines:
        lines.append("nothing was exercised: no chip took part")
    elif len(coverage.families()) > 1:
        done, total = coverage.share()
        lines.append(f"together: {done} of {total} exercised, {coverage.shown()}")
    lines.append("")
    return "\n".join(lines)


def difference(old: Coverage, new: Coverage) -> str:
    """Return what only one of two coverages exercises, as text."""
    lines = []
    for sign, parts in (("+", new.missing_from(old)), ("-", old.missing_from(new))):
        for family, item in parts:
            lines.append(f"{sign} {family} {item.group}: {_place(item)}")
    lines.append(f"{old.shown()} before, {new.shown()} now")
    lines.append("")
    return "\n".join(lines)


def tests_covering(coverage: Coverage, name: str) -> str:
    """Return which tests exercise what is called so: a command, register, flag, or rule.

    Raises:
        VbusError: the chips that took part have nothing of that name.
    """
    lines = []
    known = set()
    for family in coverage.families():
        for item in items(family):
            # A flag is known by its own name too, without the word that it stands in.
            known |= {item.name, *item.name.split()}
            if name in (item.name, *item.name.split()):
                lines.append(f"{family} {item.group}: {_place(item)}")
                lines += [f"    {test}" for test in coverage.tests_of(family, item) or ["no test"]]
    if not lines:
        raise VbusError(
            f"nothing is called {name!r} on the chips of this coverage;"
            f' {suggestion(name, known)}"vbus coverage --all" lists all there is'
        )
    return "\n".join(lines) + "\n"


def covered_by_test(coverage: Coverage, test: str) -> str:
    """Return what a test exercises.

    Raises:
        VbusError: there is no such test.
    """
    mine = coverage.of_test(test)
    lines = [
        f"{family} {item.group}: {_place(item)}"
        for family in mine.families()
        for item in items(family)
        if mine.count(family, item)
    ]
    return "\n".join([*lines, ""])


def as_cobertura(coverage: Coverage) -> str:
    """Return Cobertura XML for CI services: a package for each family, a file for each group.

    Its lines are the items of the group in the order of the manual; it names no time, so that equal
    runs give equal files.
    """

    def rates(done: int, total: int) -> dict[str, str]:
        rate = f"{done / total:.4f}" if total else "1"
        return {"line-rate": rate, "branch-rate": "0", "complexity": "0"}

    done, total = coverage.share()
    root = ElementTree.Element(
        "coverage",
        {
            **rates(done, total), "lines-covered": str(done), "lines-valid": str(total),
            # Readers of Cobertura ask for branches and a time; there are none here.
            "branches-covered": "0", "branches-valid": "0", "version": f"vbus {__version__}",
            "timestamp": "0",
        },
    )  # fmt: skip
    ElementTree.SubElement(ElementTree.SubElement(root, "sources"), "source").text = "."
    packages = ElementTree.SubElement(root, "packages")
    for family in coverage.families():
        share = rates(*coverage.share(family))
        package = ElementTree.SubElement(packages, "package", {"name": family, **share})
        classes = ElementTree.SubElement(package, "classes")
        for name, found in coverage.groups(family).items():
            # Cobertura knows lines hit and missed alone: a rule that was not broken is no miss.
            if name not in COUNTED:
                continue
            some = sum(1 for _, count in found if count)
            file = {"name": name, "filename": f"{family}/{name.replace(' ', '-')}"}
            group = ElementTree.SubElement(classes, "class", {**file, **rates(some, len(found))})
            methods = ElementTree.SubElement(group, "methods")
            lines = ElementTree.SubElement(group, "lines")
            for number, (item, count) in enumerate(found, 1):
                line = {"number": str(number), "hits": str(count)}
                method = {"name": item.name, "signature": item.clause, **rates(count > 0, 1)}
                inner = ElementTree.SubElement(methods, "method", method)
                ElementTree.SubElement(ElementTree.SubElement(inner, "lines"), "line", line)
                ElementTree.SubElement(lines, "line", line)
    ElementTree.indent(root, " ")
    return (
        '<?xml version="1.0" encoding="UTF-8"?>\n'
        '<!DOCTYPE coverage SYSTEM "http://cobertura.sourceforge.net/xml/coverage-04.dtd">\n'
        f"{ElementTree.tostring(root, encoding='unicode')}\n"
    )


_STYLE: Final = """
body { font: 15px/1.45 system-ui, sans-serif; margin: 2em auto; max-width: 60em; padding: 0 1em }
h2 { margin-top: 2em } table { border-collapse: collapse; width: 100% }
td { padding: .15em .6em; border-bottom: 1px solid #8884; vertical-align: top }
td:first-child { text-align: right; white-space: nowrap; width: 5em }
tr.no td { background: #d332 } .bar { background: #8883; height: .6em; border-radius: .3em }
.bar div { background: #2a7; height: 100%; border-radius: .3em } code { white-space: nowrap }
:root { color-scheme: light dark }
"""


def as_html(coverage: Coverage) -> str:
    """Return one page that needs no other file."""
    parts = [
        "<!doctype html><html lang=en><meta charset=utf-8><title>Driver coverage</title>",
        f"<style>{_STYLE}</style><h1>Driver coverage: {coverage.shown()}</h1>",
        f"<p>From: {escape(', '.join(coverage.runs)) or 'no run'}</p>",
    ]
    for family in coverage.families():
        done, total = coverage.share(family)
        # The bar's width; the number beside it says the same.
        share = 100 * done // total if total else 0
        parts.append(f"<h2>{escape(family)}: {done} of {total}</h2>")
        parts.append(f'<div class=bar><div style="width:{share}%"></div></div>')
        for name, found in coverage.groups(family).items():
            if name not in COUNTED:
                found = [(item, count) for item, count in found if count]
            if not found:
                continue
            some = sum(1 for _, count in found if count)
            parts.append(f"<h3>{escape(name)}: {some} of {len(found)}</h3><table>")
            parts += [_row(item, count, coverage.tests_of(family, item)) for item, count in found]
            parts.append("</table>")
    return "\n".join(parts) + "\n"


def _row(item: Item, count: int, tests: list[str]) -> str:
    kind = "" if count else " class=no"
    often = f"{count} &times;" if count else "never"
    named = "<br>".join(map(escape, tests))
    who = f"<details><summary>{len(tests)} tests</summary>{named}</details>" if tests else ""
    return (
        f"<tr{kind}><td>{often}<td><code>{escape(item.name)}</code>"
        f"<td>{escape(item.title)}{who}<td>{escape(item.clause)}</tr>"
    )


COVERAGE_FORMATS: Final[dict[str, Callable[[Coverage], str]]] = {
    ".txt": as_text,
    ".json": lambda coverage: coverage.to_json().decode(),
    ".html": as_html,
    ".xml": as_cobertura,
}
"""What writes a coverage, by the end of a file's name."""


def coverage_format(path: str) -> Callable[[Coverage], str]:
    """Return what writes a coverage to a file.

    Raises:
        ValueError: the name's end says no format.
    """
    if (suffix := PurePath(path).suffix) not in COVERAGE_FORMATS:
        known = ", ".join(COVERAGE_FORMATS)
        raise ValueError(f"{path}: a coverage file's name ends in one of {known}")
    return COVERAGE_FORMATS[suffix]
