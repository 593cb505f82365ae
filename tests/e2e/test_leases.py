"""Leases and posted writes: the same polls, transcript and state on every way to the board."""

import subprocess
from pathlib import Path

import pytest

from tests.e2e.serving import served
from tests.unit.board.test_leases import Leasing, reset_and_move
from vbus.board.board import Board
from vbus.board.build import load_board_text
from vbus.client.bus import Bus, connect
from vbus.core.kernel import US
from vbus.serve.server import LinkSpec

Outcome = tuple[list[int], int, int, str, str]
"""Poll counts, chip time, read cycles, trace hash, state hash."""


def servo(policy: str = "lockstep") -> Board:
    board = load_board_text(
        f'[board]\ntime = "{policy}"\n[chips.x]\npart = "LM629N-8"\nclock = "8 MHz"\nplant = "m"\n'
        '[plants.m]\nmodel = "dc_motor"\n' + MOTOR
    )
    board.start_trace()
    return board


MOTOR = """
supply = "24 V"
resistance = "2 ohm"
torque_constant = "0.05 N*m/A"
inertia = "1e-5 kg*m^2"
"""


def outcome(board: Board, polls: list[int]) -> Outcome:
    trace = board.trace_hash()
    return polls, board.now, board.counters["reads"], trace, board.state_hash()


def in_process() -> Outcome:
    board = servo()
    port = board.open_port("host0")
    polls = reset_and_move(Leasing(port, False))
    port.close()
    return outcome(board, polls)


def by_c(
    program: Path, link: str, runtime: Path, *options: str, policy: str = "lockstep"
) -> Outcome:
    board = servo(policy)
    with served(board, LinkSpec(f"{link}:{runtime}/x", "byte")):
        done = subprocess.run(
            [str(program), f"{link}:{runtime}/x", *options],
            capture_output=True, text=True, timeout=60, check=False,
        )  # fmt: skip
        assert done.returncode == 0, done.stdout
    return outcome(board, [int(line) for line in done.stdout.split()])


@pytest.mark.parametrize("options", [(), ("posting",), ("leases",), ("leases", "posting")])
@pytest.mark.parametrize("link", ["unix", "pty"])
def test_a_driver_in_c_polls_as_often_as_one_in_process(
    polling_host: Path, link: str, options: tuple[str, ...], runtime: Path
) -> None:
    assert by_c(polling_host, link, runtime, *options) == in_process()


@pytest.mark.parametrize("link", ["unix", "pty"])
@pytest.mark.parametrize("options", [("leases",), ("leases", "posting")])
def test_a_slaved_driver_polls_as_often_with_leases(
    polling_host: Path, link: str, options: tuple[str, ...], runtime: Path
) -> None:
    plain = by_c(polling_host, "unix", runtime, "slaved", policy="slaved")
    assert by_c(polling_host, link, runtime, "slaved", *options, policy="slaved") == plain


@pytest.mark.parametrize("options", [("posting",), ("leases",), ("leases", "posting")])
@pytest.mark.parametrize("policy", ["lockstep", "slaved"])
def test_a_driver_that_sleeps_between_polls_keeps_its_leases(
    polling_host: Path, policy: str, options: tuple[str, ...], runtime: Path
) -> None:
    own = ("sleeps",) if policy == "lockstep" else ("sleeps", "slaved")
    plain = by_c(polling_host, "unix", runtime, *own, policy=policy)
    assert by_c(polling_host, "unix", runtime, *own, *options, policy=policy) == plain


def test_leases_save_a_slaved_driver_most_of_its_round_trips(
    polling_host: Path, runtime: Path
) -> None:
    plain = by_c(polling_host, "unix", runtime, "slaved", policy="slaved")
    leased = by_c(polling_host, "unix", runtime, "slaved", "leases", "posting", policy="slaved")
    assert leased == plain


class PythonHost:
    """The driver's bus, through the Python client."""

    def __init__(self, bus: Bus) -> None:
        self.bus = bus

    def read(self, address: int) -> int:
        return self.bus.read(address)

    def write(self, address: int, data: int) -> None:
        self.bus.write(address, data)


@pytest.mark.parametrize("posting", [False, True])
@pytest.mark.parametrize("leases", [False, True])
@pytest.mark.parametrize("link", ["unix", "pty"])
def test_a_driver_in_python_polls_as_often_as_one_in_process(
    link: str, leases: bool, posting: bool, runtime: Path
) -> None:
    board = servo()
    with served(board, LinkSpec(f"{link}:{runtime}/x", "byte")) as server:
        with connect(f"{link}:{runtime}/x") as bus:
            bus.leases(leases)
            bus.posting(posting)
            polls = reset_and_move(PythonHost(bus))  # type: ignore[arg-type]
            bus.posting(False)
            bus.echo()
        received = server.statistics()["counters"]["reads"]
        assert received == sum(polls)
    assert outcome(board, polls) == in_process()


def test_stamped_polls_of_the_python_client_are_told_of_many_at_a_time(runtime: Path) -> None:
    outcomes, sizes = [], []
    for leases in (False, True):
        board = servo("slaved")
        link = LinkSpec(f"unix:{runtime}/x", "byte")
        with served(board, link) as server, connect(f"unix:{runtime}/x") as bus:
            bus.leases(leases)
            bus.posting(True)
            polls = reset_and_move(SlavedPythonHost(bus))  # type: ignore[arg-type]
            bus.delay(5 * US)
            bus.echo()
            sizes.append(server.statistics()["links"][0]["received"])
        outcomes.append(outcome(board, polls))
    assert outcomes[0] == outcomes[1]
    assert sizes[1] < 0.6 * sizes[0], "4 bytes a poll, not 10"


class SlavedPythonHost(PythonHost):
    """A host with a clock of its own, whose polls are not evenly apart."""

    def __init__(self, bus: Bus) -> None:
        super().__init__(bus)
        self._clock = self._turn = 0

    def _tick(self) -> None:
        self._turn += 1
        self._clock += (3 * US // 2, 2 * US, 5 * US)[self._turn % 3]
        self.bus.at(self._clock)

    def read(self, address: int) -> int:
        self._tick()
        return super().read(address)

    def write(self, address: int, data: int) -> None:
        self._tick()
        super().write(address, data)


def test_the_python_client_asks_less_with_leases(runtime: Path) -> None:
    sizes = []
    for leases in (False, True):
        link = LinkSpec(f"unix:{runtime}/x", "byte")
        with served(servo(), link) as server, connect(f"unix:{runtime}/x") as bus:
            bus.leases(leases)
            bus.posting(True)
            reset_and_move(PythonHost(bus))  # type: ignore[arg-type]
            bus.echo()
            sizes.append(server.statistics()["links"][0]["received"])
    assert sizes[1] * 5 < sizes[0]


def test_a_delay_keeps_a_lease_of_the_python_client(runtime: Path) -> None:
    board = servo()
    with served(board, LinkSpec(f"unix:{runtime}/x", "byte")) as server:
        with connect(f"unix:{runtime}/x") as bus:
            bus.posting(True)
            bus.leases(True)
            assert bus.read(0) == 0
            before = server.statistics()["links"][0]["received"]
            assert [bus.read(0), bus.delay(3 * US), bus.read(0)] == [0, None, 0]
            assert server.statistics()["links"][0]["received"] == before
            bus.echo()
        assert board.now == 6 * US
        assert board.counters["reads"] == 3
