"""Settings a board file may give to a chip, plant, protocol or transport, as a table."""

from collections.abc import Mapping
from typing import NamedTuple

Value = int | float | str | bool
"""A setting after checking: times in ps (int), frequencies in Hz (int), the rest in SI."""

Settings = Mapping[str, Value]


class Option(NamedTuple):
    """One setting.

    Attributes:
        name: key in the board file.
        kind: ``"count"`` (bare integer), ``"ratio"`` (bare number), ``"flag"``, ``"choice"``,
            ``"text"``, or an SI unit the value must be convertible to: ``"s"`` (given to the part
            in ps), ``"Hz"`` (integer), ``"V"``, ``"ohm"``, ``"H"``, ``"A"``, ``"N*m"``,
            ``"kg*m^2"``, ``"rad/s"``, ``"N*m*s"``, ``"N*m/A"``, ``"V*s"``.
        default: used when the key is absent; None makes the key required.
        title: what it does, for messages and documentation.
        choices: allowed values of a choice.
        low: smallest allowed value.
        high: largest allowed value.
        clause: clause of a specification it belongs to.
        extremes: values, as a board file writes them, by which silicon may legally differ from
            the default: what a host must live with. The mildest comes first.
        evidence: of a choice between readings of a manual: what speaks for each of them.
        ref: of a key of a board file whose value is a name: what it is the name of.
        needs: of a key of a board file: the keys beside it without which it means nothing.
    """

    name: str
    kind: str
    default: Value | None
    title: str
    choices: tuple[str, ...] = ()
    low: float | None = None
    high: float | None = None
    clause: str = ""
    extremes: tuple[Value, ...] = ()
    evidence: str = ""
    ref: str = ""
    needs: tuple[str, ...] = ()


def with_defaults(options: tuple[Option, ...], given: Settings | None = None) -> dict[str, Value]:
    """Return every setting of ``options``: as given, or its default.

    For parts made in Python. Board files are checked, with units, by :mod:`vbus.boardfile.walker`.

    Raises:
        ValueError: an unknown key, a required one missing, or a value out of range.
    """
    settings = dict(given or {})
    result: dict[str, Value] = {}
    for option in options:
        value = settings.pop(option.name, option.default)
        if value is None:
            raise ValueError(f"{option.name} is required: {option.title}")
        if option.choices and value not in option.choices:
            allowed = ", ".join(option.choices)
            raise ValueError(f"{option.name} = {value!r}: allowed are {allowed}")
        # A text has no range.
        if not isinstance(value, str):
            if option.low is not None and value < option.low:
                raise ValueError(f"{option.name} = {value}: at least {option.low}")
            if option.high is not None and value > option.high:
                raise ValueError(f"{option.name} = {value}: at most {option.high}")
        result[option.name] = value
    if settings:
        known = ", ".join(option.name for option in options) or "none"
        raise ValueError(f"unknown setting {next(iter(settings))!r}; known are: {known}")
    return result
