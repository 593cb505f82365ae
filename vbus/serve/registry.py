"""Boards that run on this computer: how they are found and asked."""

import contextlib
import json
import select
import socket
import stat
from collections import Counter
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any, Final

from vbus.core.errors import NameInUseError, TransportError, VbusError
from vbus.core.runtime import is_trusted, lock_of, lock_state, subdirectory
from vbus.core.values.settings import suggestion
from vbus.core.wall_clock import monotonic
from vbus.serve.time.watchdog_process import Turns
from vbus.transports.runtime import NameLock, socket_address, sweep
from vbus.transports.sockets import process_behind

ANSWER_SECONDS: Final = 2.0
"""How long a running board may take to tell about itself: far above the worst wake-up of a server
on a crowded machine, 31 ms (docs/performance.md). A person waits as long for one that hangs."""
TURN_SECONDS: Final = 0.1
"""How often it is looked whether one that takes longer has no turn, on a busy machine."""
LONGEST_ANSWER: Final = 1 << 28
"""Bytes of an answer at most: a bound of memory."""
HEAD_SIZE: Final = 4
"""Bytes of a message's length, which stands before it."""
ORDER_SECONDS: Final = 60.0
"""How long it may take to carry out an order: a step to a condition may compute for long."""
_OWNED: Final[Counter[Path]] = Counter()
"""How often this process has entered :func:`own_board`, by the name's path."""


def boards_directory() -> Path:
    """Return the directory in which running boards have their sockets."""
    return subdirectory("boards")


def socket_path(board: str) -> Path:
    """Return the socket at which the board called ``board`` is asked, ordered and watched."""
    return boards_directory() / f"{_safe(board)}.sock"


def name_path(board: str) -> Path:
    """Return the path that the process that runs the board called ``board`` has locked."""
    return boards_directory() / f"{_safe(board)}.name"


@contextlib.contextmanager
def own_board(board: str) -> Iterator[None]:
    """Own a board's name, before anything is opened that another run of it might be using.

    It may be entered again within.

    Raises:
        NameInUseError: another process runs a board of this name.
    """
    path = name_path(board)
    lock = NameLock(path)
    if not _OWNED[path]:
        try:
            lock.take(board)
        except NameInUseError as error:
            raise runs_already(board, error) from error
        sweep(path.parent)
    _OWNED[path] += 1
    try:
        yield
    finally:
        _OWNED[path] -= 1
        lock.give_back()


def runs_already(board: str, error: NameInUseError) -> NameInUseError:
    """Return the error that says so of a board."""
    # What the lock says to do is for any name; of a board there is a verb.
    owner, _, _ = str(error).partition("; ")
    return NameInUseError(
        f'a board called "{board}" runs already ({owner}); "vbus stop {board}" stops it, or give'
        " this one another name"
    )


def log_path(board: str) -> Path:
    """Return the file with what the board called ``board`` says, if it runs in the background."""
    return boards_directory() / f"{_safe(board)}.log"


def journal_path(board: str, when: int) -> Path:
    """Return where a copy of a journal of the board called ``board`` is, which ends at ``when``."""
    return subdirectory("journals") / f"{_safe(board)}-{when}.vbj"


def _safe(board: str) -> str:
    return "".join(c if c.isalnum() or c in "-_." else "_" for c in board)


def _exchange(path: Path, do: str, seconds: float, **values: Any) -> Any:
    """Return what comes of an order at a board's socket.

    Raises:
        OSError: no board answers, or not in time.
        ValueError: the answer is none of a board, or the socket is another user's.
        VbusError: the board refuses; says why.
    """
    found = path.lstat()
    if not stat.S_ISSOCK(found.st_mode) or not is_trusted(found):
        raise ValueError("it is no socket, or one that others have made or may write to")
    deadline, waited = monotonic() + seconds, seconds
    data, size = bytearray(), HEAD_SIZE
    with socket.socket(socket.AF_UNIX, socket.SOCK_STREAM) as link:
        link.settimeout(seconds)
        with socket_address(path) as address:
            link.connect(address)
        board, _ = process_behind(link)
        turns = Turns(lambda: [board])
        link.sendall(json.dumps({"do": do, **values}).encode() + b"\n")
        while len(data) < size:
            try:
                chunk = link.recv(1 << 20)
            except TimeoutError:
                # Between the two looks it may have had its turn, and have answered.
                if not turns.lacking(waited, seconds) and not select.select([link], (), (), 0)[0]:
                    raise
                waited += TURN_SECONDS
                link.settimeout(TURN_SECONDS)
                continue
            if not chunk:
                break
            data += chunk
            if len(data) >= HEAD_SIZE:
                size = HEAD_SIZE + int.from_bytes(data[:HEAD_SIZE], "little")
            if size > LONGEST_ANSWER:
                raise ValueError(f"an answer of more than {LONGEST_ANSWER} bytes")
            # One deadline for all of the answer: a byte now and then does not put it off.
            link.settimeout(max(deadline - monotonic(), 0.001))
    try:
        answer = json.loads(data[HEAD_SIZE:])
    except RecursionError:
        raise ValueError("an answer nested too deeply") from None
    if not isinstance(answer, dict) or not {"done", "error"} & answer.keys():
        raise ValueError("an answer that is none of a board")
    if "error" in answer:
        raise VbusError(str(answer["error"]))
    return answer["done"]


def ask(path: Path) -> dict[str, Any]:
    """Return what the board behind a socket tells of itself.

    Raises:
        TransportError: no board answers.
    """
    try:
        status = _exchange(path, "status", ANSWER_SECONDS)
        if not isinstance(status, dict) or not isinstance(status.get("board"), str):
            raise ValueError("an answer that names no board")
        return status
    except (OSError, ValueError, VbusError) as error:
        raise TransportError(f"{path.stem}: does not answer ({error})") from error


def answers(board: str) -> bool:
    """Tell whether a board of this name is ready; one that answers has every link open.

    A board with nodes is ready when each of them is.
    """
    try:
        ask(socket_path(board))
    except TransportError:
        here = nodes_of(board)  # of a machine, every node answers
        return bool(here) and not missing_of(here)
    return True


def nodes_of(machine: str) -> dict[str, dict[str, Any]]:
    """Return what each node on this computer of a machine tells of itself, by name."""
    here = {}
    for path in sorted(boards_directory().glob(f"{_safe(machine)}.*.sock")):
        with contextlib.suppress(TransportError):
            node = ask(path).get("node", {})
            if node.get("board") == machine:
                here[str(node["node"])] = node
    return here


def missing_of(nodes: Mapping[str, dict[str, Any]]) -> list[str]:
    """Return which nodes of a machine are not among these that :func:`nodes_of` has found."""
    return sorted({name for node in nodes.values() for name in node["others"]} - {*nodes})


def not_there(board: str, does: str, error: Exception | None = None) -> str:
    """Return that no board of a name does something, and what the name may have been meant for.

    Args:
        board: the name.
        does: what a board of this name would do.
        error: why it does not; that there is no such name needs no word.
    """
    nodes = [f"{board}.{name}" for name in nodes_of(board)]
    if nodes:
        return f'"{board}" is a machine of nodes; name one of them: {", ".join(nodes)}'
    path = Path(board)
    if path.is_dir():
        return f'"{board}" is a directory, and no board; name a file in it, or a board ("vbus ls")'
    known = error is None or isinstance(error, FileNotFoundError)
    reason = "" if known else f" ({getattr(error, 'strerror', None) or error})"
    is_file = f"; {board} is a file" if path.is_file() else ""
    # A journal or a board file that is not there: its name was meant, not that of a board.
    no_file = f"there is no file {board}, and " if path.suffix and not is_file else ""
    others = {found.stem for found in boards_directory().glob("*.sock")} - {board}
    hint = suggestion(board, sorted(others))
    return (
        f'{no_file}no board called "{board}" {does}{reason}{is_file}; {hint}"vbus ls" shows which'
        ' run, "vbus run FILE" starts one'
    )


def order(board: str, do: str, **values: Any) -> Any:
    """Give a running board an order (see :mod:`vbus.serve.local_socket`); return what came of it.

    Raises:
        TransportError: no board of that name takes orders.
        VbusError: the board refuses; says why.
    """
    try:
        return _exchange(socket_path(board), do, ORDER_SECONDS, **values)
    except (OSError, ValueError) as error:
        raise TransportError(not_there(board, "takes orders", error)) from error
    except VbusError as error:
        raise VbusError(f"{board}: {error}") from error


def running() -> Iterator[dict[str, Any]]:
    """Yield what each running board tells, by name; remove sockets of boards that died."""
    # A killed process leaves its names behind.
    sweep(boards_directory())
    for path in sorted(boards_directory().glob("*.sock")):
        try:
            yield ask(path)
        except TransportError as error:
            # The system refuses while it begins; that of one that has just ended is not there.
            if not isinstance(error.__cause__, ConnectionRefusedError | FileNotFoundError):
                yield {"board": path.stem, "error": str(error), **_owner(path)}


def _owner(path: Path) -> dict[str, Any]:
    """Return which process a socket belongs to that does not answer, and its board."""
    with contextlib.suppress(OSError, ValueError):
        lives, holder = lock_state(path)
        if lives and is_trusted(lock_of(path).lstat()):
            process, _, board = holder.partition("\n")
            return {"pid": int(process), "board": board or path.stem}
    return {}
