"""``vbus run --detach``: the board goes on in the background once it is ready."""

import fcntl
import os
import select
import socket
import sys
from typing import TextIO

import click

from vbus.cli.proc import handle_of
from vbus.core import exit_codes
from vbus.serve.registry import log_path


def go_on_in_background(name: str) -> None:
    """Go on in a process of its own, whose output is the board's log.

    Raises:
        click.exceptions.Exit: in this process, once the board is ready or has failed.
    """
    log = log_path(name)
    # Until it is ready, a board of this name that runs already keeps its log.
    begun = log.with_name(f".{log.name}.{os.getpid()}")
    with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as notices:
        notices.bind("")  # an address of its own, which the system chooses
        # Else the child prints once more what has not been printed yet.
        sys.stdout.flush()
        sys.stderr.flush()
        child = os.fork()
        if child == 0:
            os.environ["NOTIFY_SOCKET"] = f"@{notices.getsockname()[1:].decode()}"
            _leave(str(begun))
            return
        # No handler of SIGCHLD: the descriptor tells the end of just this process.
        with handle_of(child) as ended:
            # The notice that the board is ready, or the end of its process.
            ready, _, _ = select.select([notices.fileno(), ended], [], [])
        if notices.fileno() in ready:
            begun.replace(log)
            click.echo(log.read_text().rpartition("\nready; ")[0])
            click.echo(f'ready; "vbus stop {name}" stops it')
            raise click.exceptions.Exit(exit_codes.OK)
    code = os.waitstatus_to_exitcode(os.waitpid(child, 0)[1])
    # A log on a full disk is empty.
    said = begun.read_text() or (
        f"vbus: the board ended with exit code {code}, and {begun} could not take why; start it"
        " without --detach\n"
    )
    click.echo(said, nl=False, err=True)
    begun.unlink()
    raise click.exceptions.Exit(code)


def _leave(log: str) -> None:
    """Leave the terminal: a session of its own, no input, and output to a file."""
    # Ctrl-C at the terminal goes to its session alone.
    os.setsid()
    nothing = os.open(os.devnull, os.O_RDONLY)
    output = os.open(log, os.O_WRONLY | os.O_CREAT | os.O_APPEND | os.O_NOFOLLOW, 0o600)
    # Of all that write there, to the end of the last: who follows the log goes by it.
    fcntl.flock(output, fcntl.LOCK_EX)
    for descriptor, place in ((nothing, 0), (output, 1), (output, 2)):
        os.dup2(descriptor, place)
    os.close(nothing)
    os.close(output)


def goes_on(log: TextIO) -> bool:
    """Whether a process runs that may write to this log."""
    try:
        fcntl.flock(log, fcntl.LOCK_SH | fcntl.LOCK_NB)
    except BlockingIOError:
        return True
    return False
