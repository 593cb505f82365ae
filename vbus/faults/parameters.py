"""The parameters of a fault, checked: numbers as the parts use them, or texts with a unit."""

from collections.abc import Mapping

from vbus.faults.row import Fault
from vbus.options import Option, Value, with_defaults
from vbus.values.settings import allowed, check_value, listed, quoted, suggestion
from vbus.values.units import DIMENSIONS


def check_parameters(fault: Fault, given: Mapping[str, object]) -> dict[str, Value]:
    """Return every parameter of ``fault``: as given, or its default.

    Raises:
        ValueError: one it does not have, or a value that cannot be; says what is allowed.
    """
    rows = {row.name: row for row in fault.parameters}
    result: dict[str, Value] = {row.name: row.default for row in fault.parameters}  # type: ignore[misc]
    for key, value in given.items():
        row = rows.get(key)
        if row is None:
            hint = suggestion(key, rows)
            raise ValueError(f'{fault.name} has no "{key}"; {hint}it has {listed(rows)}')
        result[key] = _value(fault, row, value)
    _fits(fault, result)
    return result


def _value(fault: Fault, row: Option, value: object) -> Value:
    try:
        if row.kind in DIMENSIONS and isinstance(value, int | float):
            return with_defaults((row,), {row.name: value})[row.name]
        if row.kind in ("count", "ratio") and isinstance(value, str):
            value = int(value, 0) if row.kind == "count" else float(value)
        return check_value(value, row)
    except ValueError as error:
        reason = str(error) if "invalid literal" not in str(error) else allowed(row)
        raise ValueError(f"{fault.name}: {row.name} = {quoted(value)}: {reason}") from None


def _fits(fault: Fault, values: dict[str, Value]) -> None:
    if fault.name == "index_double" and int(values["distance"]) % 4:
        raise ValueError(
            f"index_double: distance = {values['distance']}: an index lies where A and B are low,"
            " so write a multiple of 4"
        )
