"""The ``vbus`` command. Subcommands are imported when they are called: start-up stays short."""

import errno
import importlib
import os
import sys
from typing import Any, Final

import click

from vbus.errors import (
    CaptureError,
    ConfigError,
    PluginError,
    ProgramError,
    TimeEndedError,
    TransportError,
    VbusError,
)
from vbus.tools import exit_codes
from vbus.tools.version_line import version_line
from vbus.version import __version__

_COMMANDS: Final = {
    "attach": "Make a board on another computer appear as a PTY or Unix socket here.",
    "cflags": "Print the compiler options of the C client.",
    "check": "Check board files; list the rules hosts are held to.",
    "conform": "Compare a logic analyser's capture of a real chip with the model.",
    "coverage": "Show which commands and registers a driver has used, and which never.",
    "demo": "Watch a chip move a motor under a host in another process.",
    "diff": "Compare two recorded runs: what hosts did, what motors did.",
    "doctor": "Look for what is missing or broken on this machine.",
    "exec": "Run a program or AVR firmware on a board of its own.",
    "explain": "Explain bytes on a bus, a status value, a rule, or a journal.",
    "fault": "Break a running board on schedule; show what came of it.",
    "logs": "Show what a board has said that runs in the background.",
    "ls": "List the boards that run on this machine.",
    "monitor": "Watch the buses of a running board in the manual's words.",
    "order": "Order bus cycles on several nodes for one coming instant.",
    "plot": "Draw the motion of a recorded run: SVG, PNG or PDF.",
    "replay": "Play a recorded run again; stop at the first difference.",
    "report": "Show the violations of a recorded run, with the cycles around them.",
    "router": "Let boards and hosts of several computers meet (Zenoh).",
    "run": "Run a board and serve its links until Ctrl-C.",
    "scope": "See a running board or a recorded run in a browser.",
    "schema": "Print the JSON Schema of board files, for editors.",
    "snap": "Take snapshots of running boards, load them again.",
    "stop": "End running boards in order.",
    "trace": "Merge the traces of nodes; print the hash of what happened.",
    "up": "Start a machine of nodes.",
    "wait": "Wait until boards are ready.",
    "wave": "Write a waveform of a running board or of a recorded run.",
}

_FULL: Final = (errno.ENOSPC, errno.EDQUOT, errno.EFBIG, errno.EIO)
"""What a full or broken disk behind standard output says."""

_LONGEST: Final = 100
"""Characters of a name that a message shows."""

_COMPLETING: Final = "_VBUS_COMPLETE"
"""Is set in the environment while a shell asks what could follow."""

_EPILOG: Final = "\b\nExit codes:\n" + "\n".join(
    f"  {code:<4}{meaning}" for code, meaning in exit_codes.MEANINGS.items()
)


_CODES: Final = {
    ConfigError: exit_codes.BAD_BOARD,
    TransportError: exit_codes.NO_LINK,
    PluginError: exit_codes.NO_PLUGIN,
    CaptureError: exit_codes.BAD_CAPTURE,
    TimeEndedError: exit_codes.TIME_ENDED,
}


class _Lazy(click.Group):
    """A group whose commands live in ``vbus.tools.NAME`` as ``command``."""

    def list_commands(self, ctx: click.Context) -> list[str]:
        return list(_COMMANDS)

    def get_command(self, ctx: click.Context, cmd_name: str) -> click.Command | None:
        if cmd_name not in _COMMANDS:
            return None
        module = importlib.import_module(f"vbus.tools.{cmd_name}")
        command: click.Command = module.command
        if _COMPLETING in os.environ:
            from vbus.tools.completing import prepared

            return prepared(command, cmd_name)
        return command

    def format_commands(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        with formatter.section("Commands"):
            formatter.write_dl(list(_COMMANDS.items()))

    def resolve_command(
        self, ctx: click.Context, args: list[str]
    ) -> tuple[str | None, click.Command | None, list[str]]:
        name = args[0]
        if name not in _COMMANDS and not name.startswith("-"):
            from vbus.values.settings import suggestion

            known = ", ".join(_COMMANDS)
            hint = suggestion(name, _COMMANDS)
            raise click.UsageError(f'there is no command "{name}"; {hint}there are {known}', ctx)
        return super().resolve_command(ctx, args)


@click.group(
    cls=_Lazy,
    epilog=_EPILOG,
    context_settings={"help_option_names": ["-h", "--help"]},
    help="A virtual hardware bus server: motion-control chips, bit for bit, for real drivers.",
)
@click.version_option(__version__, "-V", "--version", message=version_line())
def cli() -> None:
    """Hold the subcommands."""


def main(arguments: list[str] | None = None) -> None:
    """Run ``vbus`` and exit with one of :data:`~vbus.tools.exit_codes.MEANINGS`."""
    sys.exit(_run(arguments))


def _run(arguments: list[str] | None) -> int:
    try:
        result: Any = cli.main(arguments, prog_name="vbus", standalone_mode=False)
        sys.stdout.flush()
    except click.ClickException as error:
        error.show()
        return error.exit_code
    except click.exceptions.Exit as error:
        return error.exit_code
    except VbusError as error:
        # Mistakes of board files begin with their place.
        click.echo(f"{'' if isinstance(error, ConfigError) else 'vbus: '}{error}", err=True)
        if isinstance(error, ProgramError):
            return exit_codes.NO_PROGRAM if error.missing else exit_codes.NOT_RUNNABLE
        codes = (code for kind, code in _CODES.items() if isinstance(error, kind))
        return next(codes, exit_codes.FAILURE)
    except (KeyboardInterrupt, click.Abort):
        return exit_codes.INTERRUPTED
    except BrokenPipeError:
        # Whoever read our output has seen enough; do not complain at exit either.
        _write_no_more()
        return exit_codes.FAILURE
    except OSError as error:
        if error.filename is not None:  # a name no file can have, such as one too long
            click.echo(f"vbus: {str(error.filename)[:_LONGEST]}: {error.strerror}", err=True)
            return exit_codes.FAILURE
        if error.errno not in _FULL:
            raise
        click.echo(f"vbus: standard output: cannot be written: {error.strerror}", err=True)
        _write_no_more()
        return exit_codes.FAILURE
    return result if isinstance(result, int) else exit_codes.OK


def _write_no_more() -> None:
    """Let what is left for standard output be lost in silence."""
    os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
