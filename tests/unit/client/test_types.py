"""What a type checker and an editor see of the client, whose calls are made at its import."""

import inspect
import pydoc
import re
import subprocess
import sys
from pathlib import Path

import pytest

from contrib.generate.targets import own_clients
from tests.unit.client.served import Served
from vbus.chips.lm628.host import Lm628Calls as AioCalls
from vbus.cli.generate.layout import stale
from vbus.client import Bus, aio, blocking, connect
from vbus.client.aio.lm628 import Lm628 as AioLm628
from vbus.client.lm628 import Lm628, Lm628Calls
from vbus.client.mcp1200 import Mcp1200

PROGRAM = """\
from typing import assert_type

from vbus import connect
from vbus.client import Bus, Chip, Message
from vbus.client.aio import connect as aio_connect
from vbus.client.aio.lm628 import Lm628 as AioLm628
from vbus.client.lm628 import Lm628
from vbus.client.mc1241a import Mc1241a
from vbus.client.mcp1200 import PROFILE, Mcp1200


def drive(where: str) -> None:
    with connect(where) as bus:
        assert_type(bus, Bus)
        assert_type(bus.chip("x"), Chip)
        axis = Lm628(bus, "x", ready="wait")
        axis.ltrj(0x2B, 0, 1)
        assert_type(axis.rdrp(), int)
        assert_type(axis.move(100, acc=1), int)
        assert_type(axis.bus, Bus)
        assert_type(Mcp1200(bus).read_actual_position(), int)
        Mcp1200(bus).set_flag(PROFILE)
        assert_type(Mc1241a(bus, checked=True).get_pos(), int)
        with bus.claim(), bus.batch() as batch:
            assert_type(batch, Message)
            later = batch.read(0)
        assert_type(later.value, int)


async def drive_in_a_loop(where: str) -> None:
    async with await aio_connect(where) as bus:
        axis = AioLm628(bus)
        await axis.stt()
        assert_type(await axis.rdrp(), int)
        async with bus.batch() as batch:
            assert_type(batch, Message)
"""

WRONG = """\
from vbus.client import Bus
from vbus.client.aio.lm628 import Lm628 as AioLm628
from vbus.client.lm628 import Lm628
from vbus.client.mcp1200 import Mcp1200


async def drive(bus: Bus, far: AioLm628) -> None:
    Lm628(bus).stt(1)
    Lm628(bus).lpes("7")
    Lm628(bus).sttt()
    Mcp1200(bus).write_phase(0)
    position: str = Lm628(bus).rdrp()
    moved: int = far.rdrp()
    AioLm628(bus)
    bus.batch().read(0)
"""
ERRORS = [
    'Too many arguments for "stt" of "Lm628Calls"',
    'Argument 1 to "lpes" of "Lm628Calls" has incompatible type "str"; expected "int"',
    '"Lm628" has no attribute "sttt"',
    '"Mcp1200" has no attribute "write_phase"',
    'Incompatible types in assignment (expression has type "int", variable has type "str")',
    'Incompatible types in assignment (expression has type "Coroutine[Any, Any, int]", variable has'
    ' type "int")',
    'Argument 1 to "Lm628" has incompatible type "vbus.client.bus.Bus"; expected'
    ' "vbus.client.aio.bus.Bus"',
    '"Batch" has no attribute "read"',
]
STUBS = (
    "vbus.client.bus", "vbus.client.access", "vbus.client.lm628", "vbus.client.mcp1200",
    "vbus.client.mc1241a",
)  # fmt: skip


@pytest.fixture(scope="module")
def checked(tmp_path_factory: pytest.TempPathFactory) -> str:
    """What ``mypy --strict`` says of both programs."""
    folder = tmp_path_factory.mktemp("program")
    (folder / "right.py").write_text(PROGRAM)
    (folder / "wrong.py").write_text(WRONG)
    done = subprocess.run(
        [sys.executable, "-m", "mypy", "--strict", "--no-error-summary", "--config-file=",
         "right.py", "wrong.py"],
        cwd=folder, capture_output=True, text=True,
    )  # fmt: skip
    return done.stdout + done.stderr


@pytest.mark.slow
def test_mypy_knows_each_command_of_a_users_program(checked: str) -> None:
    assert "right.py" not in checked


@pytest.mark.slow
def test_mypy_finds_each_mistake_of_a_users_program(checked: str) -> None:
    found = re.findall(r"wrong\.py:(\d+): error: (.*?)  \[[\w-]+\]$", checked, re.MULTILINE)
    assert [message for _, message in found] == ERRORS, checked
    assert [int(line) for line, _ in found] == list(range(8, 8 + len(ERRORS)))


@pytest.mark.slow
def test_stubs_say_what_is_made_at_the_import(tmp_path: Path) -> None:
    done = subprocess.run(
        [sys.executable, "-m", "mypy.stubtest", "--concise", *STUBS],
        cwd=tmp_path, capture_output=True, text=True,
    )  # fmt: skip
    assert (done.returncode, done.stdout, done.stderr) == (0, "", "")


def test_the_stubs_are_what_would_be_made_now() -> None:
    assert stale(own_clients()) == []


def test_help_says_what_a_call_means_its_unit_its_range_and_its_clause() -> None:
    assert pydoc.plain(pydoc.render_doc(Lm628.sbpa)).splitlines()[2:] == [
        "sbpa(self, value: int) -> None",
        "    Set Breakpoint, Absolute (SBPA, 20H, LM-CMD-21).",
        "    ",
        "    Commands may be executed on the fly during motion.",
        "    ",
        "    Args:",
        "        value: 32 bits, two's complement, in cnt,",
        "            -2147483648 to 2147483647.",
    ]
    assert inspect.getdoc(Lm628.move) is not None
    assert "Lm628(bus: " in pydoc.plain(pydoc.render_doc(Lm628))


def test_both_sides_have_the_same_calls() -> None:
    for side, other in ((Lm628Calls, AioCalls), (Bus, aio.Bus)):
        made = {name for name in vars(side) if not name.startswith("_")}
        assert made == {name for name in vars(other) if not name.startswith("_")} - {"front"}


def test_what_stands_before_an_asyncio_object_is_always_the_same(served: Served) -> None:
    with connect(served.where) as bus:
        axis = Lm628(bus)
        assert axis.bus is bus
        assert axis.chip.bus is bus
        assert axis.cycles is axis.chip
        axis.polls = 7
        assert axis.polls == 7
        with pytest.raises(AttributeError, match="no attribute 'sttt'"):
            axis.sttt()  # type: ignore[attr-defined]


def test_calls_use_what_a_class_derived_from_the_asyncio_one_changes(served: Served) -> None:
    class Watched(AioLm628):
        reads = 0

        async def status(self) -> int:
            self.reads += 1
            return await super().status() & 0xFE

    with connect(served.where) as bus:
        served.port.answers = {0: [0x85]}
        axis = blocking.blocking(Watched)(bus)
        axis.stt()
        assert isinstance(axis, Lm628)
        assert (axis.reads, axis.status(), axis.reads) == (1, 0x84, 2)


def test_a_derived_class_has_calls_and_attributes_of_its_own(served: Served) -> None:
    class Shaft(Lm628):
        def __init__(self, bus: Bus, teeth: int) -> None:
            super().__init__(bus)
            self.teeth = teeth

        def steps(self) -> int:
            return self.status() * self.teeth

    with connect(served.where) as bus:
        served.port.answers = {0: [0x04]}
        assert Shaft(bus, 5).steps() == 20


def test_a_call_that_would_wait_for_an_event_loop_says_so() -> None:
    async def never() -> None:
        await Sleeping()

    class Sleeping:
        def __await__(self) -> object:
            yield

    with pytest.raises(RuntimeError, match="a blocking session waited for an event loop"):
        blocking.run(never())


def test_unknown_attributes_of_a_chip_with_registers_are_refused(served: Served) -> None:
    with connect(served.where) as bus, pytest.raises(AttributeError, match="write_phase"):
        Mcp1200(bus).write_phase(0)  # type: ignore[attr-defined]
