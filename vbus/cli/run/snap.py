"""``vbus snap``: a running board as a file, and back."""

import base64
from collections.abc import Callable, Mapping
from concurrent.futures import Future, ThreadPoolExecutor
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

import click

from vbus.cli.output import Verbs, refuse_given, seconds, show
from vbus.cli.sources import opened
from vbus.core import exit_codes
from vbus.core.errors import VbusError, content
from vbus.serve import registry
from vbus.serve.output_file import write_file

if TYPE_CHECKING:
    from vbus.board.snapshot import Snapshot
    from vbus.nodes.machine_snapshot import MachineSnapshot


@click.group("snap", cls=Verbs)
def command() -> None:
    """Take snapshots of running boards, load them again, look into them.

    BOARD is the name "vbus ls" shows, or that of a machine of nodes. A snapshot goes on with "vbus
    run FILE --from SNAPSHOT" too, one of a machine only so, in any number of processes.
    """


@command.command("save")
@click.argument("board")
@click.argument("file", type=click.Path(path_type=Path))
@click.option("--json", "as_json", is_flag=True, help="Print JSON; instants in ps.")
def save(board: str, file: Path, as_json: bool) -> None:
    """Write a snapshot of a running BOARD, or of all nodes of a machine, to FILE.

    A machine's nodes may run on several computers, at least one of them on this one.
    """
    nodes = registry.nodes_of(board)
    if nodes:
        save_machine(board, nodes, file, as_json)
        return
    answer = registry.order(board, "snap.save")
    data = base64.b64decode(answer["data"])
    write_file(file, data)
    value = {"board": board, "file": str(file), "when_ps": answer["when_ps"], "bytes": len(data)}
    line = f"{file}: {board} at {seconds(answer['when_ps'])}, {len(data)} bytes"
    show(as_json, value, [line])


@command.command("load")
@click.argument("board")
@click.argument("file", type=click.Path(path_type=Path))
@click.option("--json", "as_json", is_flag=True, help="Print JSON; instants in ps.")
def load(board: str, file: Path, as_json: bool) -> None:
    """Bring a running BOARD to the snapshot in FILE; hosts stay attached."""
    from vbus.board.snapshot import read
    from vbus.nodes.machine_snapshot import is_machine

    data = content(file)
    if is_machine(data):
        raise VbusError(
            f"{file}: a machine that runs is not brought back to a snapshot; stop it, and start it"
            " there: vbus run FILE --from SNAPSHOT, with the same --node in each process"
        )
    read(data, str(file))
    answer = registry.order(board, "snap.load", data=base64.b64encode(data).decode())
    value = {"board": board, "file": str(file), "when_ps": answer["when_ps"]}
    show(as_json, value, [f"{board}: at {seconds(answer['when_ps'])}, as in {file}"])


@command.command("info")
@click.argument("file", type=click.Path(path_type=Path))
@click.option("--json", "as_json", is_flag=True, help="Print JSON; instants in ps.")
@click.option("--board-file", is_flag=True, help="Print the board file it was taken on.")
def info(file: Path, as_json: bool, board_file: bool) -> None:
    """Say what a snapshot is of."""
    from vbus.board.snapshot import read
    from vbus.nodes.machine_snapshot import is_machine
    from vbus.nodes.machine_snapshot import read as read_machine

    data = content(file)
    whole: Snapshot | MachineSnapshot
    if is_machine(data):
        whole = read_machine(data, str(file))
        # Every node was taken on the same board file by the same version: any of them says it.
        part = next(iter(whole.nodes.values()))
        end, (about, lines) = f", the end of round {whole.round}", _of_machine(whole)
    else:
        whole = part = read(data, str(file))
        end, (about, lines) = "", _of_board(part)
    if board_file:
        refuse_given(("as_json",), "does not go with --board-file, which prints the file alone")
        click.echo(part.text, nl=False)
        return
    value = {
        "board": whole.board, "file": part.file, "when_ps": whole.when, "vbus": part.vbus, **about,
    }  # fmt: skip
    head = f"{whole.board} ({part.file or 'no board file'}) at {seconds(whole.when)}{end}"
    show(as_json, value, [head, *lines, f"  taken with vbus {part.vbus}"])


def _of_board(found: "Snapshot") -> tuple[dict[str, Any], list[str]]:
    """Return what the snapshot of a board holds: as data, and as lines."""
    hosts = [f"{host.label} to {', '.join(host.chips)}" for host in found.hosts]
    lines = [
        *(f"  chip {name}: {part}" for name, part in found.parts.items()),
        *(f"  host {host}" for host in hosts),
        f"  state {found.digest}",
    ]
    about = {
        "chips": found.parts, "hosts": hosts, "counters": found.counters, "hash": found.digest,
    }  # fmt: skip
    return about, lines


def _of_machine(found: "MachineSnapshot") -> tuple[dict[str, Any], list[str]]:
    """Return what the snapshot of a machine holds of its nodes: as data, and as lines."""
    nodes = {
        name: {"when_ps": part.when, "hosts": [host.label for host in part.hosts]}
        for name, part in found.nodes.items()
    }
    lines = [
        f"  node {name} at {seconds(part.when)}"
        + "".join(f", host {host.label} to {', '.join(host.chips)}" for host in part.hosts)
        for name, part in found.nodes.items()
    ]
    return {"round": found.round, "nodes": nodes}, lines


@command.command("bisect")
@click.argument("journal", type=click.Path(path_type=Path))
@click.argument("condition")
@click.option("--save", "keep", type=click.Path(path_type=Path), metavar="FILE",
              help="Write a snapshot of the board just before it to FILE.")  # fmt: skip
@click.option("--json", "as_json", is_flag=True, help="Print JSON; instants in ps.")
def bisect(journal: Path, condition: str, keep: Path | None, as_json: bool) -> int:
    """Find the first call of a JOURNAL after which CONDITION holds.

    \b
    CONDITION is the name of a rule         lm628.busy-write
    or a pin's level                        x.HI=1
    or a value of a chip (vbus monitor)     "x.real>200"
    or what docs/conditions.md has          "x.status.BUSY and rising(x.HI)"

    Exits with 1 if it never holds.
    """
    from vbus.board.snapshot import take, write
    from vbus.cli.journal_lines import line
    from vbus.events.watch import ConditionTracker
    from vbus.nodes.machine import board_of
    from vbus.record.history import History
    from vbus.record.view import Sessions

    with opened(journal) as reader:
        header = reader.header
        entries = list(reader)
    history = History(lambda: board_of(header, str(journal)), entries)
    holds = ConditionTracker(condition, history.board)
    found = history.first(holds)
    if found is None:
        never = f"{condition}: never in {len(entries)} entries"
        show(as_json, {"condition": condition, "entry": None, "entries": len(entries)}, [never])
        return exit_codes.FAILURE
    sessions = Sessions()
    for entry in entries[: found.number]:
        sessions.follow(entry)
    lines = [line(found, sessions)]
    value = {"condition": condition, "entry": found.number, "when_ps": found.when, "text": lines[0]}
    if keep is not None:
        data = write(take(history.to(found.number)))
        write_file(keep, data)
        lines.append(f"{keep}: {header.board} before it, {len(data)} bytes")
        value |= {"snapshot": str(keep), "bytes": len(data)}
    show(as_json, value, lines)
    return exit_codes.OK


# -- machines of nodes: all nodes at the end of one round -----------------------------------------

# A machine that waits for hosts is caught two rounds ahead; one that runs freely passes many more
# while its nodes are asked.
AHEAD: Final = (2, 50, 1_000, 20_000)
"""How many rounds after the present one the snapshot is to be taken: more, if that was too soon."""


def save_machine(
    machine: str, nodes: Mapping[str, dict[str, Any]], file: Path, as_json: bool
) -> None:
    """Write a snapshot of a running machine to a file.

    Args:
        machine: its name.
        nodes: what those on this computer tell of themselves; the others are asked through them.
        file: to be written.
        as_json: whether to print JSON.

    Raises:
        VbusError: a node is not there, refuses, or waits.
    """
    from vbus.board.snapshot import read
    from vbus.nodes.machine_snapshot import MachineSnapshot, write

    taken = _taken(machine, nodes)
    parts = {
        name: read(base64.b64decode(part["data"]), f"node {name}")
        for name, part in sorted(taken.items())
    }
    snapshot = MachineSnapshot(machine, taken[next(iter(nodes))]["round"], parts)
    data = write(snapshot)
    write_file(file, data)
    value = {
        "board": machine, "file": str(file), "when_ps": snapshot.when, "round": snapshot.round,
        "nodes": sorted(taken), "bytes": len(data),
    }  # fmt: skip
    line = (
        f"{file}: {machine} with {len(parts)} nodes at {seconds(snapshot.when)}, {len(data)} bytes"
    )
    show(as_json, value, [line])


def _taken(machine: str, nodes: Mapping[str, dict[str, Any]]) -> dict[str, dict[str, Any]]:
    """Have all nodes saved at the end of one round that is still to come.

    Raises:
        VbusError: a node is not there, refuses, or waits; or rounds have passed too fast for all to
            be asked in time.
    """

    def asked(board: str, node: str) -> Callable[..., dict[str, Any]]:
        return partial(registry.order, board, "snap.node", node=node)

    through = f"{machine}.{next(iter(nodes))}"
    asks = {name: asked(through, name) for name in registry.missing_of(nodes)}
    with ThreadPoolExecutor(len(nodes) + len(asks)) as asking:
        # Who is not there is named before the others are kept waiting for its round.
        there = _results({name: asking.submit(ask) for name, ask in asks.items()})
        lacking = [f"{name} ({one['state']})" for name, one in there.items() if not one["answers"]]
        if lacking:
            do, they = ("does", "it is") if len(lacking) == 1 else ("do", "they are")
            raise VbusError(
                f"{machine}: {', '.join(lacking)} {do} not answer, and a snapshot has all nodes of"
                f" a machine; say it again when {they} here (vbus ls)"
            )
        asks |= {name: asked(f"{machine}.{name}", name) for name in nodes}
        latest = max(node.get("round", -1) for node in nodes.values())
        for ahead in AHEAD:
            number = latest + ahead
            found = _results({name: asking.submit(ask, round=number) for name, ask in asks.items()})
            rounds = {part["round"] for part in found.values()}
            if len(rounds) == 1:
                return found
            latest = max(rounds)
    raise VbusError(f"{machine}: its rounds pass faster than all its nodes can be asked; try again")


def _results(asked: Mapping[str, Future[Any]]) -> dict[str, dict[str, Any]]:
    """Return what nodes have answered, by name.

    Raises:
        VbusError: one has refused; if several have, one that does not wait for another.
    """
    from vbus.serve.nodes.timebase import WAITS_FOR_OTHERS

    refusals = [error for answer in asked.values() if (error := answer.exception()) is not None]
    if refusals:
        raise min(refusals, key=lambda error: WAITS_FOR_OTHERS in str(error))
    return {name: answer.result() for name, answer in asked.items()}
