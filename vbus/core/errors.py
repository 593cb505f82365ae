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
    +-- PluginError       an entry point is missing or broken
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

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from vbus.core.file_kinds import no_text, unreadable, unwritable


class VbusError(Exception):
    """Base of every error vbus raises on purpose."""


class ConfigError(VbusError):
    """A board file that cannot be built.

    Example: an unknown key, a quantity in the wrong unit, two owners of one pin. The message
    names the file, the line, the key, what was found and what is allowed.
    """


class OptionError(VbusError):
    """An option or argument that makes no sense: by itself, beside others, or for this board."""


class ProtocolError(VbusError):
    """Bytes of a host that are not a request.

    Ends or refuses that one session; the board and all other sessions go on.
    """


class TransportError(VbusError, OSError):
    """A PTY, socket or serial line that cannot be opened, or was lost."""


class NotReadyError(VbusError, TimeoutError):
    """A chip that stays busy, or an axis that does not get there, beyond the limit the host set."""


class ChecksumError(VbusError):
    """A packet whose checksum, as the chip tells it, is not what was sent and received."""


class ReadBackError(VbusError):
    """What a chip says of what was written to it is something else."""


class NameInUseError(TransportError):
    """A name (a PTY's link, a socket, a board's name) that another running process has."""


class PluginError(VbusError):
    """An entry point that is missing or broken; names the distribution and the reason."""


class CaptureError(VbusError):
    """A capture that is none, is damaged, or lacks what a chip's bus needs."""


class SnapshotError(VbusError):
    """A saved state that was made by another board, version or set of chips."""


class TimeEndedError(VbusError):
    """Chip time has come to its end; a board in real time ends there, in order."""


class ProgramError(VbusError):
    """A program that cannot be started.

    Attributes:
        missing: whether there is none of that name; or else it is there and cannot be run.
    """

    def __init__(self, message: str, missing: bool) -> None:
        super().__init__(message)
        self.missing: bool = missing


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
