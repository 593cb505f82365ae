"""What a campaign runs, in one world at a time."""

import sys
from collections.abc import Awaitable, Callable
from typing import Any

import pytest

from tests.boards import BENCH
from tests.examples.boards import EXAMPLES
from vbus.board.build import build
from vbus.board.config import read_board_file, read_board_text
from vbus.boardfile.sections import HostSection
from vbus.campaign.account import Account, Witness
from vbus.campaign.plan import plan
from vbus.campaign.verdict import DETECTED, HANG, judge
from vbus.campaign.world import REFERENCE, read_world
from vbus.cli.hosted import at_rest, campaign_runs
from vbus.cli.hosted.campaign_runs import FunctionSubject, ProgramSubject
from vbus.cli.hosted.program import HostedProgram
from vbus.client import aio
from vbus.client.bus import Bus
from vbus.core.errors import TransportError

LINK_FAULTS = ("answer_lost", "half_answer", "answers_late", "link_dead", "link_closed")


def looks(bus: Bus) -> list[int]:
    """Look at the status ten times."""
    return [bus.read(0) for _ in range(10)]


async def awaited_looks(bus: aio.Bus) -> list[int]:
    """Look as often, for asyncio."""
    return [await bus.read(0) for _ in range(10)]


def asks_again(bus: Bus) -> None:
    """Look ten times, each until there is an answer."""
    for _ in range(10):
        while True:
            try:
                bus.read(0)
                break
            except TransportError:
                continue


def of(call: Callable[[Any], object | Awaitable[object]]) -> tuple[FunctionSubject, Account]:
    """Return what runs a function, and its reference run."""
    subject = FunctionSubject(*read_board_text(BENCH), call)
    return subject, subject.run(REFERENCE, None)


def test_a_function_for_asyncio_makes_the_same_run() -> None:
    assert of(awaited_looks)[1] == of(looks)[1]


@pytest.mark.parametrize("name", LINK_FAULTS)
@pytest.mark.parametrize("call", [looks, awaited_looks])
def test_a_fault_of_its_link_is_told_to_a_function_at_once(
    call: Callable[[Any], object], name: str
) -> None:
    """No wait is the wall clock's: the client gives up where no answer can come any more."""
    subject, reference = of(call)
    world = read_world(f"fault:host0@{reference.now // 2}:{name}")
    runs = [subject.run(world, reference) for _ in range(2)]
    assert runs[0] == runs[1]
    assert judge(reference, runs[0]).verdict == DETECTED
    said = "closed by the other end" if name == "link_closed" else "no reply to READ4 within 5 s"
    assert said in runs[0].errors
    assert runs[0].cycles < reference.cycles or name == "answers_late"


# What ends a function comes in vain where it strikes while garbage is collected, and comes again.
@pytest.mark.filterwarnings("ignore::pytest.PytestUnraisableExceptionWarning")
@pytest.mark.parametrize("name", LINK_FAULTS)
def test_a_function_that_asks_a_broken_link_again_and_again_hangs(
    name: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(campaign_runs, "POLLING", 0.1)
    subject, reference = of(asks_again)
    run = subject.run(read_world(f"fault:host0@{reference.now // 2}:{name}"), reference)
    assert judge(reference, run).verdict == HANG


def test_the_faults_of_a_link_that_can_be_tried_are_those_of_bytes_and_of_functions() -> None:
    file, source = read_board_text(BENCH)
    for reference in (of(looks)[1], Account(seen=of(looks)[1].seen)):
        made = plan(reference, file, build(file, source), only=("fault",))
        tried = {one.world.how for one in made.worlds} & {*LINK_FAULTS}
        assert tried == ({*LINK_FAULTS} if reference.links else set())
        assert "without messages" in made.refused["message_lost"]
        assert ("--host a function" in made.refused.get("answer_lost", "")) != reference.links


def test_firmware_has_failed_when_it_says_so() -> None:
    file, source = read_board_text(BENCH)
    host = HostSection(transport="")
    words = ["sh", "-c", "echo move: failed"]
    program = HostedProgram(file, source, host, lambda _: words)
    assert ProgramSubject(program).run(REFERENCE, None).code == 0
    run = ProgramSubject(program, "failed").run(REFERENCE, None)
    assert (run.code, run.output) == (1, "move: failed\n")


def test_sources_with_a_pin_map_that_compute_for_ever_are_ended(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(at_rest, "POLLING", 0.1)
    file, source = read_board_file(EXAMPLES / "lm629_stm32" / "board.toml")
    words = [sys.executable, "-c", "while True: pass"]
    program = HostedProgram(file, source, file.hosts[0], lambda _: words)
    short = Account(now=-900_000_000_000)  # 0.4 s of chip time
    run = ProgramSubject(program).run(REFERENCE, short)
    assert "it has computed for" in run.stuck


def test_a_card_of_parts_is_no_chip_of_a_campaign() -> None:
    file, source = read_board_file(EXAMPLES / "lm629_two_axes" / "wired_card.toml")
    board = build(file, source)
    reference = Witness(board, True).account()
    made = plan(reference, file, build(file, source))
    assert {one.world.where.partition("@")[0] for one in made.worlds if one.world.where} >= {"x"}
