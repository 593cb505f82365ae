"""``vbus snap``: a running board as a file, and back."""

import base64
import json
from pathlib import Path

import click

from vbus.errors import VbusError
from vbus.tools import exit_codes


@click.group("snap")
def command() -> None:
    """Take snapshots of running boards, load them again, look into them.

    BOARD is the name "vbus ls" shows. A snapshot goes on with "vbus run FILE --from SNAPSHOT" too.
    """


def content_of(path: str | Path) -> bytes:
    """Return what a file holds.

    Raises:
        VbusError: it cannot be read.
    """
    try:
        return Path(path).read_bytes()
    except OSError as error:
        raise VbusError(f"{path}: cannot be read: {error.strerror}") from error


def seconds(ps: int) -> str:
    """Return an instant in seconds, with all its digits that tell."""
    whole, fraction = divmod(ps, 10**12)
    return f"{whole}.{fraction:012}".rstrip("0").rstrip(".") + " s"


@command.command("save")
@click.argument("board")
@click.argument("file", type=click.Path(path_type=Path))
def save(board: str, file: Path) -> int:
    """Write a snapshot of a running BOARD to FILE."""
    from vbus.server.registry import order

    answer = order(board, "snap.save")
    data = base64.b64decode(answer["data"])
    try:
        file.write_bytes(data)
    except OSError as error:
        raise VbusError(f"{file}: cannot be written: {error.strerror}") from error
    click.echo(f"{file}: {board} at {seconds(answer['when_ps'])}, {len(data)} bytes")
    return exit_codes.OK


@command.command("load")
@click.argument("board")
@click.argument("file", type=click.Path(path_type=Path))
def load(board: str, file: Path) -> int:
    """Bring a running BOARD to the snapshot in FILE; hosts stay attached."""
    from vbus.board.snapshot import read
    from vbus.server.registry import order

    data = content_of(file)
    read(data, str(file))
    answer = order(board, "snap.load", data=base64.b64encode(data).decode())
    click.echo(f"{board}: at {seconds(answer['when_ps'])}, as in {file}")
    return exit_codes.OK


@command.command("info")
@click.argument("file", type=click.Path(path_type=Path))
@click.option("--json", "as_json", is_flag=True, help="Print JSON; instants in ps.")
@click.option("--board-file", is_flag=True, help="Print the board file it was taken on.")
def info(file: Path, as_json: bool, board_file: bool) -> int:
    """Say what a snapshot is of."""
    from vbus.board.snapshot import read

    found = read(content_of(file), str(file))
    if board_file:
        click.echo(found.text, nl=False)
        return exit_codes.OK
    hosts = [f"{host.label} to {', '.join(host.chips)}" for host in found.hosts]
    if as_json:
        told = {
            "board": found.board,
            "file": found.file,
            "when_ps": found.when,
            "vbus": found.vbus,
            "chips": found.parts,
            "hosts": hosts,
            "counters": found.counters,
            "hash": found.digest,
        }
        click.echo(json.dumps(told))
        return exit_codes.OK
    click.echo(f"{found.board} ({found.file or 'no board file'}) at {seconds(found.when)}")
    for name, part in found.parts.items():
        click.echo(f"  chip {name}: {part}")
    for host in hosts:
        click.echo(f"  host {host}")
    click.echo(f"  state {found.digest}")
    click.echo(f"  taken with vbus {found.vbus}")
    return exit_codes.OK


@command.command("bisect")
@click.argument("journal", type=click.Path(path_type=Path))
@click.argument("condition")
@click.option("--save", "keep", type=click.Path(path_type=Path), metavar="FILE",
              help="Write a snapshot of the board just before it to FILE.")  # fmt: skip
def bisect(journal: Path, condition: str, keep: Path | None) -> int:
    r"""Find the first call of a JOURNAL after which CONDITION holds.

    \b
    CONDITION is the name of a rule         lm628.busy-write
    or a pin's level                        x.HI=1
    or a value of a chip (vbus monitor)     "x.real>200"

    Exits with 1 if it never holds.
    """
    from vbus.board.board import Board
    from vbus.board.build import load_board_text
    from vbus.board.checks import all_rules
    from vbus.board.snapshot import take, write
    from vbus.tools.journal_lines import line, opened
    from vbus.trace.journal.conditions import condition as read_condition
    from vbus.trace.journal.history import History
    from vbus.trace.journal.view import Sessions

    with opened(journal) as (reader, _):
        header = reader.header
        entries = list(reader)
    if not header.text:
        raise VbusError(f"{journal}: it was recorded on a board made in Python")

    def make() -> Board:
        return load_board_text(header.text, header.file)

    holds, stays = read_condition(condition, make(), all_rules())
    history = History(make, entries)
    found = history.first(holds, stays)
    if found is None:
        click.echo(f"{condition}: never in {len(entries)} entries")
        return exit_codes.FAILURE
    sessions = Sessions()
    for entry in entries[: found.number]:
        sessions.follow(entry)
    click.echo(line(found, sessions))
    if keep is not None:
        data = write(take(history.to(found.number)))
        try:
            keep.write_bytes(data)
        except OSError as error:
            raise VbusError(f"{keep}: cannot be written: {error.strerror}") from error
        click.echo(f"{keep}: {header.board} before it, {len(data)} bytes")
    return exit_codes.OK
