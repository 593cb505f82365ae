"""Fills the tables of the pages about board files and faults: sections, chips, plants, faults."""

from collections.abc import Callable, Iterable, Iterator
from functools import partial
from typing import Final

from contrib.generate.marks import filled
from vbus import plugins
from vbus.board.card.cards import decodes
from vbus.boardfile.key import Below, Section, below, rows
from vbus.boardfile.sections import BoardFile
from vbus.cli.generate.layout import ROOT, option_table, table
from vbus.core.options import Option
from vbus.core.signals.axis import DRIVES
from vbus.core.values import units
from vbus.faults.row import AXIS, COUNTED, LINK, MESSAGES, NET, OF_BYTES, ONCE, WIRE, Fault
from vbus.faults.table import faults as known_faults
from vbus.glue.card_buses import BUSES, DATA
from vbus.glue.table import PARTS

# In the order in which one writes a file: what every board needs stands first.
_PAGES: Final = (
    "board", "chips", "plants", "nets", "hosts", "violations", "buses", "glue", "cards", "pinmaps",
    "cpu", "nodes", "zenoh", "record", "waves", "scope", "metrics", "faults",
)  # fmt: skip
"""Sections in the order of the overview; each has a page."""


def _tables(field: Below) -> Iterator[tuple[str, list[str]]]:
    """Give a table of the keys of a section, and of each section below it."""
    if isinstance(field.of, type) and issubclass(field.of, Section):
        yield field.name, option_table(rows(field.of))
        for inner in below(field.of):
            yield from _tables(inner)


def targets() -> list[tuple[str, Callable[[], str]]]:
    """Return every page and what makes it; the overview takes titles from the pages."""
    pages = [(f"docs/board-file/{name}.md", partial(_page, name)) for name in _PAGES]
    # The overview first: it reads titles and first sentences, which are written by hand.
    return [("docs/board-file.md", _overview), *pages]


def _overview() -> str:
    """Return the page of the board file with its tables up to date."""
    return filled("board-file", {"sections": _sections(), "units": _units()})


def _page(name: str) -> str:
    """Return the page of a kind of section with its tables up to date."""
    tables = dict(_tables(next(one for one in below(BoardFile) if one.name == name)))
    for title, make in _FURTHER.get(name, {}).items():
        tables[title] = make()
    return filled(f"board-file/{name}", tables)


def _sections() -> list[str]:
    """Return a heading for each kind of section, which leads to its page, and what it is about."""
    lines = []
    for name in _PAGES:
        page = (ROOT / "docs" / "board-file" / f"{name}.md").read_text()
        title, _, text = page.removeprefix("# ").partition("\n")
        # A first sentence ends at a full stop before a blank or a paragraph's end.
        sentence, _, _ = text.strip().partition(".\n\n")[0].replace("\n", " ").partition(". ")
        lines += [f"### [{title}](board-file/{name}.md)", "", f"{sentence}.", ""]
    return lines[:-1]


def _glue_parts() -> list[str]:
    """Return a table of the parts of glue."""
    listed = (
        (
            f"`{row.part}`",
            row.title,
            " ".join(f"`{pin}`" for pin in row.inputs if pin not in row.outputs) or "–",
            " ".join(f"`{pin}`" for pin in row.outputs),
        )
        for row in PARTS.values()
    )
    return table(("part", "what it is", "inputs", "outputs"), listed)


def _card_buses() -> list[str]:
    """Return a table of the buses of cards, with their usual times."""
    listed = (
        (
            f"`{row.bus}`",
            row.title,
            " ".join(f"`{name}`" for name in (f"A0-A{row.lines - 1}", *row.strobes, DATA)),
            " ".join(f"`{pin.name}`" for pin in row.others) or "–",
            *(units.show(time, "s") for time in (row.setup, row.strobe, row.hold, row.wait)),
        )
        for row in BUSES.values()
    )
    heads = ("bus", "what it is", "lines", "further lines", "setup", "strobe", "hold", "wait state")
    return table(heads, listed)


def _units() -> list[str]:
    rows = ((row.title, f'`"{row.example}"`', row.names()) for row in units.DIMENSIONS.values())
    return table(("quantity", "example", "units"), rows)


def _part(title: str, sentence: str, options: Iterable[Option]) -> list[str]:
    return [f"### {title}", "", sentence, "", *option_table(options), ""]


def _parts() -> list[str]:
    lines: list[str] = []
    # Several part numbers share a class: each class has one heading.
    for chip in dict.fromkeys(plugins.chip_class(name) for name in plugins.names(plugins.CHIPS)):
        axes = {0: "no axis", 1: "one axis"}.get(chip.AXES, f"{chip.AXES} axes")
        circuits = ", ".join(f"`{circuit}`" for circuit in decodes(chip))
        sentence = f"Family `{chip.FAMILY}`, {axes}. Decode circuits of cards: {circuits}."
        lines += _part(", ".join(chip.PARTS), sentence, chip.OPTIONS)
    return lines[:-1]


def _models() -> list[str]:
    lines: list[str] = []
    for name in plugins.names(plugins.PLANTS):
        plant = plugins.plant_class(name)
        summary = (plant.__doc__ or "").strip().partition("\n")[0]
        kinds = ", ".join(DRIVES[kind] for kind in plant.TAKES)
        lines += _part(name, f"{summary} Takes: {kinds}.", plant.OPTIONS)
    return lines[:-1]


_FURTHER: Final[dict[str, dict[str, Callable[[], list[str]]]]] = {
    "chips": {"parts": _parts},
    "plants": {"models": _models},
    "glue": {"glue-parts": _glue_parts},
    "cards": {"card-buses": _card_buses},
}
"""Tables of other things than keys of a section, by page."""


_ENDS: Final = {ONCE: "over at once", COUNTED: "once, for a time, until cleared"}


def faults() -> str:
    """Return the page with its tables up to date."""
    families: dict[str, list[Fault]] = {}
    for fault in known_faults().values():
        families.setdefault(fault.family, []).append(fault)
    return filled("faults", {name: _rows(family) for name, family in families.items()})


def _rows(family: list[Fault]) -> list[str]:
    rows = table(
        ("fault", "what happens", "for", "ends"),
        (
            (f"`{fault.name}`", fault.title, _for(fault),
             _ENDS.get(fault.acts, "for a time, until cleared"))
            for fault in family
        ),
    )  # fmt: skip
    for fault in family:
        # A table of a fault without parameters would be a heading over nothing.
        if fault.parameters:
            rows += ["", f"`{fault.name}`:", "", *option_table(fault.parameters)]
    return rows


def _for(fault: Fault) -> str:
    # Links first: their faults act on bytes or messages, whatever chip is behind them.
    if fault.target == LINK:
        if fault.name == OF_BYTES:
            return "links of bytes"
        return "links over Zenoh" if fault.family == MESSAGES else "links"
    if fault.target == WIRE:
        return "wires between nodes"
    if not fault.of_chip:
        return "wires of a board" if fault.target == NET else "parts of glue"
    if fault.families:
        return ", ".join(fault.families)
    if fault.shaft:
        return "axes with a `dc_motor` or `stepper`"
    return "every axis" if fault.target == AXIS else "every chip"
