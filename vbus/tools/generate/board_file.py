"""Fills the tables of the board-file page: every section, every registered chip and plant."""

from collections.abc import Iterable
from typing import Final

from msgspec import Struct

from vbus.board import plugins, sections, units
from vbus.board.cards import decodes
from vbus.board.settings import allowed, quoted
from vbus.options import Option
from vbus.tools.generate.documents import fill
from vbus.tools.generate.layout import ROOT

_SECTIONS: Final[dict[str, type[Struct]]] = {
    "board": sections.BoardSection,
    "chips": sections.ChipSection,
    "plants": sections.PlantSection,
    "switches": sections.SwitchSection,
    "nets": sections.NetSection,
    "nodes": sections.NodeSection,
    "buses": sections.BusSection,
    "cards": sections.CardSection,
    "ports": sections.CardPortSection,
    "pinmaps": sections.PinMapSection,
    "hosts": sections.HostSection,
    "record": sections.RecordSection,
    "waves": sections.WaveSection,
    "zenoh": sections.ZenohSection,
    "metrics": sections.MetricsSection,
    "faults": sections.FaultSection,
}


def board_file() -> str:
    """Return the board-file page with its tables up to date."""
    page = (ROOT / "docs" / "board-file.md").read_text()
    for name, section in _SECTIONS.items():
        page = fill(page, name, option_table(sections.rows(section)))
    page = fill(page, "units", _units())
    page = fill(page, "parts", _parts())
    return fill(page, "models", _models())


def option_table(options: Iterable[Option]) -> list[str]:
    """Return a table of settings: key, value, default and meaning."""
    rows = ["| key | value | default | meaning |", "|---|---|---|---|"]
    for option in options:
        clause = f" ({option.clause})" if option.clause else ""
        cells = (f"`{option.name}`", _value(option), _default(option), f"{option.title}{clause}")
        rows.append("| " + " | ".join(cell.replace("|", "\\|") for cell in cells) + " |")
    return rows if len(rows) > 2 else ["No keys of its own."]


def _value(option: Option) -> str:
    if option.kind == sections.NAMES:
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
    rows = ["| quantity | example | units |", "|---|---|---|"]
    for row in units.DIMENSIONS.values():
        rows.append(f'| {row.title} | `"{row.example}"` | {row.names()} |')
    return rows


def _parts() -> list[str]:
    lines: list[str] = []
    done: set[type] = set()
    for name in plugins.names(plugins.CHIPS):
        chip = plugins.chip_class(name)
        if chip in done:
            continue
        done.add(chip)
        axes = {0: "no axis", 1: "one axis"}.get(chip.AXES, f"{chip.AXES} axes")
        circuits = ", ".join(f"`{circuit}`" for circuit in decodes(chip))
        lines += [
            f"### {', '.join(chip.PARTS)}",
            "",
            f"Family `{chip.FAMILY}`, {axes}. Decode circuits of cards: {circuits}.",
            "",
            *option_table(chip.OPTIONS),
            "",
        ]
    return lines[:-1]


def _models() -> list[str]:
    lines: list[str] = []
    for name in plugins.names(plugins.PLANTS):
        plant = plugins.plant_class(name)
        summary = (plant.__doc__ or "").strip().partition("\n")[0]
        takes = {"drive": "servo command", "pulses": "step pulses", "phases": "phase commands"}
        kinds = ", ".join(takes[kind] for kind in plant.TAKES)
        lines += [
            f"### {name}",
            "",
            f"{summary} Takes: {kinds}.",
            "",
            *option_table(plant.OPTIONS),
            "",
        ]
    return lines[:-1]
