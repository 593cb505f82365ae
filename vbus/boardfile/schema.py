"""The board file as a JSON Schema, for editors and other tools, made from the rows it is read by.

What a schema cannot say, such as which names must exist, ``vbus check`` finds.
"""

import re
from collections.abc import Iterable, Mapping
from typing import Any, Final

from msgspec import Struct

from vbus import plugins
from vbus.boardfile import sections
from vbus.boardfile.cards import CardPortSection, CardRegisterSection, CardSection
from vbus.boardfile.key import NAMES, GlueSection, rows
from vbus.faults.table import faults
from vbus.options import Option
from vbus.signals.axis import SWITCHES
from vbus.values import units
from vbus.values.settings import allowed

Schema = dict[str, Any]

DRAFT: Final = "http://json-schema.org/draft-07/schema#"
"""The newest draft that the TOML plug-ins of editors know."""

_NAMES: Final[Schema] = {"type": "array", "items": {"type": "string"}}
_NUMBER: Final = r"\s*[+-]?\d[\d_]*(\.\d+)?([eE][+-]?\d+)?\s*"


def schema() -> Schema:
    """Return the schema, with the settings of every chip, plant and fault that is registered."""
    level = {"enum": list(sections.LEVELS)}
    properties: Schema = {
        "board": _object(sections.BoardSection),
        "violations": {"$ref": "#/definitions/violations"},
        "chips": _by_name(_chips()),
        "plants": _by_name(_plants()),
        "nets": {
            "type": "object",
            "additionalProperties": {"anyOf": [_NAMES, _object(sections.NetSection)]},
        },
        "glue": _by_name(
            _object(
                GlueSection,
                pins=_pins(),
                equations={"type": "object", "additionalProperties": {"type": "string"}},
            )
        ),
        "buses": _by_name(_object(sections.BusSection)),
        "cards": _by_name(
            _object(
                CardSection,
                ports={"type": "array", "items": _object(CardPortSection)},
                pins=_pins(),
                selects=_pins(),
                registers=_by_name(_object(CardRegisterSection, pins=_pins())),
            )
        ),
        "pinmaps": _by_name(_object(sections.PinMapSection, pins=_pins())),
        "nodes": _by_name(_object(sections.NodeSection)),
        "hosts": {"type": "array", "items": _object(sections.HostSection)},
        "record": _object(sections.RecordSection),
        "waves": _by_name(_object(sections.WaveSection)),
        "zenoh": _object(
            sections.ZenohSection, allow={"type": "object", "additionalProperties": _NAMES}
        ),
        "metrics": _object(sections.MetricsSection),
        "scope": _object(sections.ScopeSection),
        "faults": {"type": "array", "items": _faults()},
    }
    return {
        "$schema": DRAFT,
        "title": "vbus board file",
        "type": "object",
        "properties": properties,
        "additionalProperties": False,
        "definitions": {
            # An unquoted dotted rule is a table in a table.
            "violations": {
                "type": "object",
                "additionalProperties": {"anyOf": [level, {"$ref": "#/definitions/violations"}]},
            }
        },
    }


def value(option: Option) -> Schema:
    """Return what the value of one key may be."""
    kind = option.kind
    found: Schema
    if kind == NAMES:
        found = dict(_NAMES)
    elif kind == "choice":
        found = {"enum": list(option.choices)}
    elif kind in units.DIMENSIONS:
        names = "|".join(re.escape(unit) for unit in units.DIMENSIONS[kind].units)
        found = {"type": "string", "pattern": rf"^{_NUMBER}({names})\s*$"}
    else:
        found = {
            "type": {"count": "integer", "flag": "boolean", "text": "string"}.get(kind, "number")
        }
        for key, limit in (("minimum", option.low), ("maximum", option.high)):
            if limit is not None:
                found[key] = limit
        if kind == "rate":
            found = {"anyOf": [found, {"const": "max"}]}
    said = option.title if kind == NAMES else f"{option.title}; {allowed(option)}"
    found["description"] = said
    if option.default not in (None, "") and kind not in units.DIMENSIONS:
        found["default"] = option.default
    elif option.default not in (None, ""):
        found["default"] = units.show(option.default, kind)  # type: ignore[arg-type]
    return found


def _table(options: Iterable[Option], extra: Mapping[str, Schema]) -> Schema:
    rows = list(options)
    found: Schema = {
        "type": "object",
        "properties": {**{row.name: value(row) for row in rows}, **extra},
        "additionalProperties": False,
    }
    required = [row.name for row in rows if row.default is None]
    return {**found, "required": required} if required else found


def _object(section: type[Struct], **extra: Schema) -> Schema:
    return _table(rows(section), extra)


def _by_name(table: Schema) -> Schema:
    return {"type": "object", "additionalProperties": table}


def _kinds(
    section: type[Struct],
    key: str,
    kinds: Iterable[tuple[str, Iterable[str], Iterable[Option]]],
    **extra: Schema,
) -> Schema:
    """Return a table whose keys depend on one of them.

    Args:
        section: the keys it has in any case.
        key: the one that decides.
        kinds: its values as a pattern, examples of them, and the keys each brings with it.
        extra: keys that hold tables.
    """
    common = list(rows(section))
    table = _table(common, extra)
    # Which keys there are the kind says; a kind nobody knows is for vbus check.
    del table["additionalProperties"]
    known: list[str] = []
    table["allOf"] = []
    for pattern, examples, options in kinds:
        known += examples
        table["allOf"].append(
            {
                "if": {"properties": {key: {"type": "string", "pattern": pattern}}},
                "then": _table([*common, *options], extra),
            }
        )
    table["properties"][key] = {
        "description": table["properties"][key]["description"],
        "anyOf": [{"enum": known}, {"type": "string"}],
    }
    return table


def _chips() -> Schema:
    prefixes: dict[Any, list[str]] = {}
    for name in plugins.names(plugins.CHIPS):
        prefixes.setdefault(plugins.chip_class(name), []).append(name)
    return _kinds(
        sections.ChipSection,
        "part",
        (
            (f"^({'|'.join(map(re.escape, names))})", chip.PARTS, chip.OPTIONS)
            for chip, names in prefixes.items()
        ),
    )


def _plants() -> Schema:
    switch = _object(sections.SwitchSection)
    switches = _table((), dict.fromkeys(SWITCHES, switch))
    return _kinds(
        sections.PlantSection,
        "model",
        (
            (f"^{re.escape(name)}$", (name,), plugins.plant_class(name).OPTIONS)
            for name in plugins.names(plugins.PLANTS)
        ),
        switches=switches,
    )


def _faults() -> Schema:
    return _kinds(
        sections.FaultSection,
        "fault",
        ((f"^{re.escape(name)}$", (name,), row.parameters) for name, row in faults().items()),
    )


def _pins() -> Schema:
    return {"type": "object", "additionalProperties": {"anyOf": [{"type": "string"}, _NAMES]}}
