"""Cards as programs see them: memory or ports, byte order, interrupts; and what is refused."""

import pytest

from vbus.board.build import card_of, load_board_text
from vbus.board.config import read_board_text
from vbus.core.errors import ConfigError
from vbus.protocols.port import PortInfo

BOARD = """\
[board]
time = "lockstep"
clock_step = "3 us"
[chips.x]
part = "LM629N-8"
clock = "8 MHz"
plant = "none"
[chips.mc]
part = "MC1141A"
clock = "25 MHz"
plant = "none"
[cards.c]
decode = "direct"
chips = ["x"]
KEYS
[[hosts]]
transport = "tcp:5000"
card = "c"
"""


def info(keys: str) -> PortInfo:
    """Return what a program behind a card with these keys is told."""
    text = BOARD.replace("KEYS", keys)
    file, _ = read_board_text(text)
    card = card_of(file, file.hosts[0])
    return load_board_text(text).open_port("host", None, 0, card).info()


def settings(keys: str) -> dict[str, str]:
    """Return the same as keys and values."""
    return dict(part.split("=") for part in info(keys).program.split(";"))


def test_a_card_is_at_ports_little_endian_and_without_interrupt_unless_told() -> None:
    assert settings("base = 0x340") == {"step": "3000000", "memory": "0", "fixed": "0", "big": "0"}


def test_a_card_among_memory_tells_where_and_in_which_byte_order() -> None:
    keys = "base = 0x40000000\nstride = 4\nmemory = true\nbig_endian = true\nfixed = 0x50000000"
    told = settings(keys)
    assert (told["memory"], told["big"], told["fixed"]) == ("1", "1", str(0x50000000))
    assert info(keys).card == "r40000000=0.0 r40000004=0.1 w40000000=0.0 w40000004=0.1"


@pytest.mark.parametrize(
    ("outputs", "low"),
    [("x.HI", set()), ("mc.~HostIntrpt", {"mc.~HostIntrpt"}),
     ("x.HI mc.~HostIntrpt", {"mc.~HostIntrpt"})],
)  # fmt: skip
def test_interrupts_are_output_lines_with_their_polarity(outputs: str, low: set[str]) -> None:
    """A name that begins with / or ~ is active low, as in the manuals."""
    keys = f'interrupt = "{outputs}"'
    told = settings(keys)
    names = info(keys).outputs

    def named(mask: str) -> set[str]:
        return {name for bit, name in enumerate(names) if int(mask) >> bit & 1}

    assert named(told["lines"]) == set(outputs.split())
    assert (named(told["low"]), told["signal"]) == (low, "0")


GATES = """
[glue.u1]
part = "74HC02"
hosts = ["1Y"]
[glue.u1.pins]
1A = "x.HI"
1B = "x.HI"
[glue.u2]
part = "74HC03"
[glue.u2.pins]
1A = "x.HI"
1B = "x.HI"
1Y = "IRQ"
2A = "x.HI"
2B = "x.HI"
2Y = "IRQ"
"""


@pytest.mark.parametrize(
    ("outputs", "line", "low"),
    [("u1.1Y", "u1.1Y", False), ("!u1.1Y", "u1.1Y", True), ("!u2.2Y", "u2.1Y", True),
     ("!x.HI", "x.HI", True)],
)  # fmt: skip
def test_an_output_of_glue_interrupts_by_the_wire_it_is_on(
    outputs: str, line: str, low: bool
) -> None:
    keys = f'interrupt = "{outputs}"{GATES}'
    told = settings(keys)
    bit = 1 << info(keys).outputs.index(line)
    assert (int(told["lines"]), int(told["low"])) == (bit, bit * low)


@pytest.mark.parametrize(
    ("keys", "message"),
    [
        ('interrupt = "u1.2Y"', 'cards.c.interrupt: found "u1.2Y"; outputs are u1.1Y'),
        ('interrupt = "u9.1Y"', "cards.c.interrupt: there is no [chips.u9]"),
        ('interrupt = "u1.1Y"\nacknowledge = "read"', '"u1.1Y" is an output of glue: make the'),
        ('interrupt = "!x.HI"\nacknowledge = "read"', '"acknowledge" and "line" turn no output'),
    ],
)
def test_what_of_glue_cannot_interrupt_is_named(keys: str, message: str) -> None:
    with pytest.raises(ConfigError) as caught:
        load_board_text(BOARD.replace("KEYS", keys + GATES))
    assert message in str(caught.value)


@pytest.mark.parametrize(
    ("signal", "number"),
    [("SIGHUP", "1"), ("SIGUSR1", "10"), ("SIGUSR2", "12"), ("SIGALRM", "14"), ("SIGIO", "29")],
)
def test_a_signal_is_told_by_its_number(signal: str, number: str) -> None:
    assert settings(f'interrupt = "x.HI"\nsignal = "{signal}"')["signal"] == number


@pytest.mark.parametrize(
    ("keys", "message"),
    [
        ('signal = "SIGIO"', 'cards.c.signal: "signal" needs "interrupt" (output that interrupts'),
        ('interrupt = "x.HI"\nsignal = "SIGKILL"', 'cards.c.signal: found "SIGKILL"'),
        ("fixed = 0x50000000", 'cards.c.fixed: "fixed" needs "memory" (its addresses are memory'),
        ("memory = false\nfixed = 0x50000000", 'cards.c.fixed: "fixed" needs "memory" (its'),
        ("memory = true\nfixed = 0x50000010", "cards.c.fixed: found 1342177296; a page begins at"),
        ('interrupt = "x./RD"', 'cards.c.interrupt: found "x./RD"; outputs are x.HI'),
        ('interrupt = "q.HI"', "cards.c.interrupt: there is no [chips.q]; this file has x, mc"),
        ('interrupt = "HI"', "cards.c.interrupt: there is no [chips.HI]"),
        ("big_endian = 1", "cards.c.big_endian: found 1"),
        ('memory = "yes"', 'cards.c.memory: found "yes"'),
    ],
)
def test_a_mistake_is_named_with_its_line(keys: str, message: str) -> None:
    line = 15 + keys.count("\n")
    with pytest.raises(ConfigError) as caught:
        load_board_text(BOARD.replace("KEYS", keys), "b.toml")
    assert f"b.toml:{line}: {message}" in str(caught.value)
