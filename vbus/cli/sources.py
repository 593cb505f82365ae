"""What verbs look at: journals, and boards that run: one, or the nodes of a machine together."""

import io
import json
import socket
import time
from collections.abc import Iterator, Sequence
from contextlib import ExitStack, closing, contextmanager, suppress
from pathlib import Path
from queue import SimpleQueue
from threading import Thread
from typing import TYPE_CHECKING, Any, Final

from vbus.cli.output import bar, complain, reading
from vbus.core import exit_codes
from vbus.core.errors import TransportError, VbusError

if TYPE_CHECKING:
    from vbus.record.format import JournalReader
    from vbus.record.replay import Outcome

# A page sends an order for each click: more unread ones mean that the board hangs.
MOST_WAITING: Final = 1024
"""Requests that may wait for a board that does not read; more are refused."""
# Processes of one "vbus up" are started together; a busy machine spreads their beginnings.
NODES_SECONDS: Final = 2.0
"""How long nodes of a machine may take to begin after the first of them."""


@contextmanager
def opened(path: Path, what: str = "", quiet: bool = True) -> Iterator["JournalReader"]:
    """Open a journal, and show on a terminal how far it is read.

    Args:
        path: the journal.
        what: what is done with it, in a word.
        quiet: show nothing.

    Raises:
        JournalError: it is none.
        VbusError: it cannot be read.
    """
    from vbus.record.format import JournalReader
    from vbus.serve.registry import socket_path

    # Other verbs take the name of a board that runs.
    if not path.exists() and len(path.parts) == 1 and socket_path(path.name).exists():
        raise VbusError(
            f'"{path}" is a board that runs, and no journal: "vbus run --journal FILE" writes one,'
            f' "vbus monitor {path}" shows the board'
        )
    with reading(path) as file:
        reader = JournalReader(file)
        with bar(what, path.stat().st_size, lambda: reader.position, quiet) as reader.moved:
            yield reader


def tell_damage(path: Path, damage: str) -> None:
    """Say that a journal ends before its run did, if it does."""
    if damage:
        complain(f"{path}: {damage}; what is before that is all there is of the run")


def replay_code(path: Path, outcome: "Outcome", damage: str) -> int:
    """Return the exit code of a journal that was played again; complain unless it ran as before."""
    tell_damage(path, damage)
    found = outcome.divergence
    if found is None:
        return exit_codes.OK
    complain(f'{path}: the run differs from its journal at entry {found.entry}; "vbus replay" shows'
             " how")  # fmt: skip
    return exit_codes.FAILURE


class Feed:
    """What a running board tells, over its socket.

    Args:
        board: name of the board.

    Raises:
        TransportError: no board of that name can be watched.
    """

    def __init__(self, board: str) -> None:
        from vbus.serve.registry import not_there, socket_path
        from vbus.transports.runtime import socket_address

        self._socket: socket.socket = socket.socket(socket.AF_UNIX, socket.SOCK_STREAM)
        try:
            with socket_address(socket_path(board)) as address:
                self._socket.connect(address)
        except OSError as error:
            self._socket.close()
            raise TransportError(not_there(board, "can be watched", error)) from error
        self._unsent: SimpleQueue[bytes] | None = None
        self._board: str = board
        self._file: io.BufferedReader = self._socket.makefile("rb")
        self.hello: dict[str, Any] = {}
        """What ``vbus ls --json`` tells of the board."""
        with suppress(VbusError):  # it has just stopped
            self.hello = self._order("status")

    def __iter__(self) -> Iterator[list[Any]]:
        for message in self.messages():
            yield json.loads(message)

    def messages(self) -> Iterator[bytes]:
        """Give messages, until the board ends."""
        # Each message has its length before it, 4 bytes, the lowest first.
        while len(head := self._read(4)) == 4:
            size = int.from_bytes(head, "little")
            data = self._read(size)
            if len(data) == size:
                yield data

    def _read(self, size: int) -> bytes:
        """Return so many bytes; fewer where the board has ended."""
        # So the system tells of an end with a request unread: it is one like any other.
        with suppress(ConnectionResetError):
            return self._file.read(size)
        return b""

    def send(self, data: bytes) -> None:
        """Ask for something else; a board that does not read now reads it later.

        Raises:
            OSError: the board has gone, or does not read for long.
        """
        # A board that is stopped or busy does not read: the loop of a page must not wait for it.
        if self._unsent is None:
            sent = 0
            with suppress(BlockingIOError):
                sent = self._socket.send(data, socket.MSG_DONTWAIT)
            if sent == len(data):
                return
            data = data[sent:]
            self._unsent = SimpleQueue()
            Thread(target=self._send_later, args=(self._unsent,), daemon=True).start()
        elif self._unsent.qsize() >= MOST_WAITING:
            raise BlockingIOError(f"the board does not read: {MOST_WAITING} requests wait")
        self._unsent.put(data)

    def _send_later(self, unsent: SimpleQueue[bytes]) -> None:
        """Send what the board has not taken at once, and all that comes after it."""
        with suppress(OSError):  # it has gone, or is watched no more
            while data := unsent.get():
                self._socket.sendall(data)

    def ask(self, what: str, **given: Any) -> Any:
        """Ask for what is to follow; return what it is; see :mod:`vbus.serve.orders.watching`.

        Raises:
            TransportError: the board has stopped.
            VbusError: it refuses; says why.
        """
        return self._order("watch", **{what: given})

    def _order(self, do: str, **given: Any) -> Any:
        with suppress(OSError):  # it has gone
            self.send(json.dumps({"do": do, **given}).encode() + b"\n")
            answer = json.loads(next(self.messages(), b"{}"))
            if "error" in answer:
                raise VbusError(answer["error"])
            if "done" in answer:
                return answer["done"]
        raise TransportError(f'board "{self._board}" has stopped')

    def watch(self, until: str = "") -> None:
        """Ask for events from now on, and for the instant a condition holds, if there is one.

        Raises:
            VbusError: it makes no sense on this board.
        """
        self.ask("events", until=until)

    def close(self) -> None:
        """Watch no more."""
        self._socket.close()
        if self._unsent is not None:
            self._unsent.put(b"")


class MachineFeed:
    """What several boards tell, as one feed: the nodes of a machine.

    Args:
        boards: their names.

    Attributes:
        hello: what they said of themselves: of the first, with the chips of all.

    Raises:
        TransportError: one cannot be watched.
    """

    def __init__(self, boards: Sequence[str]) -> None:
        with ExitStack() as opened:
            self._feeds: list[Feed] = [opened.enter_context(closing(Feed(b))) for b in boards]
            self._opened: ExitStack = opened.pop_all()
        chips = [chip for feed in self._feeds for chip in feed.hello["chips"]]
        machine = boards[0].rpartition(".")[0]
        self.hello: dict[str, Any] = {**self._feeds[0].hello, "board": machine, "chips": chips}
        self._told: list[tuple[int, dict[str, Any]]] = [(0, {}) for _ in boards]
        self._waiting: SimpleQueue[tuple[int, list[Any] | None]] = SimpleQueue()
        self._running: int = 0

    def watch(self, until: str = "") -> None:
        """Ask for events, and for the instant a condition holds on the node whose chips it names.

        Raises:
            VbusError: no node can look for it; says why.
        """
        refusals = []
        for feed in self._feeds:
            try:
                feed.watch(until)
            except VbusError as error:
                refusals.append(error)
                feed.watch()
        if len(refusals) == len(self._feeds):
            raise VbusError(f"{refusals[0]}; a condition is about chips of one node")

    def __iter__(self) -> Iterator[list[Any]]:
        for part, feed in enumerate(self._feeds):
            # Counted here, not in the threads: a node may end before the next one begins.
            self._running += 1
            Thread(target=self._read, args=(part, feed), daemon=True).start()
        heard: set[int] = set()
        """Nodes whose values have come since the last complete set."""
        while self._running:
            part, item = self._waiting.get()
            if item is None:
                self._running -= 1
            elif item[0] == "t":
                self._told[part] = item[1], item[2]
                heard.add(part)
                if len(heard) < self._running:
                    continue
                heard.clear()
                # The earliest of their instants: until then the values of every node are known.
                values = {chip: one for _, each in self._told for chip, one in each.items()}
                yield ["t", min(now for now, _ in self._told), values]
            else:
                yield item

    def _read(self, part: int, feed: Feed) -> None:
        with suppress(OSError, ValueError):  # closed while it was read
            for item in feed:
                self._waiting.put((part, item))
        self._waiting.put((part, None))

    def close(self) -> None:
        """Watch no more."""
        self._opened.close()


def boards_of(names: Sequence[str]) -> list[str]:
    """Return the boards of some names; a machine stands for its nodes on this computer.

    Nodes that begin within two seconds are waited for; of those that do not, it is said.
    """
    from vbus.serve.registry import socket_path

    boards: list[str] = []
    for name in names:
        boards += [name] if socket_path(name).exists() else _nodes_of(name) or [name]
    return list(dict.fromkeys(boards))


def _nodes_of(machine: str) -> list[str]:
    from vbus.serve.registry import missing_of, nodes_of

    end = time.monotonic() + NODES_SECONDS
    while True:
        here = nodes_of(machine)
        missing = missing_of(here)
        if not missing or time.monotonic() > end:
            break
        time.sleep(0.05)
    if missing:
        complain(
            f"{machine}: shown without {', '.join(missing)}, which"
            f" {'runs' if len(missing) == 1 else 'run'} on another computer, or not yet"
        )
    return [f"{machine}.{node}" for node in here]
