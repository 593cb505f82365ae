"""Who answers where: the addresses of cards as a table, found out on a board of its own."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from itertools import groupby
from typing import Final

from vbus.board.board import Board
from vbus.board.build import card_of
from vbus.board.card.card_bus import CardBus
from vbus.board.pin_maps import ADDRESS, READ, SELECT, WRITE, roles
from vbus.boardfile.cards import CardSection
from vbus.boardfile.sections import BoardFile
from vbus.chips.base import Chip
from vbus.core.kernel import NS
from vbus.core.signals import HIGH, LOW, Pin, Z
from vbus.core.values.settings import listed
from vbus.glue import logic
from vbus.glue.part import GlueBlock

MOST_SHOWN: Final = 8
"""Most inputs of a decoder that are shown with their levels; more would be the whole address."""


@dataclass(frozen=True, slots=True)
class CardAnswer:
    """What answers at one address of a card.

    Attributes:
        card: name of the card.
        address: the address.
        reads: who drives the data bus in a read: ``"x.0"`` is address 0 of chip x.
        writes: who takes what is written.
        why: where no chip does either, what keeps the chips from it: inputs of what selects them.
    """

    card: str
    address: int
    reads: tuple[str, ...]
    writes: tuple[str, ...]
    why: str = ""


def address_map(file: BoardFile, board: Board) -> list[CardAnswer]:
    """Return what answers at each address of each card that hosts use.

    Args:
        file: the board file.
        board: a spare board of that file: every address is tried on it.
    """
    found: list[CardAnswer] = []
    for card in file.cards:
        host = next((host for host in file.hosts if host.card == card.name), None)
        mine: dict[int, CardAnswer] = {}
        if card.bus:
            mine = {answer.address: answer for answer in _tried(file, card, board)}
        if card.decoded and host is not None:
            table = card_of(file, host)
            assert table is not None
            names = host.chips or tuple(chip.name for chip in file.chips)
            for address in {*table.reads, *table.writes}:
                reads, writes = (
                    (f"{names[rows[address].chip]}.{rows[address].address:X}",)
                    if address in rows else ()
                    for rows in (table.reads, table.writes)
                )  # fmt: skip
                if not card.bus or all(f"{card.name}." not in one for one in (*reads, *writes)):
                    mine[address] = CardAnswer(card.name, address, reads, writes)
        found += [mine[address] for address in sorted(mine)]
    return found


def remarks(file: BoardFile, board: Board, found: list[CardAnswer]) -> Iterator[str]:
    """Give what is wrong with a map: outputs that fight, chips that are never selected."""
    for card in file.cards:
        mine = [answer for answer in found if answer.card == card.name]
        for answer in mine:
            if len(answer.reads) > 1:
                yield (
                    f"[cards.{card.name}]: {' and '.join(answer.reads)} both answer a read at"
                    f" {answer.address:X}H and fight; select one of them only"
                )
        if not card.bus:
            continue
        bus = board.chip(card.name)
        reached = {one.partition(".")[0] for a in mine for one in (*a.reads, *a.writes)}
        for chip in board.glue.behind(board.chips):
            if chip.bus_net is not bus.bus_net:
                continue
            open_pins = [pin for pin in roles(chip) if pin in chip.pins and _open(chip.pins[pin])]
            if open_pins:
                yield (
                    f'[cards.{card.name}]: {listed(open_pins)} of chip "{chip.name}" are wired to'
                    " nothing; no cycle moves them"
                )
            if chip.name not in reached:
                select = [chip.pins[p].net for p, role in roles(chip).items() if role == SELECT]
                clocked = any(map(_has_clock, board.glue.leading_to(select)))
                as_they_stand = " as the registers stand after power-on" if clocked else ""
                yield (
                    f'[cards.{card.name}]: chip "{chip.name}" is never selected at'
                    f" {card.base:X}H to {card.last:X}H{as_they_stand}; look at what drives its"
                    " select"
                )


def _has_clock(block: GlueBlock) -> bool:
    """Whether a block follows edges of inputs, not their levels alone."""
    return block.row.through is not None and block.row.function is not logic.transceiver


def _open(pin: Pin) -> bool:
    """Whether no other part is on a pin's wire, but chips that share it."""
    return all(other.name == pin.name for other in pin.net.pins)


def lines(found: list[CardAnswer]) -> Iterator[str]:
    """Give a map as text; neighbours at which no chip answers are one line."""
    for (card, silent), group in groupby(found, lambda a: (a.card, not (a.reads or a.writes))):
        rows = list(group)
        if silent:
            last = f"-{rows[-1].address:X}H" if len(rows) > 1 else ""
            at = f" at {rows[0].address:X}H" if last and rows[0].why else ""
            why = f";{at} {rows[0].why}" if rows[0].why else ""
            yield f"{card} {rows[0].address:X}H{last}: no chip{why}"
            continue
        for row in rows:
            uses = [
                f"{verb} {'+'.join(who)}"
                for verb, who in (("read", row.reads), ("write", row.writes))
                if who
            ]
            yield f"{card} {row.address:X}H: {', '.join(uses)}"


def _tried(file: BoardFile, card: CardSection, board: Board) -> Iterator[CardAnswer]:
    bus = board.chip(card.name)
    assert isinstance(bus, CardBus)
    hands = {name: pin.net.solder("map") for name, pin in bus.pins.items()}
    # Long enough for an edge to pass through all glue, one part after the other.
    wait = sum(section.delay for section in file.glue) + NS
    chips = [chip for chip in board.chips if chip is not bus]
    known = {chip.name: roles(chip) for chip in chips}
    # Resets that follow power-on are over then.
    board.run_for(wait)
    for address in map(card.address, range(card.size)):
        for line, name in enumerate(bus.row.address):
            hands[name].drive(address >> line & 1)
        answers, why = [], ""
        for write in (False, True):
            who: dict[str, None] = {}
            # Both bytes: a register that holds one already would not show that it is written.
            for data in (0xFF, 0x00) if write else (Z,):
                hands["D0-D7"].drive(data)
                before = _held(board)
                _strobe(board, hands[bus.write_strobe if write else bus.read_strobe], LOW, wait)
                for chip in chips:
                    if _selected(chip, known[chip.name], write):
                        who[f"{chip.name}.{_address(chip, known[chip.name]):X}"] = None
                if not write:
                    who |= dict.fromkeys(_drivers(board, bus))
                    why = "" if who else _kept_from(board, chips, known)
                _strobe(board, hands[bus.write_strobe if write else bus.read_strobe], HIGH, wait)
                if write:
                    after = _held(board)
                    who |= {name: None for name in after if after[name] != before[name]}
            hands["D0-D7"].release()
            answers.append(tuple(who))
        yield CardAnswer(card.name, address, answers[0], answers[1], why)
    for hand in hands.values():
        hand.release()


def _strobe(board: Board, hand: Pin, level: int, wait: int) -> None:
    board.run_for(wait)
    hand.drive(level)
    board.kernel.settle()
    board.run_for(wait)


def _held(board: Board) -> dict[str, tuple[int, ...]]:
    """Return what the registers among the glue hold."""
    return {part.name: tuple(block.state for block in part.blocks) for part in board.glue.parts}


def _selected(chip: Chip, known: Mapping[str, str], write: bool) -> bool:
    """Tell whether a chip's select, and its strobe for this direction, are low."""
    wanted = [name for name, role in known.items() if role in (SELECT, WRITE if write else READ)]
    return bool(wanted) and all(chip.pins[name].value == LOW for name in wanted)


def _kept_from(board: Board, chips: list[Chip], known: Mapping[str, Mapping[str, str]]) -> str:
    """Say what holds the selects of chips high: the part, and the levels at its inputs."""
    owners = {id(block): part.name for part in board.glue.parts for block in part.blocks}
    shown_inputs = []
    for chip in chips:
        for name, role in known[chip.name].items():
            net = chip.pins[name].net if role == SELECT else None
            for block in board.glue.blocks if net is not None and net.value else ():
                if any(pin.net is net for pin in block.outputs):
                    levels = [
                        f"{pin.net.name} {pin.net.value}" for pin, _ in block.inputs
                        if pin.net.width == 1 and pin.net.pins != (pin,)
                    ]  # fmt: skip
                    shown = f" ({', '.join(levels)})" if len(levels) <= MOST_SHOWN else ""
                    shown_inputs.append(f"{chip.name}.{name} is high by {owners[id(block)]}{shown}")
    return "; ".join(shown_inputs)


def _address(chip: Chip, known: Mapping[str, str]) -> int:
    return sum(
        chip.pins[name].value << int(role[1:])
        for name, role in known.items()
        if role[0] == ADDRESS and name in chip.pins
    )


def _drivers(board: Board, bus: CardBus) -> Iterator[str]:
    """Give the glue that drives the card's data bus."""
    for part in board.glue.parts:
        if any(pin.net is bus.bus_net and pin.level != Z for pin in part.pins.values()):
            yield part.name
