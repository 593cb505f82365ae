"""The ``vbus`` command. Subcommands are imported when they are called: start-up stays short."""

import errno
import importlib
import os
import sys
from contextlib import suppress
from itertools import zip_longest
from typing import Any, ClassVar, Final

import click

from vbus.cli.output import Verbs, complain
from vbus.compiled import version_line
from vbus.core import exit_codes
from vbus.core.errors import ConfigError, VbusError
from vbus.version import __version__

_GROUPS: Final = {
    "Run": {
        "run": "Run a board until Ctrl-C.",
        "exec": "Run a program on a board.",
        "demo": "Watch a chip move a motor.",
        "snap": "Take and load snapshots.",
        "check": "Check board files.",
        "schema": "JSON Schema of board files.",
        "ls": "List boards that run.",
        "wait": "Wait until they are ready.",
        "logs": "Show what a board has said.",
        "stop": "End running boards.",
        "doctor": "Find what is missing here.",
        "cflags": "Options of the C client.",
    },
    "Look": {
        "monitor": "Buses in the manual's words.",
        "scope": "A board or run in a browser.",
        "explain": "Explain bytes, rules, runs.",
        "wave": "Write a waveform.",
        "plot": "Draw the motion of a run.",
        "report": "Show violations of a run.",
    },
    "Test": {
        "replay": "Play a recorded run again.",
        "diff": "Compare two recorded runs.",
        "coverage": "Show what a driver has used.",
        "conform": "Compare a capture of a chip.",
        "fault": "Break a board on schedule.",
        "campaign": "A program in broken worlds.",
        "fit": "A motor's data from a move.",
        "fmu": "Make a board an FMI block.",
    },
    "Network": {
        "attach": "A board elsewhere as a PTY.",
        "router": "Let computers meet (Zenoh).",
        "up": "Start a machine of nodes.",
        "trace": "Merge the traces of nodes.",
    },
}
_TOGETHER: Final = {
    "running": ("ls", "wait", "logs", "stop"), "check": ("check", "schema"), "up": ("up", "trace"),
}  # fmt: skip
"""Modules with several commands, each of which has its own name there; else it is ``command``."""
_MODULES: Final = {name: module for module, names in _TOGETHER.items() for name in names}
_FOLDERS: Final = {name: title.lower() for title, group in _GROUPS.items() for name in group}
_COMMANDS: Final = sorted(_FOLDERS)
_USAGE: Final = "vbus COMMAND [ARGS]..., vbus COMMAND --help, vbus --version"

# Other errors without a file name are mistakes of this program, and show their traceback.
_FULL: Final = (errno.ENOSPC, errno.EDQUOT, errno.EFBIG, errno.EIO)
"""What a full or broken disk behind standard output says."""

_LONGEST: Final = 100
"""Characters of a name that a message shows."""

_COMPLETING: Final = "_VBUS_COMPLETE"
"""Is set in the environment while a shell asks what could follow."""

_GONE: Final = {
    ("up", "--write"): "For containers and systemd copy docker/compose.yaml or docker/systemd of"
    " the sources; docs/docker.md says how they run."
}  # fmt: skip
"""Options that there were, by command and name, and what to use in their place."""

_EXITS: Final = (
    "Exit codes: 0 it worked, 1 it did not; wrong: 2 command line, 3 board file,",
    "4 link, 5 plug-in, 6 capture; 7 chip time is over; 126, 127 of exec; 130 Ctrl-C.",
)


class _Lazy(Verbs):
    """A group whose commands live in ``vbus.cli.GROUP.NAME`` as ``command``."""

    GONE: ClassVar[dict[str, str]] = {
        "order": "from Python, order() of vbus.serve.nodes.ordering orders bus cycles on nodes"
    }

    def list_commands(self, ctx: click.Context) -> list[str]:
        return _COMMANDS

    def get_command(self, ctx: click.Context, cmd_name: str) -> click.Command | None:
        if cmd_name not in _COMMANDS:
            return None
        name = _MODULES.get(cmd_name, cmd_name)
        module = importlib.import_module(f"vbus.cli.{_FOLDERS[cmd_name]}.{name}")
        command: click.Command = getattr(module, cmd_name if cmd_name in _MODULES else "command")
        # Completion types cost imports that no ordinary call needs.
        if _COMPLETING in os.environ:
            from vbus.cli.completing import prepared

            return prepared(command, cmd_name)
        return command

    def format_help(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        """Write a page that fits a terminal of 24 lines and 80 columns."""
        lines = [f"Usage: {_USAGE}", self.help or ""]
        for title, commands in _GROUPS.items():
            cells = [f"  {name:<9}{text}" for name, text in commands.items()]
            half = (len(cells) + 1) // 2
            rows = zip_longest(cells[:half], cells[half:], fillvalue="")
            lines += [f"{title}:", *(f"{left:<40}{right}".rstrip() for left, right in rows)]
        formatter.write("\n".join([*lines, *_EXITS, ""]))


@click.group(
    cls=_Lazy,
    context_settings={"help_option_names": ["-h", "--help"]},
    help="A virtual bus of motion-control chips, bit for bit, for real drivers.",
)
@click.version_option(__version__, "-V", "--version", message=version_line())
def cli() -> None:
    """Hold the subcommands."""


def main(arguments: list[str] | None = None) -> None:
    """Run ``vbus`` and exit with one of :data:`~vbus.core.exit_codes.MEANINGS`."""
    sys.exit(_run(arguments))


def _run(arguments: list[str] | None) -> int:
    try:
        # Not standalone: a verb returns its exit code, and errors of vbus have codes of their own.
        result: Any = cli.main(arguments, prog_name="vbus", standalone_mode=False)
        # A full disk behind standard output is found here, not by the interpreter at its exit.
        sys.stdout.flush()
    except click.ClickException as error:
        with suppress(OSError):
            _advised(error).show()
        return error.exit_code
    except click.exceptions.Exit as error:
        return error.exit_code
    except VbusError as error:
        # Mistakes of board files begin with their place.
        complain(str(error), "" if isinstance(error, ConfigError) else "vbus: ")
        return error.exit_code
    except (KeyboardInterrupt, click.Abort):
        return exit_codes.INTERRUPTED
    except BrokenPipeError:
        # The reader of our output has gone; do not complain at exit either.
        _write_no_more()
        return exit_codes.FAILURE
    except OSError as error:
        if error.filename is not None:  # a name no file can have, such as one too long
            complain(f"{str(error.filename)[:_LONGEST]}: {error.strerror}")
            return exit_codes.FAILURE
        if error.errno not in _FULL:
            raise
        complain(f"standard output: cannot be written: {error.strerror}")
        _write_no_more()
        return exit_codes.FAILURE
    return result if isinstance(result, int) else exit_codes.OK


def _advised(error: click.ClickException) -> click.ClickException:
    """Return the error; of an option in a wrong place, one that says which place is right."""
    if not isinstance(error, click.NoSuchOption) or error.ctx is None:
        return error
    name = error.option_name
    if error.ctx.parent is None:
        place = f"An option of a command stands behind its name: vbus COMMAND {name}"
        return click.UsageError(f"{error.message} {place}", error.ctx)
    from vbus.boardfile.key import rows
    from vbus.boardfile.sections import BoardSection, HostSection

    if place := _GONE.get((str(error.ctx.info_name), name), ""):
        return click.UsageError(f"No such option '{name}'. {place}", error.ctx)
    key = name.strip("-")
    for section, of in (("[board]", BoardSection), ("[[hosts]]", HostSection)):
        if key in (row.name for row in rows(of)):
            place = f'"{key}" is a key of {section} in the board file.'
            return click.UsageError(f"{error.message} {place}", error.ctx)
    return error


def _write_no_more() -> None:
    """Let what is left for standard output be lost in silence."""
    os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
