"""LM628 and LM629: what the frozen runs do."""

from tests.frozen.hosts import DC, FAST_DC, IDEAL, LOADED, Lm, StrobedLm, Strobes, freeze, lm
from vbus.board.board import Board
from vbus.core.kernel import MS, NS, US


def move(host: Lm) -> None:
    """A move in position mode, and one back."""
    host.filter(300, 20, 2000, 500)
    host.go(4000, 2 << 16, 700)
    host.look(14)
    host.go(4000, 1 << 16, -150)
    host.look(14)


@freeze(
    "lm629-position-dc",
    lm(),
    "position mode with a DC motor: trapezoid there and back",
    ("x.SIGN",),
)
def _(board: Board) -> None:
    host = Lm(board)
    move(host)
    host.close()


@freeze("lm628-position-dc", lm("LM628N-8", LOADED), "8-bit port, a loaded DC motor", ("x.DAC7",))
def _(board: Board) -> None:
    host = Lm(board)
    host.do("PORT8")
    move(host)
    host.close()


@freeze(
    "lm628-12-bit-port",
    lm("LM628N-6", DC, clock="6 MHz"),
    "12-bit port: every step of its sequence on the pins",
    tuple(f"x.DAC{bit}" for bit in range(8)),
    going_on=60,
)
def _(board: Board) -> None:
    host = Lm(board)
    host.do("PORT12")
    host.filter(900)
    host.go(4000, 1 << 16, 60)
    host.look(4, MS)
    host.close()


@freeze(
    "lm629-pwm",
    lm(extra="pwm_frame_clk = 512"),
    "every edge of SIGN and MAG",
    ("x.SIGN", "x.MAG"),
    going_on=80,
)
def _(board: Board) -> None:
    host = Lm(board)
    host.filter(600)
    host.go(4000, 2 << 16, 200)
    host.look(5)
    host.go(4000, 2 << 16, -50)
    host.look(5)
    host.close()


@freeze(
    "lm629-ideal", lm(plant=IDEAL, power_on="reset"), "power-on reset, an ideal drive, short moves"
)
def _(board: Board) -> None:
    host = Lm(board)
    host.read(0)
    host.delay(3 * MS)
    host.do("RSTI", 0)
    host.filter(1)
    for target in (1, 2, 5, 20, 7, -4, -3000, 0):
        host.go(1 << 16, 300 << 16, target)
        host.look(3, 2 * MS)
    host.close()


@freeze("lm629-velocity", lm(), "velocity mode, both ways, velocities changed on the fly")
def _(board: Board) -> None:
    host = Lm(board)
    host.filter()
    host.load(0x1828, 2000, 1 << 16)
    host.do("STT")
    host.look(8)
    host.load(0x1808, 3 << 15)
    host.do("STT")
    host.look(6)
    host.load(0x0808, 1 << 16)
    host.do("STT")
    host.look(14)
    host.load(0x0808, 0)
    host.do("STT")
    host.look(8)
    host.close()


@freeze(
    "lm629-stops",
    lm(),
    "smooth and abrupt stops and motor off, in both modes, and going on after them",
)
def _(board: Board) -> None:
    host = Lm(board)
    host.filter()
    for mode in (0x1828, 0x2A):
        for stop in (0x400, 0x200, 0x100):
            host.load(mode, 2000, 2 << 16, *(() if mode & 0x800 else (100_000,)))
            host.do("STT")
            host.look(5)
            host.load(stop | mode & 0x1800)
            host.do("STT")
            host.look(6)
    host.load(0x2A, 2000, 1 << 16, 0)
    host.do("STT")
    host.look(6)
    host.close()


@freeze(
    "lm629-relative",
    lm(plant=IDEAL),
    "relative acceleration, velocity and position, at rest and on the fly",
)
def _(board: Board) -> None:
    host = Lm(board)
    host.filter(1)
    host.go(2000, 4 << 16, 400)
    host.look(5)
    host.load(0x03, 300)
    host.do("STT")
    host.look(5)
    host.load(0x0F, 1 << 16, -900 & 0xFFFFFFFF)
    host.do("STT")
    host.look(16)
    host.load(0x3F, 500, -1 << 16 & 0xFFFFFFFF, 1000)
    host.do("STT")
    host.look(16)
    host.close()


@freeze(
    "lm629-relative-in-stop",
    lm(plant=IDEAL),
    "a relative position, and a relative breakpoint, during a smooth stop of velocity mode",
)
def _(board: Board) -> None:
    host = Lm(board)
    host.filter(1)
    host.load(0x182A, 0x4000, 0xA0000, 0)
    host.do("STT")
    host.delay(15 * MS)
    host.load(0x1C00)
    host.do("STT")
    host.do("SBPR", 0, 40)
    host.load(0x03, 100)
    host.do("STT")
    host.look(10)
    host.load(0x1C00)
    host.do("STT")
    host.close()


@freeze(
    "lm629-relative-to-buffered",
    lm(plant=IDEAL),
    "a relative position while another position is loaded and was never started",
)
def _(board: Board) -> None:
    host = Lm(board)
    host.filter(1)
    host.load(0x182A, 0x4000, 0xA0000, 7000)
    host.do("STT")
    host.delay(10 * MS)
    host.load(0x1C00)
    host.do("STT")
    host.look(3, MS)
    host.load(0x03, 100)
    host.do("STT")
    host.look(16, 5 * MS)
    host.close()


@freeze("lm629-wrap", lm(plant=IDEAL), "the fastest velocity over the end of 31 bits")
def _(board: Board) -> None:
    host = Lm(board)
    host.filter(1)
    host.load(0x1828, 0x3FFFFFFF, 0x3FFFFFFF)
    host.do("STT")
    host.look(3, 1000 * MS)
    host.delay(13_500 * MS)
    host.look(12, 30 * MS)
    host.close()


@freeze("lm629-breakpoints", lm(), "absolute and relative breakpoints, mask and HI", ("x.HI",))
def _(board: Board) -> None:
    host = Lm(board)
    host.filter()
    host.do("MSKI", 0x7E)
    host.do("RSTI", 0)
    host.do("SBPA", 0, 200)
    host.go(4000, 2 << 16, 600)
    host.look(10)
    host.do("RSTI", 0)
    host.do("SBPR", 0xFFFF, 0xFF38)
    host.look(3)
    host.do("SBPA", 0xFFFF, 0xFFF6)
    host.go(4000, 2 << 16, -100)
    host.look(10)
    host.do("RSTI", 0x3E)
    host.look(3)
    host.close()


@freeze(
    "lm629-index", lm(plant=FAST_DC), "index position, armed twice, with its interrupt", ("x.HI",)
)
def _(board: Board) -> None:
    host = Lm(board)
    host.filter(600)
    host.do("MSKI", 0x08)
    host.do("SIP")
    host.go(4000, 1 << 16, 300)
    host.look(10)
    host.do("RDIP")
    host.do("RSTI", 0x76)
    host.do("SIP")
    host.go(4000, 1 << 16, 100)
    host.look(10)
    host.do("RDIP")
    host.close()


@freeze("lm629-home", lm(), "DFH at rest and in motion, in both modes")
def _(board: Board) -> None:
    host = Lm(board)
    host.filter()
    host.go(4000, 1 << 16, 200)
    host.look(10)
    host.do("DFH")
    host.look(2)
    host.go(4000, 1 << 16, 300)
    host.look(4)
    host.do("DFH")
    host.look(8)
    host.load(0x1828, 2000, 1 << 16)
    host.do("STT")
    host.look(3)
    host.do("DFH")
    host.look(3)
    host.close()


@freeze(
    "lm629-position-error",
    lm(plant='model = "dc_motor"\nstop_low = -1000\nstop_high = 150'),
    "an end stop: LPEI, then LPES turns the motor off",
    ("x.HI",),
)
def _(board: Board) -> None:
    host = Lm(board)
    host.filter()
    host.do("MSKI", 0x20)
    host.do("LPEI", 60)
    host.go(4000, 1 << 16, 1000)
    host.look(10)
    host.do("RSTI", 0x5E)
    host.do("LPES", 200)
    host.look(10)
    host.go(4000, 1 << 16, 100)
    host.look(4)
    host.close()


@freeze("lm629-integral", lm(plant=LOADED), "the integral and its limit against a load; RDSUM")
def _(board: Board) -> None:
    host = Lm(board)
    host.filter(200, 200, 1500, 3000)
    host.go(4000, 1 << 16, 100)
    host.look(20)
    host.filter(200, 200, 1500, 40)
    host.look(12)
    host.filter(200, 0x7FFF, 1500, 0x7FFF)
    host.look(8)
    host.close()


@freeze(
    "lm629-filter",
    lm(extra='pid_overflow = "wrap"'),
    "derivative intervals, gains changed in motion, products over 16 bits wrapped",
)
def _(board: Board) -> None:
    host = Lm(board)
    host.filter(500, 3, 3000, 100, ds=5)
    host.go(4000, 2 << 16, 500)
    host.look(6)
    host.filter(0x7FFF, 0x7FFF, 0x7FFF, 0x7FFF, ds=1)
    host.look(6)
    host.filter(100, 3, 800, 100, ds=255)
    host.look(6)
    host.close()


@freeze("lm629-saturation", lm(plant=LOADED), "products over 16 bits saturated: gains far too high")
def _(board: Board) -> None:
    host = Lm(board)
    host.filter(0x7FFF, 0x4000, 0x7FFF, 0x7FFF)
    host.go(4000, 4 << 16, 2000)
    host.look(14)
    host.close()


@freeze(
    "lm629-udf-twice",
    lm(plant=LOADED),
    "coefficients loaded after UDF, within its sample",
    ("x.MAG", "x.SIGN"),
    going_on=200,
)
def _(board: Board) -> None:
    host = Lm(board)
    host.filter(200)
    host.go(4000, 1 << 16, 100)
    for kp in (200, 300, 250, 400, 220):
        host.do("LFIL", 0x08, kp)
        host.do("UDF")
        host.do("LFIL", 0x08, 1000)
        host.look(3, 2 * MS)
    host.close()


@freeze(
    "lm629-resets",
    lm(power_on="reset", extra='reset_status = "C4"\nreset_fail = 1'),
    "a failed reset, /RST, and the RESET command in motion",
    ("x.HI",),
)
def _(board: Board) -> None:
    host = Lm(board)
    for _ in range(2):
        host.delay(3 * MS)
        host.read(0)
        host.pulse("/RST", 0)
    host.delay(3 * MS)
    host.do("RSTI", 0)
    host.filter()
    host.go(4000, 1 << 16, 500)
    host.look(4)
    host.do("RESET")
    host.delay(3 * MS)
    host.look(3)
    host.close()


@freeze(
    "lm629-busy-jitter",
    lm(extra="busy_clk = 150\nbusy_jitter_clk = 60", seed=77),
    "busy of varying length, drawn from the board's seed",
)
def _(board: Board) -> None:
    host = Lm(board)
    move(host)
    host.close()


def careless(host: Lm) -> None:
    """Breaks every rule of the bus and of the packets."""
    host.filter()
    host.write(0, 0x0A)
    host.write(0, 0x0A)  # while busy
    host.read(1)
    for code in (0x0E, 0x55, 0xFF):
        host.ready()
        host.write(0, code)
    host.ready()
    host.write(0, 0x1F)
    host.ready()
    host.write(0, 0x0A)  # a packet cut short
    host.ready()
    host.write(1, 0x12)  # the wrong way
    host.ready()
    host.write(1, 0x34)
    host.ready()
    host.read(1)
    host.do("PORT12")
    host.load(0x2A, 0xFFFFFFFF, 0x7FFFFFFF, 0x60000000)
    host.load(0x0600)
    host.go(4000, 1 << 16, 400)
    host.do("PORT8")
    host.delay(5 * MS)
    host.load(0x20, 90)
    host.do("STT")
    host.look(6)


@freeze("lm629-violations-warn", lm(), "rules of bus and packets broken, recorded")
def _(board: Board) -> None:
    host = Lm(board)
    careless(host)
    host.close()


@freeze("lm629-violations-strict", lm(rules="strict"), "the same rules broken, cycles lost")
def _(board: Board) -> None:
    host = Lm(board)
    careless(host)
    host.close()


@freeze("lm629-strobed", lm(), "a host that moves the strobes: a whole move", ("x.HI",))
def _(board: Board) -> None:
    host = StrobedLm(board)
    host.filter()
    host.go(4000, 2 << 16, 120)
    host.look(5, 6 * MS)
    host.close()


@freeze(
    "lm629-strobed-too-fast",
    lm(rules="strict"),
    "strobes too short and too close: AC limits broken",
)
def _(board: Board) -> None:
    host = StrobedLm(board)
    port = host.port
    for step in (200, 90, 40, 10, 0):
        strobes = Strobes(port, step * NS)
        for address in (0, 1):
            strobes.put(ps=address, cs=0)
            strobes.drive(0x0C)
            strobes.put(wr=0)
            strobes.put(wr=1)
            strobes.put(cs=1)
            strobes.release()
            host.delay(40 * US)
            strobes.put(ps=address, cs=0)
            strobes.put(rd=0)
            port.sample()
            strobes.put(wr=0)
            strobes.put(wr=1, rd=1)
            strobes.put(cs=1)
            host.delay(40 * US)
    host.look(2)
    host.close()


@freeze(
    "lm629-encoder-pins",
    lm(plant=""),
    "the encoder and the index as edges at the pins, some too fast",
)
def _(board: Board) -> None:
    host = Lm(board)
    host.do("SIP")
    for number in range(120):
        turn = number if number < 80 else 160 - number
        host.pin("A", (0, 1, 1, 0)[turn % 4])
        host.pin("B", (0, 0, 1, 1)[turn % 4])
        host.pin("/IN", 0 if turn % 20 == 16 else 1)
        host.delay((3 * US, 2 * US, 900 * NS)[number // 40])
        if number % 15 == 0:
            host.do("RDRP")
    host.pin("A", 1)
    host.pin("B", 1)
    host.delay(3 * US)
    host.do("RDIP")
    host.look(3)
    host.close()


@freeze("lm629-slaved", lm(time="slaved"), "a host that stamps its requests")
def _(board: Board) -> None:
    host = Lm(board)
    move(host)
    host.close()


@freeze(
    "lm629-realtime", lm(time="realtime"), "a run in real time, at the instants the wall clock gave"
)
def _(board: Board) -> None:
    host = Lm(board)
    move(host)
    host.close()
