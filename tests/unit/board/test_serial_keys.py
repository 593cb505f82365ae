"""Serial lines in a board file: what they mean, and what is refused."""

import pytest

from vbus.board.build import build
from vbus.board.config import read_board_text
from vbus.core.errors import ConfigError
from vbus.protocols.byte import ByteProtocol
from vbus.protocols.serial_line import BREAK, DTR, RTS, ModemPins
from vbus.serve.server import on_line

BOARD = """\
[board]
time = "TIME"
[chips.x]
part = "LM629N-8"
clock = "8 MHz"
plant = "none"
[chips.y]
part = "LM629N-8"
clock = "8 MHz"
plant = "none"
[nets]
reset = ["x./RST", "y./RST"]
[[hosts]]
transport = "LINK"
chips = ["CHIP"]
KEYS
"""


def text(keys: str, link: str = "rfc2217:0", chip: str = "x", time: str = "lockstep") -> str:
    """Return a board file whose host has these keys."""
    board = BOARD.replace("TIME", time).replace("LINK", link).replace("CHIP", chip)
    return board.replace("KEYS", keys)


@pytest.mark.parametrize(
    ("document", "message"),
    [
        (text("baud = 9600", "serial:/dev/ttyS0"),
         "b.toml:16: hosts[1].baud: a real line takes its own time: its speed stands in the"
         " address, ?baud=9600; take baud out"),
        (text("baud = 9600", "zenoh:"),
         "b.toml:16: hosts[1].baud: messages over the network are no serial line; take baud out"),
        (text("", "zenoh:bench"),
         'b.toml:14: hosts[1].transport: found "zenoh:bench"; write "zenoh:" and nothing behind it:'
         " where on the network the board is stands in [zenoh]"),
        (text('rts = ["x./RST"]').replace("[chips.x]", "[nodes.a]\n[chips.x]\nnode = \"a\"")
         .replace("[chips.y]", "[nodes.b]\n[chips.y]\nnode = \"b\"").replace(', "y./RST"', ""),
         "b.toml:20: hosts[1].rts: modem lines are for boards without nodes"),
        (text("baud = 9600", "tcp:0", time="slaved"),
         "b.toml:16: hosts[1].baud: on a slaved board the host's own time stamps say when things"
         " happen; take baud out"),
        (text('frame = "8E1"', "tcp:0"),
         "b.toml:16: hosts[1].frame: frames take no time without baud; write baud = 9600"),
        (text('frame = "7E1"', "tcp:0"),
         'b.toml:16: hosts[1].frame: found "7E1"; did you mean "8E1"? allowed are "8N1", "8E1",'
         ' "8O1", "8N2", "8E2", "8O2"'),
        (text('dtr = ["x./RST"]', "pty:/x"),
         "b.toml:16: hosts[1].dtr: pty carries no modem lines and no break; write a transport that"
         " does: rfc2217"),
        (text('cts = "x.HI"', "unix:/x"),
         "b.toml:16: hosts[1].cts: unix carries no modem lines and no break; write a transport that"
         " does: rfc2217"),
        (text('reset = ["x.HI"]'),
         'b.toml:16: hosts[1].reset[1]: found "x.HI"; it may be x./RST, x.A, x.B, x./IN'),
        (text('breaks = ["y./RST"]'),
         'b.toml:16: hosts[1].breaks[1]: found "y./RST"; it may be x./RST, x.A, x.B, x./IN'),
        (text('rts = ["x./CS"]'),
         'b.toml:16: hosts[1].rts[1]: found "x./CS"; it may be x./RST, x.A, x.B, x./IN'),
    ],
)  # fmt: skip
def test_what_a_line_cannot_be_is_refused_in_words(document: str, message: str) -> None:
    with pytest.raises(ConfigError) as error:
        read_board_text(document, "b.toml")

    assert str(error.value) == message


def test_inputs_of_the_host_follow_any_pin() -> None:
    file, _ = read_board_text(text('cts = "x.HI"\ndsr = "x./RST"'))

    assert file.hosts[0].sensed == {"cts": "x.HI", "dsr": "x./RST"}


@pytest.mark.parametrize("chip", ["x", "y"])
def test_lines_reach_the_side_pins_on_their_nets_each_once(chip: str) -> None:
    keys = (
        f'dtr = ["{chip}./RST"]\nrts = ["{chip}./IN"]\nbreaks = ["{chip}.A"]\n'
        f'reset = ["{chip}./RST"]\nchange_time = "3 ms"'
    )
    file, source = read_board_text(text(keys, chip=chip))
    board = build(file, source)
    port = board.open_port("host0", [chip])
    line = on_line(file.hosts[0], board, port, ByteProtocol(port))

    assert line is not None
    sides = port.pins.side_names()
    numbers = {name: sides.index(f"{chip}.{name}") for name in ("/RST", "/IN", "A")}
    assert line.modem == ModemPins(
        ((DTR, numbers["/RST"]), (RTS, numbers["/IN"]), (BREAK, numbers["A"])),
        (numbers["/RST"],),
        3_000_000_000,
    )
    assert port.promises, "bytes take no time"


def test_a_host_without_such_keys_has_no_line() -> None:
    file, source = read_board_text(text(""))
    board = build(file, source)
    port = board.open_port("host0", ["x"])

    assert on_line(file.hosts[0], board, port, ByteProtocol(port)) is None
    assert port.promises
