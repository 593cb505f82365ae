"""A board file: what it gives when it is right, and every message when it is not."""

from pathlib import Path

import pytest

from tests.unit.board.parts import Acme, Motor
from vbus import plugins
from vbus.board.board import Board
from vbus.board.build import card_of, load_board, load_board_text
from vbus.board.card.cards import Card, card_of_rows
from vbus.board.config import read_board_text
from vbus.boardfile.source import BoardFileError
from vbus.chips.tables import CardRow
from vbus.core.errors import ConfigError
from vbus.core.signals import HIGH, LOW, OFF, STRICT, WARN, Z

pytestmark = pytest.mark.usefixtures("acme")

GOOD = """\
[board]
name = "bench"
time = "lockstep"
seed = 7
clock_step = "2 us"
power_on = "done"

[violations]
default = "strict"
acme = "warn"
"toy.T1" = "off"

[chips.x]
part = "ACME-1"
clock = "8 MHz"
plant = "left"
busy_clk = 60
settle = "2 us"

[chips.y]
part = "ACME-2"
clock = "6 MHz"
plant = "right"

[plants.left]
model = "motor"
supply = "24 V"

[plants.right]
model = "motor"
supply = "12 V"
switches.home = { first = -10, last = 20, closed = "high" }

[nets]
"/SYNC" = ["x./SYNC", "y./SYNC", "x./RST"]
TRIG = { pins = ["x.TRIG", "y.IRQ"], rest = "low" }

[buses.main]
chips = ["x", "y"]

[cards.isa]
base = 0x340
decode = "isa"
chips = ["y", "x"]
block = 16

[cards.rows]
stride = 4
ports = [
  { offset = 0, chip = "x", address = 1 },
  { offset = 3, chip = "y", address = 0 },
]

[[hosts]]
transport = "pty:x"
card = "isa"

[[hosts]]
transport = "tcp:127.0.0.1:5000"
protocol = "text"
chips = ["y", "x"]
cycle = "400 ns"
card = "rows"
"""


@pytest.fixture
def board() -> Board:
    return load_board_text(GOOD)


def test_the_board_section_says_how_time_passes(board: Board) -> None:
    assert (board.name, board.policy, board.seed) == ("bench", "lockstep", 7)
    assert board.clock_step == 2_000_000


def test_chips_come_in_the_order_of_the_file_with_their_settings(board: Board) -> None:
    assert [(chip.name, chip.part, chip.clock.hz) for chip in board.chips] == [
        ("x", "ACME-1", 8_000_000),
        ("y", "ACME-2", 6_000_000),
    ]
    assert board.chip("x").settings["busy_clk"] == 60
    assert board.chip("x").settings["settle"] == 2_000_000
    assert board.chip("y").settings["busy_clk"] == 120


def test_each_axis_gets_its_plant(board: Board) -> None:
    x = board.chip("x")
    assert isinstance(x, Acme)
    plant = x.plants[0]
    assert isinstance(plant, Motor)
    assert plant.settings == {"supply": 24.0, "inertia": 1e-6, "lines": 500}


def test_a_chip_may_have_nothing_behind_it() -> None:
    x, y = load_board_text(
        """
        chips.x = { part = "ACME-1", clock = "1 MHz", plant = "none" }
        chips.y = { part = "TWIN-1", clock = "1 MHz", plants = ["none", "m"] }
        plants.m = { model = "motor", supply = "9 V" }
        """
    ).chips
    assert not hasattr(x, "plants")
    assert isinstance(y, Acme)
    assert list(y.plants) == [1]


def test_a_switch_is_closed_from_its_first_to_its_last_count(board: Board) -> None:
    switch = board.plants[1].switches["home"]
    assert [switch.level(count) for count in (-11, -10, 20, 21)] == [0, 1, 1, 0]


def test_violations_have_a_policy_by_default_family_and_rule(board: Board) -> None:
    policy = board.violation_policy
    assert policy.of("board.contention") == STRICT
    assert policy.of("acme.slow") == WARN
    assert policy.of("toy.T1") == OFF


def test_a_card_is_among_io_ports_and_interrupts_nothing_unless_it_is_said() -> None:
    card = Card("c", 3, {}, {})
    assert (card.memory, card.fixed, card.interrupt, card.signal) == (False, 0, "", 0)


def test_a_dotted_rule_needs_no_quotes() -> None:
    board = load_board_text(GOOD.replace('"toy.T1"', "toy.T1"))
    assert board.violation_policy.of("toy.T1") == OFF


def test_pins_of_a_net_are_joined(board: Board) -> None:
    assert board.find_pin("x./SYNC").net is board.find_pin("y./SYNC").net
    assert board.find_pin("x./SYNC").net.rest == HIGH
    assert board.find_pin("x.TRIG").net.rest == LOW


def test_a_bus_joins_data_and_strobes_but_no_selects(board: Board) -> None:
    for pin in ("D0-D7", "/RD", "/WR", "A0"):
        assert board.find_pin(f"x.{pin}").net is board.find_pin(f"y.{pin}").net
    assert board.find_pin("x./CS").net is not board.find_pin("y./CS").net
    assert board.find_pin("x.D0-D7").net.rest == Z


def test_parts_that_take_a_seed_get_one_each_from_the_board() -> None:
    text = """
        board.seed = %d
        chips.x = { part = "TWIN-1", clock = "1 MHz", plant = "m" }
        chips.y = { part = "TWIN-1", clock = "1 MHz", plant = "n" }
        chips.z = { part = "TWIN-1", clock = "1 MHz", plant = "o", seed = 5 }
        plants.m = { model = "motor", supply = "9 V" }
        plants.n = { model = "motor", supply = "9 V" }
        plants.o = { model = "motor", supply = "9 V" }
    """
    seeds = [[chip.settings["seed"] for chip in load_board_text(text % n).chips] for n in (1, 1, 2)]
    assert seeds[0] == seeds[1]
    assert len({seed for row in seeds for seed in row}) == 5
    assert seeds[0][2] == 5


@pytest.mark.parametrize(("key", "state"), [("done", "done"), ("reset", "reset")])
def test_power_on_starts_in_or_after_the_reset(key: str, state: str) -> None:
    board = load_board_text(GOOD.replace('power_on = "done"', f'power_on = "{key}"'))
    assert {getattr(chip, "powered", "") for chip in board.chips} == {state}


@pytest.mark.parametrize(("text", "rate"), [("2", 2.0), ("0.5", 0.5), ('"max"', float("inf"))])
def test_the_rate_is_a_number_or_as_fast_as_possible(text: str, rate: float) -> None:
    given = GOOD.replace("seed = 7", f"rate = {text}")
    assert load_board_text(given).rate == rate


def test_a_board_without_a_name_has_that_of_its_file(tmp_path: Path) -> None:
    path = tmp_path / "robot.toml"
    path.write_text(GOOD.replace('name = "bench"', ""))
    assert load_board(path).name == "robot"


def test_a_named_decode_gives_each_chip_its_block() -> None:
    file, _ = read_board_text(GOOD)
    card = card_of(file, file.hosts[0])
    assert card is not None
    # y stands first on the card; in the session of this host it is chip 1.
    assert card.reads[0x340][:2] == (1, 0)
    assert card.writes[0x340][:2] == (1, 0)
    assert 0x342 not in card.reads
    assert card.writes[0x342][:2] == (1, 1)
    assert card.reads[0x344][:2] == (1, 1)
    assert 0x344 not in card.writes
    assert card.reads[0x350][:2] == (0, 0)
    assert 0x33F not in card.reads
    assert [card.reads[at].floating for at in (0x340, 0x344)] == [0x00, 0x7F]
    at = [0x340, 0x342, 0x344, 0x350, 0x352, 0x354]
    assert sorted({*card.reads, *card.writes}) == at


def test_a_card_tells_its_table_to_the_host() -> None:
    card = card_of_rows("c", 0x340, 2, [(1, [CardRow(0, 0, 0), CardRow(1, 5, 1, 0x80)])])
    assert card.text([]) == "r340=1.0 r342=1.5/7F w340=1.0 w342=1.1"


def test_a_card_of_rows_counts_offsets_in_strides() -> None:
    file, _ = read_board_text(GOOD)
    card = card_of(file, file.hosts[1])
    assert card is not None
    assert card.reads[0][:2] == (1, 1)
    assert card.reads[12][:2] == (0, 0)
    assert 3 not in card.reads


def test_a_host_without_a_card_has_none() -> None:
    file, _ = read_board_text(GOOD.replace('card = "isa"', ""))
    assert card_of(file, file.hosts[0]) is None


# -- mistakes -----------------------------------------------------------------------------------

SMALL = """\
[chips.x]
part = "ACME-1"
clock = "8 MHz"
plant = "m"
[plants.m]
model = "motor"
supply = "24 V"
"""
CHIP_KEYS = "busy_clk, clock, gain, label, mode, node, part, plant, plants, settle, swap"
CLOCK = 'write a frequency with its unit, such as "8 MHz" (units: Hz, kHz, MHz, GHz), at least 1 Hz'
TIME = 'write a time with its unit, such as "500 us" (units: s, ms, us, ns, ps)'
NAME = "a name begins with a letter and goes on with letters, digits, - and _"
FREQUENCY = 'write a frequency with its unit, such as "8 MHz" (units: Hz, kHz, MHz, GHz)'
VOLTAGE = 'write a voltage with its unit, such as "24 V" (units: V, mV, kV)'
Y = SMALL.replace("chips.x", "chips.y").replace('"m"', '"n"').replace("plants.m", "plants.n")
ONE_NET = "a pin is soldered to one net"

MISTAKES = [
    # what is replaced, by what, the lines of the message
    ("", "x = = 3\n", "b.toml:8: no TOML: Invalid value (column 5)"),
    ("", "a = [1,\n", "b.toml:9: no TOML: Invalid value"),
    ("", "a = " + "[" * 5000 + "\n", "b.toml: nested too deeply"),
    ("", "a = " + "1" * 5000 + "\n", "b.toml: no TOML: Exceeds the limit (4300 digits) for integer"
     " string conversion: value has 5000 digits; use sys.set_int_max_str_digits() to increase the"
     " limit"),
    (SMALL, "", "b.toml: the board is empty: it needs at least one [chips.NAME]"),
    (
        "", "[chip.y]\n",
        'b.toml:8: chip: unknown section; did you mean "chips"? allowed are board, violations,'
        " chips, plants, nets, glue, buses, cards, pinmaps, cpu, nodes, hosts, record, waves,"
        " zenoh, metrics, scope, faults",
    ),
    ("[chips.x]", "board = 3\n[chips.x]", "b.toml:1: board: found 3; this is the table [board]"),
    ("[chips.x]", "[[chips.x]]", 'b.toml:1: chips.x: found [{part = "ACME-1", clock = "8 MHz", '
     'plant = "m"}]; this is the table [chips.x]'),
    ("[chips.x]", "[[chips]]", "b.toml: the board is empty: it needs at least one [chips.NAME]",
     'b.toml:1: chips: found [{part = "ACME-1", clock = "8 MHz", plant = "m"}]; write tables'
     " [chips.NAME]"),
    ("[chips.x]", '[chips."x.y"]', f'b.toml:1: chips."x.y": {NAME}'),
    ("", '[board]\nname = "my board"\n', f'b.toml:9: board.name: found "my board"; {NAME}'),
    (
        "clock =", "clok =",
        'b.toml:1: chips.x: key "clock" is missing: frequency at the CLK pin; ' + CLOCK,
        f'b.toml:3: chips.x.clok: unknown key; did you mean "clock"? allowed are {CHIP_KEYS}',
    ),
    ('"8 MHz"', "8000000", f"b.toml:3: chips.x.clock: found 8000000; it has no unit; {FREQUENCY}"),
    ('"8 MHz"', '"0 Hz"', 'b.toml:3: chips.x.clock: found "0 Hz"; out of range: at least 1 Hz'),
    (
        "supply =", "zzz =",
        'b.toml:5: plants.m: key "supply" is missing: supply of the amplifier;'
        f" {VOLTAGE}, from 1 V to 60 V",
        "b.toml:7: plants.m.zzz: unknown key; allowed are inertia, lines, model, supply, switches",
    ),
    ('"24 V"', '"24 A"', f'b.toml:7: plants.m.supply: found "24 A"; "A" is the unit of a current; '
     f"{VOLTAGE}"),
    ('"24 V"', '"61 V"', 'b.toml:7: plants.m.supply: found "61 V"; out of range: from 1 V to 60 V'),
    (
        "[plants.m]", "busy_clk = 1.5\nmode = 'grey'\nsettle = '0 s'\ngain = '1'\nswap = 1\n"
        "label = 3\n[plants.m]",
        "b.toml:5: chips.x.busy_clk: found 1.5; write a whole number without unit, from 1 to 800",
        'b.toml:6: chips.x.mode: found "grey"; did you mean "gray"? allowed are "plain", "gray"',
        'b.toml:7: chips.x.settle: found "0 s"; out of range: from 1 us to 1 ms',
        'b.toml:8: chips.x.gain: found "1"; write a number without unit, at least 0.5',
        "b.toml:9: chips.x.swap: found 1; write true or false",
        "b.toml:10: chips.x.label: found 3; write a text in quotes",
    ),
    ("[plants.m]", "gain = inf\n[plants.m]",
     "b.toml:5: chips.x.gain: found inf; write a number without unit, at least 0.5"),
    ("[plants.m]", "gain = 'max'\n[plants.m]",
     'b.toml:5: chips.x.gain: found "max"; write a number without unit, at least 0.5'),
    (
        "[chips.x]", "[board]\nrate = 'fast'\n[chips.x]",
        'b.toml:2: board.rate: found "fast"; write a number without unit, or "max",'
        " at least 0.001",
    ),
    (
        "ACME-1", "AMCE-1",
        'b.toml:2: chips.x.part: unknown part "AMCE-1"; did you mean "ACME-1" or "ACME-2"?'
        " known are ACME-1, ACME-2, GRUMPY, TWIN-1",
    ),
    ("ACME-1", "ACME-3", 'b.toml:2: chips.x.part: found "ACME-3"; did you mean "ACME-2"? known are'
     " ACME-1, ACME-2"),
    (
        "ACME-1", "BROKEN-1",
        'b.toml:2: chips.x.part: part "BROKEN" of tests.unit.board.no_such_module:Chip cannot be'
        " loaded: ModuleNotFoundError: No module named 'tests.unit.board.no_such_module'",
    ),
    ("ACME-1", "ODD", 'b.toml:2: chips.x.part: part "ODD" of tests.unit.board.parts:NOT_A_CHIP is'
     " not a subclass of Chip"),
    ('"motor"', '"mottor"', 'b.toml:6: plants.m.model: unknown plant model "mottor"; did you mean'
     ' "motor"? known are motor, steps'),
    ("ACME-1", "GRUMPY", "b.toml:1: chips.x: GRUMPY runs at 6 MHz at most"),
    ('plant = "m"', 'plant = "mm"', 'b.toml:4: chips.x.plant: there is no [plants.mm]; did you'
     ' mean "m"? this file has m'),
    (
        'plant = "m"\n', "",
        'b.toml:1: chips.x: no plant: write plant = "NAME", and a [plants.NAME] with the motor,'
        " load and encoder",
    ),
    ('plant = "m"', 'plants = ["m"]', 'b.toml:4: chips.x.plants: ACME-1 has one axis; write'
     ' plant = "m"'),
    ('plant = "m"', 'plant = "m"\nplants = ["m"]', 'b.toml:5: chips.x.plants: write either "plant"'
     ' or "plants", not both'),
    (
        'ACME-1"\nclock = "8 MHz"\nplant = "m"',
        'TWIN-1"\nclock = "8 MHz"\nplants = ["m", "n", "o"]',
        "b.toml:4: chips.x.plants: TWIN-1 has 2 axes, and 3 plants are named",
        "b.toml:4: chips.x.plants[2]: there is no [plants.n]; this file has m",
        "b.toml:4: chips.x.plants[3]: there is no [plants.o]; this file has m",
    ),
    (
        '"ACME-1"\nclock = "8 MHz"\nplant = "m"', '"TWIN-1"\nclock = "8 MHz"',
        "b.toml:1: chips.x: no plant: write plants = [...] with up to 2 names, and a [plants.NAME]"
        " with the motor, load and encoder",
    ),
    (
        "[plants.m]", Y.replace('"n"', '"m"') + "[plants.m]",
        'b.toml:8: chips.y.plant: plant "m" is driven by chips.x already; every axis needs a plant'
        " of its own",
    ),
    (
        '"motor"\nsupply = "24 V"', '"steps"',
        "b.toml:4: chips.x.plant: ACME-1 gives a servo command; this plant takes step pulses",
    ),
    ("", '[plants.m.switches]\nhome = {first = 5, last = 4}\n', "b.toml:5: plants.m: switch 'home'"
     " closes at 5 and opens after 4: first must not be above last"),
    (
        "", "[plants.m.switches.home]\nfirst = 5\nlost = 4\n",
        'b.toml:8: plants.m.switches.home: key "last" is missing: last encoder count at which it is'
        " closed; write a whole number without unit",
        'b.toml:10: plants.m.switches.home.lost: unknown key; did you mean "last"? allowed are'
        " closed, first, last",
    ),
    ("", '[plants.m.switches]\n"limit*" = {first = 5, last = 9}\n', 'b.toml:9: plants.m.switches.'
     '"limit*": unknown switch; did you mean "limit-"? known are home, limit+, limit-'),
    ("plants.m", "plants.none",
     'b.toml:4: chips.x.plant: there is no [plants.m]; this file has none',
     'b.toml:5: plants.none: "none" stands for no plant; choose another name'),
    ("", '[violations]\ndefault = "of"\n', 'b.toml:9: violations.default: found "of"; did you mean'
     ' "off"? allowed are "off", "warn", "strict"'),
    # metrics
    ("", '[metrics]\nlisten = "0.0.0.0:9100"\n', 'b.toml:9: metrics.listen: "0.0.0.0:9100" lets'
     ' other computers in; write "127.0.0.1:9100", or say remote = true in [metrics] if that is'
     " meant"),
    ("", '[scope]\nlisten = "9100"\n', 'b.toml:9: scope.listen: found "9100"; write'
     ' HOST:PORT with a port of 0 to 65535, such as "127.0.0.1:9100"'),
    ("", '[metrics]\nlisten = "[::]:9100"\n', 'b.toml:9: metrics.listen: "[::]:9100" lets other'
     ' computers in; write "[::1]:9100", or say remote = true in [metrics] if that is meant'),
    ("", "[scope]\nremote = true\n", "b.toml:9: scope.remote: pages go to other computers by TLS"
     " alone; give certificate and key"),
    # links that other computers reach
    ("", '[[hosts]]\ntransport = "tcp:0.0.0.0:5000"\n', 'b.toml:9: hosts[1].transport:'
     ' "tcp:0.0.0.0:5000" lets other computers in; write "tcp:5000", or say remote = true for this'
     " host if that is meant"),
    ("", '[[hosts]]\ntransport = "rfc2217:[::]:5000"\n', 'b.toml:9: hosts[1].transport:'
     ' "rfc2217:[::]:5000" lets other computers in; write "rfc2217:5000", or say remote = true for'
     " this host if that is meant"),
    ("", '[[hosts]]\ntransport = "tcp:bench:5000"\n', 'b.toml:9: hosts[1].transport:'
     ' "tcp:bench:5000" lets other computers in; write "tcp:5000", or say remote = true for this'
     " host if that is meant"),
    # wires
    ("", '[nets]\na = ["x./SYNK"]\n', 'b.toml:9: nets.a[1]: "x" has no pin "/SYNK"; did you mean'
     ' "/SYNC"? it has /CS, A0, /RD, /WR, D0-D7, TRIG, IRQ, /RST, /SYNC, READY'),
    ("", '[nets]\na = ["z./SYNC"]\n', "b.toml:9: nets.a[1]: there is no [chips.z]; this file has"
     " x"),
    ("", '[nets]\na = ["SYNC"]\n', 'b.toml:9: nets.a[1]: found "SYNC"; write a pin as "chip.pin",'
     ' such as "x./RST"'),
    ("", "[nets]\na = []\n", "b.toml:9: nets.a: a net joins at least one pin"),
    ("", "[nets]\na = 3\n", 'b.toml:9: nets.a: found 3; write a list of names, such as ["x"]'),
    ("", '[nets]\na = {rest = "z"}\n',
     'b.toml:9: nets.a.rest: found "z"; allowed are "low", "high", "keep"',
     'b.toml:9: nets.a: key "pins" is missing: the pins soldered to it, as "chip.pin";'
     ' write a list of names, such as ["x"]'),
    (
        "", '[nets]\na = ["x./RST"]\nb = [\n  "x.IRQ",\n  "x./RST",\n]\n',
        'b.toml:12: nets.b[2]: pin "x./RST" is on net "a" already; a pin is soldered to one net',
    ),
    ("", '[nets]\na = ["x.IRQ", "x.IRQ"]\n', 'b.toml:9: nets.a[2]: "x.IRQ" stands in the list'
     " twice"),
    (
        "", '[nets]\na = ["x.IRQ", "x./SYNC", "x.READY"]\n',
        'b.toml:9: nets.a[3]: "x.READY" and "x.IRQ" are both outputs and would always fight; join'
        " an output to inputs or to open-drain pins",
    ),
    ("", '[nets]\na = ["x.IRQ", "x.D0-D7"]\n', 'b.toml:9: nets.a[2]: "x.D0-D7" has 8 wires, "x.IRQ"'
     " has 1"),
    ("", '[buses.b]\nchips = ["x"]\n[nets]\na = ["x./RD"]\n', 'b.toml:11: nets.a[1]: pin "x./RD" is'
     " on bus b already; a pin is soldered to one net"),
    ("", "[buses.b]\nchips = []\n", "b.toml:8: buses.b: a bus joins at least one chip"),
    ("", "[buses.b]\n", 'b.toml:8: buses.b: key "chips" is missing: chips of one family; write'
     ' a list of names, such as ["x"]'),
    (
        "", '[buses.b]\nchips = ["x", "y"]\n' + Y.replace("ACME-1", "GRUMPY").replace("8 M", "6 M")
        + '[buses.c]\nchips = ["x", "w"]\n',
        f'b.toml:18: buses.c.chips[1]: pin "x.A0" is on bus b already; {ONE_NET}',
        f'b.toml:18: buses.c.chips[1]: pin "x./RD" is on bus b already; {ONE_NET}',
        f'b.toml:18: buses.c.chips[1]: pin "x./WR" is on bus b already; {ONE_NET}',
        f'b.toml:18: buses.c.chips[1]: pin "x.D0-D7" is on bus b already; {ONE_NET}',
        "b.toml:18: buses.c.chips[2]: there is no [chips.w]; this file has x, y",
    ),
    (
        "", '[buses.b]\nchips = ["x", "y"]\n'
        + Y.replace("ACME-1", "TWIN-1").replace('plant = "n"', 'plants = ["n", "o"]')
        + '[plants.o]\nmodel = "motor"\nsupply = "9 V"\n',
        'b.toml:9: buses.b.chips[2]: "y" is a twin and "x" is not; one bus joins chips of one'
        " family",
    ),
    # cards and hosts
    ("", "[cards.c]\n", 'b.toml:8: cards.c: a card has either "decode" and "chips", or a list of'
     ' "ports"'),
    ("", '[cards.c]\ndecode = "isa"\n', 'b.toml:9: cards.c.decode: "decode" needs "chips" (the'
     ' chips behind the decode circuit, one block each)'),
    ("", '[cards.c]\ndecode = "isaa"\nchips = ["x"]\n', 'b.toml:9: cards.c.decode: found "isaa";'
     ' did you mean "isa"? known are direct, isa, reset'),
    ("", "[cards.c]\nports = 3\n", "b.toml:9: cards.c.ports: found 3; this is a list of tables:"
     " [[cards.c.ports]]"),
    (
        "", '[cards.c]\nports = [\n{offset=1,chip="x",address=0},\n7,\n'
        '{offset=1,chip="x",address=9}]\n',
        "b.toml:11: cards.c.ports[2]: found 7; this is a table",
        "b.toml:12: cards.c.ports[3].offset: offset 1 is decoded by row 1 already",
        'b.toml:12: cards.c.ports[3].address: found 9; addresses of "x" are 0 to 2',
    ),
    (
        "", '[cards.c]\nports = [\n{offset=1,chip="x",address=0},\n'
        '{offset=-1,chip="q",address=0},{offset=2,chip="q",address=0}]\n',
        "b.toml:11: cards.c.ports[2].offset: found -1; out of range: at least 0",
        "b.toml:11: cards.c.ports[2].chip: there is no [chips.q]; this file has x",
        "b.toml:11: cards.c.ports[3].chip: there is no [chips.q]; this file has x",
    ),
    ("", "[hosts]\n", "b.toml:8: hosts: found {}; this is a list of tables: [[hosts]]"),
    ("", "[[hosts]]\ntransport = 'pty'\n", 'b.toml:9: hosts[1].transport: found "pty"; write'
     ' SCHEME:ADDRESS, such as "pty:$VBUS_RUNTIME/x" or "tcp:5000"'),
    ("[chips.x]", "hosts = [3]\n[chips.x]", "b.toml:1: hosts[1]: found 3; this is a table"),
    ("", '[[hosts]]\ntransport = "ptty:x"\nprotocol = "txt"\n', 'b.toml:9: hosts[1].transport:'
     ' found "ptty"; did you mean "pty"? known are pty, rfc2217, tcp',
     'b.toml:10: hosts[1].protocol: found "txt"; did you mean "text"? known are byte, text'),
    (
        "", '[[hosts]]\ntransport = "pty:x"\n[[hosts]]\ntransport = "pty:x"\nchips = ["y"]\n',
        'b.toml:11: hosts[2].transport: "pty:x" is the link of hosts[1] already; every host needs'
        " one of its own",
        "b.toml:12: hosts[2].chips[1]: there is no [chips.y]; this file has x",
    ),
    (
        "", Y + '[cards.c]\ndecode = "isa"\nchips = ["y"]\n'
        '[[hosts]]\ntransport = "pty:x"\nchips = ["x"]\ncard = "c"\n'
        '[[hosts]]\ntransport = "tcp:5"\ncard = "d"\ncycle = 5\n',
        'b.toml:21: hosts[1].card: card "c" decodes to "y", which is not among the chips of this'
        " host: x",
        'b.toml:24: hosts[2].card: there is no [cards.d]; this file has c',
        f"b.toml:25: hosts[2].cycle: found 5; it has no unit; {TIME}",
    ),
]  # fmt: skip


@pytest.mark.parametrize("mistake", MISTAKES, ids=[mistake[2] for mistake in MISTAKES])
def test_a_mistake_is_named_with_its_line_and_what_is_allowed(mistake: tuple[str, ...]) -> None:
    before, after, *lines = mistake
    if before:
        assert before in SMALL
        text = SMALL.replace(before, after)
    else:
        text = SMALL + after
    with pytest.raises(ConfigError) as caught:
        load_board_text(text, "b.toml")
    assert str(caught.value).split("\n") == lines


def test_a_wave_is_recorded_to_the_end_unless_the_file_says_how_long() -> None:
    file, _ = read_board_text(SMALL + '[waves.a]\nfile = "a.vcd"\n', "b.toml")
    assert [wave.duration for wave in file.waves] == [0]


CERTIFICATES = 'certificate = "a"\nkey = "b"\nauthority = "c"\n'


@pytest.mark.parametrize(
    "entry",
    [
        'transport = "tcp:5000"',
        'transport = "tcp:127.0.0.9:5000"',
        'transport = "tcp:[::1]:5000"',
        'transport = "rfc2217:localhost:5000"',
        'transport = "tcp:$HERE:5000"',
        'transport = "tcp:0.0.0.0:5000"\nremote = true',
    ],
)
def test_a_link_of_this_computer_or_one_that_is_meant_may_be(entry: str) -> None:
    read_board_text(f"{SMALL}[[hosts]]\n{entry}\n", "b.toml")


def test_nodes_meet_where_other_computers_reach_them_only_if_that_is_meant() -> None:
    text = SMALL.replace("plant =", 'node = "n"\nplant =')
    node = '[nodes.n]\nlisten = "tcp/192.0.2.1:7447"\n'
    with pytest.raises(BoardFileError, match=r'nodes\.n\.listen: "tcp/192\.0\.2\.1:7447" lets'):
        read_board_text(text + node, "b.toml")
    read_board_text(f"{text}{node}[zenoh]\nremote = true\n", "b.toml")


@pytest.mark.parametrize(
    ("text", "problems"),
    [
        ('listen = ["tcp/127.0.0.1:7447"]\n', {}),
        ('connect = ["tcp/127.0.0.1:7447"]\n' + CERTIFICATES, {}),
        ('listen = ["tls/127.0.0.1:7447"]\n' + CERTIFICATES, {}),
        ('listen = ["tls/0.0.0.0:7447"]\n' + CERTIFICATES, {}),
        ('listen = ["tcp/0.0.0.0:7447"]\nremote = true\n', {}),
        ('connect = ["tcp/192.0.2.1:7447"]\n', {}),
        ('listen = ["tcp/0.0.0.0:7447"]\n', {
            "zenoh.listen[1]": '"tcp/0.0.0.0:7447" lets other computers in; write'
            ' "tcp/127.0.0.1:7447", or say remote = true in [zenoh] (vbus router: --remote) if that'
            " is meant",
        }),
        ('listen = ["tcp/127.0.0.1:7447"]\n' + CERTIFICATES, {
            "zenoh.listen[1]": '"tcp/127.0.0.1:7447" lets hosts in that show no certificate; write'
            ' "tls/127.0.0.1:7447", or leave certificate, key and authority out',
        }),
        ('connect = ["tls/127.0.0.1:7447"]\n', {
            "zenoh.connect[1]": '"tls/127.0.0.1:7447" needs certificates: give certificate, key and'
            " authority",
        }),
        ('certificate = "a"\n', {
            "zenoh.certificate": '"certificate" needs "key" (PEM file of its private key),'
            ' "authority" (PEM file of the authority whose certificates are accepted)',
        }),
    ],
)  # fmt: skip
def test_certificates_fit_each_other_and_the_endpoints(text: str, problems: dict[str, str]) -> None:
    found = {}
    try:
        read_board_text(f"{SMALL}[zenoh]\n{text}", "b.toml")
    except BoardFileError as error:
        found = {it.key: str(it).partition(f"{it.key}: ")[2] for it in error.problems}
    assert found == problems


def test_what_follows_an_unknown_key_is_checked_too() -> None:
    with pytest.raises(BoardFileError) as caught:
        load_board_text(SMALL + "[zenoh]\nnope = 1\nmode = 2\n", "b.toml")
    assert [problem.key for problem in caught.value.problems] == ["zenoh.nope", "zenoh.mode"]


def test_a_rule_no_chip_has_is_named_also_beside_one_of_a_chip_that_is_not_there() -> None:
    with pytest.raises(ConfigError) as caught:
        load_board_text(SMALL + '[violations]\n"toy.T1" = "off"\n"toy.T2" = "off"\n', "b.toml")
    assert str(caught.value) == (
        'b.toml:10: violations."toy.T2": unknown rule; did you mean "toy.T1"?'
        ' "vbus check --rules" lists them all'
    )


def test_all_mistakes_are_named_in_the_order_of_their_lines() -> None:
    text = 'hosts = []\n[board]\nseed = -1\n[chips.x]\nclock = "1 m"\n[nets]\na = []\n'
    with pytest.raises(BoardFileError) as caught:
        load_board_text(text, "b.toml")
    assert [(problem.line, problem.key) for problem in caught.value.problems] == [
        (3, "board.seed"),
        (4, "chips.x"),
        (5, "chips.x.clock"),
        (7, "nets.a"),
    ]


def test_a_file_that_is_not_there_is_named(tmp_path: Path) -> None:
    path = tmp_path / "none.toml"
    with pytest.raises(ConfigError) as caught:
        load_board(path)
    assert str(caught.value) == f"{path}: cannot be read: No such file or directory; check its name"
    (tmp_path / "nine.toml").touch()
    with pytest.raises(ConfigError, match=r'directory; did you mean ".*nine.toml"\?'):
        load_board(path)


def test_a_folder_is_no_board_file(tmp_path: Path) -> None:
    with pytest.raises(ConfigError) as caught:
        load_board(tmp_path)
    assert str(caught.value) == f"{tmp_path}: cannot be read: it is a directory; name a file in it"


def test_bytes_that_are_no_text_are_refused_with_their_line(tmp_path: Path) -> None:
    path = tmp_path / "latin.toml"
    path.write_bytes(b"[board]\nname = '\xe9'\n")
    with pytest.raises(ConfigError) as caught:
        load_board(path)
    assert str(caught.value) == (
        f"{path}:2: this is no UTF-8 text: it looks like text in another encoding; save it as UTF-8"
    )


@pytest.mark.parametrize(
    ("again", "line"),
    [("[chips.x]\n", 8), ('[plants.m]\nmodel = "motor"\n', 8), ("lines = 1\nlines = 2\n", 9)],
)
def test_a_name_given_twice_is_refused_at_its_second_place(again: str, line: int) -> None:
    with pytest.raises(ConfigError, match=rf"^b\.toml:{line}: no TOML: Cannot [a-z]+ .*$"):
        load_board_text(SMALL + again, "b.toml")


@pytest.mark.parametrize(
    ("part", "plants", "message"),
    [
        (
            "LM629N-8", 'plant = "m"',
            "b.toml:4: chips.x.plant: the LM629N-8 gives servo commands; this plant takes"
            " step pulses, phase commands: choose a model that takes servo commands",
        ),
        ("MC1141A", 'plants = ["m", "n"]', "b.toml:4: chips.x.plants: MC1141A has one axis; write"
         ' plant = "m"'),
    ],
)  # fmt: skip
def test_real_parts_are_checked_with_what_depends_on_the_part_number(
    monkeypatch: pytest.MonkeyPatch, part: str, plants: str, message: str
) -> None:
    monkeypatch.undo()
    plugins._entries.cache_clear()
    text = SMALL.replace("ACME-1", part).replace('plant = "m"', plants)
    text = text.replace('"motor"', '"stepper"').replace('supply = "24 V"\n', "")
    with pytest.raises(ConfigError) as caught:
        load_board_text(text.replace("8 MHz", "8 MHz" if "LM" in part else "25 MHz"), "b.toml")
    assert str(caught.value).split("\n")[0] == message


@pytest.mark.parametrize("model", ["dc_motor", "stepper"])
def test_a_motor_that_asks_for_sub_steps_is_refused_with_what_to_do(
    monkeypatch: pytest.MonkeyPatch, model: str
) -> None:
    monkeypatch.undo()
    plugins._entries.cache_clear()
    with pytest.raises(ConfigError) as caught:
        load_board_text(f'[plants.m]\nmodel = "{model}"\nsubsteps = 4\n', "b.toml")
    assert "b.toml:3: plants.m.substeps: motors are solved exactly; leave substeps out" in (
        str(caught.value).splitlines()
    )
