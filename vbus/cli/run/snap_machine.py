"""Snapshots of machines of nodes: all nodes at the end of one round."""

import base64
from collections.abc import Callable, Mapping
from concurrent.futures import Future, ThreadPoolExecutor
from functools import partial
from pathlib import Path
from typing import Any, Final

import click

from vbus.board.snapshot import read as read_board
from vbus.cli.output import seconds, show
from vbus.core.errors import VbusError
from vbus.nodes.machine_snapshot import MachineSnapshot, read, write
from vbus.serve.output_file import write_file

_Ask = Callable[..., dict[str, Any]]

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
    taken = _taken(machine, nodes)
    parts = {
        name: read_board(base64.b64decode(part["data"]), f"node {name}")
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
    from vbus.serve.registry import missing_of, order

    through = f"{machine}.{next(iter(nodes))}"
    asks: dict[str, _Ask] = {
        name: partial(order, through, "snap.node", node=name) for name in missing_of(nodes)
    }
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
        asks |= {
            name: partial(order, f"{machine}.{name}", "snap.node", node=name) for name in nodes
        }
        latest = max(node.get("round", -1) for node in nodes.values())
        for ahead in AHEAD:
            number = latest + ahead
            found = _results({name: asking.submit(ask, round=number) for name, ask in asks.items()})
            rounds = {part["round"] for part in found.values()}
            if len(rounds) == 1:
                return found
            latest = max(rounds)
    raise VbusError(f"{machine}: its rounds pass faster than all its nodes can be asked; try again")


def _results(asked: Mapping[str, "Future[Any]"]) -> dict[str, dict[str, Any]]:
    """Return what nodes have answered, by name.

    Raises:
        VbusError: one has refused; if several have, one that does not wait for another.
    """
    from vbus.serve.nodes.timebase import WAITS_FOR_OTHERS

    refusals = [error for answer in asked.values() if (error := answer.exception()) is not None]
    if refusals:
        raise min(refusals, key=lambda error: WAITS_FOR_OTHERS in str(error))
    return {name: answer.result() for name, answer in asked.items()}


def info_of_machine(data: bytes, file: Path, as_json: bool, board_file: bool) -> None:
    """Say what a snapshot of a machine is of."""
    found = read(data, str(file))
    any_node = next(iter(found.nodes.values()))
    if board_file:
        click.echo(any_node.text, nl=False)
        return
    value = {
        "board": found.board, "file": any_node.file, "when_ps": found.when, "vbus": any_node.vbus,
        "round": found.round,
        "nodes": {
            name: {"when_ps": part.when, "hosts": [host.label for host in part.hosts]}
            for name, part in found.nodes.items()
        },
    }  # fmt: skip
    lines = [
        f"{found.board} ({any_node.file or 'no board file'}) at {seconds(found.when)}, the end of"
        f" round {found.round}",
        *(
            f"  node {name} at {seconds(part.when)}"
            + "".join(f", host {host.label} to {', '.join(host.chips)}" for host in part.hosts)
            for name, part in found.nodes.items()
        ),
        f"  taken with vbus {any_node.vbus}",
    ]
    show(as_json, value, lines)
