"""One setting against its row: unit, range, spelling."""

import re
from collections.abc import Iterable
from typing import Final

from vbus.core.options import Option, Value
from vbus.core.values import units

NAME_FORM: Final = re.compile(r"[A-Za-z_][A-Za-z0-9_-]*")
"""What a name looks like that may stand in ``"name.pin"``."""
A_NAME: Final = "a name begins with a letter and goes on with letters, digits, - and _"


def quoted(value: object) -> str:
    """Return ``value`` as TOML would write it, cut to a readable length."""
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, str):
        text = '"' + value.replace("\\", "\\\\").replace('"', '\\"').replace("\n", "\\n") + '"'
    elif isinstance(value, dict):
        text = "{" + ", ".join(f"{key} = {quoted(item)}" for key, item in value.items()) + "}"
    elif isinstance(value, list):
        text = "[" + ", ".join(quoted(item) for item in value) + "]"
    else:
        text = str(value)
    return text if len(text) <= 60 else text[:57] + "..."


MOST_LISTED: Final = 60
"""Names in one message."""


def listed(names: Iterable[str]) -> str:
    """Return names as a message lists them: a screen of them at most."""
    first = list(names)
    # A board of a thousand chips would fill the screen with their names.
    more = len(first) - MOST_LISTED
    return ", ".join(first[:MOST_LISTED]) + (f" and {more} more" if more > 0 else "") or "none"


def suggestion(name: str, known: Iterable[str], most: int = 1) -> str:
    """Return ``'did you mean "x"? '`` if ``known`` has what is close to ``name``, else nothing."""
    from difflib import get_close_matches

    known = list(known)
    close = get_close_matches(name, known, n=most)
    # A name in capitals has no letter in common with the right one.
    if not close:
        folded = {item.lower(): item for item in reversed(known)}
        close = get_close_matches(name.lower(), list(folded), n=most)
        close = [folded[item] for item in close]
    return f"did you mean {' or '.join(map(quoted, close))}? " if close else ""


def among(name: str, known: Iterable[str], they: str, most: int = 1) -> str:
    """Return the likely name and all that are known: ``'did you mean "x"? THEY x, y'``."""
    known = list(known)
    return f"{suggestion(name, known, most)}{they} {listed(known)}"


def unknown(name: str, known: Iterable[str]) -> str:
    """Return what to say of a name that is none of the ``known`` ones."""
    return f"found {quoted(name)}; {among(name, known, 'known are')}"


def rule_names(rules: Iterable[str]) -> set[str]:
    """Return names of rules, and those of their families, which stand for all rules of one."""
    return {name for rule in rules for name in (rule, rule.partition(".")[0])}


def rule_hint(name: str, known: Iterable[str]) -> str:
    """Return what to do about a name that is none of the ``known`` ones of rules."""
    return f'{suggestion(name, sorted(known))}"vbus check --rules" lists them all'


def allowed(option: Option) -> str:
    """Return what a value of ``option`` may be, for messages and documentation."""
    if option.kind == "choice":
        return "allowed are " + listed(quoted(choice) for choice in option.choices)
    text = {
        "count": "write a whole number without unit",
        "ratio": "write a number without unit",
        "rate": 'write a number without unit, or "max"',
        "flag": "write true or false",
        "text": "write a text in quotes",
        "name": "write a text in quotes",
        "names": 'write a list of names, such as ["x"]',
    }.get(option.kind)
    if text is None:
        text = "write " + units.describe(option.kind)
    limits = _limits(option)
    return f"{text}, {limits}" if limits else text


def _limits(option: Option) -> str:
    low = "" if option.low is None else units.show(option.low, option.kind)
    high = "" if option.high is None else units.show(option.high, option.kind)
    if low and high:
        return f"from {low} to {high}"
    if low:
        return f"at least {low}"
    return f"at most {high}" if high else ""


def check_value(value: object, option: Option) -> Value:
    """Return ``value`` in the unit the part works with.

    Raises:
        ValueError: it is of another kind, or out of range; says what is allowed.
    """
    kind = option.kind
    if kind in units.DIMENSIONS:
        return _in_range(units.parse(value, kind), option)
    if kind == "flag" and isinstance(value, bool):
        return value
    if kind in ("text", "name") and isinstance(value, str):
        if kind == "name" and not NAME_FORM.fullmatch(value):
            raise ValueError(A_NAME)
        return value
    if kind == "choice" and isinstance(value, str):
        if value in option.choices:
            return value
        raise ValueError(suggestion(value, option.choices) + allowed(option))
    if kind == "rate" and value == "max":
        return float("inf")
    # TOML's true is Python's True, which counts as 1.
    if isinstance(value, int) and not isinstance(value, bool):
        if kind == "count":
            return _in_range(value, option)
        if kind in ("ratio", "rate"):
            return _in_range(float(value), option)
    # TOML writes inf and nan: neither is a ratio.
    if isinstance(value, float) and kind in ("ratio", "rate") and abs(value) < float("inf"):
        return _in_range(value, option)
    raise ValueError(allowed(option))


def _in_range(value: int | float, option: Option) -> int | float:
    if (option.low is not None and value < option.low) or (
        option.high is not None and value > option.high
    ):
        raise ValueError(f"out of range: {_limits(option)}")
    return value
