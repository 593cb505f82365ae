"""MC1241A and MC1141A: what the frozen runs do."""

from tests.frozen.hosts import (
    COARSE,
    MICROSTEPPER,
    OVERLOADED,
    WITH_SWITCHES,
    Pmd,
    StrobedPmd,
    Strobes,
    freeze,
    pmd,
)
from vbus.board.board import Board
from vbus.chips.mc1241a.datasheet import COMMANDS
from vbus.core.kernel import MS, NS, US


@freeze(
    "mc1241a-trapezoid",
    pmd(),
    "trapezoids with and without a plateau, both ways",
    ("x.~HostIntrpt",),
)
def _(board: Board) -> None:
    host = Pmd(board)
    host.begin()
    host.set(prfl_trap=0, vel=6 << 16, acc=0x8000)
    for target in (200, 203, -150, -149):
        host.set(pos=target)
        host.do("UPDATE")
        host.look(7, 4 * MS)
    host.close()


@freeze(
    "mc1241a-trapezoid-on-the-fly",
    pmd(),
    "position, velocity and acceleration changed while it moves",
)
def _(board: Board) -> None:
    host = Pmd(board)
    host.begin()
    host.set(prfl_trap=0, vel=6 << 16, acc=0x4000, pos=500)
    host.do("UPDATE")
    host.look(4, 4 * MS)
    for name, value in (
        ("vel", 9 << 16),
        ("pos", 700),
        ("acc", 0x9000),
        ("vel", 2 << 16),
        ("pos", 300),
    ):
        host.set(**{name: value})
        host.do("UPDATE")
        host.look(4, 4 * MS)
    host.look(6, 9 * MS)
    host.close()


@freeze(
    "mc1241a-velocity-contouring", pmd(), "velocity contouring, both ways, with a starting velocity"
)
def _(board: Board) -> None:
    host = Pmd(board)
    host.begin()
    host.set(prfl_vel=0, start_vel=0x8000, vel=5 << 16, acc=0x3000)
    host.do("UPDATE")
    host.look(6, 4 * MS)
    host.set(acc=-0x5000)
    host.do("UPDATE")
    host.look(10, 4 * MS)
    host.set(acc=0x5000, vel=0)
    host.do("UPDATE")
    host.look(6, 4 * MS)
    host.close()


@freeze(
    "mc1241a-starting-velocity", pmd(), "a trapezoid that begins and ends at the starting velocity"
)
def _(board: Board) -> None:
    host = Pmd(board)
    host.begin()
    host.set(prfl_trap=0, start_vel=2 << 16, vel=6 << 16, acc=0x2000, pos=300)
    host.do("UPDATE")
    host.look(6, 5 * MS)
    host.set(pos=0)
    host.do("UPDATE")
    host.look(10, 5 * MS)
    host.close()


@freeze(
    "mc1241a-s-curve", pmd(), "S-curves with all phases and with some, both ways, with a remainder"
)
def _(board: Board) -> None:
    host = Pmd(board)
    host.begin()
    host.set(prfl_s_crv=0)
    for target, vel, acc, jerk in (
        (400, 8 << 16, 0x4000, 0x02000000), (2003, 30 << 16, 0x7000, 0x04000000),
        (1990, 30 << 16, 0x7000, 0x01000000), (-77, 20 << 16, 0x2000, 0x10000000),
    ):  # fmt: skip
        host.set(pos=target, vel=vel, max_acc=acc, jerk=jerk)
        host.do("UPDATE")
        host.look(12, 8 * MS)
    host.close()


@freeze("mc1241a-s-curve-stops", pmd(), "SMOOTH_STOP and STOP of S-curves, and moves after them")
def _(board: Board) -> None:
    host = Pmd(board)
    host.begin()
    host.set(prfl_s_crv=0, vel=8 << 16, max_acc=0x4000, jerk=0x02000000)
    for stop, after in (("SMOOTH_STOP", 12), ("SMOOTH_STOP", 40), ("STOP", 20)):
        host.set(pos=1500)
        host.do("UPDATE")
        host.delay(after * MS)
        host.look(1)
        host.do(stop)
        host.do("UPDATE")
        host.look(6, 6 * MS)
        host.do("RST_STATUS", 0xFF00)
    host.close()


@freeze(
    "mc1241a-gear",
    pmd(extra='encoder_1 = "axis 2"'),
    "the electronic gear: axis 1 follows axis 2's encoder, ratios of both signs",
)
def _(board: Board) -> None:
    host = Pmd(board)
    host.begin()
    host.do("SET_2")
    host.set(step_ratio=0x0100, buf_mtr_cmd=0x4000, prfl_vel=0, vel=3 << 16, acc=0x4000)
    host.do("SET_1")
    host.set(prfl_gear=0, ratio=0x18000)
    host.do("MULTI_UPDATE", 3)
    host.look(6, 4 * MS)
    host.set(ratio=-0x8000)
    host.do("UPDATE")
    host.look(5, 4 * MS)
    host.do("STOP")
    host.do("UPDATE")
    host.look(2)
    host.close()


@freeze(
    "mc1241a-stops",
    pmd(),
    "STOP and SMOOTH_STOP of trapezoid and velocity contouring, both in one update",
)
def _(board: Board) -> None:
    host = Pmd(board)
    host.begin()
    for mode in ("prfl_trap", "prfl_vel"):
        for stops in (("STOP",), ("SMOOTH_STOP",), ("SMOOTH_STOP", "STOP")):
            host.set(**{mode: 0}, vel=6 << 16, acc=0x4000, pos=3000)
            host.do("UPDATE")
            host.look(3, 4 * MS)
            for stop in stops:
                host.do(stop)
            host.do("UPDATE")
            host.look(4, 4 * MS)
    host.close()


@freeze(
    "mc1241a-stop-at-rest-and-breakpoint",
    pmd(),
    "SMOOTH_STOP at rest with a motion-complete breakpoint, then a move; phases of the cycle",
)
def _(board: Board) -> None:
    host = Pmd(board)
    host.begin()
    host.set(vel=8 << 16, acc=0x4000, max_acc=0x4000, jerk=0x10000000)
    for mode in ("prfl_s_crv", "prfl_trap", "prfl_vel"):
        host.set(**{mode: 0})
        for phase in range(6):
            host.delay(phase * 97 * US)
            host.do("SMOOTH_STOP")
            host.do("UPDATE")
            host.set(pos=185 + phase, mtn_cmplt_brk=0)
            host.look(2, 9 * MS)
            host.do("STOP")
            host.do("UPDATE")
            host.do("RST_STATUS", 0)
    host.close()


@freeze(
    "mc1241a-synch-profile",
    pmd(plant=MICROSTEPPER),
    "SYNCH_PRFL at rest and in motion; the phases of the motor go on",
)
def _(board: Board) -> None:
    host = Pmd(board)
    host.begin()
    host.set(step_ratio=0x0100, prfl_trap=0, vel=3 << 16, acc=0x2000, pos=120)
    host.do("UPDATE")
    host.look(6, 6 * MS)
    host.set(actl_pos=-40)
    host.do("SYNCH_PRFL")
    host.do("UPDATE")
    host.look(3)
    host.set(pos=90)
    host.do("UPDATE")
    host.look(3, 6 * MS)
    host.do("SYNCH_PRFL")
    host.do("UPDATE")
    host.look(5, 6 * MS)
    host.close()


def cannot_move(mode: str, zero: str) -> None:
    """Freeze updates with a parameter 0 at rest, others while it is so, and then a move."""

    @freeze(
        f"mc1241a-cannot-move-{mode}-{zero}", pmd(), f"profile {mode}: {zero} 0 at rest, then not 0"
    )
    def _(board: Board) -> None:
        host = Pmd(board)
        host.begin()
        host.set(**{f"prfl_{mode}": 0})
        host.set(vel=4 << 16, acc=0x4000, max_acc=0x4000, jerk=0x08000000, pos=60)
        host.set(**{zero: 0})
        host.do("UPDATE")
        host.look(4, 2 * MS)
        host.set(pos=80)
        host.do("UPDATE")
        host.look(3, 2 * MS)
        host.set(vel=4 << 16, acc=0x4000, max_acc=0x4000, jerk=0x08000000)
        host.do("UPDATE")
        host.look(5, 8 * MS)
        host.do("STOP")
        host.do("UPDATE")
        host.set(pos=100)
        host.do("UPDATE")
        host.look(5, 8 * MS)
        host.close()


for _mode, _zero in (
    ("trap", "acc"), ("trap", "vel"), ("s_crv", "vel"), ("s_crv", "max_acc"), ("s_crv", "jerk"),
):  # fmt: skip
    cannot_move(_mode, _zero)


@freeze(
    "mc1241a-velocity-zero-in-motion",
    pmd(),
    "a trapezoid whose velocity is set to 0 while it moves, then not 0 again",
)
def _(board: Board) -> None:
    host = Pmd(board)
    host.begin()
    host.set(prfl_trap=0, vel=6 << 16, acc=0x4000, pos=900)
    host.do("UPDATE")
    host.look(3, 6 * MS)
    host.set(vel=0)
    host.do("UPDATE")
    host.look(8, 6 * MS)
    host.set(vel=6 << 16)
    host.do("UPDATE")
    host.look(8, 6 * MS)
    host.close()


@freeze(
    "mc1241a-breakpoints",
    pmd(),
    "breakpoints of every kind, each updating a new velocity",
    ("x.~HostIntrpt",),
)
def _(board: Board) -> None:
    host = Pmd(board)
    host.begin()
    host.set(intrpt_mask=0x04, prfl_trap=0, vel=4 << 16, acc=0x4000, pos=5000)
    host.do("UPDATE")
    for kind, value in (
        ("time", 120), ("pos", 400), ("actl_pos", 700), ("neg", 0), ("actl_neg", -100), ("ext", 0),
        ("mtn_cmplt", 0),
    ):  # fmt: skip
        if kind == "neg":
            host.set(pos=-5000)
            host.do("UPDATE")
        if kind == "mtn_cmplt":
            host.set(pos=host.do("GET_TRGT_POS"))
            host.do("UPDATE")
        base = host.do("GET_TIME") if kind == "time" else 0
        host.set(brk_pnt=base + value, vel=5 << 16)
        host.set(**{f"{kind}_brk": 0})
        host.look(8, 9 * MS)
        if kind == "ext":
            host.pulse("~Home1", 0, 50 * US)
            host.look(2)
        host.do("GET_INTRPT")
        host.do("RST_INTRPT", 0)
        host.do("RST_STATUS", 0)
    host.close()


@freeze(
    "mc1241a-no-auto-update",
    pmd(),
    "a breakpoint that does not update, then an update by hand; two axes together",
)
def _(board: Board) -> None:
    host = Pmd(board)
    host.begin()
    host.set(auto_update_off=0, prfl_trap=0, vel=4 << 16, acc=0x4000, pos=200, brk_pnt=60)
    host.do("UPDATE")
    host.set(pos_brk=0, pos=-50)
    host.look(6, 6 * MS)
    host.do("SET_2")
    host.set(step_ratio=0x0100, buf_mtr_cmd=0x4000, prfl_trap=0, vel=2 << 16, acc=0x2000, pos=90)
    host.do("MULTI_UPDATE", 3)
    host.look(6, 8 * MS)
    host.do("SET_1")
    host.look(3)
    host.close()


@freeze(
    "mc1241a-limits-and-home",
    pmd(plant=WITH_SWITCHES),
    "limit switches both ways, their sense, home captured",
)
def _(board: Board) -> None:
    host = Pmd(board)
    host.begin()
    host.do("LMTS_ON")
    host.set(capt_home=0, prfl_trap=0, vel=8 << 16, acc=0x8000, pos=400)
    host.do("UPDATE")
    host.look(10, 5 * MS)
    host.do("GET_CAPT")
    host.do("GET_LMT_SWTCH")
    host.do("GET_HOME")
    host.do("RST_STATUS", 0)
    host.set(pos=500)
    host.do("UPDATE")
    host.look(2)
    host.set(pos=-400)
    host.do("UPDATE")
    host.look(10, 8 * MS)
    host.do("RST_STATUS", 0)
    host.do("LMTS_OFF")
    host.set(pos=-200)
    host.do("UPDATE")
    host.look(4, 5 * MS)
    host.set(lmt_sense=0x0F)
    host.do("GET_LMT_SWTCH")
    host.do("LMTS_ON")
    host.look(3)
    host.close()


@freeze(
    "mc1241a-capture-index",
    pmd(plant=COARSE),
    "the index captures the actual position of a stepper's encoder",
)
def _(board: Board) -> None:
    host = Pmd(board)
    host.begin(0x7FFF)
    host.set(step_ratio=0x0010, capt_index=0, prfl_trap=0, vel=30 << 16, acc=0x8000, pos=8000)
    host.do("UPDATE")
    host.look(10, 9 * MS)
    host.do("GET_CAPT")
    host.do("RST_STATUS", 0)
    host.set(pos=0)
    host.do("UPDATE")
    host.look(10, 9 * MS)
    host.do("GET_CAPT")
    host.close()


@freeze(
    "mc1241a-motion-error",
    pmd(plant=OVERLOADED + "encoder_lines = 50\n"),
    "a stall: motion error with automatic stop off, then on",
)
def _(board: Board) -> None:
    host = Pmd(board)
    host.begin(0x2000)
    host.do("SET_AUTO_STOP_OFF")
    host.set(step_ratio=0x0010, pos_err=10, prfl_trap=0, vel=20 << 16, acc=0x8000, pos=4000)
    host.do("UPDATE")
    host.look(5, 6 * MS)
    host.do("GET_ACTL_POS_ERR")
    host.do("RST_STATUS", 0)
    host.do("SET_AUTO_STOP_ON")
    host.look(5, 6 * MS)
    host.do("MTR_ON")
    host.look(2)
    host.close()


@freeze("mc1241a-wrap", pmd(), "positions over the end of 31 bits, both ways")
def _(board: Board) -> None:
    host = Pmd(board)
    host.begin()
    host.set(actl_pos=0x3FFFFFC0, prfl_vel=0, vel=6 << 16, acc=0x8000)
    host.do("UPDATE")
    host.look(8, 4 * MS)
    host.do("RST_STATUS", 0)
    host.set(acc=-0x8000)
    host.do("UPDATE")
    host.look(12, 4 * MS)
    host.close()


@freeze(
    "mc1241a-pwm",
    pmd(plant=MICROSTEPPER),
    "microsteps as PWM: every edge of both phases",
    ("x.PWMMag1A", "x.PWMSign1A", "x.PWMMag1B", "x.PWMSign1B"),
    going_on=40,
)
def _(board: Board) -> None:
    host = Pmd(board)
    host.set(output_pwm=0)
    host.begin()
    host.set(prfl_trap=0, vel=20 << 16, acc=0x8000, pos=300)
    host.do("UPDATE")
    host.look(3, 2 * MS)
    host.close()


@freeze(
    "mc1241a-dac",
    pmd(plant=MICROSTEPPER, extra='phase_b = "lags"'),
    "microsteps as DAC words, two and three phases",
    ("x.DAC16Addr0-1", "x.Data0-11", "x.DACLow0-3"),
    going_on=80,
)
def _(board: Board) -> None:
    host = Pmd(board)
    host.set(output_dac16=0)
    host.begin()
    host.set(prfl_trap=0, vel=20 << 16, acc=0x8000, pos=300)
    host.do("UPDATE")
    host.look(4, 2 * MS)
    host.do("SET_PHASE_3")
    host.do("GET_PHASE_INFO")
    host.do("GET_OUTPUT_MODE")
    host.look(3, 2 * MS)
    host.close()


@freeze(
    "mc1241a-buffered-motor-command", pmd(), "the buffered motor command, in force with an update"
)
def _(board: Board) -> None:
    host = Pmd(board)
    host.do("SET_1")
    for value in (0x1000, -0x2000, 0x7FFF):
        host.set(buf_mtr_cmd=value)
        host.do("GET_MTR_CMD")
        host.do("GET_BUF_MTR_CMD")
        host.do("UPDATE")
        host.delay(2 * MS)
        host.do("GET_MTR_CMD")
    host.do("MTR_OFF")
    host.look(2)
    host.do("MTR_ON")
    host.look(2)
    host.close()


@freeze(
    "mc1241a-direct-motor-command",
    pmd(),
    "SET_MTR_CMD with updates behind it, alone and after SET_BUF_MTR_CMD",
)
def _(board: Board) -> None:
    host = Pmd(board)
    host.do("SET_1")
    host.set(mtr_cmd=0x3000)
    host.do("GET_MTR_CMD")
    host.do("UPDATE")
    host.delay(2 * MS)
    host.do("GET_MTR_CMD")
    host.set(buf_mtr_cmd=0x1000, mtr_cmd=0x2000)
    host.do("UPDATE")
    host.delay(2 * MS)
    host.do("GET_MTR_CMD")
    host.do("UPDATE")
    host.delay(2 * MS)
    host.do("GET_MTR_CMD")
    host.close()


@freeze("mc1241a-after-reset", pmd(), "all that can be read after reset; an update of nothing")
def _(board: Board) -> None:
    host = Pmd(board)
    for axis in ("SET_1", "SET_2"):
        host.do(axis)
        for _ in range(2):
            for command in COMMANDS:
                if command.read and not command.write and command.name != "GET_VRSN":
                    host.do(command.name)
            host.do("UPDATE")
            host.delay(2 * MS)
    host.close()


@freeze(
    "mc1241a-checksums", pmd(), "the checksum of each packet, also of illegal and reserved codes"
)
def _(board: Board) -> None:
    host = Pmd(board)
    for command in COMMANDS:
        if command.name not in ("RESET", "GET_VRSN"):
            host.do(command.name, 0x00012345)
            host.ready()
            host.read(0)
            host.read(0)
    for code in (0x00, 0x49, 0x9A):
        host.send(code)
        host.ready()
        host.read(0)
        host.read(0)
    host.close()


@freeze("mc1241a-version", pmd(), "the version word and the time")
def _(board: Board) -> None:
    host = Pmd(board)
    host.do("GET_VRSN")
    host.do("GET_TIME")
    host.close()


@freeze("mc1141a-version", pmd("MC1141A"), "the version word of the part with one axis")
def _(board: Board) -> None:
    host = Pmd(board)
    host.do("GET_VRSN")
    host.do("SET_2")
    host.do("GET_STATUS")
    host.close()


@freeze("mc1141a-trapezoid", pmd("MC1141A", MICROSTEPPER), "the part with one axis moves a stepper")
def _(board: Board) -> None:
    host = Pmd(board)
    host.begin(0x6000)
    host.set(prfl_trap=0, vel=5 << 16, acc=0x4000, pos=150)
    host.do("UPDATE")
    host.look(8, 8 * MS)
    host.close()


@freeze(
    "mc1241a-parameter-ranges", pmd(), "every parameter with all bits set, with none, and read back"
)
def _(board: Board) -> None:
    host = Pmd(board)
    host.do("SET_1")
    for name in (
        "pos",
        "vel",
        "acc",
        "max_acc",
        "jerk",
        "ratio",
        "brk_pnt",
        "intrpt_mask",
        "pos_err",
        "buf_mtr_cmd",
    ):
        for value in (0xFFFFFFFF, 0x80000000, 0x7FFF7FFF, 0):
            host.set(**{name: value})
            host.do(f"GET_{name.upper()}")
    host.close()


@freeze(
    "mc1241a-setup-ranges",
    pmd(),
    "SET_STEP_RATIO, SET_START_VEL and SET_PHASE beyond their ranges and in motion",
)
def _(board: Board) -> None:
    host = Pmd(board)
    host.begin()
    for value in (0xFFFFFFFF, 0x80008000, 0x7FFF7FFF, 0x100, 0):
        host.set(step_ratio=value & 0xFFFF, start_vel=value)
        host.do("GET_STEP_RATIO")
        host.do("GET_START_VEL")
    for phase in ("SET_PHASE_2", "SET_PHASE_3"):
        host.do(phase)
        host.do("GET_PHASE_INFO")
    host.set(step_ratio=0x100, prfl_vel=0, vel=3 << 16, acc=0x4000)
    host.do("UPDATE")
    host.look(2, 3 * MS)
    host.set(step_ratio=0x200, start_vel=1 << 16)
    host.do("SET_PHASE_2")
    host.look(3, 3 * MS)
    host.do("GET_START_VEL")
    host.close()


@freeze(
    "mc1241a-command-errors",
    pmd(),
    "commands refused for the state of the axis; profiles changed in motion",
)
def _(board: Board) -> None:
    host = Pmd(board)
    host.begin()
    host.set(prfl_trap=0, vel=6 << 16, acc=0x4000, pos=600)
    host.do("UPDATE")
    host.delay(8 * MS)
    host.set(prfl_s_crv=0, max_acc=0x1000, jerk=0x01000000)
    host.do("UPDATE")
    host.look(3)
    host.set(prfl_vel=0)
    host.do("UPDATE")
    host.look(3, 4 * MS)
    host.set(prfl_trap=0)
    host.do("UPDATE")
    host.look(5, 8 * MS)
    host.do("CLR_STATUS")
    host.look(1)
    host.close()


def careless_pmd(host: Pmd) -> None:
    host.begin()
    for code in (0x00, 0x49, 0x22, 0x9A, 0x25):
        host.send(code, 1, write=1)
        host.send(code, read=1)
    host.write(1, 0x10)
    host.write(0, 0)
    host.write(0, 1)  # not ready
    host.ready()
    host.write(1, 0x31)  # cut short
    host.ready()
    host.write(0, 1)
    host.write(0, 1)
    host.ready()
    host.write(1, 0x12)
    host.ready()
    host.read(0)
    host.read(0)
    host.set(max_acc=0xFFFF, vel=0xFFFFFFFF, intrpt_mask=0x1FF, lmt_sense=0xFFFF)
    host.look(2)
    host.write(2, 0)
    host.delay(3 * MS)
    host.look(1)


@freeze(
    "mc1241a-violations-warn",
    pmd(),
    "illegal codes, packets cut short, words out of range; the adapter's reset",
)
def _(board: Board) -> None:
    host = Pmd(board)
    careless_pmd(host)
    host.close()


@freeze(
    "mc1241a-violations-strict",
    pmd(rules="strict", extra='family_codes = "noop"\nhost_busy = "slot"'),
    "the same with cycles lost; the servo chips' codes do nothing; ready at the next slot",
)
def _(board: Board) -> None:
    host = Pmd(board)
    careless_pmd(host)
    host.close()


@freeze("mc1241a-resets", pmd(power_on="reset"), "power-on, RESET and ~Reset in motion")
def _(board: Board) -> None:
    host = Pmd(board)
    for how in ("RESET", "~Reset"):
        host.delay(3 * MS)
        host.begin()
        host.set(prfl_vel=0, vel=6 << 16, acc=0x8000)
        host.do("UPDATE")
        host.look(3)
        if how == "RESET":
            host.do("RESET")
        else:
            host.pulse("~Reset", 0)
        host.delay(MS)
        host.read(1)
    host.delay(3 * MS)
    host.look(1)
    host.close()


@freeze("mc1241a-strobed", pmd(), "a host that moves the strobes: a whole move", ("x.HostRdy",))
def _(board: Board) -> None:
    host = StrobedPmd(board)
    host.begin()
    host.set(prfl_trap=0, vel=6 << 16, acc=0x4000, pos=100)
    host.do("UPDATE")
    host.look(3, 4 * MS)
    host.close()


@freeze(
    "mc1241a-strobed-too-fast", pmd(rules="strict"), "strobes too short, too close and forbidden"
)
def _(board: Board) -> None:
    host = StrobedPmd(board)
    for step in (100, 40, 15, 5, 0):
        strobes = Strobes(host.port, step * NS)
        for command in (1, 0):
            strobes.put(slct=0, cmd=command)
            strobes.drive(0x31)
            strobes.put(write=0)
            strobes.put(write=1)
            strobes.release()
            host.delay(200 * US)
            strobes.put(read=0)
            host.port.sample()
            strobes.put(write=0)
            strobes.put(write=1, read=1)
            strobes.put(slct=1, cmd=0)
            host.delay(200 * US)
    host.close()


@freeze("mc1241a-encoder-pins", pmd(plant=""), "the encoder, index and home as edges at the pins")
def _(board: Board) -> None:
    host = Pmd(board)
    host.begin()
    for number in range(120):
        turn = number if number < 70 else 140 - number
        host.pin("QuadA1", (0, 1, 1, 0)[turn % 4])
        host.pin("QuadB1", (0, 0, 1, 1)[turn % 4])
        host.pin("~Index1", 0 if turn % 20 == 16 else 1)
        host.delay((3 * US, US, 300 * NS)[number // 40])
        if number % 15 == 0:
            host.do("GET_ACTL_POS")
    host.do("GET_CAPT")
    host.look(1)
    host.close()


def pmd_moves(host: Pmd) -> None:
    host.begin()
    host.set(prfl_trap=0, vel=6 << 16, acc=0x4000, pos=120)
    host.do("UPDATE")
    host.look(6, 4 * MS)
    host.set(prfl_vel=0, acc=-0x4000)
    host.do("UPDATE")
    host.look(5, 4 * MS)


@freeze("mc1241a-slaved", pmd(plant=MICROSTEPPER, time="slaved"), "a host that stamps its requests")
def _(board: Board) -> None:
    host = Pmd(board)
    pmd_moves(host)
    host.close()


@freeze("mc1241a-realtime", pmd(plant=MICROSTEPPER, time="realtime"), "a run in real time")
def _(board: Board) -> None:
    host = Pmd(board)
    pmd_moves(host)
    host.close()
