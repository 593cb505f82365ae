"""``vbus stop``: end running boards in order."""

import contextlib
import os
import select
import signal

import click

from vbus.cli import exit_codes
from vbus.cli.output import complain
from vbus.core.errors import TransportError

_STEP = 0.1
"""Seconds."""


@click.command("stop")
@click.argument("names", metavar="NAME...", nargs=-1, required=True)
@click.option(
    "--timeout", type=click.FloatRange(0, 3600), default=15.0, metavar="SECONDS",
    help="How long a board may take; 15 s if not given.",
)  # fmt: skip
def command(names: tuple[str, ...], timeout: float) -> int:
    """End running boards, and wait until they have ended.

    Journals, reports and waveforms are whole when it returns. NAME is what "vbus ls" shows, also of
    what "vbus attach" has brought here, or that of a board with nodes: all of them.
    """
    from vbus.serve.registry import running

    boards = [(board["board"], board["pid"]) for board in running() if "pid" in board]
    processes: dict[str, set[int]] = {}
    for name in names:
        # A node of a board is listed as BOARD.NODE.
        processes[name] = {
            process for board, process in boards if name in (board, board.partition(".")[0])
        }
        if not processes[name]:
            raise TransportError(f'no board called "{name}" runs; "vbus ls" shows which do')
    late = []
    for name in names:
        ended = [_ended(process, timeout) for process in processes[name]]
        if not all(ended):
            late.append(name)
    for name in late:
        complain(
            f'{name} has not ended within {timeout:g} s and still runs; "vbus logs {name}" shows'
            " what it says, if it was started with --detach"
        )
    return exit_codes.FAILURE if late else exit_codes.OK


def _ended(process: int, timeout: float) -> bool:
    """End a process; tell whether it has ended in time."""
    with contextlib.suppress(ProcessLookupError):
        handle = os.pidfd_open(process)
        try:
            signal.pidfd_send_signal(handle, signal.SIGTERM)
            # One that was stopped (Ctrl-Z) would not hear of it.
            signal.pidfd_send_signal(handle, signal.SIGCONT)
            # In steps, so that seconds in which the machine itself stood still do not count.
            steps = range(int(timeout / _STEP) + 1)
            return any(select.select([handle], [], [], min(timeout, _STEP))[0] for _ in steps)
        finally:
            os.close(handle)
    return True
