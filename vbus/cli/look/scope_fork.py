"""A copy of a board, made from its journal, that goes on from an instant of its own."""

import asyncio
import os
import sys
from collections.abc import Callable
from contextlib import ExitStack, closing, suppress
from pathlib import Path
from typing import TYPE_CHECKING, Final

from vbus.protocols.quantities import parse_duration

if TYPE_CHECKING:
    import subprocess

# Each is a process with a board of its own; a page that opens one in a loop is stopped.
MOST_FORKS: Final = 8
"""Copies that pages of one scope may have at a time."""
LINK: Final = b"scope: "


def fork(
    journal: Path, to: int | None, show: Callable[[str], "subprocess.Popen[bytes]"], quiet: bool
) -> None:
    """Play a journal up to an instant, and serve that board with its scope until a signal.

    The copy stands still at first. It keeps a journal of its own, which begins at power-on too, and
    hosts may attach to ``pty:$VBUS_RUNTIME/NAME``. What hosts of the journal drove they still
    drive; what they had claimed is free.

    Args:
        journal: of the board.
        to: the instant (ps); None: the journal's end.
        show: shows the board of a name in a scope, which ends with the copy.
        quiet: show no progress.

    Raises:
        VbusError: the journal is none, or is of a board made in Python.
    """
    from vbus.boardfile.sections import RecordSection
    from vbus.cli.output import complain
    from vbus.cli.sources import opened
    from vbus.nodes.machine import board_of
    from vbus.record.player import Player
    from vbus.serve.recording import Recording
    from vbus.serve.registry import journal_path, own_board
    from vbus.serve.server import LinkSpec, Server, run

    with ExitStack() as held:
        with opened(journal, "replaying", quiet) as reader:
            board = board_of(reader.header, str(journal))
            # The original may still run: its name, log and links are in use.
            origin, board.name = board.name, f"{board.name}-{os.getpid()}"
            recording = Recording(board, reader.header.text, reader.header.file, complain)
            held.enter_context(own_board(board.name))
            held.enter_context(closing(recording))
            recording.open(RecordSection(journal=str(journal_path(board.name, 0))))
            for _ in Player(board).up_to(reader, to):
                pass
        # A claim of a recorded host would hold the bus for ever: no one is there to let go.
        for port in list(board.ports):
            port.unclaim()

        def ready(server: Server) -> None:
            server.keep(recording)
            recording.start(asyncio.get_running_loop())
            server.steps.pause(f"a copy of {origin}")
            scope = show(board.name)
            held.callback(scope.wait)
            held.callback(scope.terminate)

        run(board, [LinkSpec(f"pty:$VBUS_RUNTIME/{board.name}")], on_ready=ready)


class Forks:
    """Copies that pages of a scope have opened; they end with it.

    Args:
        listen: where their pages are to be.
    """

    def __init__(self, listen: str) -> None:
        self._listen: str = listen
        self._processes: list[asyncio.subprocess.Process] = []

    async def open(self, journal: Path, to: str) -> str:
        """Open a copy of a board; return the link of its page.

        Args:
            journal: of the board.
            to: the instant, such as ``"12.5 ms"``; "": the journal's end.

        Raises:
            ValueError: that is no instant, there are too many, or the copy says why not.
        """
        if to:
            parse_duration(to)
        self._processes = [one for one in self._processes if one.returncode is None]
        if len(self._processes) >= MOST_FORKS:
            raise ValueError(f"there are {MOST_FORKS} copies; end one (vbus stop) before the next")
        process = await asyncio.create_subprocess_exec(
            sys.executable, "-m", "vbus", "scope", str(journal), "--control", "--listen",
            self._listen, *(["--at", to] if to else []),
            stdin=asyncio.subprocess.DEVNULL, stdout=asyncio.subprocess.DEVNULL,
            stderr=asyncio.subprocess.PIPE, start_new_session=True,
        )  # fmt: skip
        self._processes.append(process)
        assert process.stderr is not None
        line = await process.stderr.readline()
        if not line.startswith(LINK):
            raise ValueError(line.decode("utf-8", "replace").strip() or "the copy has ended")
        return line.removeprefix(LINK).split()[0].decode()

    async def end(self) -> None:
        """End every copy; return when they have closed their journals and links."""
        for process in self._processes:
            with suppress(ProcessLookupError):
                process.terminate()
        # asyncio kills what still runs when its loop is closed.
        await asyncio.gather(*(process.wait() for process in self._processes))
