"""Whatever lets time pass in a test, every value that the test can reach is of now."""

import asyncio
import inspect
import re
from collections import deque
from collections.abc import Callable, Iterator, Mapping
from itertools import islice
from pathlib import Path
from typing import Any

import pytest

from tests.unit.testing.test_machine import TWO, made
from vbus.board.board import Board
from vbus.client import Bus
from vbus.client.mcp1200 import PROFILE
from vbus.core.errors import VbusError
from vbus.core.kernel import MS
from vbus.serve.in_process import connect_in_process
from vbus.testing.bench import Bench
from vbus.testing.checks.around_chip import ChipBench
from vbus.testing.clock import BoardClock
from vbus.testing.execute import Execute
from vbus.testing.machine import TestedMachine
from vbus.testing.robot import robot
from vbus.testing.triggers import Triggers

PARTS = ("LM629", "MCP-1200", "MC1241A")
ACTS = {
    "advance", "after_load", "before_save", "catch_up", "chip", "close", "come_true", "connect",
    "course", "depart", "end", "end_leases", "end_read", "first_heard", "fail_resets", "flush",
    "heard_changed", "follow_clock", "forget_course", "jam", "journal", "page", "pass_until",
    "rearm", "relent", "release", "resolve", "settle", "start", "start_trace", "tell_drivers",
    "input_changed", "trace", "unclaim", "unsolder", "wave",
}  # fmt: skip
"""Methods without an argument that do something: all others tell something, and are asked."""
NO_VALUES = {
    "beyond": "leads to what nodes agree on, where a call without arguments is an act",
    "batch": "counts the changes of the board, and a look is one",
    "caught": "the instant up to which chips were brought, which is what is tried here",
    "link": "a descriptor",
    "looks": "of timers",
}


def values(roots: Mapping[str, object]) -> dict[str, object]:
    """Return all that can be reached by public names, first what is there, then what is asked."""
    found: dict[str, object] = {}
    objects: dict[int, object] = {}
    todo = deque(roots.items())
    asked: list[tuple[str, Callable[[], object]]] = []
    while todo or asked:
        if not todo:
            path, ask = asked.pop(0)
            try:
                todo.append((path, ask()))
            except (NotImplementedError, ValueError, TypeError, VbusError) as error:
                found[path] = str(error)
            continue
        path, value = todo.popleft()
        if value is None or isinstance(value, bool | int | float | str | bytes | Path):
            found[path] = value
        elif isinstance(value, Mapping):
            todo.extend((f"{path}[{key!r}]", one) for key, one in list(value.items()))
        elif isinstance(value, list | tuple | deque | set | frozenset):
            found[f"{path} is of"] = len(value)
            todo.extend((f"{path}[{n}]", one) for n, one in enumerate(islice(value, 200)))
        elif of_board(value) and id(value) not in objects:
            objects[id(value)] = value  # so that no other gets its number
            for name, one in attributes(value):
                if not callable(one):
                    todo.append((f"{path}.{name}", one))
                elif "()" not in path and inspect.ismethod(one) and tells(one):
                    asked.append((f"{path}.{name}()", one))
    return found


CLIENTS = re.compile(r"vbus[.](client|testing[.]in_process)|vbus[.]chips[.]\w+[.](generated|host)$")


def of_board(value: object) -> bool:
    """Whether it is of vbus, and no client: to ask a client is to let time pass."""
    module = type(value).__module__
    client = CLIENTS.match(module) or hasattr(value, "bus")
    return isinstance(value, ChipBench) or (module[:5] == "vbus." and not client)


def attributes(value: object) -> Iterator[tuple[str, object]]:
    for name in dir(value):
        if not name.startswith("_") and not name.isupper() and name not in NO_VALUES:
            try:
                yield name, getattr(value, name)
            except (AttributeError, ValueError, NotImplementedError) as error:
                yield name, str(error)


def tells(method: Any) -> bool:
    """Whether a method can be asked without being given anything, and does nothing."""
    if method.__name__ in ACTS:
        return False
    parameters = inspect.signature(method).parameters.values()
    return all(one.default is not one.empty for one in parameters)


# -- a board on which three chips move ------------------------------------------------------------


class Moving:
    """A test's board with one chip of each family, each of which moves a motor."""

    def __init__(self, folder: Path) -> None:
        self.bench = Bench("test", {}, [folder], lambda: folder, scope=False, chips=PARTS)
        self.x, self.y, self.z = (self.bench.chip(part) for part in PARTS)
        self.other = connect_in_process(self.board)
        servo, mcp, pmd = self.x.host, self.y.host, self.z.host
        mcp.reset()
        mcp.write_kp(64)
        mcp.write_kd(64)
        mcp.control()
        mcp.write_profile_velocity(10)
        mcp.write_acceleration(0x40)
        mcp.write_final_position(1 << 20)
        mcp.set_flag(PROFILE)
        for axis in (2, 1):
            pmd.select(axis)
            pmd.set_prfl_trap()
            pmd.set_phase_2()
            pmd.set_buf_mtr_cmd(24_000)
            pmd.set_pos(1 << 20)
            pmd.set_vel(9 << 16)
            pmd.set_acc(0x4000)
        pmd.multi_update(0x3)
        servo.check_reset()
        servo.load_filter(kp=300, kd=2000)
        servo.load_trajectory(acc=400, vel=4 << 16, pos=50_000, start=True)
        self.clock.advance("100 ms")
        assert all(one.plant.count for one in (self.x, self.y, self.z))

    @property
    def board(self) -> Board:
        return self.x.board

    @property
    def clock(self) -> BoardClock:
        return self.x.clock

    def roots(self) -> dict[str, object]:
        tested = self.bench.main()
        return {"x": self.x, "y": self.y, "z": self.z, "tested": tested, "other": self.other}


def by_batch(moving: Moving) -> None:
    with moving.x.bus.batch() as message:
        message.delay("3 ms")
        message.read(0)


def by_leases(moving: Moving) -> None:
    moving.x.bus.leases()
    for _ in range(700):
        moving.x.bus.read(0)


def by_kept_back(moving: Moving) -> None:
    moving.x.bus.posting()
    moving.x.bus.delay("3 ms")
    moving.x.bus.posting(False)


def by_wait(moving: Moving) -> None:
    moving.x.bus.write(0, 0x0A)  # RDRP: it is busy
    moving.x.bus.wait("1 ms")


def frozen(moving: Moving) -> None:
    with moving.clock.freeze():
        moving.x.bus.delay("3 ms")
        moving.x.bus.read(0)


def by_trigger(moving: Moving) -> None:
    async def wait() -> None:
        triggers = Triggers(moving.bench.main())
        await triggers.at(moving.board.now + 3 * MS)

    asyncio.run(wait())


def by_hosts_of_a_trigger(moving: Moving) -> None:
    async def wait() -> None:
        there = Triggers(moving.bench.main()).at(moving.board.now + 3 * MS, by_hosts=True)
        moving.other.delay("4 ms")
        await there

    asyncio.run(wait())


def by_program(moving: Moving) -> None:
    program = moving.bench.folder() / "host.py"
    program.write_text(
        "import os\nfrom vbus import connect\nwith connect(os.environ['VBUS_LINK']) as bus:\n"
        "    bus.delay('3 ms')\n    bus.chip('x').read(0)\n"
    )
    assert Execute(moving.bench)(program).ok


def by_strobes(moving: Moving) -> None:
    moving.x.bus.pin("/RST", None)
    moving.x.bus.lines({"/CS": 0, "/RD": 0})
    moving.other.delay("10 us")
    moving.x.bus.lines({"/CS": 1, "/RD": 1})


def by_robot(moving: Moving) -> None:
    keywords = robot()
    keywords._bench = moving.bench
    keywords.advance_time("2 ms")
    keywords.read_bus(0)


def by_end(moving: Moving) -> None:
    moving.other.delay("3 ms")
    moving.other.close()


WAYS: dict[str, Callable[[Moving], object]] = {
    "Bus.delay": lambda m: m.x.bus.delay("3 ms"),
    "Bus.read": lambda m: [m.x.bus.read(0) for _ in range(700)],
    "Bus.reads": lambda m: [m.x.bus.reads(0, 250) for _ in range(3)],
    "Bus.write": lambda m: [m.y.bus.write(0x11, 0) for _ in range(700)],
    "Bus.writes": lambda m: [m.y.bus.writes(0x11, bytes(250)) for _ in range(3)],
    "Bus.wait": by_wait,
    "Bus.batch": by_batch,
    "Bus.leases": by_leases,
    "Bus.posting": by_kept_back,
    "Bus.lines": by_strobes,
    "Bus.close": by_end,
    "BoardClock.advance": lambda m: m.clock.advance("3 ms"),
    "BoardClock.run_until": lambda m: m.clock.run_until(m.clock.now + 3 * MS),
    "BoardClock.wait_until": lambda m: m.clock.wait_until("x.real > 480"),
    "BoardClock.freeze": frozen,
    "Board.run_for": lambda m: m.board.run_for(3 * MS),
    "Board.run_until": lambda m: m.board.run_until(m.board.now + 3 * MS),
    "Board.wait_until": lambda m: m.board.wait_until("x.real > 480"),
    "Board.waits": lambda m: m.board.waits("x.real > 480", "1 s"),
    "Triggers.at": by_trigger,
    "by_hosts": by_hosts_of_a_trigger,
    "another host": lambda m: m.other.delay("3 ms"),
    "vbus_exec": by_program,
    "robot": by_robot,
}
NO_WAYS = {
    "Bus": "at chip claim drive echo events exchange getpin hello info next_event now pin"
    " release sample select sync take_events",
    "BoardClock": "board now",
    "Board": "add_chip add_glue adopt after_load axes beyond broken buses catch_up caught chip"
    " chips clock_step connect counters disturbed end_leases faults file file_violation find_pin"
    " glue glue_of granted hints hosts join kernel levels left_over limit listen listeners load"
    " meet missed name nets next_due now observe observers open_port parts pass_until pin_nets pins"
    " plants player policy port_type ports power_on rate reads save seed serve_links set_counters"
    " settled share_bus sliced start_trace state_hash stream stride tail tell_cycle text through"
    " trace_hash unobserve violation_policy violations watch wires writes",
}
"""Public names by which a test lets no time pass; ``pass_until`` and ports are the server's."""


@pytest.mark.parametrize("way", WAYS)
def test_every_value_is_of_now_whatever_has_let_time_pass(way: str, tmp_path: Path) -> None:
    found, fresh = Moving(tmp_path), Moving(tmp_path)
    before = found.board.now
    WAYS[way](found)
    WAYS[way](fresh)
    fresh.board.catch_up()
    compare(values(found.roots()), values(fresh.roots()))
    assert found.board.now > before


def compare(found: dict[str, object], fresh: dict[str, object]) -> None:
    assert len(found) > 1000
    differs = {
        path: (found.get(path, "nothing"), fresh.get(path, "nothing"))
        for path in found.keys() | fresh.keys()
        if found.get(path, "nothing") != fresh.get(path, "nothing")
    }
    assert not differs


def test_no_way_is_left_out() -> None:
    for cls in (Bus, BoardClock, Board):
        names = {name for name in dir(cls("b") if cls is Board else cls) if name[0] != "_"}
        ways = {way.partition(".")[2] for way in WAYS if way.startswith(f"{cls.__name__}.")}
        names = {name for name in names if not name.isupper()}
        assert names - ways - {"board"} == set(NO_WAYS[cls.__name__].split()) - {"board"}


# -- a machine of nodes ---------------------------------------------------------------------------


def moving_machine() -> tuple[TestedMachine, dict[str, object]]:
    machine = made(TWO)
    x, y = machine.chip("x"), machine.chip("y")
    plants = {"x": x.plant, "y": y.plant, "chip": y.chip, "board": y.board}
    for axis in (x, y):
        axis.host.check_reset()
        axis.host.load_filter(kp=300, kd=2000)
        axis.host.load_trajectory(acc=400, vel=4 << 16, pos=50_000, start=True)
    machine.advance("100 ms")
    return machine, {"machine": machine, "x chip": x, "y chip": y, **plants}


MACHINE_WAYS: dict[str, Callable[[TestedMachine, Any, Any], object]] = {
    "advance": lambda machine, x, y: machine.advance("3 ms"),
    "run_until": lambda machine, x, y: machine.run_until(machine.now + 3 * MS),
    "a host": lambda machine, x, y: x.bus.delay("3 ms"),
    "cycles": lambda machine, x, y: [x.bus.read(0) for _ in range(1200)],
    "the end": lambda machine, x, y: (y.bus.delay("3 ms"), y.bus.close()),
}


@pytest.mark.parametrize("way", MACHINE_WAYS)
def test_values_of_all_nodes_are_of_now(way: str) -> None:
    seen = []
    for fresh in (False, True):
        machine, roots = moving_machine()
        before = roots["x"].count, roots["y"].count  # type: ignore[attr-defined]
        MACHINE_WAYS[way](machine, roots["x chip"], roots["y chip"])
        if fresh:
            for node in machine.nodes:
                machine.board(node).catch_up()
        after = roots["x"].count, roots["y"].count  # type: ignore[attr-defined]
        assert all(one > other for one, other in zip(after, before, strict=True))
        assert {machine.board(node).now for node in machine.nodes} == {machine.now}
        seen.append(values(roots))
    compare(*seen)
