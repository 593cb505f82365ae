"""Nodes in the board file: what is refused, and in which words."""

import pytest

from tests.nodes.four_chips import BOARD
from vbus.board.build import load_board_text
from vbus.board.config import read_board_text
from vbus.boardfile.source import BoardFileError
from vbus.core.errors import ConfigError
from vbus.core.kernel import END, US
from vbus.nodes.machine import build_nodes
from vbus.nodes.plan import part_of, pins_of, plan_of
from vbus.nodes.scenario import read_scenario

CHIPS = {"x": {"/RST", "HI"}, "y": {"/RST"}}


def problems(old: str, new: str) -> list[str]:
    assert old in BOARD
    with pytest.raises(BoardFileError) as caught:
        read_board_text(BOARD.replace(old, new, 1), "b.toml")
    return [str(problem).partition(": ")[2] for problem in caught.value.problems]


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        (
            ', delay = "200 us" }',
            " }",
            'nets."/SYNC": its pins are on the nodes c, d; say how long an edge takes between'
            ' them: "/SYNC" = { pins = [...], delay = "2 us" }',
        ),
        (
            '["m./SYNC", "p.~HostIntrpt"]',
            '["m./SYNC", "m./STOP"]',
            'nets."/SYNC".delay: a delay is for wires between nodes; all its pins are on node c',
        ),
        (
            'node = "a"',
            'node = "aa"',
            'chips.x.node: there is no [nodes.aa]; did you mean "a"? this file has a, b, c, d',
        ),
        (
            'plant = "x_motor"\nnode = "a"',
            'plant = "x_motor"',
            'chips.x: to which node does it belong? write node = "a" or "b" or "c" or "d"',
        ),
        ("[nodes.d]", "[nodes.d]\n[nodes.e]", 'nodes.e: no chip has node = "e"'),
        (
            "[nets]",
            '[buses.main]\nchips = ["x", "y"]\n\n[nets]',
            'buses.main.chips: bus "main" reaches chips of the nodes a, b; only wires with a delay'
            " go from node to node: name the chips of one",
        ),
        (
            "[nets]",
            '[pinmaps.uno]\nchips = ["x", "y"]\n\n[nets]',
            'pinmaps.uno: pin map "uno" reaches chips of the nodes a, b; only wires with a delay go'
            " from node to node: name the chips of one",
        ),
        (
            "[nets]",
            '[[hosts]]\ntransport = "unix:/tmp/h"\n\n[nets]',
            "hosts[1]: this host reaches chips of the nodes a, b, c, d; only wires with a delay go"
            " from node to node: name the chips of one",
        ),
        (
            "[nodes.d]",
            '[nodes.d]\ndeadline = "1 ms"',
            'nodes.d.deadline: found "1 ms"; out of range: at least 100 ms',
        ),
    ],
)
def test_what_nodes_make_impossible_is_refused(old: str, new: str, message: str) -> None:
    assert message in problems(old, new)


def test_a_delay_without_nodes_is_refused() -> None:
    text = '[chips.x]\npart = "LM629N-8"\nclock = "8 MHz"\nplant = "none"\n'
    with pytest.raises(BoardFileError, match="a delay is for wires between nodes; there are no"):
        read_board_text(f'{text}[nets]\nN = {{ pins = ["x.HI"], delay = "1 us" }}')


def test_a_single_board_of_a_file_with_nodes_is_refused() -> None:
    with pytest.raises(ConfigError, match=r"this board has nodes \(a, b, c, d\)"):
        load_board_text(BOARD)


def test_a_node_has_its_own_chips_and_the_ends_of_its_wires() -> None:
    file, source = read_board_text(BOARD)
    plan = plan_of(file)
    assert plan.lookahead == 200 * US
    nodes = build_nodes(file, source)
    assert [[chip.name for chip in node.board.chips] for node in nodes] == [
        ["x"], ["y"], ["m"], ["p"],
    ]  # fmt: skip
    assert [list(node.board.nets) for node in nodes] == [
        ["DONE"], ["TRIG", "READY"], ["/SYNC", "TRIG"], ["/SYNC", "TRIG", "DONE", "READY"],
    ]  # fmt: skip
    assert nodes[0].board.name == "four.a"
    assert {plant.name for plant in part_of(file, "a").plants} == {"x_motor"}
    # The level at rest is that of the wire's first pin, on every node.
    assert {node.board.nets["TRIG"].rest for node in nodes[1:]} == {1}
    assert [node.board.nets["DONE"].rest for node in (nodes[0], nodes[3])] == [0, 0]


def test_two_boards_that_differ_have_different_digests() -> None:
    first = plan_of(read_board_text(BOARD)[0])
    same = plan_of(read_board_text(BOARD + "# a remark\n", "elsewhere.toml")[0])
    other = plan_of(read_board_text(BOARD.replace("300 us", "301 us"))[0])
    assert first.digest != other.digest
    assert (same.digest, same.board) == (first.digest, first.board)


@pytest.mark.parametrize(
    ("line", "message"),
    [
        ("1ms x", "write an instant, a chip, a request and what belongs to it"),
        ("1 ms x w 0 1", "'1' is no duration"),
        ("1ms z w 0 1", "no chip called 'z'; there are x, y"),
        ("1ms x+y r 0", "only writes go to several chips at once"),
        ("1ms x w 0", "unknown request 'w 0'; allowed are: w ADDRESS DATA ..."),
        ("x 1ms w 0", "'x' is no duration"),
        ("1ms x w 0 zz", "data 'zz' is no hexadecimal number from 0 to FF"),
        ("1ms x w 0 1ff", "data '1ff' is no hexadecimal number from 0 to FF"),
        ("1ms x pin /RTS 0", "x has no pin '/RTS'; it has /RST, HI"),
        ("1ms x pin /RST 5", "level '5': allowed are 0, 1 and z (let go)"),
        ("end", 'write "end" and an instant'),
    ],
)
def test_a_line_of_a_scenario_that_makes_no_sense_is_named(line: str, message: str) -> None:
    with pytest.raises(ConfigError) as caught:
        read_scenario(f"# nothing\n\n{line}\n", "s.txt", CHIPS, US)
    assert str(caught.value).startswith(f"s.txt:3: {message}")


def test_a_pin_is_driven_low_or_high_or_let_go() -> None:
    text = "".join(f"1ms x pin /RST {level}\n" for level in "01z")
    assert [order.data for order in read_scenario(text, "s.txt", CHIPS, US).orders] == [0, 1, 2]


def test_every_node_that_listens_too_is_told_which_does() -> None:
    old = "[nodes.a]\n[nodes.b]\n[nodes.c]\n"
    listen = 'listen = "tcp/127.0.0.1:7450"'
    new = "".join(f"[nodes.{name}]\n{listen}\n" for name in "abc")
    text = "node a listens already; one node does, and the others connect to it"
    assert problems(old, new) == [f"nodes.b.listen: {text}", f"nodes.c.listen: {text}"]


def test_bytes_of_one_line_follow_each_other_a_cycle_apart() -> None:
    read = read_scenario("2ms x+y w 1 a b\n1ms x r 0 2 # look\n", "s.txt", CHIPS, 3 * US)
    assert [(o.when // US, o.chips[0], o.kind, o.data) for o in read.orders] == [
        (1000, "x", 0, 0), (1003, "x", 0, 0),
        (2000, "x", 1, 10), (2000, "y", 1, 10), (2003, "x", 1, 11), (2003, "y", 1, 11),
    ]  # fmt: skip
    assert read.until == 2006 * US
    with pytest.raises(ConfigError, match="it ends at 1000000000 ps, and a request stands at"):
        read_scenario("2ms x r 0\nend 1ms", "s.txt", CHIPS, US)
    last = END // US
    late = f"it ends at {last * US + US} ps, and time ends at {END} ps"
    with pytest.raises(ConfigError, match=late):
        read_scenario(f"{last}us x r 0", "s.txt", CHIPS, US)
    assert read_scenario(f"{last - 1}us x r 0", "s.txt", CHIPS, US).until == last * US


def test_a_scenario_of_nothing_lasts_one_cycle() -> None:
    assert read_scenario("# nothing\n", "s.txt", CHIPS, 3 * US).until == 3 * US


def test_every_pin_of_every_chip_may_be_named() -> None:
    pins = pins_of(read_board_text(BOARD)[0])
    assert "/RST" in pins["x"]
    assert "~Home1" in pins["p"]
