"""A card's interrupt: its outputs wired-OR, a flip-flop an access clears, a line cards share."""

from typing import Final

from vbus.chips.tables import PinRow
from vbus.circuit.circuit import Circuit
from vbus.core.signals import HIGH, LOW
from vbus.glue import logic
from vbus.glue.table import OPEN, Block

INT: Final = PinRow("/INT", "od", title="interrupt, active low, open collector")
ACK: Final = PinRow("/ACK", "in", title="clears the flip-flop while it is low")


def active_low(pin: str) -> bool:
    """Tell whether a pin of this name is active when it is low, as in the manuals."""
    return pin[:1] in ("/", "~")


def add_interrupt(board: Circuit, name: str, outputs: list[str], latched: bool, edge: bool) -> None:
    """Put what stands between the outputs of a card that interrupt and its line on a board.

    The outputs are one wire, active as long as one of them is. Without a flip-flop ``/INT`` follows
    it. With one ``/INT`` is low until ``/ACK`` is low: edge sensing, from when the wire becomes
    active; level sensing, from when it is active, and at least as long.

    Args:
        board: the board.
        name: the card's name; its pins are ``"name./INT"`` and, latched, ``"name./ACK"``.
        outputs: the outputs of chips that interrupt.
        latched: whether there is a flip-flop.
        edge: whether only an edge sets it.
    """
    pins = [board.find_pin(output) for output in outputs]
    active = tuple([LOW if active_low(pin.name) else HIGH for pin in pins])
    rows = (INT, ACK) if latched else (INT,)
    names = (*outputs, ACK.name) if latched else tuple(outputs)
    block = Block(names, (INT.name,), logic.card_interrupt(active, latched, edge), OPEN)
    borrowed = {output: (pin, 0) for output, pin in zip(outputs, pins, strict=True)}
    board.add_glue(name, rows, (block,), borrowed)
