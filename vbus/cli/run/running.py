"""Verbs about boards that run: ``vbus ls``, ``wait``, ``logs`` and ``stop``."""

import os
import select
import signal
import time
from contextlib import suppress
from typing import Any, Final

import click

from vbus.cli.output import complain, endpoint_option, seconds_option, show
from vbus.cli.proc import handle_of
from vbus.cli.status_lines import listed_lines
from vbus.core import exit_codes
from vbus.core.errors import TransportError
from vbus.serve import registry

# A person who follows a log does not see a tenth of a second.
LOG_PAUSE: Final = 0.1
"""Seconds between two looks at a log that is followed."""
# Scripts wait for a start often: a fiftieth of a second does not add up.
WAIT_PAUSE: Final = 0.02
"""Seconds between two looks whether a board is ready."""
_STEP: Final = 0.1
"""Seconds of a wait for the end of a board."""


@click.command("ls")
@click.argument("names", metavar="[NAME]...", nargs=-1)
@endpoint_option("--zenoh", "endpoints", multiple=True, text="Look on this network too.")
@click.option("--json", "as_json", is_flag=True, help="Print JSON; instants and spans in ps.")
def ls(names: tuple[str, ...], endpoints: tuple[str, ...], as_json: bool) -> int:
    """List the boards that run on this machine, with their chips, links, time and lag.

    Boards elsewhere that "vbus attach" has brought here are listed with their round trips; others
    on the network where --zenoh, $VBUS_ZENOH or a router on this machine says where to look. With
    NAMES, only those; the exit code is 4 if one of them does not run or does not answer.
    """
    found = list(registry.running())
    found += _elsewhere(endpoints, {(board["board"], board.get("pid")) for board in found})
    boards = [board for board in found if not names or board["board"] in names]
    answering = {board["board"] for board in boards if "error" not in board}
    missing = [name for name in names if name not in answering]
    lines = (line for board in boards for line in listed_lines(board))
    show(as_json, boards, lines if boards or names else ["no board is running"])
    listed = {board["board"] for board in boards}
    for name in missing:
        if name not in listed:  # else its line says that it does not answer
            complain(registry.not_there(name, "answers"))
    return exit_codes.NO_LINK if missing else exit_codes.OK


def _elsewhere(
    endpoints: tuple[str, ...], known: set[tuple[str, int | None]]
) -> list[dict[str, Any]]:
    """Return what boards on the network tell that were not found on this machine."""
    from vbus.network import places

    wanted = endpoints or tuple(filter(None, os.environ.get("VBUS_ZENOH", "").split(",")))
    wanted = wanted or places.endpoints_at(places.router_place())
    if not wanted:
        return []
    from vbus.network.session import boards_on

    try:
        boards = boards_on(wanted, places.security_of({}, "vbus ls"))
    except TransportError as error:
        complain(str(error))
        return []
    return [board for board in boards if (board["board"], board.get("pid")) not in known]


@click.command("wait")
@click.argument("names", metavar="NAME...", nargs=-1, required=True)
@seconds_option("--timeout", default=10.0, text="How long to wait for all of them; else 10 s.")
def wait(names: tuple[str, ...], timeout: float) -> int:
    """Wait until boards are ready: every link of each is open.

    NAME is that of a board, of a node (BOARD.NODE), or of a board with nodes: all of them.
    """
    deadline = time.monotonic() + timeout
    for name in names:
        while not registry.answers(name):
            if time.monotonic() >= deadline:
                late = registry.not_there(name, f"is ready within {timeout:g} s")
                raise TransportError(f'{late}; "vbus logs" shows what one in the background says')
            time.sleep(WAIT_PAUSE)
    return exit_codes.OK


@click.command("logs")
@click.argument("board")
@click.option("-f", "--follow", is_flag=True, help="Go on until the board ends.")
def logs(board: str, follow: bool) -> None:
    """Show what a board has said that was started with "--detach": by vbus run, or by vbus up.

    The log stays until a board of this name is started again.
    """
    from vbus.cli.run.detach import goes_on

    try:
        file = registry.log_path(board).open(encoding="utf-8", errors="replace")
    except FileNotFoundError:
        absent = registry.not_there(board, "was started with --detach")
        raise TransportError(f"{absent}; without it a board tells its own terminal") from None
    with file:
        while True:
            alive = follow and goes_on(file)
            click.echo(file.read(), nl=False)
            if not alive:
                return
            time.sleep(LOG_PAUSE)


@click.command("stop")
@click.argument("names", metavar="NAME...", nargs=-1, required=True)
@seconds_option("--timeout", default=15.0, text="How long a board may take; else 15 s.")
def stop(names: tuple[str, ...], timeout: float) -> int:
    """End running boards, and wait until they have ended.

    Journals, reports and waveforms are whole when it returns; the exit code is 1 if a board in the
    background could not write all of them. NAME is what "vbus ls" shows, also of
    what "vbus attach" has brought here, or that of a board with nodes: all of them.
    """
    # All are found before any is ended: a wrong name stops none of them.
    boards = [(board["board"], board["pid"]) for board in registry.running() if "pid" in board]
    processes: dict[str, set[int]] = {}
    for name in names:
        # A node of a board is listed as BOARD.NODE.
        processes[name] = {
            process for board, process in boards if name in (board, board.partition(".")[0])
        }
        if not processes[name]:
            raise TransportError(registry.not_there(name, "runs"))
    late, lacking = [], []
    for name in names:
        ended = [_ended(process, timeout) for process in processes[name]]
        if not all(ended):
            late.append(name)
        lacking += _unrecorded(name, processes[name])
    for sentence in lacking:
        complain(sentence)
    for name in late:
        complain(
            f'{name} has not ended within {timeout:g} s and still runs; "vbus logs {name}" shows'
            " what it says, if it was started with --detach"
        )
    return exit_codes.FAILURE if late or lacking else exit_codes.OK


def _unrecorded(name: str, processes: set[int]) -> list[str]:
    """Return what a board in the background has last said, if that is what it could not record."""
    from vbus.serve.recording import LACKING

    try:
        lines = registry.log_path(name).read_text(errors="replace").splitlines() or [""]
    except OSError:
        return []
    # The log may be of an earlier run than the one in a terminal that has ended now.
    own = any(lines[0].endswith(f"process {process}") for process in processes)
    said = lines[-1].removeprefix("vbus: ")
    return [f"{name}: {said}"] if own and said.startswith(LACKING) else []


def _ended(process: int, timeout: float) -> bool:
    """End a process; tell whether it has ended in time."""
    with suppress(ProcessLookupError), handle_of(process) as handle:
        signal.pidfd_send_signal(handle, signal.SIGTERM)
        # One that was stopped (Ctrl-Z) would not hear of it.
        signal.pidfd_send_signal(handle, signal.SIGCONT)
        # In steps, so that seconds in which the machine itself stood still do not count.
        steps = range(int(timeout / _STEP) + 1)
        return any(select.select([handle], [], [], min(timeout, _STEP))[0] for _ in steps)
    return True
