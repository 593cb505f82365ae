"""What can be wrong with glue: names, open inputs, outputs that fight, loops."""

from collections.abc import Iterable, Mapping

from vbus.board.card_bus import ADDRESS_LINES, CardBus
from vbus.board.card_interrupt import ACK, INT
from vbus.board.glue_plan import plan_glue
from vbus.board.glue_section import GlueSection
from vbus.board.sections import BoardFile, CardSection
from vbus.board.source import Source
from vbus.chips.base import Chip


def check_glue(file: BoardFile, chips: Mapping[str, Chip], source: Source) -> None:
    """Check the glue of a board file.

    Args:
        file: the board file.
        chips: a specimen of each chip that could be read.
        source: takes the mistakes.
    """
    rows = {f"{name}.{row.name}": row for name, chip in chips.items() for row in chip.pin_rows}
    taken = {name: f"[chips.{name}]" for name in chips}
    for card in file.cards:
        if card.has_circuit:
            rows |= {f"{card.name}.{row.name}": row for row in (INT, ACK)}
            taken.setdefault(card.name, f"the interrupt of [cards.{card.name}]")
        if card.bus:
            rows |= {f"{card.name}.{row.name}": row for row in CardBus.PINS}
            taken.setdefault(card.name, f"[cards.{card.name}]")
    taken |= {bus.name: f"[buses.{bus.name}]" for bus in file.buses}
    for section in file.glue:
        if section.name in taken:
            source.fail(
                ("glue", section.name),
                f"{taken[section.name]} has this name too, and pins of its own; choose another",
            )
    if file.nodes:
        source.fail(
            ("glue",) if file.glue else ("cards",),
            "glue and cards with a bus are for boards without nodes; take it out, or the nodes",
        )
        return
    plan_glue(file, rows, source.fail)


def check_card_bus(
    card: CardSection, chips: list[str], glue: Iterable[GlueSection], source: Source
) -> None:
    """Check a card that has a bus: glue decodes it, not ``ports`` or ``decode``."""
    path = ("cards", card.name)
    for key, given in (
        ("ports", bool(card.ports)), ("decode", bool(card.decode)), ("chips", bool(card.chips)),
        ("block", bool(card.block)), ("stride", card.stride != 1),
    ):  # fmt: skip
        if given:
            source.fail(
                (*path, key), f'"{key}" is for cards without a bus; here glue decodes the addresses'
            )
    if card.base + card.size > 1 << ADDRESS_LINES:
        source.fail((*path, "base"), f"found {card.base}; addresses of this bus end at 65535")
    if card.name in chips:
        source.fail(path, f'a chip is called "{card.name}" too; give the card another name')
    if card.memory:
        source.fail((*path, "memory"), "this bus is one of I/O ports; take memory out, or the bus")
    data = f"{card.name}.D"
    wired = any(
        name.startswith(data) for part in glue for names in part.pins.values() for name in names
    )
    if not card.pins and not wired:
        source.fail(
            path,
            'its data bus is not wired; write "D0-D7" = "x.D0-D7" in [cards.NAME.pins], or the name'
            " of a bus in place of x",
        )
