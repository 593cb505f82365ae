"""A cable between two computers is pulled for five seconds while their nodes keep one time."""

import re
import time
from collections.abc import Iterator
from pathlib import Path

import pytest

from tests.namespaces import Computers, computers
from tests.nodes.four_chips import BOARD, scenario
from tests.nodes.processes import Bench, ended
from vbus.board.config import read_board_text
from vbus.core.kernel import US
from vbus.nodes.machine import Machine
from vbus.nodes.plan import pins_of
from vbus.nodes.scenario import read_scenario

AWAY = 5.0
"""Seconds: longer than Zenoh's lease and the deadline of a node."""
PLACE = "tcp/10.77.0.1:7447"


@pytest.fixture
def place() -> Iterator[Computers]:
    with computers(1) as made:
        yield made


@pytest.fixture
def bench(tmp_path: Path, place: Computers) -> Iterator[Bench]:
    board = re.sub(r"\[nodes\..\]", '\\g<0>\ndeadline = "3 s"', BOARD)
    made = Bench(tmp_path, board, endpoint=PLACE)
    yield made
    made.close()


def started(bench: Bench, place: Computers, *options: str) -> None:
    """Start nodes on two computers, and wait until time has run for a while."""
    bench.start("ac", *options, disturb="1:20", inside=place.hub.run)
    bench.start("bd", *options, disturb="2:20", inside=place.around[0].run)
    bench.until(lambda: all(bench.node(name).get("round", 0) > 8 for name in "ab"))


def test_nodes_that_are_cut_off_name_each_other(bench: Bench, place: Computers) -> None:
    started(bench, place)
    place.around[0].cut()
    for process, others in zip(bench.started, ("bd", "ac"), strict=True):
        code, out = ended(process)
        assert code == 1, out
        # It is silent for its deadline, and its link is gone a moment later: who has stood still
        # in between, on a busy machine, hears of that first.
        said = "(has been silent for 3 s: it stalls or is|has died or was) cut off"
        assert re.match(f"vbus: node [{others}] {said}", out.splitlines()[-1]), out


def test_patient_nodes_go_on_when_the_cable_is_back_and_the_hash_stays(
    bench: Bench, place: Computers
) -> None:
    file, source = read_board_text(BOARD)
    machine = Machine(file, source, read_scenario(scenario(), "s", pins_of(file), US))
    machine.run()
    started(bench, place, "--patience", "60")
    place.around[0].cut()
    began = time.monotonic()
    bench.until(lambda: bench.node("a").get("others", {}).get("b") == "lost")
    rounds = [bench.node(name)["round"] for name in "abcd"]
    time.sleep(max(0.0, AWAY - (time.monotonic() - began)))
    # Time stands still on both sides: nobody runs beyond what was granted.
    assert (
        max(bench.node(name)["round"] - was for name, was in zip("abcd", rounds, strict=True)) < 2
    )
    place.around[0].mend()
    for process in bench.started:
        code, out = ended(process)
        assert code == 0, out
        assert "is back" in out
    assert bench.merged(["ac", "bd"]) == machine.trace_hash()
