"""``vbus snap``: a running board as a file, and back."""

import base64
from pathlib import Path

import click

from vbus.cli import exit_codes
from vbus.cli.output import reading, seconds, show
from vbus.cli.sources import opened
from vbus.core.errors import VbusError
from vbus.serve.output_file import write_file
from vbus.serve.registry import nodes_of, order


@click.group("snap")
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
    nodes = nodes_of(board)
    if nodes:
        from vbus.cli.run.snap_machine import save_machine

        save_machine(board, nodes, file, as_json)
        return
    answer = order(board, "snap.save")
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

    with reading(file) as taken:
        data = taken.read()
    if is_machine(data):
        raise VbusError(
            f"{file}: a machine that runs is not brought back to a snapshot; stop it, and start it"
            " there: vbus run FILE --from SNAPSHOT, with the same --node in each process"
        )
    read(data, str(file))
    answer = order(board, "snap.load", data=base64.b64encode(data).decode())
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

    with reading(file) as taken:
        data = taken.read()
    if is_machine(data):
        from vbus.cli.run.snap_machine import info_of_machine

        info_of_machine(data, file, as_json, board_file)
        return
    found = read(data, str(file))
    if board_file:
        click.echo(found.text, nl=False)
        return
    hosts = [f"{host.label} to {', '.join(host.chips)}" for host in found.hosts]
    value = {
        "board": found.board,
        "file": found.file,
        "when_ps": found.when,
        "vbus": found.vbus,
        "chips": found.parts,
        "hosts": hosts,
        "counters": found.counters,
        "hash": found.digest,
    }
    lines = [
        f"{found.board} ({found.file or 'no board file'}) at {seconds(found.when)}",
        *(f"  chip {name}: {part}" for name, part in found.parts.items()),
        *(f"  host {host}" for host in hosts),
        f"  state {found.digest}",
        f"  taken with vbus {found.vbus}",
    ]
    show(as_json, value, lines)


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
    found = history.first(holds, holds.stays)
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
