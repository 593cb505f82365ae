"""A coverage as text and as a page of HTML, and the difference between two."""

from collections.abc import Callable
from html import escape
from typing import Final

from vbus.trace.coverage.coverage import Coverage
from vbus.trace.coverage.tables import COUNTED, GROUPS, Item


def _percent(done: int, total: int) -> str:
    return f"{100 * done // total}%" if total else "-"


def _place(item: Item) -> str:
    clause = f"  [{item.clause}]" if item.clause else ""
    title = f"  {item.title}" if item.title else ""
    return f"{item.name}{title}{clause}"


def as_text(coverage: Coverage, every: bool = False) -> str:
    """Return what was exercised and, item by item, what was not.

    Args:
        coverage: what to show.
        every: list also what was exercised, with how often.
    """
    lines: list[str] = []
    for family in coverage.families():
        done, total = coverage.share(family)
        lines.append(f"{family}: {done} of {total} exercised, {_percent(done, total)}")
        if not total:
            lines.append("  no tables of this family: nothing can be counted")
        for name in GROUPS:
            found = coverage.group(family, name)
            if not found:
                continue
            some = [(item, count) for item, count in found if count]
            none = [item for item, count in found if not count]
            lines.append(f"  {name}: {len(some)} of {len(found)}")
            listed = every or name not in COUNTED
            lines += [f"    {count:>7} x {_place(item)}" for item, count in some if listed]
            if name in COUNTED:
                lines += [f"      never {_place(item)}" for item in none]
    if not lines:
        lines.append("nothing was exercised: no chip took part")
    lines.append("")
    return "\n".join(lines)


def difference(old: Coverage, new: Coverage) -> str:
    """Return what only one of two coverages exercises, as text."""
    lines = []
    for sign, parts in (("+", new.missing_from(old)), ("-", old.missing_from(new))):
        for family, item in parts:
            lines.append(f"{sign} {family} {item.group}: {_place(item)}")
    before, after = old.percent(), new.percent()
    lines.append(f"{before:.1f}% before, {after:.1f}% now")
    lines.append("")
    return "\n".join(lines)


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
        f"<style>{_STYLE}</style><h1>Driver coverage: {coverage.percent():.1f}%</h1>",
        f"<p>From: {escape(', '.join(coverage.runs)) or 'no run'}</p>",
    ]
    for family in coverage.families():
        done, total = coverage.share(family)
        share = 100 * done // total if total else 0
        parts.append(f"<h2>{escape(family)}: {done} of {total}</h2>")
        parts.append(f'<div class=bar><div style="width:{share}%"></div></div>')
        for name in GROUPS:
            found = coverage.group(family, name)
            if name not in COUNTED:
                found = [(item, count) for item, count in found if count]
            if not found:
                continue
            some = sum(1 for _, count in found if count)
            parts.append(f"<h3>{escape(name)}: {some} of {len(found)}</h3><table>")
            parts += [_row(item, count) for item, count in found]
            parts.append("</table>")
    return "\n".join(parts) + "\n"


def _row(item: Item, count: int) -> str:
    kind = "" if count else " class=no"
    often = f"{count} &times;" if count else "never"
    return (
        f"<tr{kind}><td>{often}<td><code>{escape(item.name)}</code>"
        f"<td>{escape(item.title)}<td>{escape(item.clause)}</tr>"
    )


COVERAGE_FORMATS: Final[dict[str, Callable[[Coverage], str]]] = {
    ".txt": as_text,
    ".json": lambda coverage: coverage.to_json().decode(),
    ".html": as_html,
}
"""What writes a coverage, by the end of a file's name."""
