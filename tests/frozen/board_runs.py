"""Boards with several chips and hosts, and with faults: what the frozen runs do."""

from tests.frozen.hosts import DC, IDEAL, STEPPER, Lm, Mcp, Pmd, freeze, head, lm, mcp, pmd
from tests.frozen.mcp1200_runs import profile
from vbus.board.board import Board
from vbus.core.kernel import MS

TWO_LM = f"""\
{head("TIME")}[chips.x]
part = "LM629N-8"
clock = "8 MHz"
plant = "xm"
[chips.y]
part = "LM629N-6"
clock = "6 MHz"
plant = "ym"
[plants.xm]
{DC}
[plants.ym]
{IDEAL}
[buses.main]
chips = ["x", "y"]
"""


@freeze(
    "board-one-bus-selects",
    TWO_LM.replace("TIME", "lockstep"),
    "two chips on one bus, one selected, both written together, none; events of HI",
)
def _(board: Board) -> None:
    host = Lm(board)
    for mask in (1, 2):
        host.port.select(mask)
        host.filter(300 if mask == 1 else 1)
        host.do("MSKI", 0x04)
        host.load(0x2A, 2000, 2 << 16, 150)
    host.port.select(3)
    host.port.events(3)
    host.delay(MS)
    host.write(0, 1)
    host.read(0)
    host.delay(200 * MS)
    host.port.take_events()
    for mask in (1, 2):
        host.port.select(mask)
        host.look(2)
    host.port.select(0)
    host.read(0)
    host.close()


def two_hosts(board: Board) -> None:
    """Two sessions that take turns by CLAIM, and step on each other's toes without it."""
    one, two = Lm(board, "one"), Lm(board, "two")
    for host, mask in ((one, 1), (two, 2)):
        host.port.select(mask)
        host.port.claim()
        host.filter(200 * mask)
        host.go(4000, 1 << 16, 100 * mask)
        host.port.unclaim()
    for number in range(30):
        host, other = (one, two) if number % 2 else (two, one)
        host.port.select(1 + number % 3 % 2)
        host.port.claim()
        other.port.select(1 + number % 2)
        other.port.claim()
        host.look(1, MS)
        host.port.unclaim()
        other.port.claim()
        if not other.port.held:
            other.look(1, MS)
        other.port.unclaim()
    one.close()
    two.look(3)
    two.close()


@freeze(
    "board-two-hosts-claim",
    TWO_LM.replace("TIME", "lockstep"),
    "two sessions that take turns by CLAIM",
)
def _(board: Board) -> None:
    two_hosts(board)


@freeze(
    "board-two-hosts-claim-realtime",
    TWO_LM.replace("TIME", "realtime"),
    "two sessions in real time, with CLAIM",
)
def _(board: Board) -> None:
    two_hosts(board)


WIRED = f"""\
{head()}[chips.l]
part = "LM629N-8"
clock = "8 MHz"
plant = "lm"
[chips.m]
part = "MCP-1200"
clock = "8 MHz"
plant = "mm"
[chips.p]
part = "MC1241A"
clock = "25 MHz"
plants = ["pm", "none"]
[plants.lm]
{DC}
[plants.mm]
{IDEAL}
[plants.pm]
{STEPPER}
[nets]
HI = ["l.HI", "p.PosLimit1"]
INTRPT = ["p.~HostIntrpt", "m./STOP"]
TRIG = ["m.TRIG", "p.~Home1", "l./IN"]
"""


@freeze(
    "board-wired-lines",
    WIRED,
    "HI stops an MC1241A, ~HostIntrpt stops an MCP-1200, TRIG captures on two others",
)
def _(board: Board) -> None:
    first = Lm(board, "l", ("l",))
    second = Mcp(board, "m", ("m",))
    third = Pmd(board, "p", ("p",))
    first.filter()
    first.do("MSKI", 0x48)
    first.do("SBPA", 0, 120)
    first.do("SIP")
    third.begin()
    third.do("LMTS_ON")
    third.set(capt_home=0, intrpt_mask=0x28, prfl_vel=0, vel=2 << 16, acc=0x1000)
    third.do("UPDATE")
    second.begin()
    second.set(config=0x11, breakpoint=40, exception=0x08)
    second.set(acceleration=0x100, profile_velocity=2, final_position=400)
    second.flag(0)
    first.go(4000, 2 << 16, 300)
    for _ in range(6):
        first.look(1, 4 * MS)
        second.look(1, 4 * MS)
        third.look(1, 4 * MS)
    third.do("RST_INTRPT", 0)
    first.do("RSTI", 0)
    first.do("RDIP")
    third.do("GET_CAPT")
    second.set(status=0)
    second.look(3)
    for host in (first, second, third):
        host.close()


FAULTS = """
[[faults]]
fault = "jam"
target = "x"
when = "position 150"
until = "for 60 ms"
[[faults]]
fault = "byte_flipped"
target = "x"
when = "rate 60 Hz"
until = "once"
[[faults]]
fault = "load_step"
target = "x"
when = "at 90 ms"
until = "for 40 ms"
[[faults]]
fault = "offset_jump"
target = "x"
when = "at 150 ms"
counts = 37
[[faults]]
fault = "clock_off"
target = "x"
when = "at 20 ms"
until = "for 70 ms"
ppm = 900
"""
"""Not for a link, which a journal knows nothing of."""


@freeze(
    "faults-lm629",
    lm(seed=11) + FAULTS,
    "faults from the board file: mechanics, bus, clock and encoder",
)
def _(board: Board) -> None:
    host = Lm(board)
    host.filter(300, 20, 2000, 500)
    host.do("LPES", 500)
    host.go(4000, 2 << 16, 700)
    host.look(40, 6 * MS)
    host.close()


FAULTS_MCP = """
[[faults]]
fault = "limit_bouncing"
target = "x"
when = "at 20 ms"
until = "for 4 ms"
[[faults]]
fault = "strobe_doubled"
target = "x"
when = "rate 90 Hz"
until = "once"
[[faults]]
fault = "slip"
target = "x"
when = "position 60"
until = "for 30 ms"
share = 0.3
[[faults]]
fault = "ab_swapped"
target = "x"
when = "at 70 ms"
until = "for 10 ms"
[[faults]]
fault = "supply_dip"
target = "x"
when = "at 110 ms"
"""


@freeze(
    "faults-mcp1200",
    mcp(DC, seed=12) + FAULTS_MCP,
    "faults from the board file: switch, strobe, encoder, supply",
)
def _(board: Board) -> None:
    host = Mcp(board)
    host.begin()
    for final in (200, -40):
        profile(host, final)
        host.look(30)
    host.close()


FAULTS_PMD = """
[[faults]]
fault = "lost_steps"
target = "x.1"
when = "at 20 ms"
until = "for 50 ms"
every = 7
[[faults]]
fault = "ready_stuck"
target = "x"
when = "at 40 ms"
until = "for 2 ms"
[[faults]]
fault = "limit_stuck"
target = "x.1"
when = "position 90"
until = "for 20 ms"
[[faults]]
fault = "contention"
target = "x"
when = "cycle 150"
until = "once"
[[faults]]
fault = "clock_stopped"
target = "x"
when = "at 120 ms"
until = "for 3 ms"
"""


@freeze(
    "faults-mc1241a",
    pmd(seed=13) + FAULTS_PMD,
    "faults from the board file: steps, ready, limit, contention, clock",
)
def _(board: Board) -> None:
    host = Pmd(board)
    host.begin()
    host.do("LMTS_ON")
    host.set(prfl_trap=0, vel=3 << 16, acc=0x4000, pos=300)
    host.do("UPDATE")
    host.look(30, 4 * MS)
    host.close()
