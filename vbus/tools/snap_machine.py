"""Snapshots of machines of nodes: all nodes at the end of one round."""

import base64
from collections.abc import Mapping
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any, Final

import click

from vbus.errors import VbusError
from vbus.nodes.machine_snapshot import VERSION, HostThere, MachineSnapshot, NodePart, read, write
from vbus.tools.output import seconds, show, write_file
from vbus.version import __version__

AHEAD: Final = (2, 50, 1_000, 20_000)
"""How many rounds after the present one the snapshot is to be taken: more, if that was too soon."""


def save_machine(
    machine: str, nodes: Mapping[str, dict[str, Any]], file: Path, as_json: bool
) -> None:
    """Write a snapshot of a running machine to a file.

    Raises:
        VbusError: a node is not here, refuses, or waits.
    """
    from vbus.server.registry import missing_of

    missing = missing_of(nodes)
    if missing:
        raise VbusError(
            f"{machine}: {', '.join(missing)} {'is' if len(missing) == 1 else 'are'} not on this"
            " computer, and a snapshot has all nodes of a machine"
        )
    taken = _taken(machine, nodes)
    first = next(iter(taken.values()))
    parts = tuple(
        NodePart(
            name, part["when_ps"], base64.b64decode(part["data"]),
            tuple(HostThere(label, tuple(chips), cycle) for label, chips, cycle in part["hosts"]),
        )
        for name, part in taken.items()
    )  # fmt: skip
    snapshot = MachineSnapshot(
        VERSION, machine, first["file"], first["text"], __version__, first["round"], parts
    )
    data = write(snapshot)
    write_file(file, data)
    value = {
        "board": machine, "file": str(file), "when_ps": snapshot.when, "round": snapshot.round,
        "nodes": [*taken], "bytes": len(data),
    }  # fmt: skip
    line = (
        f"{file}: {machine} with {len(parts)} nodes at {seconds(snapshot.when)}, {len(data)} bytes"
    )
    show(as_json, value, [line])


def _taken(machine: str, nodes: Mapping[str, dict[str, Any]]) -> dict[str, dict[str, Any]]:
    """Have all nodes saved at the end of one round that is still to come.

    Raises:
        VbusError: a node refuses, or rounds have passed too fast for all to be asked in time.
    """
    latest = max(node.get("round", -1) for node in nodes.values())
    with ThreadPoolExecutor(len(nodes)) as asking:
        for ahead in AHEAD:
            asked = {name: asking.submit(_ask, machine, name, latest + ahead) for name in nodes}
            found = {name: answer.result() for name, answer in asked.items()}
            rounds = {part["round"] for part in found.values()}
            if len(rounds) == 1:
                return found
            latest = max(rounds)
    raise VbusError(f"{machine}: its rounds pass faster than all its nodes can be asked; try again")


def _ask(machine: str, node: str, number: int) -> dict[str, Any]:
    from vbus.server.registry import order

    answer: dict[str, Any] = order(f"{machine}.{node}", "snap.node", round=number)
    return answer


def info_of_machine(data: bytes, file: Path, as_json: bool, board_file: bool) -> None:
    """Say what a snapshot of a machine is of."""
    found = read(data, str(file))
    if board_file:
        click.echo(found.text, nl=False)
        return
    value = {
        "board": found.board, "file": found.file, "when_ps": found.when, "vbus": found.vbus,
        "round": found.round,
        "nodes": {
            part.node: {"when_ps": part.when, "hosts": [host.label for host in part.hosts]}
            for part in found.nodes
        },
    }  # fmt: skip
    lines = [
        f"{found.board} ({found.file or 'no board file'}) at {seconds(found.when)}, the end of"
        f" round {found.round}",
        *(
            f"  node {part.node} at {seconds(part.when)}"
            + "".join(f", host {host.label} to {', '.join(host.chips)}" for host in part.hosts)
            for part in found.nodes
        ),
        f"  taken with vbus {found.vbus}",
    ]
    show(as_json, value, lines)
