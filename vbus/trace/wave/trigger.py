"""When a waveform begins: the text of a trigger, and the test of a change against it."""

import re
from collections.abc import Iterable
from typing import Final

from vbus.board import circuit, plugins
from vbus.board.board import Board
from vbus.board.settings import suggestion
from vbus.errors import VbusError
from vbus.signals import Net
from vbus.trace.wave.signals import Signal, Value, net_names, values_of

FORMS: Final = (
    "violation", "violation RULE", "CHIP.PIN rises", "CHIP.PIN falls", "command MNEMONIC",
    "CHIP.VALUE > NUMBER", "CHIP.VALUE < NUMBER",
)  # fmt: skip
"""What a trigger may say."""

_PATTERNS: Final = {
    "violation": re.compile(r"violation(?:\s+(?P<wanted>\S+))?"),
    "command": re.compile(r"command\s+(?P<wanted>\S.*)"),
    "net": re.compile(r"(?P<name>\S+)\s+(?P<wanted>rises|falls)"),
    "value": re.compile(r"(?P<name>\S+)\s*(?P<wanted>[<>])\s*(?P<number>[-+]?\d+(?:\.\d+)?)"),
}
"""By kind of the signal it looks at, in the order in which they are tried."""

_MNEMONIC: Final = re.compile(r"[A-Z][A-Z0-9_]*")


class Trigger:
    """A condition on one change.

    Args:
        text: one of :data:`FORMS`.
        board: what it is about, for names.

    Raises:
        VbusError: the text is none of the forms, or names nothing that there is.
    """

    def __init__(self, text: str, board: Board) -> None:
        self.text: str = text
        self.net: Net | None = None
        """The net it looks at, if it is an edge."""
        text = text.strip()
        found = ((kind, one.fullmatch(text)) for kind, one in _PATTERNS.items())
        kind, match = next((each for each in found if each[1]), ("", None))
        if match is None:
            raise VbusError(f'trigger "{text}": write one of: {"; ".join(FORMS)}')
        given = match.groupdict("")
        self._kind: str = kind
        self._wanted: str = given["wanted"]
        self._name: str = given.get("name", "")
        self._number: float = float(given.get("number", 0))
        self._check(board)

    def _check(self, board: Board) -> None:
        """Refuse what can never come."""
        if self._kind == "violation":
            self._known(self._wanted, _rules(board), hint=True)
        elif self._kind == "command":
            self._known(self._wanted, _mnemonics(board, self._wanted), hint=True)
        elif self._kind == "net":
            nets = net_names(board)
            self._known(self._name, nets)
            self.net = nets[self._name]
            self._name = self.net.name
        else:
            self._known(self._name, values_of(board))

    def _known(self, name: str, names: Iterable[str], hint: bool = False) -> None:
        names = list(names)
        if name and names and name not in names:
            near = suggestion(name, names) if hint else ""
            raise VbusError(
                f'trigger "{self.text}": no "{name}"; {near}there are {", ".join(names)}'
            )

    def fires(self, signal: Signal, before: Value | None, after: Value) -> bool:
        """Tell whether this change is the one waited for."""
        if signal.kind != self._kind or (self._name and signal.name != self._name):
            return False
        if self._kind == "violation":
            return self._wanted in ("", after, str(after).partition(".")[0])
        if self._kind == "command":
            return f"{after} ".startswith(f"{self._wanted} ")
        if isinstance(after, str) or isinstance(before, str):
            return False
        if self._kind == "net":
            return before is not None and (after > before) == (self._wanted == "rises")
        if self._wanted == ">":
            return after > self._number and (before is None or before <= self._number)
        return after < self._number and (before is None or before >= self._number)


def _rules(board: Board) -> list[str]:
    """Return the rules and families that may be broken on a board."""
    rules = [rule.name for rule in circuit.RULES]
    rules += [rule.name for chip in board.chips for rule in type(chip).RULES]
    families = [name.partition(".")[0] for name in rules]
    return list(dict.fromkeys([*families, *rules]))


def _mnemonics(board: Board, wanted: str) -> list[str]:
    """Return the mnemonics of a board's chips; none where ``wanted`` may be something else."""
    found = [plugins.family(chip.FAMILY).commands for chip in board.chips]
    if not _MNEMONIC.fullmatch(wanted) or not all(found):
        return []
    return [row.name for rows in found for row in rows]
