"""A run of a + b is the snapshot after a, loaded anywhere, and b: random boards, hosts, faults.

``VBUS_SNAPSHOTS=5000`` tries so many boards instead of the usual few.
"""

import contextlib
import os
from random import Random

import pytest

from tests.differential.drive import BOARDS as FAMILIES
from tests.differential.drive import Host, servo_motor, step_motor
from vbus.board import snapshot
from vbus.board.board import Board
from vbus.board.build import load_board_text
from vbus.board.host_bus import HostBus
from vbus.core.kernel import MS, NS
from vbus.faults.row import AXIS, LASTS, LINK
from vbus.faults.table import faults
from vbus.protocols.port import PortError

BOARDS = int(os.environ.get("VBUS_SNAPSHOTS", "100"))
OPERATIONS = 160
KEPT = 1000

Operation = tuple[object, ...]
FAULTS = faults()
NAMES = sorted(name for name, fault in FAULTS.items() if fault.target != LINK)
COMMANDS = {"lm": ("LTRJ", "STT", "RDSTAT"), "mc": ("UPDATE", "SET_VEL"), "mcp": ("KP", "R05H")}
EDGES = {"lm": ("/WR", "/RST"), "mc": ("~HostWrite", "~Reset"), "mcp": ("/CS", "/RESET")}
SPIN = {
    "lm": (
        (0, 0x1E), (1, 0, 0x0A, 0, 60, 2, 88), (0, 0x04), (0, 0x1F),
        (1, 0x18, 0x28, 0, 0, 7, 0xD0, 0, 4, 0, 0), (0, 0x01),
    ),
    "mc": (
        (1, 0x0A), (1, 0x12), (0, 0, 0, 0x20, 0), (1, 0x11), (0, 0, 4, 0, 0), (1, 0x62),
        (0, 0x5D, 0xC0), (1, 0x1A),
    ),
    "mcp": ((1, 8), (0x26, 0x10), (0x3C, 2), (5, 3), (0, 0x0D)),
}  # fmt: skip
"""What sets each family in motion: addresses and bytes."""


def made(random: Random) -> tuple[str, list[str]]:
    """Return a board file, and the families of its chips in order."""
    rows = [
        f'[board]\nname = "b"\ntime = "lockstep"\nseed = {random.randrange(1000)}\n'
        f'power_on = "{random.choice(("reset", "done"))}"\n[violations]\n'
        f'default = "{random.choice(("warn", "strict"))}"\n'
    ]
    families = [random.choice(("lm", "mc", "mcp")) for _ in range(random.randrange(1, 4))]
    for place, family in enumerate(families):
        name = f"c{place}"
        plant = f'plant = "{name}p"'
        motor = random.choice((servo_motor, lambda _: 'model = "ideal"'))(random)
        if family == "lm":
            part, extra = random.choice(("LM628N-8", "LM629N-8")), "busy_jitter_clk = 40"
            clock = random.choice(("8 MHz", "3333333 Hz"))
        elif family == "mcp":
            part, extra = "MCP-1200", f'drive = "{random.choice(("pwm", "dac"))}"'
            clock = random.choice(("20 MHz", "7999999 Hz"))
        else:
            part, extra = "MC1241A", f'host_busy = "{random.choice(("fixed", "slot"))}"'
            clock, plant = random.choice(("25 MHz", "20 MHz")), f'plants = ["{name}p"]'
            motor = step_motor(random)
        rows.append(f'[chips.{name}]\npart = "{part}"\nclock = "{clock}"\n{extra}\n{plant}\n')
        if plant:
            rows.append(f"[plants.{name}p]\n{motor}\n")
    if len(families) > 1 and random.random() < 0.5:
        outputs = {"lm": "HI", "mc": "~HostIntrpt", "mcp": "PULSE"}
        inputs = {"lm": "/IN", "mc": "~Home1", "mcp": "/STOP"}
        rows.append(f'[nets]\nwire = ["c0.{outputs[families[0]]}", "c1.{inputs[families[1]]}"]\n')
    return "".join(rows), families


def fault(random: Random, families: list[str]) -> Operation:
    name = random.choice(NAMES)
    row = FAULTS[name]
    place = random.randrange(len(families))
    family = families[place]
    when = random.choice(
        (
            None, f"at {random.randrange(1, 30000)} us", f"cycle {random.randrange(1, 30)}",
            f"position {random.randrange(-50, 50)}",
            f"command {random.choice(COMMANDS[family])}",
            f"edge c{place}.{random.choice(EDGES[family])} {random.choice(('low', 'high'))}",
            f"rate {random.randrange(50, 900)} Hz",
        )
    )  # fmt: skip
    lasting = row.acts == LASTS or (when is not None and when.startswith("rate"))
    until = f"for {random.randrange(1, 9000)} us" if lasting and random.random() < 0.8 else None
    return ("arm", name, f"c{place}{'.1' if row.target == AXIS else ''}", when, until)


def operations(random: Random, families: list[str]) -> list[Operation]:
    """Return what hosts and testers do, in the smallest pieces there are."""
    todo: list[Operation] = []
    for place, family in enumerate(families):
        todo.append(("select", 1 << place))
        for address, *data in SPIN[family]:
            for number, byte in enumerate(data):
                if family != "lm" or number % 2 == 0 or address == 0:
                    todo.append(("wait", 3 * MS))
                todo.append(("write", address, byte))
    strobes = random.random() < 0.4
    for _ in range(OPERATIONS):
        kind = random.randrange(18)
        if kind < 5:
            todo.append(("read", random.randrange(2) if random.random() < 0.7 else 0x14))
        elif kind < 8:
            todo.append(("write", random.randrange(2), random.randrange(256)))
        elif kind < 12:
            todo.append(("delay", int(10 ** random.uniform(3, 9.3))))
        elif kind == 12:
            todo.append(("wait", random.choice((NS, MS))))
        elif kind == 13:
            todo.append(("select", 1 << random.randrange(len(families))))
        elif kind == 14:
            todo.append(("pin", random.randrange(12), random.randrange(3)))
        elif kind == 15 and strobes:
            todo.append(("lines", random.randrange(64), random.randrange(64)))
            todo.append(("delay", random.randrange(300 * NS)))
            todo.append(random.choice((("drive", random.randrange(256)), ("release",))))
        elif kind == 16:
            todo.append(fault(random, families))
        elif kind == 17 and random.random() < 0.3:
            todo.append(("clear",))
    return todo


def play(board: Board, port: HostBus, todo: list[Operation]) -> list[object]:
    """Do all that; return what came of it."""
    told = len(board.faults.log)
    seen: list[object] = []
    began = board.now
    for name, *values in todo:
        try:
            if name == "arm":
                fault_name, target, when, until = values
                with contextlib.suppress(ValueError):  # not for this chip or motor
                    board.faults.arm(fault_name, target, when, until)
                seen.append(len(board.faults.all()))
            elif name == "clear":
                seen.append([armed.number for armed in board.faults.clear()])
            else:
                seen.append(getattr(port, name)(*values))
        except PortError as error:
            seen.append(error.code)
    board.run_for(20 * MS)
    board.catch_up()
    seen += [str(evidence) for evidence in list(board.faults.log)[told:]]
    # A lazy chip may find out only now what happened before; of many, the board keeps the last.
    found = sorted(str(one) for one in board.violations if one.when > began)
    if len(board.violations) < KEPT:
        seen += found
    seen += [chip.telemetry() for chip in board.chips]
    return seen


def start(text: str) -> tuple[Board, HostBus]:
    board = load_board_text(text)
    return board, board.open_port("host")


@pytest.mark.parametrize("seed", range(BOARDS))
def test_a_run_goes_on_from_its_snapshot_as_it_would_have(seed: int) -> None:
    random = Random(seed)
    text, families = made(random)
    todo = operations(random, families)
    cut = random.randrange(len(todo))

    board, port = start(text)
    for operation in todo[:cut]:
        play_one(board, port, operation)
    kept = snapshot.read(snapshot.write(snapshot.take(board)))
    rest = play(board, port, todo[cut:])
    ends = board.state_hash()

    # On a board that is elsewhere, on one that has never run, and on the one it was taken of.
    other, other_port = start(text)
    for operation in operations(Random(seed + 1), families)[:90]:
        play_one(other, other_port, operation)
    fresh, fresh_port = start(text)
    for place, (target, host) in {
        "elsewhere": (other, other_port), "fresh": (fresh, fresh_port), "same": (board, port),
    }.items():  # fmt: skip
        snapshot.restore(target, kept)
        target.faults.log.clear()
        assert target.now == kept.when, place
        assert play(target, host, todo[cut:]) == rest, place
        assert target.state_hash() == ends, place

    # And nobody has noticed that it was taken.
    unseen, host = start(text)
    for operation in todo[:cut]:
        play_one(unseen, host, operation)
    assert play(unseen, host, todo[cut:]) == rest
    assert unseen.state_hash() == ends


class Listed(list[bytes]):
    """Replies as they are, where a host has a digest of them."""

    update = list.append


def judged(host: Host, count: int) -> dict[str, object]:
    """Make operations of a random host; return what it is told of them, and what a report says."""
    board = host.board
    board.violations.clear()
    board.start_trace()
    host.replies = replies = Listed()  # type: ignore[assignment]
    for _ in range(count):
        host.operation()
    board.catch_up()
    found = list(board.violations)
    return {
        "replies": replies, "violations": found, "trace": board.trace_hash(),
        "left over": [chip.left_over() for chip in board.chips],
        "hints": [chip.hint(one.rule, one.when) for chip in board.chips for one in found],
        "state": board.state_hash(),
    }  # fmt: skip


@pytest.mark.parametrize("family", FAMILIES)
def test_rules_find_after_a_snapshot_what_they_would_have_found(
    family: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    # A trace begins where the snapshot is taken, on each board.
    with monkeypatch.context() as patch:
        patch.setattr(Board, "start_trace", lambda _: None)
        hosts = [[Host(family, 2 * seed) for _ in range(2)] for seed in range(BOARDS // 4)]
    for seed, (host, other) in enumerate(hosts):
        random = Random(seed)
        for _ in range(random.randrange(5, 120)):
            host.operation()
        kept = snapshot.read(snapshot.write(snapshot.take(host.board)))
        # On a board that is elsewhere, or has never run, or on a fork.
        for _ in range(random.choice((0, 40, 90))):
            other.operation()
        snapshot.restore(other.board, kept)
        if random.random() < 0.3:
            other.board = snapshot.fork(host.board)
            other.port = other.board.ports[0]
        other.random.setstate(host.random.getstate())
        host.traced = other.traced = True
        count = random.randrange(1, 80)
        assert judged(host, count) == judged(other, count), seed


def play_one(board: Board, port: HostBus, operation: Operation) -> None:
    """Do one thing, whatever it answers."""
    name, *values = operation
    with contextlib.suppress(PortError, ValueError):
        if name == "arm":
            fault_name, target, when, until = values
            board.faults.arm(fault_name, target, when, until)
        elif name == "clear":
            board.faults.clear()
        else:
            getattr(port, name)(*values)
