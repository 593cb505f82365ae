"""What the exit code of ``vbus`` says; documented in ``vbus --help``, and stable."""

from typing import Final

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
    BAD_BOARD: "the board file is wrong, or names a part, model or protocol that is not here",
    NO_LINK: "no such board runs, or a PTY, socket or serial device cannot be opened",
    NO_PLUGIN: "a package that is needed is not installed, or a plug-in is broken",
    BAD_CAPTURE: "a capture cannot be read, or lacks what is needed",
    TIME_ENDED: "chip time has come to its end, 106 days after power-on",
    NOT_RUNNABLE: "vbus exec: the program is there, and cannot be run",
    NO_PROGRAM: "vbus exec: there is no such program",
    INTERRUPTED: "interrupted by Ctrl-C before it was done",
}
