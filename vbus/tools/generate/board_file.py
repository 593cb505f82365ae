"""Fills the tables of the board-file page: every section, every registered chip and plant."""

from collections.abc import Iterable
from typing import Final

from msgspec import Struct

from vbus import plugins
from vbus.board import sections
from vbus.board.card_buses import BUSES, DATA
from vbus.board.card_section import CardPortSection, CardRegisterSection, CardSection
from vbus.board.cards import decodes
from vbus.board.glue_section import GlueSection
from vbus.board.section import NAMES, rows
from vbus.glue.table import PARTS
from vbus.options import Option
from vbus.tools.generate.markdown import filled, table
from vbus.values import units
from vbus.values.settings import allowed, quoted

_SECTIONS: Final[dict[str, type[Struct]]] = {
    "board": sections.BoardSection,
    "chips": sections.ChipSection,
    "plants": sections.PlantSection,
    "switches": sections.SwitchSection,
    "nets": sections.NetSection,
    "glue": GlueSection,
    "nodes": sections.NodeSection,
    "buses": sections.BusSection,
    "cards": CardSection,
    "ports": CardPortSection,
    "registers": CardRegisterSection,
    "pinmaps": sections.PinMapSection,
    "hosts": sections.HostSection,
    "record": sections.RecordSection,
    "waves": sections.WaveSection,
    "zenoh": sections.ZenohSection,
    "metrics": sections.MetricsSection,
    "scope": sections.ScopeSection,
    "faults": sections.FaultSection,
}


def board_file() -> str:
    """Return the board-file page with its tables up to date."""
    tables = {name: option_table(rows(section)) for name, section in _SECTIONS.items()}
    tables |= {"glue-parts": _glue_parts(), "card-buses": _card_buses()}
    tables |= {"units": _units(), "parts": _parts(), "models": _models()}
    return filled("board-file", tables)


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


def option_table(options: Iterable[Option]) -> list[str]:
    """Return a table of settings: key, value, default and meaning."""
    rows = (
        (
            f"`{option.name}`",
            _value(option),
            _default(option),
            f"{option.title} ({option.clause})" if option.clause else option.title,
        )
        for option in options
    )
    return table(("key", "value", "default", "meaning"), rows) or ["No keys of its own."]


def _value(option: Option) -> str:
    if option.kind == NAMES:
        return "a list of names"
    text = allowed(option).removeprefix("write ")
    if option.kind == "choice":
        return " or ".join(f"`{quoted(choice)}`" for choice in option.choices)
    if option.kind in units.DIMENSIONS:
        title = units.DIMENSIONS[option.kind].title
        _, _, limits = text.partition("), ")
        return f"{title}, {limits}" if limits else title
    return text.replace(" without unit", "")


def _default(option: Option) -> str:
    if option.default is None:
        return "required"
    if option.default == "":
        return "–"
    if isinstance(option.default, str | bool):
        return f"`{quoted(option.default)}`"
    shown = units.show(option.default, option.kind)
    return f'`"{shown}"`' if option.kind in units.DIMENSIONS else f"`{shown}`"


def _units() -> list[str]:
    rows = ((row.title, f'`"{row.example}"`', row.names()) for row in units.DIMENSIONS.values())
    return table(("quantity", "example", "units"), rows)


def _part(title: str, sentence: str, options: Iterable[Option]) -> list[str]:
    return [f"### {title}", "", sentence, "", *option_table(options), ""]


def _parts() -> list[str]:
    lines: list[str] = []
    for chip in dict.fromkeys(plugins.chip_class(name) for name in plugins.names(plugins.CHIPS)):
        axes = {0: "no axis", 1: "one axis"}.get(chip.AXES, f"{chip.AXES} axes")
        circuits = ", ".join(f"`{circuit}`" for circuit in decodes(chip))
        sentence = f"Family `{chip.FAMILY}`, {axes}. Decode circuits of cards: {circuits}."
        lines += _part(", ".join(chip.PARTS), sentence, chip.OPTIONS)
    return lines[:-1]


def _models() -> list[str]:
    takes = {"drive": "servo command", "pulses": "step pulses", "phases": "phase commands"}
    lines: list[str] = []
    for name in plugins.names(plugins.PLANTS):
        plant = plugins.plant_class(name)
        summary = (plant.__doc__ or "").strip().partition("\n")[0]
        kinds = ", ".join(takes[kind] for kind in plant.TAKES)
        lines += _part(name, f"{summary} Takes: {kinds}.", plant.OPTIONS)
    return lines[:-1]
