"""Checked clients notice what their chip tells of what it has taken: one broken cycle at a time."""

import contextlib
from collections.abc import Callable

import pytest

from vbus.board.build import load_board_text
from vbus.campaign.account import Witness
from vbus.campaign.world import begin, read_world
from vbus.client import Bus
from vbus.client.lm628 import Lm628
from vbus.client.mc1241a import Mc1241a
from vbus.client.mcp1200 import PROFILE, VELOCITY, Mcp1200
from vbus.core.errors import NotReadyError, ReadBackError
from vbus.serve.in_process import connect_in_process
from vbus.testing.boards import of_part

Move = Callable[[Bus, bool], int]


def lm629(bus: Bus, checked: bool) -> int:
    """Load the filter and move."""
    axis = Lm628(bus, ready="wait", checked=checked)
    axis.load_filter(kp=300, kd=2000)
    return axis.move(50, acc=400, vel=4 << 16, longest="200ms")


def mcp1200(bus: Bus, checked: bool) -> int:
    """Load the filter and move."""
    axis = Mcp1200(bus, checked=checked)
    axis.feature(pid=True)
    axis.write_kp(64)
    axis.write_kd(64)
    axis.control()
    return axis.move(50, velocity=1024, acceleration=64, longest="200ms")


def run(part: str, move: Move, checked: bool, cycle: str = "", how: str = "") -> int:
    """Return where the axis is, on a board of its own, on which a cycle is broken.

    Args:
        part: the chip.
        move: the host.
        checked: whether its client is.
        cycle: how the cycle's group begins, as a campaign has it: the first such cycle.
        how: the way it is broken.
    """
    text = of_part(part).replace("[board]", '[board]\ntime = "lockstep"\npower_on = "done"')
    board = load_board_text(text)
    if cycle:
        witness = Witness(board, reference=True)
        with connect_in_process(board) as bus:
            move(bus, checked)
        seen = witness.account().seen
        number = next(row.number for row in seen if row.group.startswith(cycle))
        board = load_board_text(text)
        begin(board, read_world(f"cycle:x.{number}:{how}"))
    with connect_in_process(board) as bus:
        return move(bus, checked)


@pytest.mark.parametrize(("part", "move"), [("LM629N-8", lm629), ("MCP-1200", mcp1200)])
def test_a_checked_client_does_what_an_unchecked_one_does(part: str, move: Move) -> None:
    assert run(part, move, True) == pytest.approx(run(part, move, False), abs=2)
    assert run(part, move, True) == pytest.approx(50, abs=3)


@pytest.mark.parametrize(
    ("part", "move", "cycle", "how", "message"),
    [
        ("LM629N-8", lm629, "LFIL 1 of", "flip7", "packet 1Eh: status .*command error"),
        ("LM629N-8", lm629, "UDF", "flip7", "packet 04h: status .*command error"),
        ("LM629N-8", lm629, "LTRJ 1 of", "lost", "packet 1Fh: status .*command error"),
        ("LM629N-8", lm629, "LTRJ 7 of 7", "flip4", "ended at 34; 50 was asked for"),
        ("MCP-1200", mcp1200, "write FEATURE", "flip4", "R01H reads"),
        ("MCP-1200", mcp1200, "write CONFIG", "lost", "R02H reads"),
        ("MCP-1200", mcp1200, "write KP", "flip0", "R.* reads 41h after 40h was written"),
        ("MCP-1200", mcp1200, "write FINAL_POSITION 3", "lost", "reads 0h after 32h"),
    ],
)
def test_a_checked_client_raises_where_an_unchecked_one_says_nothing(
    part: str, move: Move, cycle: str, how: str, message: str
) -> None:
    with pytest.raises(ReadBackError, match=message):
        run(part, move, True, cycle, how)
    with contextlib.suppress(NotReadyError):
        run(part, move, False, cycle, how)


@pytest.mark.parametrize("checked", [True, False])
def test_a_move_that_a_limit_switch_has_ended_is_told(checked: bool) -> None:
    board = load_board_text(
        '[board]\ntime = "lockstep"\npower_on = "done"\n[chips.x]\npart = "MC1241A"\n'
        'clock = "25 MHz"\nplants = ["m"]\n[plants.m]\nmodel = "stepper"\n'
    )
    with connect_in_process(board) as bus:
        axis = Mc1241a(bus, ready="wait", checked=checked)
        axis.set_buf_mtr_cmd(24000)
        axis.set_step_ratio(40)
        board.faults.arm("limit_stuck", when="command UPDATE")
        told = pytest.raises(
            ReadBackError, match=r"the move has ended with status .*positive limit"
        )
        with told if checked else contextlib.nullcontext():
            axis.move(500, vel=15 << 16, acc=0x1000)


@pytest.mark.parametrize("ready", ["poll", "wait"])
def test_a_direction_in_velocity_mode_is_looked_at_when_it_is_in_use(ready: str) -> None:
    """RDSIGS gives the bits in use, and STT takes effect at the next sample."""

    def run_on(broken: bool) -> None:
        board = load_board_text(
            of_part("LM629N-8").replace("[board]", '[board]\ntime = "lockstep"\npower_on = "done"')
        )
        with connect_in_process(board) as bus:
            axis = Lm628(bus, ready=ready, checked=True)
            axis.load_filter(kp=300, kd=2000)
            if broken:
                board.faults.arm("byte_flipped", when="command LTRJ", mask=0x10, cycles="write")
            axis.load_trajectory(acc=400, vel=4 << 16, velocity_mode=True, start=True)

    run_on(broken=False)
    with pytest.raises(ReadBackError, match=r"signals register .*1800h must be set"):
        run_on(broken=True)


def test_flags_of_an_mcp_1200_are_read_back() -> None:
    board = load_board_text(of_part("MCP-1200").replace("[board]", '[board]\ntime = "lockstep"'))
    with connect_in_process(board) as bus:
        axis = Mcp1200(bus, checked=True)
        axis.reset()
        axis.set_flag(VELOCITY)
        axis.clear_flag(VELOCITY)
        axis.set_flag(PROFILE)
        board.faults.arm("strobe_lost", when="cycle 1", cycles="write")
        with pytest.raises(ReadBackError, match="flag F5 is not 1 in R00H"):
            axis.set_flag(VELOCITY)
