"""From a checked board file to a board: chips, plants, wires, and power."""

import hashlib
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path as FilePath
from typing import Final

from msgspec.structs import replace

from vbus import plugins
from vbus.board.board import Board
from vbus.board.card import cards
from vbus.board.card.card_bus import CLOCK, CardBus
from vbus.board.card.cards import ACK, INT, add_interrupt
from vbus.board.config import read_board_file, read_board_text
from vbus.boardfile.cards import SIGNALS
from vbus.boardfile.lines import Path
from vbus.boardfile.sections import (
    RESTS,
    BoardFile,
    HostSection,
    NetSection,
    PinMapSection,
    PlantSection,
)
from vbus.boardfile.source import Source
from vbus.chips.base import Chip
from vbus.chips.tables import CardRow
from vbus.core.errors import ConfigError
from vbus.core.interpreter import collection_held
from vbus.core.options import Option, Value
from vbus.core.signals import HIGH, LOW, OFF, STRICT, WARN, Net, Plant, Policy, Switch, Z
from vbus.glue.part import GluePart

_LEVELS: Final = {"off": OFF, "warn": WARN, "strict": STRICT}
_RESTS: Final = dict(zip(RESTS, (LOW, HIGH, Z), strict=True))


def load_board(path: str | FilePath) -> Board:
    """Return the board that a board file describes, powered on, at instant 0.

    Raises:
        ConfigError: the file has mistakes; every one is named with its line.
    """
    return build(*read_board_file(path))


def load_board_text(text: str, file: str = "board.toml") -> Board:
    """Return the board that a board file in memory describes; ``file`` is its name in messages."""
    return build(*read_board_text(text, file))


@collection_held()
def build(file: BoardFile, source: Source) -> Board:
    """Return the board a checked file describes.

    Raises:
        ConfigError: a part or a model refuses its settings, or two of them do not fit together;
            or the board has nodes: :func:`vbus.nodes.machine.build_nodes` makes a board of each.
    """
    if file.nodes:
        names = ", ".join(node.name for node in file.nodes)
        raise ConfigError(
            f"{file.path}: this board has nodes ({names}), each with a time and hosts of its own;"
            ' this needs a board without: take out [nodes] and every "node" and "delay", or let'
            ' "vbus run" run them all'
        )
    board = assemble(file, source)
    board.text, board.file = source.text, file.path
    return board


def assemble(
    file: BoardFile, source: Source, wires: Callable[[Board], None] | None = None
) -> Board:
    """Return the board of a file that has no nodes, or of one node's part of a file.

    Args:
        file: what stands on this board.
        source: takes the mistakes.
        wires: solders further wires before power comes up.
    """
    board = _empty(file)
    plants: dict[str, Plant] = {}
    for plant in file.plants:
        with _refusals(source, ("plants", plant.name)):
            plants[plant.name] = _plant(plant, board.seed)
    for chip in file.chips:
        with _refusals(source, ("chips", chip.name)):
            cls = plugins.chip_class(chip.part)
            settings = _seeded(f"chips.{chip.name}", chip.settings, cls.OPTIONS, board.seed)
            board.add_chip(cls, chip.name, chip.part, chip.clock, settings)
            for axis, name in enumerate(chip.axes):
                key: Path = ("plant",) if chip.plant else ("plants", axis)
                with _refusals(source, ("chips", chip.name, *key)):
                    # A plant that was refused has a message of its own.
                    if name in plants:
                        board.connect(chip.name, axis, plants[name])
    source.finish()
    for bus in file.buses:
        with _refusals(source, ("buses", bus.name)):
            board.share_bus(bus.name, bus.chips)
    _card_buses(board, file)
    lines = _interrupts(board, file)
    for net in _glue(board, file, source):
        with _refusals(source, ("nets", net.name)):
            board.join(net.name, net.pins, rest_of(net))
    for line, pins in lines.items():
        board.join(line, pins)
    source.finish()
    if wires is not None:
        wires(board)
    # Before power comes up: a fault may be there from the first instant on.
    for fault in file.faults:
        with _refusals(source, ("faults", fault.place)):
            board.faults.arm(
                fault.fault, fault.target, fault.when or None, fault.until or None, **fault.settings
            )
    source.finish()
    board.power_on(done=file.board.power_on == "done")
    # After it: a path begins with the levels at which the wires rest.
    if file.has_glue:
        _card_paths(board)
    return board


def _card_paths(board: Board) -> None:
    from vbus.board.card.card_path import CardPath

    for part in board.chips:
        if isinstance(part, CardBus):
            part.path = CardPath(board, part)


def _card_buses(board: Board, file: BoardFile) -> None:
    """Put the connectors of cards on the board."""
    chips = tuple(board.chips)
    for card in file.cards:
        if card.bus:
            settings: dict[str, Value] = {
                option.name: getattr(card, option.name) for option in CardBus.OPTIONS
            }
            made = board.add_chip(CardBus, card.name, card.bus, CLOCK, settings)
            assert isinstance(made, CardBus)
            made.chips = chips


def _interrupts(board: Board, file: BoardFile) -> dict[str, list[str]]:
    """Put the interrupts of cards on the board; return which are on one line together."""
    lines: dict[str, list[str]] = {}
    for card in file.cards:
        if card.has_circuit:
            edge = card.sense == "edge"
            outputs = card.interrupt.split()
            add_interrupt(board, card.name, outputs, bool(card.acknowledge), edge)
        if card.line:
            lines.setdefault(card.line, []).append(f"{card.name}.{INT.name}")
    return lines


def _glue(board: Board, file: BoardFile, source: Source) -> list[NetSection]:
    """Put the parts of glue on the board; return the nets that join them to the rest."""
    if not file.has_glue:
        return list(file.nets)
    from vbus.board.glue_plan import plan_glue

    parts: list[Chip | GluePart] = [*board.chips, *board.glue.parts]
    rows = {f"{part.name}.{row.name}": row for part in parts for row in part.pin_rows}
    plan = plan_glue(file, rows, source.fail)
    for part in plan.parts:
        borrowed = {pin: (board.find_pin(name), wire) for pin, (name, wire) in part.taps.items()}
        for pin, level in part.tied.items():
            tied = Net(board.kernel, f"{part.name}.{pin}", rest=level)
            borrowed[pin] = tied.solder(pin), 0
        board.add_glue(part.name, part.pin_rows, part.blocks, borrowed, part.delay, part.inner)
    board.glue.order = plan.order
    return plan.nets


def rest_of(net: NetSection) -> int | None:
    """Return the level of a net that no pin drives; None: as its first pin rests."""
    return _RESTS.get(net.rest)


@contextmanager
def _refusals(source: Source, path: Path) -> Iterator[None]:
    """Make what a part objects to a mistake at ``path``."""
    try:
        yield
    except ValueError as error:
        source.fail(path, str(error))


def _empty(file: BoardFile) -> Board:
    rules = {rule: _LEVELS[level] for rule, level in file.violations.items()}
    policy = Policy(rules.pop("default", WARN), rules)
    settings = file.board
    return Board(
        settings.name, settings.time, settings.rate, policy, settings.seed, settings.clock_step
    )


def _seeded(
    name: str, settings: Mapping[str, Value], options: Iterable[Option], seed: int
) -> dict[str, Value]:
    """Give a part that takes a seed, and got none, one of its own from the board's."""
    result = dict(settings)
    for option in options:
        # By name, not by place: a part added above leaves the streams of the others as they are.
        if option.name == "seed" and "seed" not in result:
            digest = hashlib.sha256(f"{seed} {name}".encode()).digest()
            result["seed"] = int.from_bytes(digest[:4], "big")
    return result


def _plant(section: PlantSection, seed: int) -> Plant:
    cls = plugins.plant_class(section.model)
    _, _, named = section.model.partition(":")
    settings = {**section.settings, "file": named} if named else section.settings
    plant = cls(_seeded(f"plants.{section.name}", settings, cls.OPTIONS, seed))
    for name, switch in section.switches.items():
        if switch.last < switch.first:
            raise ValueError(
                f"switch {name!r} closes at {switch.first} and opens after {switch.last}:"
                " first must not be above last"
            )
        level = HIGH if switch.closed == "high" else LOW
        # The file names the last count at which it is closed; a switch ends before its end.
        plant.switches[name] = Switch(switch.first, switch.last + 1, level)
    return plant


def card_of(file: BoardFile, host: HostSection) -> cards.Card | None:
    """Return the card a host of the file uses, with chips numbered as in the host's session."""
    if not host.card:
        return None
    reached = host.chips or tuple(chip.name for chip in file.chips)
    parts = {chip.name: plugins.chip_class(chip.part) for chip in file.chips}
    card = next(card for card in file.cards if card.name == host.card)
    blocks = [(reached.index(name), rows) for name, rows in cards.rows_of(card, parts)]
    if card.bus:
        decoded = {row.offset for _, rows in blocks for row in rows}
        others = [CardRow(at, at, at) for at in range(card.size) if at not in decoded]
        blocks.append((reached.index(card.name), others))
    made = cards.card_of_rows(card.name, card.base, card.stride, blocks)
    made.memory, made.fixed, made.big_endian = card.memory, card.fixed, card.big_endian
    made.interrupt, made.signal = card.interrupt, SIGNALS.get(card.signal, 0)
    made.edge = card.sense == "edge"
    if card.has_circuit:
        made.interrupt = f"{card.name}.{INT.name}"
    if card.acknowledge:
        at = card.acknowledge_at * card.stride
        made.acknowledge = f"{card.name}.{ACK.name}"
        made.acknowledge_read = -1 if card.acknowledge == "write" else at
        made.acknowledge_write = -1 if card.acknowledge == "read" else at
    return made


def pin_map_of(file: BoardFile, name: str) -> PinMapSection | None:
    """Return the pin map called ``name`` with all its chips; None if there is none."""
    for section in file.pinmaps:
        if section.name == name:
            meant = section.chips or tuple(chip.name for chip in file.chips)
            return replace(section, chips=meant)
    return None
