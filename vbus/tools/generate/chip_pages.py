"""Makes the pages of each chip family: what its tables hold, and its clauses in full."""

import importlib
import re
from collections.abc import Callable, Iterable, Iterator
from functools import cache, partial
from typing import Any, Final

from vbus.board import plugins, units
from vbus.chips.base import Chip
from vbus.chips.clauses import Clause, clauses_of
from vbus.chips.strobes import AcLimit, AcTable
from vbus.chips.tables import Bit, Command, PinRow, Register
from vbus.options import Option
from vbus.signals import Rule
from vbus.tools.generate.board_file import option_table
from vbus.tools.generate.layout import ROOT

_TITLES: Final = {
    "lm628": "LM628 and LM629",
    "mcp1200": "MCP-1200",
    "mc1241a": "MC1241A and MC1141A",
}
_ADDRESSES: Final = {
    "lm628": (
        ("0", "/PS low", "status byte", "command"),
        ("1", "/PS high", "data byte", "data byte"),
    ),
    "mcp1200": (
        ("00H to 7FH", "address latched by /ALE or /CS", "register byte", "register byte"),
    ),
    "mc1241a": (
        ("0", "HostCmd low", "data byte", "data byte"),
        ("1", "HostCmd high", "status byte", "command"),
        ("2", "plug-in card only", "–", "resets the chip set"),
    ),
}
_BITS: Final = {
    "lm628": (
        ("Status byte", "STATUS"),
        ("Signals register (RDSIGS)", "SIGNALS"),
        ("Trajectory control word (LTRJ)", "TRAJECTORY"),
        ("Filter control word (LFIL)", "FILTER"),
    ),
    "mcp1200": (
        ("Flag register R00H", "FLAG_BITS"),
        ("Feature control R01H", "FEATURE_BITS"),
        ("Advanced configuration R02H", "CONFIG_BITS"),
        ("Capture control R03H", "CAPTURE_BITS"),
        ("Status register R07H", "STATUS_BITS"),
    ),
    "mc1241a": (
        ("Axis status word (GET_STATUS)", "STATUS_BITS"),
        ("Axis mode word (GET_MODE)", "MODE_BITS"),
    ),
}
_KEPT: Final = {
    "lm628": frozenset[str](),
    "mcp1200": frozenset({"tDOEH", "tOF", "tOR", "tEP"}),
    "mc1241a": frozenset({"T11", *(f"T{number}" for number in range(19, 28))}),
}
"""Rows of the chips' own outputs that no host can break: they are kept, not judged."""
_SCOPES: Final = {"c": "current axis", "g": "chip set", "i": "interrupting axis"}


def targets() -> list[tuple[str, Callable[[], str]]]:
    """Return every page and what makes it."""
    return [
        target
        for family in _TITLES
        for target in (
            (f"docs/chips/{family}.md", partial(page, family)),
            (f"docs/chips/{family}-clauses.md", partial(clause_page, family)),
        )
    ]


def page(family: str) -> str:
    """Return the page of a chip family."""
    sheet = importlib.import_module(f"vbus.chips.{family}.datasheet")
    chip = _chip(family)
    others = " · ".join(
        f"[{title}]({name}.md)" for name, title in _TITLES.items() if name != family
    )
    lines = [
        f"# {_TITLES[family]}",
        "",
        "<!-- Made from the tables of the chip by vbus.tools.generate; change the tables. -->",
        "",
        "What `vbus` knows of this chip, from its own tables.",
        f"Other chips: {others}. See also: [Board file](../board-file.md).",
        "",
        f"What the chip has to do stands in [its clauses]({family}-clauses.md); ids such as"
        f" {next(iter(sheet.RULES)).clause} lead there.",
        "",
        "## Parts",
        "",
        f"{', '.join(f'`{part}`' for part in chip.PARTS)}: family `{family}`,"
        f" {'one axis' if chip.AXES == 1 else f'up to {chip.AXES} axes'}.",
        "",
        "## Bus addresses",
        "",
        *_table(("address", "how", "read", "write"), _ADDRESSES[family]),
        "",
    ]
    if hasattr(sheet, "COMMANDS"):
        lines += ["## Commands", "", *_commands(sheet.COMMANDS), ""]
    if hasattr(sheet, "REGISTERS"):
        lines += ["## Registers", "", *_registers(sheet.REGISTERS), ""]
    lines += ["## Bits", ""]
    for title, name in _BITS[family]:
        lines += [f"### {title}", "", *_bits(getattr(sheet, name)), ""]
    lines += ["## Pins", "", *_pins(sheet.PINS), ""]
    lines += ["## AC limits", "", *_limits(family, sheet), ""]
    lines += ["## Other rules", "", *_rules(sheet.RULES, _tables(sheet)), ""]
    lines += ["## Options in a board file", "", *option_table(chip.OPTIONS), ""]
    lines += _readings(chip.OPTIONS)
    lines += ["## Where the manual is silent", "", *_silent(family)]
    return _linked("\n".join(lines) + "\n")


def _chip(family: str) -> type[Chip]:
    chips = (plugins.chip_class(name) for name in plugins.names(plugins.CHIPS))
    return next(chip for chip in chips if family == chip.FAMILY)


def _table(head: Iterable[str], rows: Iterable[Iterable[str]]) -> list[str]:
    head = tuple(head)
    lines = ["| " + " | ".join(head) + " |", "|" + "---|" * len(head)]
    for row in rows:
        lines.append("| " + " | ".join(cell.replace("|", "\\|") or "–" for cell in row) + " |")
    return lines


def _commands(commands: Iterable[Command]) -> list[str]:
    rows = list(commands)
    scoped = any(row.scope for row in rows)
    head = ["command", "code", "data bytes", "meaning", "clause"]
    if scoped:
        head.insert(3, "acts on")
    cells = []
    for row in sorted(rows, key=lambda row: row.code):
        cell = [f"`{row.name}`", f"{row.code:02X}H", _data(row), row.title, row.clause]
        if scoped:
            cell.insert(3, _SCOPES.get(row.scope, ""))
        cells.append(cell)
    return _table(head, cells)


def _data(row: Command) -> str:
    if row.read:
        return f"{2 * row.read} read"
    if row.up_to > row.write:
        return f"{2 * row.write} to {2 * row.up_to} written"
    return f"{2 * row.write} written" if row.write else "none"


def _registers(registers: Iterable[Register]) -> list[str]:
    access = {"rw": "read, write", "r": "read", "w": "write"}
    cells = []
    for row in registers:
        sense = "signed" if row.signed else "unsigned"
        scale = f", 1/{1 << row.fraction}" if row.fraction else ""
        cells.append(
            (
                f"`{row.name}`",
                ", ".join(f"{address:02X}H" for address in row.addresses),
                f"{row.bits} bits {sense}{scale}",
                access[row.access],
                f"{row.reset:0{row.bits // 4}X}H",
                row.title,
                row.clause,
            )
        )
    head = ("register", "addresses, high byte first", "value", "access", "reset", "meaning")
    return _table((*head, "clause"), cells)


def _bits(bits: Iterable[Bit]) -> list[str]:
    return _table(
        ("bit", "name", "meaning"), ((str(bit.number), f"`{bit.name}`", bit.title) for bit in bits)
    )


def _pins(pins: Iterable[PinRow]) -> list[str]:
    ways = {"in": "input", "out": "output", "io": "both ways", "od": "open drain"}
    return _table(
        ("pin", "direction", "wires", "meaning"),
        ((f"`{pin.name}`", ways[pin.direction], str(pin.width), pin.title) for pin in pins),
    )


# -- AC limits and rules --------------------------------------------------------------------------


def _tables(sheet: Any) -> dict[str, AcTable]:
    return sheet.AC if isinstance(sheet.AC, dict) else {"": sheet.AC}


def _limits(family: str, sheet: Any) -> list[str]:
    tables = _tables(sheet)
    first = next(iter(tables.values()))
    heads = [f"limit, {name}" if name else "limit" for name in tables]
    cells = []
    for row in first:
        rule = first.rules[row.symbol]
        limits = [_limit(table[row.symbol]) for table in tables.values()]
        side = _side(row, row.symbol in _KEPT[family])
        cells.append((f"`{rule.name}`", row.symbol, row.title, *limits, side, rule.clause))
    lines = [
        "Each row of the manual's table is a rule of its name. *Host*: the interval is the host's,"
        " and judged. *Chip*: the chip promises it, and a host that looks or drives too early is"
        " told. *Kept*: the chip's own outputs keep it, and no host can break it.",
        "",
        *_table(("rule", "row", "interval", *heads, "whose", "clause"), cells),
    ]
    if hasattr(sheet, "CLOCK_LIMITS"):
        grades = "; ".join(
            f"grade -{grade}: T4 {units.show(high, 's')}, T5 {units.show(period, 's')}"
            for grade, (high, period) in sheet.CLOCK_LIMITS.items()
        )
        lines += ["", f"By speed grade, at least: {grades}."]
    return lines


def _side(row: AcLimit, kept: bool) -> str:
    if kept:
        return "kept"
    return "chip" if row.output else "host"


def _limit(row: AcLimit) -> str:
    least = []
    if row.min_clk:
        least.append(f"{row.min_clk:g} clk")
    if row.min_ps or not (row.min_clk or row.max_ps):
        least.append(_time(row.min_ps))
    text = "at least " + " + ".join(least) if least else ""
    if row.max_ps:
        text += (", " if text else "") + f"at most {_time(row.max_ps)}"
    return text


def _time(ps: int) -> str:
    return f"{ps / 1000:g} ns" if abs(ps) < 10**6 else units.show(ps, "s")


def _rules(rules: Iterable[Rule], tables: dict[str, AcTable]) -> list[str]:
    ac = {rule.name for table in tables.values() for rule in table.rules.values()}
    return _table(
        ("rule", "severity", "what is required", "clause"),
        ((f"`{r.name}`", r.severity, r.title, r.clause) for r in rules if r.name not in ac),
    )


def _readings(options: Iterable[Option]) -> list[str]:
    """Return what speaks for the readings of the manual that a setting chooses from."""
    found = [f"* `{option.name}`. {option.evidence}" for option in options if option.evidence]
    if not found:
        return []
    return ["Where an option chooses between readings of the manual:", "", *found, ""]


def _silent(family: str) -> list[str]:
    """Return what was ruled, by title; the rulings themselves stand beside the chip."""
    path = f"vbus/chips/{family}/NOTES.md"
    found = list(_notes((ROOT / path).read_text()))
    return [f"What was decided, in full: [`{path}`](../../{path}).", "", *found]


def _notes(text: str) -> Iterator[str]:
    for line in re.sub(r"\n +", " ", text).splitlines():
        match = re.match(r"(\d+)\. (?:\*\*(.+?)\*\*|([^.]+)\.)", line)
        if match is not None:
            yield f"{match[1]}. {(match[2] or match[3]).rstrip('.')}."


# -- clauses --------------------------------------------------------------------------------------


def clause_page(family: str) -> str:
    """Return the page with the clauses of a chip family."""
    sheet = importlib.import_module(f"vbus.chips.{family}.datasheet")
    clauses = clauses_of(f"vbus.chips.{family}")
    folder = f"../../vbus/chips/{family}"
    rows = ((clause.name, clause.title, clause.kind) for clause in clauses.values())
    lines = [
        f"# Clauses of the {_TITLES[family]}",
        "",
        "<!-- Made from clauses.toml of the chip by vbus.tools.generate; change that. -->",
        "",
        f"What the [chip]({family}.md) has to do. Of the kinds of clauses, *manual* is what its"
        " manual states; *ruling* is what was decided where the manual is silent or contradicts"
        " itself; *silicon* is decided by what real parts, or drivers that work with them, are"
        " known to do. `vbus explain ID` also names the tests of a clause; NOTES are those of"
        f" [NOTES.md]({folder}/NOTES.md).",
        "",
        *_table(("clause", "title", "kind"), rows),
    ]
    for clause in clauses.values():
        lines += ["", f"### {clause.name}", "", *_clause(clause, sheet.RULES)]
    return _linked("\n".join(lines) + "\n")


def _clause(clause: Clause, rules: Iterable[Rule]) -> Iterator[str]:
    yield f"**{clause.title}**"
    yield f"({clause.kind}: {clause.section})"
    yield from ("", clause.text)
    if cited := [f"`{rule.name}`" for rule in rules if rule.clause == clause.name]:
        yield from ("", f"Rules: {', '.join(cited)}.")
    if not clause.tested:
        yield from ("", f"No test: {clause.reason}")


@cache
def _pages() -> dict[str, str]:
    """Return the page of every clause, by id."""
    return {name: family for family in _TITLES for name in clauses_of(f"vbus.chips.{family}")}


def _linked(text: str) -> str:
    """Make links of the clause ids in a page, but for those in headings."""
    pages = _pages()

    def link(match: re.Match[str]) -> str:
        name = match[0]
        return f"[{name}]({pages[name]}-clauses.md#{name.lower()})" if name in pages else name

    ids = re.compile(r"\b[A-Z]+-[A-Z]+-\d+\b")
    return "\n".join(
        line if line.startswith("#") else ids.sub(link, line) for line in text.split("\n")
    )
