"""The interrupt of a card: wired-OR, flip-flop, acknowledge, and a line that cards share."""

import pytest

from tests.unit.board.test_card_keys import BOARD, info, settings
from tests.unit.board.toy import Toy
from vbus.board.board import Board
from vbus.board.build import card_of, load_board_text
from vbus.board.card.cards import add_interrupt
from vbus.board.config import read_board_text
from vbus.board.host_bus import HostBus
from vbus.board.snapshot import restore, take
from vbus.core.errors import ConfigError
from vbus.core.kernel import US
from vbus.protocols.port import CardAccess, PortError


def bench(latched: bool = True, edge: bool = False) -> tuple[Board, HostBus]:
    """Two toys, whose IRQ rises n us after n is written to port 0, interrupt by one card."""
    board = Board("bench")
    for name in ("x", "y"):
        board.add_chip(Toy, name, "TOY", 8_000_000)
    add_interrupt(board, "c", ["x.IRQ", "y.IRQ"], latched, edge)
    return board, board.open_port("host")


def level(port: HostBus) -> int:
    """Return the level of /INT as the host hears of it."""
    outputs, _ = port.sync()
    return outputs >> port.pins.output_names().index("c./INT") & 1


def raise_in(port: HostBus, chip: int, us: int) -> None:
    port.select(1 << chip)
    port.write(0, us)


def acknowledge(port: HostBus) -> None:
    number = port.pins.side_names().index("c./ACK")
    port.pin(number, 0)
    port.pin(number, 2)


def test_without_a_flip_flop_the_line_is_low_as_long_as_one_output_is_active() -> None:
    board, port = bench(latched=False)
    with pytest.raises(PortError, match=r"no 'c\./ACK'"):
        port.pin_number("c./ACK")
    raise_in(port, 0, 20)
    raise_in(port, 1, 10)
    board.run_until(11 * US)
    assert level(port) == 1
    board.run_until(12 * US)
    assert level(port) == 0  # y's, written at 2 us
    raise_in(port, 1, 100)
    board.run_until(21 * US)
    assert level(port) == 0  # x's, written at 1 us
    raise_in(port, 0, 100)
    assert level(port) == 1


def test_edges_of_the_line_are_reported_at_their_instants() -> None:
    _, port = bench(latched=False)
    port.events(1 << port.pins.output_names().index("c./INT"))
    raise_in(port, 0, 5)
    port.delay(10 * US)
    assert [instant for _, instant in port.take_events()] == [6 * US]


@pytest.mark.parametrize("edge", [False, True])
def test_an_interrupt_is_kept_until_it_is_acknowledged(edge: bool) -> None:
    board, port = bench(edge=edge)
    raise_in(port, 0, 3)
    board.run_until(10 * US)
    raise_in(port, 0, 100)  # the output has let go
    assert level(port) == 0
    acknowledge(port)
    assert level(port) == 1


@pytest.mark.parametrize("edge", [False, True])
def test_acknowledged_while_the_wire_is_active_a_level_stays_and_an_edge_is_gone(
    edge: bool,
) -> None:
    board, port = bench(edge=edge)
    raise_in(port, 0, 3)
    board.run_until(10 * US)
    acknowledge(port)
    assert level(port) == int(edge)
    raise_in(port, 1, 3)  # no edge of the wire: x holds it
    board.run_until(20 * US)
    assert level(port) == int(edge)
    raise_in(port, 0, 100)
    raise_in(port, 1, 3)  # both have let go
    board.run_until(30 * US)
    assert level(port) == 0


def test_a_session_sees_the_interrupts_its_chips_raise() -> None:
    board, _ = bench()
    board.add_chip(Toy, "z", "TOY", 8_000_000)
    assert "c./INT" in board.open_port("y alone", ["y"]).info().outputs
    other = board.open_port("z alone", ["z"]).info()
    assert (other.outputs, [name for name in other.pins if "c." in name]) == (["z.IRQ"], [])


@pytest.mark.parametrize("edge", [False, True])
def test_a_snapshot_keeps_the_flip_flop_and_what_a_host_does_to_it(edge: bool) -> None:
    board, port = bench(edge=edge)
    raise_in(port, 0, 3)
    board.run_until(10 * US)
    waiting = take(board)
    acknowledge(port)
    raise_in(port, 0, 100)
    port.pin(port.pins.side_names().index("c./ACK"), 0)
    held = take(board)
    other, mine = bench(edge=edge)
    restore(other, waiting)
    assert level(mine) == 0
    acknowledge(mine)
    assert level(mine) == int(edge)  # the wire was active before: no edge
    restore(other, held)
    assert mine.getpin(mine.pins.side_names().index("c./ACK")) == 0
    assert (level(mine), other.state_hash()) == (1, board.state_hash())


# -- in a board file ------------------------------------------------------------------------------

LINE = BOARD.replace(
    "KEYS",
    'interrupt = "x.HI"\nline = "irq5"\n'
    '[cards.d]\ndecode = "direct"\nchips = ["mc"]\ninterrupt = "mc.~HostIntrpt"\nline = "irq5"',
)


def test_a_program_is_told_of_the_line_in_place_of_the_outputs() -> None:
    keys = 'interrupt = "x.HI"\nacknowledge = "read"\nacknowledge_at = 4\nsense = "edge"'
    told, names = settings(keys), info(keys)
    bit = 1 << names.outputs.index("c./INT")
    assert (told["lines"], told["low"], told["edge"]) == (str(bit), str(bit), "1")
    pin = names.pins.index("c./ACK")
    assert names.card == f"r0=0.0 r1=0.1 r4!{pin:X} w0=0.0 w1=0.1"


@pytest.mark.parametrize(
    ("access", "reads", "writes"),
    [("read", True, False), ("write", False, True), ("either", True, True)],
)
def test_an_access_acknowledges_at_a_chips_address_too(
    access: str, reads: bool, writes: bool
) -> None:
    keys = f'base = 0x340\nstride = 2\ninterrupt = "x.HI"\nacknowledge = "{access}"'
    text = BOARD.replace("KEYS", f"{keys}\nacknowledge_at = 1")
    file, _ = read_board_text(text)
    port = load_board_text(text).open_port("host", None, 0, card_of(file, file.hosts[0]))
    pin = port.info().pins.index("c./ACK")
    assert port.card(0x342) == CardAccess(0, 1, 0, pin if reads else -1)
    assert port.card(0x342, write=True) == CardAccess(0, 1, 0, pin if writes else -1)
    assert port.card(0x340) == CardAccess(0, 0, 0, -1)


def test_an_edge_without_a_flip_flop_is_for_the_program_to_know() -> None:
    assert settings('interrupt = "x.HI"\nsense = "edge"')["edge"] == "1"
    assert "edge" not in settings('interrupt = "x.HI"')


def test_cards_on_one_line_pull_it_low_together() -> None:
    """The MC1141A's interrupt, active low, reaches the program of the other card."""
    board = load_board_text(LINE)
    port = board.open_port("host", ["x"])
    net = board.find_pin("c./INT").net
    assert (net.name, net is board.find_pin("d./INT").net, net.value) == ("irq5", True, 1)
    board.find_pin("mc.~HostIntrpt").drive(0)
    board.kernel.settle()
    assert port.sync()[0] >> port.pins.output_names().index("c./INT") & 1 == 0


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("KEYS", 'line = "irq5"', 'cards.c.line: "line" needs "interrupt" (output that'),
        ("KEYS", 'acknowledge = "read"', 'cards.c.acknowledge: "acknowledge" needs "interrupt"'),
        ("KEYS", 'sense = "edge"', 'cards.c.sense: "sense" needs "interrupt"'),
        (
            "KEYS",
            'interrupt = "x.HI"\nacknowledge_at = 4',
            'cards.c.acknowledge_at: "acknowledge_at" needs "acknowledge" (access that clears',
        ),
        (
            "KEYS",
            'interrupt = "x.HI"\nacknowledge = "reading"',
            'cards.c.acknowledge: found "reading"',
        ),
        (
            "KEYS",
            'interrupt = "x.HI"\nline = "irq5"',
            'cards.c.line: no other card is on line "irq5"; a line is shared by two cards or more',
        ),
        (
            '[chips.mc]\npart = "MC1141A"',
            '[chips.c]\npart = "MC1141A"',
            'cards.c: a chip is called "c" too; its interrupt has pins of its own ("c./INT")',
        ),
        (
            '[[hosts]]',
            '[nets]\nirq5 = ["x.HI"]\n[[hosts]]',
            'cards.c.line: there is a net "irq5" already; choose another name',
        ),
        (
            'line = "irq5"\n[[hosts]]',
            'line = "irq5"\nsense = "edge"\n[[hosts]]',
            'cards.d.sense: card "c" senses the level of the same line; cards on one line have one',
        ),
        (
            'line = "irq5"\n[[hosts]]',
            'line = "irq6"\n[[hosts]]',
            'cards.d.line: no other card is on line "irq6"; did you mean "irq5"? a line is shared',
        ),
        (
            "[[hosts]]",
            '[[hosts]]\nchips = ["mc"]',
            'hosts[1].card: card "c" is interrupted by "x", which is not among the chips',
        ),
    ],
)  # fmt: skip
def test_a_mistake_is_named(old: str, new: str, message: str) -> None:
    text = BOARD if old == "KEYS" else LINE
    assert old in text
    text = text.replace(old, new)
    with pytest.raises(ConfigError) as caught:
        load_board_text(text, "b.toml")
    assert message in str(caught.value)
