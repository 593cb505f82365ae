"""The board file as a JSON Schema, for editors and other tools, made from the rows it is read by.

What a schema cannot say, such as which names must exist, ``vbus check`` finds.
"""

import re
from collections.abc import Iterable
from typing import Any, Final

from vbus.boardfile.key import NAMES, Below, Names, Section, below, rows
from vbus.boardfile.sections import BoardFile
from vbus.core.options import Option
from vbus.core.values import units
from vbus.core.values.settings import allowed

Schema = dict[str, Any]

DRAFT: Final = "http://json-schema.org/draft-07/schema#"
"""The newest draft that the TOML plug-ins of editors know."""

_NAMES: Final[Schema] = {"type": "array", "items": {"type": "string"}}
_TYPES: Final = {
    "count": "integer", "flag": "boolean", "text": "string", "name": "string",
}  # fmt: skip
_NUMBER: Final = r"\s*[+-]?\d[\d_]*(\.\d+)?([eE][+-]?\d+)?\s*"


def schema() -> Schema:
    """Return the schema, with the settings of every chip, plant and fault that is registered."""
    definitions: Schema = {}
    board = _section(BoardFile, definitions)
    return {"$schema": DRAFT, "title": "vbus board file", **board, "definitions": definitions}


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
        found = {"type": _TYPES.get(kind, "number")}
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


def _section(section: type[Section], definitions: Schema) -> Schema:
    """Return what a table may be: the keys of a section, those of its kinds, and what is below."""
    extra = {field.name: _below(field, definitions) for field in below(section)}
    common = rows(section)
    found = _table(common, extra)
    if section.KINDS:
        # The kind says which keys there are; an unknown kind is for vbus check.
        key = section.KINDS.key
        known: list[str] = []
        del found["additionalProperties"]
        found["allOf"] = []
        for pattern, examples, options in section.KINDS.known():
            known += examples
            when = {"properties": {key: {"type": "string", "pattern": pattern}}}
            found["allOf"].append({"if": when, "then": _table([*common, *options], extra)})
        said = found["properties"][key]["description"]
        any_of = [{"enum": known}, {"type": "string"}]
        found["properties"][key] = {"description": said, "anyOf": any_of}
    return {"anyOf": [_NAMES, found]} if section.SHORT else found


def _table(options: Iterable[Option], extra: Schema) -> Schema:
    rows = list(options)
    found: Schema = {
        "type": "object",
        "properties": {**{row.name: value(row) for row in rows}, **extra},
        "additionalProperties": False,
    }
    needs = {row.name: [key for key in row.needs if "=" not in key] for row in rows}
    if needed := {name: keys for name, keys in needs.items() if keys}:
        found["dependencies"] = needed
    required = [row.name for row in rows if row.default is None]
    return {**found, "required": required} if required else found


def _below(field: Below, definitions: Schema) -> Schema:
    of = field.of
    if field.shape is None:
        return _section(of, definitions)
    if field.shape is tuple and not field.named:
        return {"type": "array", "items": _section(of, definitions)}
    if field.row and field.row.choices:
        return _table((), dict.fromkeys(field.row.choices, _section(of, definitions)))
    each: Schema
    if of == Names:
        each = {"anyOf": [{"type": "string"}, _NAMES]}
    elif not isinstance(of, Option):
        each = _section(of, definitions)
    elif of.kind == "choice":
        # An unquoted dotted name is a table in a table.
        again = {"$ref": f"#/definitions/{field.name}"}
        each = {"anyOf": [{"enum": list(of.choices)}, again]}
        definitions[field.name] = {"type": "object", "additionalProperties": each}
        return again
    else:
        each = {"type": "string"}
    return {"type": "object", "additionalProperties": each}
