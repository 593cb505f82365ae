"""A board served in a thread of this process: for programs and terminals beside a test."""

import asyncio
import threading
from collections.abc import Callable, Coroutine, Sequence
from concurrent.futures import wait
from typing import Any, Final, TypeVar

from vbus.board.board import Board
from vbus.core.errors import VbusError
from vbus.core.kernel import END
from vbus.serve.loop import HostLoop
from vbus.serve.server import LinkSpec, ServedRun, Server

_T = TypeVar("_T")
PATIENCE_SECONDS: Final = 60.0
"""How long what hosts that have gone had sent may take at the end (s of wall time): far above
what a busy machine takes."""
THREAD: Final = "vbus board"
"""Name of the thread."""


class ServedBoard:
    """Serves a board on its links, from entering the block to leaving it.

    The thread has an event loop of its own, so it works from ordinary tests and from tests that
    are coroutines alike.

    Args:
        board: the board; between enter and exit it belongs to the thread, see :meth:`call`.
        links: what hosts may attach to.
        stall: what real time does after the machine was too slow.
    """

    def __init__(self, board: Board, links: Sequence[LinkSpec], stall: str = "catch_up") -> None:
        self.board = board
        self.server = Server(board, list(links), stall, settle=self._settle)
        self.error: BaseException | None = None
        self._ready = threading.Event()
        self._loop: asyncio.AbstractEventLoop | None = None
        self._stop: asyncio.Event | None = None
        self._thread = threading.Thread(target=self._serve, name=THREAD, daemon=True)

    def _settle(self) -> bool:
        """Bring all there that a test can look at, before a host is answered."""
        self.board.catch_up()
        return True

    def _serve(self) -> None:
        async def main() -> None:
            self._loop = asyncio.get_running_loop()
            self._stop = asyncio.Event()
            run = ServedRun([self.server], patience=PATIENCE_SECONDS)
            await run.serve(self._stop, self._ready.set)
            self.board.catch_up()

        try:
            with asyncio.Runner(loop_factory=HostLoop) as runner:
                runner.run(main())
        except BaseException as error:
            self.error = error
        finally:
            self._ready.set()

    def __enter__(self) -> "ServedBoard":
        self._thread.start()
        self._ready.wait()
        if self.error is not None:
            self._thread.join()
            raise self.error
        return self

    def __exit__(self, *exc: object) -> None:
        if self._loop is not None and self._stop is not None and self._thread.is_alive():
            self._loop.call_soon_threadsafe(self._stop.set)
        self._thread.join()
        self.board.limit = END

    def run(self, work: Coroutine[Any, Any, _T]) -> _T:
        """Do something in the board's thread; return or raise what it does.

        Raises:
            VbusError: the board is served no more.
        """
        if self._loop is None or not self._thread.is_alive():
            work.close()
            raise VbusError(f"the board is served no more: {self.error}")
        done = asyncio.run_coroutine_threadsafe(work, self._loop)
        try:
            while not wait([done], 1.0).done:
                if not self._thread.is_alive():
                    raise VbusError(f"the board is served no more: {self.error}")
        except BaseException:
            done.cancel()
            raise
        return done.result()

    def call(self, what: Callable[[], _T]) -> _T:
        """Do something to the board while no host does; return or raise what it does.

        Raises:
            VbusError: the board is served no more.
        """

        async def work() -> _T:
            self.server.pacer.catch_up()
            return what()

        return self.run(work()) if self._thread.is_alive() else what()
