"""What can be wrong with glue: names, open inputs, outputs that fight, loops."""

from collections.abc import Iterable, Mapping
from typing import Final

from msgspec import Struct

from vbus.board.card.card_parts import names_of
from vbus.board.card.cards import ACK, INT
from vbus.board.glue_plan import plan_glue
from vbus.boardfile.cards import CardSection
from vbus.boardfile.lines import Path
from vbus.boardfile.sections import BoardFile, GlueSection
from vbus.boardfile.source import Mistakes, Source
from vbus.chips.base import Chip
from vbus.glue.card_buses import BUSES


class GlueEnds(Struct, frozen=True):
    """Where glue ends, for those who wire a microcontroller to it.

    Attributes:
        pins: the pins of each part that a host can reach, by the part's name.
        driven: the pins of chips, ``"x./CS"``, that glue or a card's connector drives.
        outputs: the outputs of each part, ``"u1.Y0"``, by the part's name.
    """

    pins: Mapping[str, tuple[str, ...]]
    driven: frozenset[str]
    outputs: Mapping[str, tuple[str, ...]]


NO_GLUE: Final = GlueEnds({}, frozenset(), {})


def check_glue(file: BoardFile, chips: Mapping[str, Chip], source: Source) -> GlueEnds:
    """Check the glue of a board file; return where it ends.

    Args:
        file: the board file.
        chips: a specimen of each chip that could be read.
        source: takes the mistakes.
    """
    if not file.has_glue:
        return NO_GLUE
    rows = {f"{name}.{row.name}": row for name, chip in chips.items() for row in chip.pin_rows}
    taken = {name: f"[chips.{name}]" for name in chips}
    for card in file.cards:
        if card.has_circuit:
            rows |= {f"{card.name}.{row.name}": row for row in (INT, ACK)}
            taken.setdefault(card.name, f"the interrupt of [cards.{card.name}]")
        if card.bus:
            rows |= {f"{card.name}.{row.name}": row for row in BUSES[card.bus].pins}
            taken.setdefault(card.name, f"[cards.{card.name}]")
    taken |= {bus.name: f"[buses.{bus.name}]" for bus in file.buses}
    named: list[tuple[Path, str]] = [(("glue", part.name), part.name) for part in file.glue]
    named += [place for card in file.cards if card.bus for place in names_of(card)]
    for path, name in named:
        if name in taken:
            source.fail(
                path, f"{taken[name]} has this name too, and pins of its own; choose another"
            )
        taken[name] = f"[{'.'.join(map(str, path))}]"
    if file.nodes:
        source.fail(
            ("glue",) if file.glue else ("cards",),
            "glue and cards with a bus are for boards without nodes; take it out, or the nodes",
        )
        return NO_GLUE
    plan = plan_glue(file, rows, source.fail)
    parts = {part.name: {row.name: row for row in part.pin_rows} for part in plan.parts}
    buses = {card.name for card in file.cards if card.bus}
    driven: set[str] = set()
    for pin, net in plan.wires.items():
        owner, _, name = pin.partition(".")
        row = parts.get(owner, {}).get(name)
        if owner in buses or (row is not None and row.direction != "in"):
            driven.add(net)
    return GlueEnds(
        {name: tuple(row.name for row in own.values() if row.width == 1)
         for name, own in parts.items()},
        frozenset(
            pin for pin, net in plan.wires.items()
            if net in driven and pin.partition(".")[0] in chips
        ),
        {name: tuple(f"{name}.{row.name}" for row in own.values() if row.direction in ("out", "od"))
         for name, own in parts.items()},
    )  # fmt: skip


def check_card(card: CardSection, chips: list[str], glue: Iterable[GlueSection]) -> Mistakes:
    """Check where a card is: glue decodes the addresses of one with a bus, or a table."""
    path: Path = ("cards", card.name)
    if bool(card.ports) + bool(card.decode) != 1 and not (card.bus and not card.ports):
        beside = ' beside its "bus"' if card.bus else ""
        yield path, f'a card has either "decode" and "chips", or a list of "ports"{beside}'
    if not card.bus:
        return
    bus = BUSES[card.bus]
    last = card.last
    begins = bus.on_lines(card.base) if bus.window else card.base
    if begins + last - card.base >= 1 << bus.lines:
        ends = (1 << bus.lines) - 1
        yield (
            (*path, "base"),
            f"the card ends at {last:X}H; addresses of this bus end at {ends:X}H",
        )
    if bus.ports and not card.memory and last > 0xFFFF:
        yield (*path, "base"), f"the card ends at {last:X}H; I/O ports end at FFFFH"
    if not bus.ports and not card.memory:
        yield path, f'a bus "{card.bus}" has memory alone; write memory = true'
    if card.name in chips:
        yield path, f'a chip is called "{card.name}" too; give the card another name'
    data = f"{card.name}.D"
    wired = any(
        name.startswith(data) for part in glue for names in part.pins.values() for name in names
    )
    if not card.pins and not wired and not card.registers:
        yield (
            path,
            'its data bus is not wired; write "D0-D7" = "x.D0-D7" in [cards.NAME.pins], or the name'
            " of a bus in place of x",
        )
