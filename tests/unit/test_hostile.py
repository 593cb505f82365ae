"""Specimens of a hostile chip: what the manual leaves open; programs on a board, and their end."""

import sys
import time
from pathlib import Path

import pytest

from tests.waiting import until
from vbus.board.build import load_board_text
from vbus.board.config import read_board_text
from vbus.campaign.plan import specimens
from vbus.campaign.world import (
    SPECIMEN,
    World,
    extremes,
    possible,
    with_settings,
)
from vbus.core.kernel import SECOND
from vbus.plugins import chip_class
from vbus.testing.limits import Limits
from vbus.testing.programs import ProgramOutcome, run_program

BOARD = """\
[board]
name = "bench"
time = "lockstep"
seed = 3

[chips.x]
part = "LM629N-8"
clock = "8 MHz"
plant = "none"
"""
FEW = Limits(cycles=4000)


@pytest.mark.parametrize("world", [*specimens(read_board_text(BOARD)[0], 5, 40)], ids=str)
def test_every_specimen_is_a_board_file_without_mistakes_with_just_these_settings(
    world: World,
) -> None:
    file, _ = read_board_text(with_settings(BOARD, world))
    assert file.board.seed == (world.seed or 3)
    assert set(file.chips[0].settings) == {key for _, key, _ in world.settings}
    assert possible(file, world) == (not world.settings)
    assert possible(read_board_text(BOARD)[0], world)


def test_what_the_board_file_fixes_is_not_varied() -> None:
    file, _ = read_board_text(BOARD + 'busy = "worst"\n')
    assert "busy" not in {key for _, key, _ in extremes(file)}
    assert "reset_status" in {key for _, key, _ in extremes(file)}


@pytest.mark.parametrize("part", ["LM628N-6", "MCP-1200", "MC1141A"])
def test_every_extreme_of_every_chip_is_accepted_by_its_chip(part: str) -> None:
    clock = {"LM628N-6": "6 MHz", "MCP-1200": "2 MHz", "MC1141A": "25 MHz"}[part]
    text = f'[board]\nname = "b"\n[chips.x]\npart = "{part}"\nclock = "{clock}"\nplant = "none"\n'
    rows = [row for row in chip_class(part).OPTIONS if row.extremes]
    assert rows
    for row in rows:
        for value in row.extremes:
            assert value != row.default
            load_board_text(with_settings(text, World(SPECIMEN, "+0us", f"x.{row.name}={value}")))


# -- programs ----------------------------------------------------------------------------------

ENDLESS = "from vbus import connect\nb = connect('{link}')\nwhile True: b.read(0)"


def test_a_program_is_stopped_at_its_bound_of_bus_cycles() -> None:
    outcome = run_program(*read_board_text(BOARD), ["python", "-c", ENDLESS], FEW)
    assert outcome.stuck == "it made more than 4000 bus cycles"
    assert not outcome.ok


def test_a_program_is_stopped_at_its_bound_of_chip_time() -> None:
    limits = Limits(chip_time=SECOND)
    waits = ENDLESS.replace("b.read(0)", "b.delay(10**11); b.read(0)")
    outcome = run_program(*read_board_text(BOARD), ["python", "-c", waits], limits)
    assert outcome.stuck == "it was not done after 1 s of chip time"


def test_a_program_that_does_nothing_is_stopped_by_the_clock_on_the_wall() -> None:
    sleeps = ["python", "-c", "import time; print('here', flush=True); time.sleep(60)"]
    outcome = run_program(*read_board_text(BOARD), sleeps, Limits(wall=5.0))
    assert outcome.stuck.startswith("it was not done after 5 s of wall time; by then it had made 0")
    assert outcome.output == "here\n"


def test_exit_code_output_and_transcript_of_a_program_are_kept() -> None:
    code = (
        "import os, sys\nfrom vbus import connect\nb = connect(os.environ['VBUS_LINK'])\n"
        "b.delay(2 * 10**9)\nb.write(0, 0x02)\nprint(b.read(0) & 1)\nsys.exit(7)"
    )
    outcome = run_program(*read_board_text(BOARD), [sys.executable, "-c", code])
    assert (outcome.code, outcome.output, outcome.cycles) == (7, "1\n", 2)
    assert outcome.transcript[0] == "x DFH"
    assert outcome.now >= 2 * 10**9
    assert not outcome.ok


def test_a_program_finds_the_link_of_the_board_file_too() -> None:
    link = "unix:$VBUS_RUNTIME/first"
    text = f'{BOARD}\n[[hosts]]\ntransport = "{link}"\n'
    code = f"from vbus import connect\nb = connect('{link}')\nb.delay(2 * 10**9)\nprint(b.read(0))"
    outcome = run_program(*read_board_text(text), [sys.executable, "-c", code])
    assert (outcome.code, outcome.output, outcome.cycles) == (0, "132\n", 1)


def test_what_a_program_leaves_behind_ends_with_its_board() -> None:
    """It has the program's output open, and so the run would wait for it."""
    # Between fork and exec the child still has the name of the shell.
    begun = 'until [ "$(cat /proc/$!/comm)" = sleep ]; do :; done'
    leaves = ["sh", "-c", f"sleep 3600 & {begun}; echo $!"]
    outcome = run_program(*read_board_text(BOARD), leaves)
    assert (outcome.code, outcome.stuck) == (0, "")
    assert f"left behind: sleep (process {outcome.output.strip()})" in outcome.errors
    # Whose child it has become reaps it.
    left = Path(f"/proc/{outcome.output.strip()}")
    until(lambda: not left.exists(), "the end of what was left behind")


def test_a_program_that_does_nothing_ends_though_a_test_has_stopped_its_clock(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(time, "monotonic", lambda: 0.0)
    outcome = run_program(*read_board_text(BOARD), ["sh", "-c", "kill -STOP $$"], Limits(wall=0.1))
    assert outcome.stuck.startswith("it was not done after 0.1 s of wall time")


def test_a_program_works_from_a_test_that_is_a_coroutine() -> None:
    import asyncio

    async def test() -> ProgramOutcome:
        return run_program(*read_board_text(BOARD), ["python", "-c", "print(1)"])

    assert asyncio.run(test()).output == "1\n"
