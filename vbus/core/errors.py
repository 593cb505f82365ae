"""Every exception of vbus.

::

    VbusError
    +-- ConfigError       the board file is wrong: file, line, key, what is allowed
    +-- OptionError       what a user has asked for makes no sense, or not on this board
    +-- ProtocolError     a host's bytes cannot be understood; ends that session only
    +-- TransportError    a link cannot be opened or was lost (also an OSError)
    |   +-- NameInUseError    another running process has the name
    +-- NotReadyError     a chip stays busy, or does not get there, beyond the host's own limit
    +-- ChecksumError     a chip's checksum of a packet is not the host's
    +-- ReadBackError     a chip says that something else was written
    +-- PluginError       an entry point is broken, or a package is missing
    +-- CaptureError      a capture is none, or lacks what a chip's bus needs
    +-- ProgramError      a program cannot be started
    +-- TimeEndedError    chip time has come to its end
    +-- SnapshotError     a saved state does not fit the board it is loaded into
    +-- NodeError         another node of the board: names it
        +-- NodeLostError     it has died, stalled or was cut off
        +-- NodeMismatchError it runs another board, or tells what cannot be

The kind says whose mistake it was. A host that breaks a *datasheet* raises nothing: the chip
does what silicon would do and a :class:`~vbus.core.signals.violation.Violation` is filed.
"""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

from vbus.core import exit_codes
from vbus.core.file_kinds import no_text, unreadable, unwritable


class VbusError(Exception):
    """Base of every error vbus raises on purpose."""

    exit_code: int = exit_codes.FAILURE
    """That of a command which the error has ended."""


class ConfigError(VbusError):
    """A board file that cannot be built.

    Example: an unknown key, a quantity in the wrong unit, two owners of one pin. The message
    names the file, the line, the key, what was found and what is allowed.
    """

    exit_code = exit_codes.BAD_BOARD


class OptionError(VbusError):
    """An option or argument that makes no sense: by itself, beside others, or for this board."""

    exit_code = exit_codes.USAGE


class ProtocolError(VbusError):
    """Bytes of a host that are not a request.

    Ends or refuses that one session; the board and all other sessions go on.
    """


class TransportError(VbusError, OSError):
    """A PTY, socket or serial line that cannot be opened, or was lost."""

    exit_code = exit_codes.NO_LINK


class NotReadyError(VbusError, TimeoutError):
    """A chip that stays busy, or an axis that does not get there, beyond the limit the host set."""


class ChecksumError(VbusError):
    """A packet whose checksum, as the chip tells it, is not what was sent and received."""


class ReadBackError(VbusError):
    """What a chip says of what was written to it is something else."""


class NameInUseError(TransportError):
    """A name (a PTY's link, a socket, a board's name) that another running process has."""


class PluginError(VbusError):
    """An entry point that is broken, or a package that is missing; says which, and why."""

    exit_code = exit_codes.NO_PLUGIN


class CaptureError(VbusError):
    """A capture that is none, is damaged, or lacks what a chip's bus needs."""

    exit_code = exit_codes.BAD_CAPTURE


class SnapshotError(VbusError):
    """A saved state that was made by another board, version or set of chips."""


class TimeEndedError(VbusError):
    """Chip time has come to its end; a board in real time ends there, in order."""

    exit_code = exit_codes.TIME_ENDED


class ProgramError(VbusError):
    """A program that cannot be started: there is none, or it is there and cannot be run."""

    def __init__(self, message: str, missing: bool) -> None:
        super().__init__(message)
        self.exit_code = exit_codes.NO_PROGRAM if missing else exit_codes.NOT_RUNNABLE


class NodeError(VbusError):
    """Another node of the same board does not do its part.

    Attributes:
        node: its name.
    """

    def __init__(self, node: str, message: str) -> None:
        super().__init__(message)
        self.node: str = node


class NodeLostError(NodeError):
    """A node that has died, was cut off, or has been silent beyond its deadline."""


class NodeMismatchError(NodeError):
    """A node that runs another board file or version, or whose messages make no sense."""


@contextmanager
def read_errors(path: str | Path, kind: type[VbusError] = VbusError) -> Iterator[None]:
    """Raise an error of this kind where the file cannot be read, or is no text."""
    try:
        yield
    except OSError as error:
        raise kind(f"{path}: {unreadable(path, error)}") from error
    # The bytes are at hand: what the file is instead can be said.
    except UnicodeDecodeError as error:
        raise kind(f"{path}: {no_text(path, error.object)}") from error


def content(path: str | Path) -> bytes:
    """Return what a file has.

    Raises:
        VbusError: it cannot be read.
    """
    with read_errors(path):
        return Path(path).read_bytes()


@contextmanager
def write_errors(path: str | Path) -> Iterator[None]:
    """Raise a :class:`VbusError` where the file cannot be written."""
    try:
        yield
    except OSError as error:
        if isinstance(error, VbusError):  # a TransportError, which says more
            raise
        raise VbusError(f"{path}: {unwritable(path, error)}") from error


@contextmanager
def value_errors(kind: Callable[..., Exception], before: str = "", **more: str) -> Iterator[None]:
    """Raise a ValueError of the block as an error of this kind.

    Args:
        kind: makes it of the text, and of what else it is to be given (``more``).
        before: stands in front of the text.
    """
    try:
        yield
    except ValueError as error:
        raise kind(f"{before}{error}", **more) from None


@contextmanager
def import_errors(
    lacking: str, install: str, kind: Callable[[str], Exception] = PluginError
) -> Iterator[None]:
    """Raise an error of this kind where a package that is no part of vbus is not installed.

    Args:
        lacking: what needs which package, such as "pictures need matplotlib".
        install: what pip is to install, such as "matplotlib".
        kind: makes the error of a sentence.
    """
    try:
        yield
    except ImportError as error:
        them = "them" if " " in install else "it"
        raise kind(f"{lacking}; install {them} with: pip install {install}") from error


@contextmanager
def listen_errors(place: str, where: str = "", kind: type[Exception] = OSError) -> Iterator[None]:
    """Raise a :class:`TransportError` where nothing can listen at a place.

    Args:
        place: the address.
        where: the option, or section, that gives another, such as "with --sigrok".
        kind: error that says so.
    """
    try:
        yield
    except kind as error:
        # Libraries wrap the system's error, which has the words that help.
        cause = error.__cause__ or error
        another = " ".join(["another", *where.split()])
        raise TransportError(
            f"{place}: cannot listen: {getattr(cause, 'strerror', None) or error}; free the"
            f" address, or give {another} (port 0 is any free one)"
        ) from error
