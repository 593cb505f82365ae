"""Makes the pages of each chip family: what its tables hold, and its clauses in full."""

import re
from collections.abc import Iterable, Iterator, Mapping
from functools import cache
from typing import Final

from vbus import plugins
from vbus.chips.ac_table import AcLimit, AcTable
from vbus.chips.clauses import Clause, clauses_of
from vbus.chips.family import Family
from vbus.chips.tables import Bit, Command, PinRow, Register
from vbus.cli.generate.layout import folder_of, option_table, own_families, table
from vbus.core.options import Option
from vbus.core.signals import Rule
from vbus.core.values import units

_MADE: Final = "<!-- Made from {} by vbus.cli.generate; change {}. -->"
PICTURES: Final = "../pictures"
"""Where a page finds the picture of its chip, which ``docs/pictures/chips.py`` draws."""
_SCOPES: Final = {"c": "current axis", "g": "chip set", "i": "interrupting axis"}


def page(family: Family) -> str:
    """Return the page of a chip family: what it has tables for."""
    datasheet = family.tables
    chip = plugins.chip_of(family)
    lines = [f"# {_title(family)}", "", _MADE.format("the tables of the chip", "the tables"), ""]
    lines += [family.about, ""] if family.about else []
    own = own_families()
    # Only families of this source tree have a picture, and pages beside theirs.
    if family in own:
        lines += [f"![Between host and motor]({PICTURES}/{family.name}.svg)", ""]
    lines += ["The tables below are those from which `vbus` makes the chip and its clients."]
    if family in own:
        others = (f"[{one.title}]({one.name}.md)" for one in own if one is not family)
        lines += [
            f"Other chips: {' · '.join(others)}."
            " In a board file: [`[chips.NAME]`](../board-file/chips.md)."
        ]
    lines += [""]
    if family.rules and family.rules[0].clause in _pages():
        lines += [
            f"[Its clauses]({family.name}-clauses.md) say what the chip has to do; ids such as"
            f" {family.rules[0].clause} lead there.",
            "",
        ]
    axes = {0: "no axis", 1: "one axis"}.get(chip.AXES, f"up to {chip.AXES} axes")
    parts = ", ".join(f"`{part}`" for part in chip.PARTS)
    lines += ["## Parts", "", f"{parts}: family `{family.name}`, {axes}.", ""]
    # Sections without rows are left out: a family has commands or registers, rarely both.
    for head, rows in (
        ("Bus addresses", table(("address", "how", "read", "write"), family.addresses)),
        ("Commands", family.commands and _commands(family.commands)),
        ("Registers", family.registers and _registers(family.registers)),
    ):
        lines += [f"## {head}", "", *rows, ""] if rows else []
    # Words of commands first, then the fields of registers, as the manuals have them.
    bits = [(title, getattr(datasheet, name)) for title, name in family.bits]
    bits += [(f"{row.title} {row.low:02X}H", row.fields) for row in family.registers if row.fields]
    lines += ["## Bits", ""] if bits else []
    for title, fields in bits:
        lines += [f"### {title}", "", *_bits(fields), ""]
    recipes = folder_of(family) / "RECIPES.md" if family.home else None
    lines += [recipes.read_text()] if recipes is not None and recipes.exists() else []
    lines += ["## Pins", "", *_pins(chip.PINS), ""]
    tables = family.ac_tables
    if tables:
        lines += ["## AC limits", "", *_limits(family), ""]
    rules = _rules(family.rules, tables)
    if rules:
        lines += ["## Other rules" if tables else "## Rules", "", *rules, ""]
    lines += ["## Options in a board file", "", *option_table(chip.OPTIONS), ""]
    lines += _readings(chip.OPTIONS)
    silent = _silent(family)
    lines += ["## Where the manual is silent", "", *silent] if silent else []
    return _linked("\n".join(lines).rstrip("\n") + "\n")


def _title(family: Family) -> str:
    return family.title or family.name


def _commands(commands: Iterable[Command]) -> list[str]:
    rows = list(commands)
    scoped = any(row.scope for row in rows)
    head = ["command", "code", "data bytes", "meaning", "clause"]
    if scoped:
        head.insert(3, "acts on")
    cells = []
    # By code, as one looks a byte up that was seen on the bus.
    for row in sorted(rows, key=lambda row: row.code):
        cell = [f"`{row.name}`", f"{row.code:02X}H", _data(row), row.title, row.clause]
        if scoped:
            cell.insert(3, _SCOPES.get(row.scope, ""))
        cells.append(cell)
    return table(head, cells)


def _data(row: Command) -> str:
    if row.read:
        return f"{2 * row.read} read"
    # Words follow only where the control word asks for them (LTRJ, LFIL).
    if row.up_to > row.write:
        return f"{2 * row.write} to {2 * row.up_to} written"
    return f"{2 * row.write} written" if row.write else "none"


def _registers(registers: Iterable[Register]) -> list[str]:
    access = {"rw": "read, write", "r": "read", "w": "write"}
    cells = (
        (
            f"`{row.name}`",
            ", ".join(f"{address:02X}H" for address in row.addresses),
            f"{row.bits} bits {'signed' if row.signed else 'unsigned'}{_scale(row)}",
            access[row.access],
            row.counts,
            f"{row.reset:0{row.bits // 4}X}H",
            row.title,
            row.clause,
        )
        for row in registers
    )
    head = ("register", "addresses, high byte first", "value", "access", "counts", "reset")
    return table((*head, "meaning", "clause"), cells)


def _scale(row: Register) -> str:
    scale = f"1/{1 << row.fraction} " if row.fraction else ""
    return f", {scale}{row.unit}".rstrip() if scale or row.unit else ""


def _bits(bits: Iterable[Bit]) -> list[str]:
    return table(
        ("bit", "name", "meaning"), ((str(bit.number), f"`{bit.name}`", bit.title) for bit in bits)
    )


def _pins(pins: Iterable[PinRow]) -> list[str]:
    ways = {"in": "input", "out": "output", "io": "both ways", "od": "open drain"}
    return table(
        ("pin", "direction", "wires", "meaning"),
        ((f"`{pin.name}`", ways[pin.direction], str(pin.width), pin.title) for pin in pins),
    )


# -- AC limits and rules --------------------------------------------------------------------------


def _limits(family: Family) -> list[str]:
    tables = family.ac_tables
    # All tables of a family have the same rows; they differ in their limits by supply or grade.
    first = next(iter(tables.values()))
    heads = [f"limit, {name}" if name else "limit" for name in tables]
    cells = []
    for row in first:
        rule = first.rules[row.symbol]
        limits = [_limit(table[row.symbol]) for table in tables.values()]
        side = _side(row, row.symbol in family.kept)
        cells.append((f"`{rule.name}`", row.symbol, row.title, *limits, side, rule.clause))
    lines = [
        "Each row of the manual's table is a rule of its name. *Host*: the host makes the interval,"
        " and breaks the rule if it is too short or too long. *Chip*: the chip makes the interval,"
        " and a host that looks or drives earlier breaks the rule. *Kept*: the chip's own outputs"
        " keep to the interval, and no host can break the rule.",
        "",
        *table(("rule", "row", "interval", *heads, "whose", "clause"), cells),
    ]
    clocks = getattr(family.tables, "CLOCK_LIMITS", None)
    if clocks:
        grades = "; ".join(
            f"grade -{grade}: T4 {units.show(high, 's')}, T5 {units.show(period, 's')}"
            for grade, (high, period) in clocks.items()
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
    # A row that has no other limit says "at least 0 ns", rather than nothing.
    if row.min_ps or not (row.min_clk or row.max_ps):
        least.append(_time(row.min_ps))
    text = "at least " + " + ".join(least) if least else ""
    if row.max_ps:
        text += (", " if text else "") + f"at most {_time(row.max_ps)}"
    return text


def _time(ps: int) -> str:
    return f"{ps / 1000:g} ns" if abs(ps) < 10**6 else units.show(ps, "s")


def _rules(rules: Iterable[Rule], tables: Mapping[str, AcTable]) -> list[str]:
    # Rules of AC rows stand in their own table, with their limits.
    ac = {rule.name for table in tables.values() for rule in table.rules.values()}
    return table(
        ("rule", "severity", "what is required", "clause"),
        ((f"`{r.name}`", r.severity, r.title, r.clause) for r in rules if r.name not in ac),
    )


def _readings(options: Iterable[Option]) -> list[str]:
    """Return what speaks for the readings of the manual that a setting chooses from."""
    found = [f"* `{option.name}`. {option.evidence}" for option in options if option.evidence]
    if not found:
        return []
    return ["Where an option chooses between readings of the manual:", "", *found, ""]


def _silent(family: Family) -> list[str]:
    """Return what was ruled, by title; the rulings themselves stand beside the chip."""
    notes = folder_of(family) / "NOTES.md" if family.home else None
    if notes is None or not notes.exists():
        return []
    place = f"{family.home.replace('.', '/')}/NOTES.md"
    sentence = f"What was decided, in full: [`{place}`]({_beside(family)}/NOTES.md)."
    return [sentence, "", *_notes(notes.read_text())]


def _beside(family: Family) -> str:
    """Return the way from a family's page to its folder."""
    own = family in own_families()
    return f"../../{family.home.replace('.', '/')}" if own else ".."


def _notes(text: str) -> Iterator[str]:
    # Continuation lines are joined first, so that a title broken in two is found whole.
    for line in re.sub(r"\n +", " ", text).splitlines():
        match = re.match(r"(\d+)\. (?:\*\*(.+?)\*\*|([^.]+)\.)", line)
        if match is not None:
            yield f"{match[1]}. {(match[2] or match[3]).rstrip('.')}."


# -- clauses --------------------------------------------------------------------------------------


def clause_page(family: Family) -> str:
    """Return the page with the clauses of a chip family."""
    clauses = clauses_of(family.home)
    notes = ""
    if (folder_of(family) / "NOTES.md").exists():
        notes = f"; NOTES are those of [NOTES.md]({_beside(family)}/NOTES.md)"
    rows = ((clause.name, clause.title, clause.kind) for clause in clauses.values())
    lines = [
        f"# Clauses of the {_title(family)}",
        "",
        _MADE.format("clauses.toml of the chip", "that"),
        "",
        f"What the [chip]({family.name}.md) has to do. Of the kinds of clauses, *manual* is what"
        " its manual states; *ruling* is what was decided where the manual is silent or contradicts"
        " itself; *silicon* is decided by what real parts, or drivers that work with them, are"
        f" known to do. `vbus explain ID` also names the tests of a clause{notes}.",
        "",
        *table(("clause", "title", "kind"), rows),
    ]
    for clause in clauses.values():
        lines += ["", f"## {clause.name}", "", *_clause(clause, family.rules)]
    return _linked("\n".join(lines) + "\n")


def _clause(clause: Clause, rules: Iterable[Rule]) -> Iterator[str]:
    yield f"**{clause.title}**"
    yield f"({clause.kind}: {clause.section})"
    if clause.evidence:
        yield ""
        yield f"Shown by silicon: {clause.evidence}."
    yield from ("", clause.text)
    if cited := [f"`{rule.name}`" for rule in rules if rule.clause == clause.name]:
        yield from ("", f"Rules: {', '.join(cited)}.")
    if not clause.tested:
        yield from ("", f"No test: {clause.reason}")


@cache
def _pages() -> dict[str, str]:
    """Return the page of every clause, by id."""
    return {
        name: family.name
        for family in plugins.families()
        if family.home
        for name in clauses_of(family.home)
    }


def _linked(text: str) -> str:
    """Make links of the clause ids in a page, but for those in headings."""
    pages = _pages()

    def link(match: re.Match[str]) -> str:
        name = match[0]
        return f"[{name}]({pages[name]}-clauses.md#{name.lower()})" if name in pages else name

    # Ids of families that are not installed stay plain text.
    ids = re.compile(r"\b[A-Z]+-[A-Z]+-\d+\b")
    return "\n".join(
        line if line.startswith("#") else ids.sub(link, line) for line in text.split("\n")
    )
