"""The four-chip machine: the hash of a run without any network, and a folder to run it in."""

from collections.abc import Iterator
from pathlib import Path

import pytest

from tests.nodes.four_chips import BOARD, eight, eight_scenario, scenario
from tests.nodes.processes import Bench
from tests.waiting import PATIENCE
from vbus.board.config import read_board_text
from vbus.core.kernel import US
from vbus.nodes.machine import Machine
from vbus.nodes.plan import pins_of
from vbus.nodes.scenario import read_scenario
from vbus.serve.nodes import ordering


@pytest.fixture(scope="module")
def reference() -> str:
    """The hash of a run in a single process, without any network."""
    return hash_of(BOARD, scenario())


@pytest.fixture(scope="module")
def reference_of_eight() -> str:
    """The same of the machine of eight nodes."""
    return hash_of(eight(), eight_scenario())


def hash_of(board: str, script: str) -> str:
    """Run a machine in this process."""
    file, source = read_board_text(board)
    machine = Machine(file, source, read_scenario(script, "s", pins_of(file), US))
    machine.run()
    return machine.trace_hash()


@pytest.fixture
def bench(tmp_path: Path) -> Iterator[Bench]:
    made = Bench(tmp_path)
    yield made
    made.close()


@pytest.fixture(autouse=True)
def _patience(monkeypatch: pytest.MonkeyPatch) -> None:
    """Have a node take its time to answer: on a busy machine it may stand still for seconds."""
    monkeypatch.setattr(ordering, "ANSWER_SECONDS", PATIENCE)
