"""Glue on boards: from the file to the chips, mistakes, snapshots."""

import pytest

from tests.boards import ALONE
from vbus.board.build import load_board_text
from vbus.board.host_bus import HostBus
from vbus.board.snapshot import fork, restore, take
from vbus.core.errors import ConfigError
from vbus.core.kernel import MS, NS, US
from vbus.core.signals import Observer
from vbus.glue.part import MOST_TURNS

BOARD = f"""{ALONE}
[chips.y]
part = "LM629N-8"
clock = "8 MHz"
plant = "none"
"""
DECODER = """
[buses.main]
chips = ["x", "y"]

[glue.u1]
part = "74HC138"
delay = "20 ns"
low = ["/G2A", "C"]
high = ["G1"]
hosts = ["A", "/G2B"]

[glue.u1.pins]
B = "SB"
Y0 = "x./CS"
Y1 = "y./CS"

[glue.u2]
part = "74HC04"
hosts = ["1A"]

[glue.u2.pins]
1Y = "SB"
"""


def mistakes(text: str) -> list[str]:
    with pytest.raises(ConfigError) as told:
        load_board_text(BOARD + text)
    return str(told.value).splitlines()


def pin(port: HostBus, name: str, level: int) -> None:
    port.pin(port.pin_number(name), level)


def test_a_host_selects_a_chip_by_the_inputs_of_a_decoder() -> None:
    board = load_board_text(BOARD + DECODER)
    port = board.open_port("host", ["x", "y"])
    assert {"u1.A", "u2.1A", "u1./G2B"} <= set(port.pins.side_names())
    for name in ("u1.A", "u2.1A", "u1./G2B"):
        pin(port, name, 0)
    pin(port, "u2.1A", 1)
    for a, off, levels in ((0, 0, [0, 1]), (1, 0, [1, 0]), (1, 1, [1, 1]), (0, 0, [0, 1])):
        before = [board.find_pin(f"{chip}./CS").net.value for chip in "xy"]
        port.lines(0, 0)
        pin(port, "u1.A", a)
        pin(port, "u1./G2B", off)
        now = board.now
        board.run_until(now + 20 * NS - 1)
        assert [board.find_pin(f"{chip}./CS").net.value for chip in "xy"] in (before, [0, 1])
        board.run_until(now + 20 * NS)
        assert [board.find_pin(f"{chip}./CS").net.value for chip in "xy"] == levels


def test_a_strobe_behind_a_decoder_reaches_the_chip_that_is_selected() -> None:
    board = load_board_text(BOARD + DECODER)
    port = board.open_port("host", ["x", "y"])
    lines = {name: 1 << place for place, name in enumerate(port.pins.line_names())}
    for name, level in (("u2.1A", 1), ("u1.A", 1), ("u1./G2B", 0)):
        pin(port, name, level)
    bus = lines["main./RD"] | lines["main./WR"] | lines["main./PS"]
    port.lines(bus, bus)
    port.delay(US)
    port.lines(lines["main./RD"] | lines["main./PS"], 0)
    port.delay(US)
    seen, _ = port.sample()
    port.lines(bus, bus)
    direct = board.open_port("direct", ["y"])
    assert seen == direct.read(0)
    pin(port, "u1./G2B", 1)
    port.delay(US)
    assert board.chip("y").bus_net.driven is False


@pytest.mark.parametrize("observed", [False, True])
def test_a_whole_cycle_is_made_at_a_chip_behind_glue_whoever_looks_on(observed: bool) -> None:
    board = load_board_text(BOARD + DECODER)
    if observed:
        board.start_trace()
        board.watch("x./RD", Observer())
    port = board.open_port("host", ["y"])
    port.write(0, 0x00)
    status = port.read(0)
    assert (status & 0x7F, board.now, len(board.violations)) == (0x01, 2 * US, 0)


def test_a_wire_has_its_own_name_or_that_of_a_chips_pin() -> None:
    board = load_board_text(BOARD + DECODER)
    assert {"SB", "x./CS", "y./CS"} <= set(board.nets)
    assert [one.name for one in board.find_pin("u1.Y0").net.pins] == ["/CS", "Y0"]


def test_what_is_on_its_way_through_glue_is_in_a_snapshot() -> None:
    text = BOARD + """
[glue.u1]
part = "74HC74"
delay = "1 ms"
high = ["1/PRE", "1/CLR", "1D"]
[glue.u1.pins]
1CLK = "x.HI"
1Q = "y./RST"
[glue.u2]
part = "RESET"
delay = "3 ms"
high = ["/MR"]
[glue.u2.pins]
"/RESET" = "x./RST"
"""  # fmt: skip
    board = load_board_text(text)
    port = board.open_port("host")
    board.run_until(2 * MS)
    pin(port, "x.HI", 0)
    pin(port, "x.HI", 1)
    board.run_for(500 * US)
    kept = take(board)
    twin = fork(board)
    assert twin.state_hash() == board.state_hash()
    seen = []
    for one in (board, twin, board):
        if seen:
            restore(one, kept)
        now = one.now
        levels = []
        for ahead in (500 * US - 1, 500 * US, 1000 * US):
            one.run_until(now + ahead)
            levels += [one.find_pin(name).net.value for name in ("y./RST", "x./RST")]
        seen.append(levels)
    assert seen == [seen[0]] * 3
    assert seen[0][0::2] == [0, 1, 1]
    assert seen[0][1::2] == [0, 1, 1]


def test_a_fault_bends_the_output_of_glue() -> None:
    board = load_board_text(BOARD + DECODER)
    net = board.find_pin("x./CS").net
    net.bend(lambda level: 1)
    net.resolve()
    port = board.open_port("host")
    for name in ("u1.A", "u1./G2B"):
        pin(port, name, 0)
    pin(port, "u2.1A", 1)
    board.run_for(US)
    assert (board.find_pin("u1.Y0").level, net.value) == (0, 1)


@pytest.mark.parametrize("wired", ["1Y", "1A", "both"])
def test_an_output_and_the_input_it_drives_are_wired_at_either_part(wired: str) -> None:
    there = '"u2.1A"' if wired != "1A" else '"W"'
    here = {"1Y": "", "1A": '1A = "W"', "both": '1A = "u1.1Y"'}[wired]
    board = load_board_text(
        BOARD
        + f"""
[glue.u1]
part = "74HC04"
hosts = ["1A"]
[glue.u1.pins]
1Y = {there}
[glue.u2]
part = "74HC04"
[glue.u2.pins]
{here}
1Y = "x./CS"
"""
    )
    port = board.open_port("host")
    for level in (0, 1, 0):
        pin(port, "u1.1A", level)
        assert board.find_pin("x./CS").net.value == level


def test_an_input_of_an_open_gate_is_named_as_such() -> None:
    told = mistakes(
        '[glue.u1]\npart = "74HC04"\nhosts = ["1A"]\n[glue.u1.pins]\n1Y = ["u2.2A", "x./CS"]\n'
        '[glue.u2]\npart = "74HC04"\n[glue.u2.pins]\n1A = "x.HI"\n1Y = "y./CS"\n'
    )
    assert "is an input of which no output is wired: it does nothing" in told[0]


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ('[glue.u]\npart = "74HC13"\n[glue.u.pins]\n', 'found "74HC13"; did you mean "74HC163"?'),
        ('[glue.u]\npart = "74HC08"\nlow = ["1A"]\n[glue.u.pins]\n1B = "x.HI"\n1Y = "x./CS"\n'
         '5A = "y.HI"\n', 'there is no pin "5A"; it has 1A, 1B, 2A, 2B, 3A, 3B, 4A, 4B, 1Y, '),
        ('[glue.u]\npart = "74HC04"\n[glue.u.pins]\n1A = "x.HI"\n',
         "no output is wired: it does nothing; it has 1Y, 2Y, 3Y, 4Y, 5Y, 6Y"),
        ('[glue.u]\npart = "74HC04"\n[glue.u.pins]\n1Y = "x./CS"\n',
         'open inputs: 1A; wire each in [glue.u.pins], or tie it with "low" or "high"'),
        ('[glue.u]\npart = "74HC04"\n[glue.u.pins]\n1A = "x.HO"\n1Y = "x./CS"\n',
         'there is no pin "x.HO"; did you mean'),
        ('[glue.u]\npart = "74HC04"\n[glue.u.pins]\n1A = "z.HI"\n1Y = "x./CS"\n',
         'nothing on the board is called "z"; '),
        ('[glue.u]\npart = "74HC04"\n[glue.u.pins]\n1A = "x.HI"\n1Y = "y.HI"\n',
         '"u.1Y" and "y.HI" are both outputs on one wire and would always fight;'),
        ('[glue.u]\npart = "74HC04"\n[glue.u.pins]\n1A = "x.HI"\n1Y = "W"\n2A = "W"\n2Y = "x./CS"\n'
         '[glue.v]\npart = "74HC04"\n[glue.v.pins]\n1A = "y.HI"\n1Y = "W"\n',
         ': glue.u: "u.1Y" and "v.1Y" are both outputs on one wire and would always fight;'),
        ('[glue.u]\npart = "74HC04"\n[glue.u.pins]\n1A = "W"\n1Y = "V"\n2A = "V"\n2Y = "W"\n',
         "a loop without a clock: "),
        ('[glue.u]\npart = "74HC04"\n[glue.u.pins]\n1A = "SOLO"\n1Y = "x./CS"\n',
         'nothing else is on wire "SOLO"; '),
        ('[glue.x]\npart = "74HC04"\nlow = ["1A"]\n[glue.x.pins]\n1Y = "x./CS"\n',
         "[chips.x] has this name too, and pins of its own; choose another"),
        ('[glue.u]\npart = "74HC04"\nlow = ["1A"]\nhigh = ["1A"]\n[glue.u.pins]\n1Y = "x./CS"\n',
         '"1A" is wired or tied already; an input has one source'),
        ('[glue.u]\npart = "RESET"\nhigh = ["/MR"]\n[glue.u.pins]\n"/RESET" = "x./RST"\n',
         'a reset lasts for its "delay"; write one, such as "100 ms"'),
        ('[glue.u]\npart = "74HC04"\nlow = ["1A"]\n[glue.u.pins]\n1Y = "x./CS"\n'
         '[glue.u.equations]\n"y./CS" = "x.HI"\n', 'equations are for part = "PLD"; this is ano'),
        ('[nets]\none = ["x./RST"]\ntwo = ["y./RST"]\n[glue.u]\npart = "74HC04"\nlow = ["1A"]\n'
         '[glue.u.pins]\n1Y = ["x./RST", "y./RST"]\n',
         "glue joins the wires one, two, which have different names"),
        ('[glue.u]\npart = "PLD"\n', "a PLD needs [glue.NAME.equations], such as"),
        ('[glue.u]\npart = "PLD"\n[glue.u.equations]\n"x./CS" = "x.HI &"\n', 'equation "x.HI &": '),
        ('[glue.u]\npart = "PLD"\n[glue.u.equations]\n"x./CS" = "x.HI"\n"!x./CS" = "y.HI"\n',
         '"x./CS" has two equations; join them with "|"'),
        ('[glue.u]\npart = "PLD"\n[glue.u.equations]\n"x./CS" = 1\n"y./CS" = "1"\n',
         'found 1; write an equation in quotes, such as "A & !B"'),
        ('[glue.u]\npart = "74HC374"\nlow = ["/OE"]\n[glue.u.pins]\nCLK = "y.HI"\n'
         '"D0-D7" = "x.D0-D7"\nQ0 = "x.D3"\n',
         '"x.D3" is one wire of D0-D7, which outputs drive together: wire a bundle such as'),
    ],
)  # fmt: skip
def test_a_mistake_in_glue_is_named_with_its_place(text: str, message: str) -> None:
    found = mistakes(text)
    assert len(found) == 1
    assert message in found[0]
    assert ": glue" in found[0]


def test_a_loop_is_named_by_its_wires() -> None:
    text = '[glue.u]\npart = "74HC04"\n[glue.u.pins]\n1A = "W"\n1Y = "V"\n2A = "V"\n2Y = "W"\n'
    told = mistakes(text)[0]
    assert "through u; put a register into it, or take one wire out" in told
    assert {"V", "W"} <= set(told.replace("->", " ").split())


def test_a_wire_may_move_as_often_as_hosts_like_at_one_instant() -> None:
    board = load_board_text(BOARD + '[glue.u]\npart = "74HC04"\n[glue.u.pins]\n1A = "x.HI"\n'
                            '1Y = "y./RST"\n')  # fmt: skip
    port = board.open_port("host")
    begin = board.now
    for number in range(MOST_TURNS):
        for level in (0, 1):
            pin(port, "x.HI", level)
            assert board.find_pin("y./RST").net.value == 1 - level, number
    assert board.now - begin < MOST_TURNS * US
    assert not [v for v in board.violations if v.rule == "board.oscillation"]


def test_a_register_in_the_loop_makes_it_a_divider() -> None:
    board = load_board_text(BOARD + """
[glue.u]
part = "74HC74"
high = ["1/CLR", "1/PRE"]
[glue.u.pins]
1CLK = "CLOCK"
1D = "LOOP"
"1/Q" = "LOOP"
1Q = "y./RST"
[glue.v]
part = "74HC07"
[glue.v.pins]
1A = "x.HI"
1Y = "CLOCK"
""")  # fmt: skip
    port = board.open_port("host")
    levels = []
    for _ in range(4):
        pin(port, "x.HI", 0)
        pin(port, "x.HI", 1)
        levels.append(board.find_pin("y./RST").net.value)
    assert levels == [1, 0, 1, 0]


def test_without_delays_nobody_sees_what_glue_goes_through_on_the_way() -> None:
    # A and not A, listed against the order in which the gates follow one another: never high.
    board = load_board_text(BOARD + """
[glue.counter]
part = "74HC393"
[glue.counter.pins]
1CLR = "LOW"
1CLK = "NEVER"
1QA = "y./RST"
[glue.both]
part = "74HC08"
[glue.both.pins]
1A = "x.HI"
1B = "BAR"
1Y = "NEVER"
[glue.bar]
part = "74HC04"
high = ["2A"]
[glue.bar.pins]
1A = "x.HI"
1Y = "BAR"
2Y = "LOW"
""")  # fmt: skip
    seen: list[int] = []

    class Edges(Observer):
        def edge(self, when: int, net: str, level: int) -> None:
            seen.append(level)

    port = board.open_port("host")
    board.nets["NEVER"].observe(Edges())
    for level in (0, 1, 0, 1):
        pin(port, "x.HI", level)
    assert (seen, board.find_pin("y./RST").net.value) == ([], 0)
