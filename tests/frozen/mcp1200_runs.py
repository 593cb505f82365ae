"""MCP-1200: what the frozen runs do."""

from tests.frozen.hosts import (
    DC,
    FAST_DC,
    LOADED,
    OVERLOADED,
    STEPPER,
    WITH_SWITCHES,
    Mcp,
    StrobedMcp,
    Strobes,
    freeze,
    mcp,
)
from vbus.board.board import Board
from vbus.core.kernel import MS, NS, US


def profile(host: Mcp, final: int, velocity: int = 12, acceleration: int = 0x80) -> None:
    host.set(acceleration=acceleration, profile_velocity=velocity, final_position=final)
    host.flag(0)


@freeze(
    "mcp1200-position-lead",
    mcp(DC),
    "position control with the lead filter; increments and positions commanded",
)
def _(board: Board) -> None:
    host = Mcp(board)
    host.set(config=1)
    host.set(exception=0, lead_zero=0xE5, lead_pole=0x40, lead_gain=0x10, mode=3)
    for number in range(8):
        host.set(command_increment=(5, 20, -7, 60)[number % 4])
        host.look(3)
    host.set(command_position=-300)
    host.look(12)
    host.close()


@freeze(
    "mcp1200-position-pid",
    mcp(DC),
    "position control with PID, both ways, with integral",
    ("x.SIGN",),
)
def _(board: Board) -> None:
    host = Mcp(board)
    host.begin()
    host.set(ki=6, integral_limit=0x2000)
    for position in (40, 300, -100):
        host.set(command_position=position)
        host.look(10)
    host.close()


@freeze(
    "mcp1200-integral-limit",
    mcp("", 'drive = "dac"'),
    "the integral limit lowered while the output is saturated; the motor held",
)
def _(board: Board) -> None:
    host = Mcp(board)
    host.set(config=1, exception=0, feature=8, kp=0, ki=255, kd=0)
    host.set(command_position=1000, mode=3)
    host.look(8)
    host.set(integral_limit=100)
    host.look(6)
    host.close()


@freeze(
    "mcp1200-feed-forward",
    mcp(DC),
    "velocity and acceleration feed-forward, a command feed-forward",
)
def _(board: Board) -> None:
    host = Mcp(board)
    host.begin()
    host.set(kv=30, ka=40)
    profile(host, 400)
    host.look(14)
    host.set(feed_forward=0x0180)
    host.look(8)
    host.close()


@freeze(
    "mcp1200-trapezoid",
    mcp(),
    "trapezoids with and without a plateau, both ways, with fractions",
    ("x.PROF",),
)
def _(board: Board) -> None:
    host = Mcp(board)
    host.begin()
    for final, velocity, acceleration in (
        (400, 12, 0x80), (410, 200, 0x37), (-500, 25, 0x155), (-501, 3, 0x100), (90, 255, 0x4000),
    ):  # fmt: skip
        profile(host, final, velocity, acceleration)
        host.look(14, 2 * MS)
    host.close()


@freeze(
    "mcp1200-trapezoid-on-the-fly",
    mcp(),
    "final position, velocity and acceleration changed while it moves",
)
def _(board: Board) -> None:
    host = Mcp(board)
    host.begin()
    profile(host, 600)
    host.look(6)
    host.set(final_position=900)
    host.look(6)
    host.set(profile_velocity=20)
    host.look(4)
    host.set(acceleration=0x100, profile_velocity=6)
    host.look(4)
    host.set(final_position=300)
    host.look(20, 2 * MS)
    host.flag(0, False)
    host.look(3)
    host.close()


@freeze(
    "mcp1200-trapezoid-back-through-rest",
    mcp(),
    "a final position just behind, while the velocity is 0 on the way; both mirror images",
)
def _(board: Board) -> None:
    host = Mcp(board)
    host.begin()
    for sign in (-1, 1):
        host.set(acceleration=0x100, profile_velocity=1, final_position=sign * 100_000)
        host.flag(0)
        host.look(6)
        host.set(profile_velocity=0)
        host.look(3)
        command = host.get("COMMAND_POSITION")
        command -= 1 << 24 if command & 0x800000 else 0
        host.set(final_position=command + sign * 43, profile_velocity=1)
        host.look(10)
        host.set(profile_velocity=4)
        host.look(14, 4 * MS)
    host.close()


@freeze(
    "mcp1200-s-curve", mcp(), "S-curves with and without plateaus, with and without a remainder"
)
def _(board: Board) -> None:
    host = Mcp(board)
    host.begin(features=0x10)
    for final, velocity, acceleration, jerk in (
        (640, 12, 0x80, 0x1000), (643, 40, 0x80, 0x2000), (100, 30, 0x200, 0x0800),
        (-1903, 16, 0x40, 0x0400),
    ):  # fmt: skip
        host.set(jerk=jerk)
        profile(host, final, velocity, acceleration)
        host.look(16, 3 * MS)
    host.close()


@freeze("mcp1200-s-curve-on-the-fly", mcp(), "an S-curve made longer, then shorter, then left")
def _(board: Board) -> None:
    host = Mcp(board)
    host.begin(features=0x10)
    host.set(jerk=0x0800)
    profile(host, 800, 10, 0x60)
    host.look(8)
    host.set(final_position=1200)
    host.look(16)
    host.set(final_position=700)
    host.look(24)
    profile(host, 0, 10, 0x60)
    host.look(10)
    host.flag(0, False)
    host.look(4)
    host.close()


@freeze(
    "mcp1200-integral-velocity", mcp(DC), "integral velocity in 8 bits, both ways, goals far apart"
)
def _(board: Board) -> None:
    host = Mcp(board)
    host.begin()
    host.set(acceleration=0x80, velocity_command=5)
    host.flag(5)
    host.look(8)
    for goal in (9, -6, -100, 60, 0):
        host.set(velocity_command=goal)
        host.look(7)
    host.flag(5, False)
    host.look(3)
    host.close()


@freeze(
    "mcp1200-integral-velocity-high",
    mcp(),
    "integral velocity in high resolution, cut off in motion",
)
def _(board: Board) -> None:
    host = Mcp(board)
    host.begin(features=0x20)
    host.set(acceleration=0x0C, velocity=0x0233)
    host.flag(5)
    host.look(10)
    host.set(velocity=-0x0777)
    host.look(14)
    host.set(acceleration=0)
    host.look(3)
    host.flag(5, False)
    host.look(3)
    host.close()


@freeze(
    "mcp1200-velocity-to-trapezoid",
    mcp(),
    "from velocity mode to a trapezoid within one sample, and one sample apart",
)
def _(board: Board) -> None:
    host = Mcp(board)
    host.begin()
    for apart in (False, True):
        host.set(acceleration=0x200, velocity_command=20, profile_velocity=30)
        host.flag(5)
        host.look(10)
        host.set(final_position=host.get("COMMAND_POSITION") + 900)
        if apart:
            host.flag(5, False)
            host.delay(MS)
            host.flag(0)
        else:
            host.flag(0)
            host.flag(5, False)
        host.look(14, 3 * MS)
    host.close()


@freeze(
    "mcp1200-position-interpolation",
    mcp(),
    "position interpolation, segments of changing length",
    ("x.PROF",),
)
def _(board: Board) -> None:
    host = Mcp(board)
    host.begin()
    host.set(capture_control=0x40, interpolator_preset=3, final_position=100)
    host.flag(3)
    for position, preset in ((250, 3), (240, 3), (-60, 2), (-61, 2), (500, 4)):
        while host.read(0x03) & 0x80:
            host.read(0x19)
            host.delay(MS)
        host.set(interpolator_preset=preset, final_position=position)
        host.look(4)
    host.look(8)
    host.flag(3, False)
    host.look(2)
    host.close()


@freeze("mcp1200-velocity-interpolation", mcp(), "velocity interpolation, both ways, to a stand")
def _(board: Board) -> None:
    host = Mcp(board)
    host.begin(features=0x20)
    host.set(interpolator_preset=3, velocity=0x0300)
    host.flag(4)
    for velocity in (0x0500, -0x0200, -0x0211, 0):
        while host.read(0x03) & 0x80:
            host.delay(MS)
        host.set(velocity=velocity)
        host.look(5)
    host.look(6)
    host.flag(4, False)
    host.look(2)
    host.close()


@freeze(
    "mcp1200-interpolation-single-byte",
    mcp(),
    "one byte of the final position written while the interpolator is not busy",
)
def _(board: Board) -> None:
    host = Mcp(board)
    host.begin()
    host.set(interpolator_preset=1, final_position=0x000110)
    host.flag(3)
    host.look(8)
    host.write(0x2A, 0x02)
    host.look(8)
    host.write(0x2A, 0x00)
    host.look(6)
    host.flag(3, False)
    host.close()


@freeze(
    "mcp1200-capture",
    mcp(FAST_DC),
    "the actual position captured by index and by TRIG, latches cleared",
    ("x.TRIG",),
)
def _(board: Board) -> None:
    host = Mcp(board)
    host.begin()
    host.set(capture_control=0x10)
    profile(host, 300)
    host.look(10, 2 * MS)
    host.get("CAPTURE")
    host.set(capture_control=0x36)
    profile(host, 0)
    host.look(4)
    host.pulse("TRIG", 0)
    host.look(3)
    host.get("CAPTURE")
    host.pulse("INDEX", 0)
    host.look(6, 2 * MS)
    host.get("CAPTURE")
    host.close()


@freeze(
    "mcp1200-breakpoint",
    mcp(),
    "a breakpoint reported, and one that decelerates",
    ("x.TRIG", "x.PROF"),
)
def _(board: Board) -> None:
    host = Mcp(board)
    host.begin()
    host.set(config=0x11, breakpoint=100)
    profile(host, 300)
    host.look(12, 2 * MS)
    host.set(status=0, breakpoint=420, exception=0x20)
    profile(host, 600)
    host.look(12, 2 * MS)
    host.set(status=0)
    host.look(2)
    host.close()


@freeze(
    "mcp1200-polled-closely",
    mcp(),
    "status, flags and position read every two clocks, odd and even, around breakpoints",
    going_on=4000,
)
def _(board: Board) -> None:
    host = Mcp(board)
    host.begin()
    host.set(config=0x11)
    close = Mcp(board, "close", cycle=250 * NS)
    for target in (30, 60):
        host.set(breakpoint=target - 20, status=0)
        profile(host, target, 12, 0x400)
        close.delay(MS + 125 * NS)
        for _ in range(10_000):
            if not close.read(0x07) & 0x20:
                break
        for address in (0x00, 0x14):
            for _ in range(800):
                close.read(address)
        host.delay(8 * MS)
    close.close()
    host.close()


@freeze(
    "mcp1200-step-breakpoint",
    mcp(STEPPER),
    "step mode: a breakpoint at a step, both ways",
    ("x.TRIG", "x.PULSE"),
)
def _(board: Board) -> None:
    host = Mcp(board)
    host.set(config=0x13)
    host.set(exception=0, step_width=0x0F, breakpoint=57, mode=3)
    host.delay(2 * MS)
    for target, code in ((120, 0x33), (0, 0x33), (90, 0x13)):
        profile(host, target, 10, 0x100)
        host.look(10)
        host.set(config=code, status=0)
    host.close()


@freeze(
    "mcp1200-registers", mcp(), "every address after reset, with bits set, and read back, in idle"
)
def _(board: Board) -> None:
    host = Mcp(board)
    host.set(config=0x01)
    for value in (None, 0x5A, 0xA5, 0xFF):
        for address in range(0x80):
            if value is not None and address not in (0x02, 0x05):
                host.write(address, value)
        for address in range(0x80):
            host.read(address)
    host.close()


@freeze(
    "mcp1200-breakpoint-repeat",
    mcp(),
    "a breakpoint again and again, left in the middle",
    ("x.TRIG",),
)
def _(board: Board) -> None:
    host = Mcp(board)
    host.begin()
    host.set(breakpoint=25, config=0x31)
    profile(host, 300)
    host.look(10, 2 * MS)
    host.set(status=0)
    host.look(4, 2 * MS)
    host.set(config=0x01)
    profile(host, 0)
    host.look(8, 2 * MS)
    host.close()


@freeze(
    "mcp1200-backlash-deadband",
    mcp(LOADED),
    "backlash compensation at each reversal, and a deadband",
)
def _(board: Board) -> None:
    host = Mcp(board)
    host.begin()
    host.set(backlash=12)
    for final in (100, 40, 160):
        profile(host, final)
        host.look(8, 2 * MS)
    host.set(backlash=0, deadband=9)
    for position in (165, 180, 178):
        host.set(command_position=position)
        host.look(6)
    host.close()


@freeze(
    "mcp1200-step-mode",
    mcp(STEPPER, power_on="reset"),
    "step mode with a stepper: every step and its direction",
    ("x.PULSE", "x.SIGN"),
)
def _(board: Board) -> None:
    host = Mcp(board)
    host.delay(MS)
    host.set(config=0x03)
    host.set(exception=0, step_width=0x0F, mode=3)
    host.delay(2 * MS)
    profile(host, 200, 10, 0x100)
    host.look(10, 2 * MS)
    host.set(config=0x07, step_width=3)
    profile(host, 20, 10, 0x100)
    host.look(10, 2 * MS)
    host.close()


@freeze(
    "mcp1200-step-stall",
    mcp(OVERLOADED),
    "step mode: the encoder tells of a stall; a sample with too many steps",
)
def _(board: Board) -> None:
    host = Mcp(board)
    host.set(config=0x03)
    host.set(exception=0x00, encoder_ratio=0x0A00, mode=3)
    host.delay(2 * MS)
    profile(host, 400, 8, 0x80)
    host.look(12, 2 * MS)
    host.set(status=0, exception=0x40, step_width=0xFF)
    profile(host, 4000, 200, 0x4000)
    host.look(6)
    host.close()


@freeze(
    "mcp1200-exceptions",
    mcp(),
    "/STOP and /LIMIT, maximum error and a forced exception, with each action of R04",
    ("x.IDLE",),
)
def _(board: Board) -> None:
    host = Mcp(board)
    for action in range(4):
        host.begin()
        for pin, code in (("/STOP", action << 2), ("/LIMIT", action), ("", action)):
            host.set(exception=code, status=0, acceleration=0x100, velocity_command=6, mode=3)
            host.delay(2 * MS)
            host.flag(5)
            host.look(4)
            if pin:
                host.pulse(pin, 0, 2 * MS)
            else:
                host.set(forced_exception=action)
                host.delay(2 * MS)
                host.set(forced_exception=0)
            host.look(3)
            host.flag(5, False)
    host.close()


@freeze(
    "mcp1200-maximum-error",
    mcp('model = "dc_motor"\nstop_low = -1000\nstop_high = 60'),
    "an end stop: the maximum error takes the motor off",
)
def _(board: Board) -> None:
    host = Mcp(board)
    host.begin()
    host.set(max_error=80, exception=0x40)
    profile(host, 400)
    host.look(14)
    host.set(status=0, command_position=0, mode=3)
    host.look(4)
    host.close()


@freeze(
    "mcp1200-limit-in-control",
    mcp(WITH_SWITCHES.replace('"high"', '"low"')),
    "limit switches of the axis in control mode, reported only",
)
def _(board: Board) -> None:
    host = Mcp(board)
    host.begin()
    profile(host, 260, 30, 0x400)
    host.look(10)
    host.set(status=0)
    profile(host, 0, 30, 0x400)
    host.look(10)
    host.set(status=0)
    host.look(2)
    host.close()


@freeze(
    "mcp1200-limit-in-idle",
    mcp("", 'drive = "dac"'),
    "/LIMIT while outputs are set by hand in idle, for each action of R04",
    ("x.PULSE", "x.SIGN"),
    going_on=60,
)
def _(board: Board) -> None:
    host = Mcp(board)
    host.set(config=1)
    for action in range(4):
        host.set(exception=action, mode=1, motor_command=0xC0, pwm_command=0x30)
        host.delay(MS)
        host.pin("/LIMIT", 0)
        host.look(2)
        host.set(motor_command=0xD0, pwm_command=0x20)
        host.look(2)
        host.pin("/LIMIT", 2)
        host.set(status=0)
        host.look(2)
    host.close()


@freeze("mcp1200-in-position-in-idle", mcp(), "the in-position flag around going idle and back")
def _(board: Board) -> None:
    host = Mcp(board)
    host.begin()
    profile(host, 200)
    host.look(6)
    host.set(mode=1)
    host.look(6)
    host.set(preset_position=30)
    host.look(4)
    host.set(mode=3)
    host.look(4)
    host.set(mode=2)
    host.look(4)
    host.close()


@freeze(
    "mcp1200-pwm",
    mcp(DC),
    "every edge of PULSE and SIGN, at several resolutions, with bias",
    ("x.PULSE", "x.SIGN"),
    going_on=100,
)
def _(board: Board) -> None:
    host = Mcp(board)
    host.begin()
    for resolution in (0, 4, 8):
        host.set(encoder_pwm=resolution, command_position=40 * resolution - 60)
        host.look(4)
    host.set(config=0x81)
    host.look(3)
    host.set(config=0x41, command_position=0)
    host.look(3)
    host.close()


@freeze(
    "mcp1200-dac",
    mcp(DC, 'drive = "dac"'),
    "every value of the DAC, with offset and a diagnostic output",
    ("x.MC0-MC11",),
)
def _(board: Board) -> None:
    host = Mcp(board)
    host.begin()
    host.set(dac_offset=5)
    profile(host, 200)
    host.look(8)
    host.set(feature=0x88)
    host.look(4)
    host.set(feature=0x48, command_position=0)
    host.look(6)
    host.close()


@freeze(
    "mcp1200-unipolar",
    mcp(DC),
    "unipolar outputs: a command of either sign",
    ("x.SIGN", "x.PULSE"),
    going_on=60,
)
def _(board: Board) -> None:
    host = Mcp(board)
    host.begin(features=0x04)
    for position in (50, -50, 10):
        host.set(command_position=position)
        host.look(4)
    host.set(mode=1, motor_command=0x40, pwm_command=-0x30)
    host.look(2)
    host.close()


@freeze(
    "mcp1200-sample-timer",
    mcp(),
    "sample times from short, with a timer error, to long; BUSY",
    ("x.BUSY",),
    going_on=120,
)
def _(board: Board) -> None:
    host = Mcp(board)
    host.begin()
    profile(host, 3000, 10, 0x40)
    for timer, prescaler in ((0x20, 0x3F), (0x10, 0x3F), (0x02, 0x3F), (0x40, 0x20), (0xFF, 0x3F)):
        host.set(prescaler=prescaler, sample_timer=timer, status=0)
        host.look(3)
    host.close()


@freeze("mcp1200-wrap", mcp(), "positions over the end of 24 bits, both ways")
def _(board: Board) -> None:
    host = Mcp(board)
    host.begin()
    host.set(mode=1)
    host.delay(2 * MS)
    host.set(preset_position=0x7FFFD0, mode=3)
    host.delay(2 * MS)
    host.set(acceleration=0x200, velocity_command=7)
    host.flag(5)
    host.look(8)
    host.set(velocity_command=-7)
    host.look(12)
    host.close()


@freeze(
    "mcp1200-resets", mcp(DC, power_on="reset"), "power-on, soft reset in motion, /RESET in motion"
)
def _(board: Board) -> None:
    host = Mcp(board)
    host.look(2, 20 * US)
    for soft in (True, False):
        host.begin()
        profile(host, 500)
        host.look(4)
        if soft:
            host.set(mode=0)
        else:
            host.pulse("/RESET", 0)
        host.look(4, 30 * US)
    host.close()


def careless_mcp(host: Mcp) -> None:
    host.begin()
    for address in (0x1E, 0x4E, 0x7F, 0x5A):
        host.read(address)
        host.write(address, 0x55)
    host.set(acceleration=0x100, velocity_command=100)
    host.flag(5)
    host.set(velocity_command=-100)
    host.pulse("/STOP", 0, 40 * NS)
    host.pulse("/SYNC", 0, 20 * NS)
    host.look(4)


@freeze(
    "mcp1200-violations-warn",
    mcp(clock="20 MHz"),
    "reserved addresses, velocities too far apart, short pulses",
)
def _(board: Board) -> None:
    host = Mcp(board)
    careless_mcp(host)
    host.close()


@freeze(
    "mcp1200-violations-strict", mcp(rules="strict"), "the same with cycles lost; cycles too close"
)
def _(board: Board) -> None:
    host = Mcp(board)
    careless_mcp(host)
    host.close()
    host = Mcp(board, cycle=300 * NS)
    host.look(2)
    host.close()


@freeze("mcp1200-strobed", mcp(DC), "a host that moves /ALE, /CS, /OE and R/W: a whole move")
def _(board: Board) -> None:
    host = StrobedMcp(board)
    host.begin()
    profile(host, 100)
    host.look(6, 3 * MS)
    host.close()


@freeze("mcp1200-strobed-too-fast", mcp(rules="strict"), "strobes too short and in forbidden order")
def _(board: Board) -> None:
    host = StrobedMcp(board)
    for step in (100, 20, 3, 1, 0):
        strobes = Strobes(host.port, step * NS)
        for rw in (0, 1):
            strobes.put(rw=rw)
            strobes.drive(0x20 + rw)
            strobes.put(ale=0)
            strobes.put(cs=0)
            strobes.put(ale=1)
            strobes.drive(step)
            strobes.put(oe=0)
            host.port.sample()
            strobes.put(cs=1)
            strobes.release()
            host.port.sample()
            strobes.put(oe=1)
    host.look(2)
    host.close()


@freeze(
    "mcp1200-encoder-pins",
    mcp(""),
    "the encoder and the index as edges at the pins, with several filters",
)
def _(board: Board) -> None:
    host = Mcp(board)
    host.begin()
    host.set(capture_control=0x10)
    for number in range(120):
        if number % 40 == 0:
            host.set(encoder_pwm=(0x00, 0x30, 0x80)[number // 40])
        turn = number if number < 70 else 140 - number
        host.pin("CHA", (0, 1, 1, 0)[turn % 4])
        host.pin("CHB", (0, 0, 1, 1)[turn % 4])
        host.pin("INDEX", 0 if turn % 20 == 16 else 1)
        host.delay((600 * NS, 5 * US, 900 * NS)[number // 40])
        if number % 12 == 0:
            host.get("ACTUAL_POSITION")
    host.get("CAPTURE")
    host.close()


def mcp_moves(host: Mcp) -> None:
    host.begin()
    profile(host, 300)
    host.look(10, 2 * MS)
    host.set(velocity_command=-8)
    host.flag(5)
    host.look(6)
    host.pulse("/STOP", 0, 100 * US)
    host.look(4)


@freeze("mcp1200-slaved", mcp(DC, time="slaved"), "a host that stamps its requests")
def _(board: Board) -> None:
    host = Mcp(board)
    mcp_moves(host)
    host.close()


@freeze(
    "mcp1200-realtime",
    mcp(DC, "io_stall_clk = 3", time="realtime"),
    "a run in real time, with bus cycles that stall the core",
)
def _(board: Board) -> None:
    host = Mcp(board)
    mcp_moves(host)
    host.close()
