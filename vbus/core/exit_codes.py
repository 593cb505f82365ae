"""What the exit code of ``vbus`` says; documented in ``vbus --help`` and kept stable."""

from typing import TYPE_CHECKING, Final

if TYPE_CHECKING:
    from vbus.core.errors import VbusError

OK: Final = 0
FAILURE: Final = 1
USAGE: Final = 2
BAD_BOARD: Final = 3
NO_LINK: Final = 4
NO_PLUGIN: Final = 5
BAD_CAPTURE: Final = 6
TIME_ENDED: Final = 7
NOT_RUNNABLE: Final = 126
NO_PROGRAM: Final = 127
INTERRUPTED: Final = 130

MEANINGS: Final = {
    OK: "it worked; also what serves until Ctrl-C, ended by that",
    FAILURE: "it did not work; the message says why",
    USAGE: "the command line is wrong, or is not for this board; of vbus diff: the runs cannot be"
    " compared",
    BAD_BOARD: "the board file is wrong",
    NO_LINK: "no such board runs, or a PTY, socket or serial device cannot be opened",
    NO_PLUGIN: "a plug-in is missing or broken",
    BAD_CAPTURE: "a capture cannot be read, or lacks what is needed",
    TIME_ENDED: "chip time has come to its end, 106 days after power-on",
    NOT_RUNNABLE: "vbus exec: the program is there, and cannot be run",
    NO_PROGRAM: "vbus exec: there is no such program",
    INTERRUPTED: "interrupted by Ctrl-C before it was done",
}


def code_of(error: "VbusError") -> int:
    """Return the exit code of a command that an error has ended."""
    # Not above: Ctrl-C may come while the errors are imported, and has a code of its own.
    from vbus.core import errors

    if isinstance(error, errors.ProgramError):
        return NO_PROGRAM if error.missing else NOT_RUNNABLE
    codes = {
        errors.OptionError: USAGE,
        errors.ConfigError: BAD_BOARD,
        errors.TransportError: NO_LINK,
        errors.PluginError: NO_PLUGIN,
        errors.CaptureError: BAD_CAPTURE,
        errors.TimeEndedError: TIME_ENDED,
    }
    # By class, base classes too: a name in use is a link that cannot be opened.
    return next((code for kind, code in codes.items() if isinstance(error, kind)), FAILURE)
