"""What the exit code of ``vbus`` says; documented in ``vbus --help`` and kept stable."""

from typing import Final

from vbus.core.errors import (
    CaptureError,
    ConfigError,
    PluginError,
    ProgramError,
    TimeEndedError,
    TransportError,
    VbusError,
)

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
    USAGE: "the command line is wrong; of vbus diff: the runs cannot be compared",
    BAD_BOARD: "the board file is wrong",
    NO_LINK: "no such board runs, or a PTY, socket or serial device cannot be opened",
    NO_PLUGIN: "a plug-in is missing or broken",
    BAD_CAPTURE: "a capture cannot be read, or lacks what is needed",
    TIME_ENDED: "chip time has come to its end, 106 days after power-on",
    NOT_RUNNABLE: "vbus exec: the program is there, and cannot be run",
    NO_PROGRAM: "vbus exec: there is no such program",
    INTERRUPTED: "interrupted by Ctrl-C before it was done",
}

_CODES: Final = {
    ConfigError: BAD_BOARD,
    TransportError: NO_LINK,
    PluginError: NO_PLUGIN,
    CaptureError: BAD_CAPTURE,
    TimeEndedError: TIME_ENDED,
}


def code_of(error: VbusError) -> int:
    """Return the exit code of a command that an error has ended."""
    if isinstance(error, ProgramError):
        return NO_PROGRAM if error.missing else NOT_RUNNABLE
    return next((code for kind, code in _CODES.items() if isinstance(error, kind)), FAILURE)
