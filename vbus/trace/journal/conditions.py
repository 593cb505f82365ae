"""Conditions on a board as people write them: ``x./HI=1``, ``x.real > 200``, a rule's name."""

import operator
import re
from collections.abc import Callable, Iterable
from contextlib import suppress
from typing import Any, Final

from vbus.board.board import Board
from vbus.errors import VbusError
from vbus.signals import Rule

_COMPARE: Final[dict[str, Callable[[Any, Any], bool]]] = {
    "<=": operator.le,
    ">=": operator.ge,
    "!=": operator.ne,
    "<": operator.lt,
    ">": operator.gt,
    "=": operator.eq,
}
_FORM: Final = re.compile(r"\s*([^\s<>=!]+)\s*(<=|>=|!=|<|>|=)\s*(\S+)\s*")


def condition(
    text: str, board: Board, rules: Iterable[Rule]
) -> tuple[Callable[[Board], bool], bool]:
    """Return what a condition asks of a board, and whether it stays true once it is.

    * ``lm628.busy-write``: that rule has been broken.
    * ``x.HI=1``: a pin's level.
    * ``x.real>200``: a value that ``vbus monitor`` shows of a chip.

    Args:
        text: the condition.
        board: the board it is meant for.
        rules: every rule there is.

    Raises:
        VbusError: it is none of these, or names what the board does not have.
    """
    name = text.strip()
    if any(rule.name == name for rule in rules):
        return lambda looked: looked.counters.get(name, 0) > 0, True
    found = _FORM.fullmatch(text)
    if found is None:
        raise VbusError(
            f'"{text}" is no condition; write the name of a rule (vbus check --rules), a pin'
            ' ("x.HI=1"), or a value of a chip ("x.real>200")'
        )
    place, sign, wanted = found.groups()
    compare = _COMPARE[sign]
    chip_name, _, part = place.partition(".")
    try:
        chip = board.chip(chip_name)
    except ValueError as error:
        raise VbusError(f'"{text}": {error}') from None
    if part in chip.pins:
        level = _number(text, wanted)
        return lambda looked: compare(looked.find_pin(place).value, level), False
    telemetry = chip.telemetry()
    if part not in telemetry:
        raise VbusError(
            f'"{text}": {chip_name} has no pin and no value "{part}"; its values are'
            f" {', '.join(telemetry)}; its pins {', '.join(chip.pins)}"
        )
    value: float | str = wanted if isinstance(telemetry[part], str) else _number(text, wanted)
    return lambda looked: compare(looked.chip(chip_name).telemetry()[part], value), False


def _number(text: str, wanted: str) -> float:
    with suppress(ValueError):
        return int(wanted, 0)
    with suppress(ValueError):
        return float(wanted)
    raise VbusError(f'"{text}": {wanted} is no number')
