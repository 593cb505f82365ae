"""What the summary of a run says of an axis that has not moved."""

from vbus.board.build import load_board_text
from vbus.board.host_bus import HostBus
from vbus.cli.outcome import AxisOutcomes
from vbus.core.kernel import MS, US

HEAD = '[board]\nname = "b"\ntime = "lockstep"\npower_on = "done"\n[chips.x]\n'
LM629 = HEAD + 'part = "LM629N-8"\nclock = "8 MHz"\nplant = "none"\n'
DC_MOTOR = '[plants.m]\nmodel = "dc_motor"\n'
IDEAL = '[plants.m]\nmodel = "ideal"\n'
MC1241A = HEAD + 'part = "MC1241A"\nclock = "25 MHz"\nplants = ["none"]\n'


def lm629(port: HostBus, code: int, *words: int) -> None:
    port.delay(100 * US)
    port.write(0, code)
    for word in words:
        port.delay(100 * US)
        port.write(1, word >> 8)
        port.write(1, word & 0xFF)


def pmd(port: HostBus, code: int, *words: int) -> None:
    port.delay(100 * US)
    port.write(1, code)
    for word in words:
        port.delay(100 * US)
        port.write(0, word >> 8)
        port.write(0, word & 0xFF)


def run(text: str, *commands: tuple[int, ...]) -> str:
    board = load_board_text(text)
    outcome = AxisOutcomes(board)
    board.observe(outcome)
    port = board.open_port("h")
    for command in commands:
        (lm629 if text == LM629 else pmd)(port, *command)
    for _ in range(20):
        port.delay(5 * MS)
        port.read(0)
    outcome.look()
    return outcome.lines()[0]


MOVE = ((0x1F, 0x002A, 0, 400, 1, 0, 0, 2), (0x01,))  # LTRJ, STT


def test_an_lm629_without_udf_says_that_its_filter_never_took_effect() -> None:
    said = run(LM629, (0x1E, 0x0008, 300), *MOVE)
    assert said.endswith(
        "did not move, its profile ran in vain: its filter has not taken effect: UDF has not"
        " followed LFIL"
    )
    assert "it has no filter: all coefficients are 0" in run(LM629, *MOVE)


def test_an_lm629_with_a_filter_says_nothing_of_it() -> None:
    said = run(LM629, (0x1E, 0x0008, 300), (0x04,), *MOVE)
    assert "filter" not in said


# SET_POS, SET_VEL, SET_ACC, UPDATE; SET_MTR_CMD
PROFILE = ((0x10, 0, 20), (0x11, 1, 0), (0x12, 0, 0x4000), (0x1A,))


def test_a_slow_start_is_no_profile_without_a_motor_command() -> None:
    """At 20/65536 count/sample/sample the filter finds no error for the first samples."""
    board = load_board_text(LM629.replace('plant = "none"', 'plant = "m"') + DC_MOTOR)
    port = board.open_port("h")
    lm629(port, 0x1E, 0x000A, 300, 2000)
    lm629(port, 0x04)
    lm629(port, 0x1F, 0x002A, 0, 20, 3, 0, 0, 2000)
    outcomes = AxisOutcomes(board)
    outcomes.watch()
    lm629(port, 0x01)
    for span, runs in ((500 * MS, True), (1500 * MS, False)):
        board.run_for(span)
        outcomes.look()
        (said,) = outcomes.lines()
        assert "motor command" not in said
        assert said.endswith(", its profile still ran then") is runs


def test_an_mc1241a_without_a_motor_command_says_so_of_a_profile_that_has_ended() -> None:
    said = run(MC1241A, *PROFILE)
    assert "its profile ran in vain: its motor command is 0" in said
    assert "SET_MTR_CMD sets it" in said
    assert "motor command" not in run(MC1241A, (0x62, 0x4000), *PROFILE)


def test_an_mcp1200_with_a_gain_of_0_says_that_its_profile_ran_without_a_motor_command() -> None:
    # LEAD_GAIN, FINAL_POSITION, PROFILE_VELOCITY, ACCELERATION; control mode, profile flag
    move = ((0x29, 0), (0x2A, 0x10), (0x2B, 0), (0x28, 0x08), (0x26, 0), (0x27, 0x20), (0x05, 0x03),
            (0x00, 0x08))  # fmt: skip
    said = []
    for gain in (0, 0x40):
        board = load_board_text(HEAD + 'part = "MCP-1200"\nclock = "10 MHz"\nplant = "none"\n')
        outcome = AxisOutcomes(board)
        board.observe(outcome)
        port = board.open_port("h")
        for address, data in ((0x22, gain), *move):
            port.write(address, data)
            port.delay(MS)
        for _ in range(50):
            port.delay(MS)
            port.read(7)
        said += outcome.lines()
    assert said[0].endswith("its profile ran while the motor command was 0")
    assert "motor command" not in said[1]


def test_an_axis_is_looked_at_while_its_host_sleeps() -> None:
    board = load_board_text(LM629.replace('plant = "none"', 'plant = "m"') + IDEAL)
    outcome = AxisOutcomes(board)
    outcome.watch()
    port = board.open_port("h")
    for command in ((0x1E, 0x0008, 300), (0x04,), (0x1F, 0x002A, 0, 400, 4, 0, 0, 3000), (0x01,)):
        lm629(port, *command)
    port.delay(2000 * MS)
    port.read(0)
    outcome.look()
    assert outcome.lines()[0].endswith(", at up to 4 (commanded 4) cnt/sample")
