"""A board served for real, in a thread of the test."""

import asyncio
import threading
from collections.abc import Iterator
from contextlib import contextmanager

from tests.waiting import PATIENCE
from vbus.board.board import Board
from vbus.serve.server import LinkSpec, ServedRun, Server


@contextmanager
def served(board: Board, *links: LinkSpec, stall: str = "catch_up") -> Iterator[Server]:
    """Serve ``board`` on ``links`` while the block runs; errors at the start are raised here."""
    server = Server(board, list(links), stall)
    ready = threading.Event()
    failure: list[BaseException] = []
    loop = asyncio.new_event_loop()
    stop = asyncio.Event()

    def run() -> None:
        try:
            loop.run_until_complete(ServedRun([server], patience=PATIENCE).serve(stop, ready.set))
        except BaseException as error:
            failure.append(error)
        finally:
            loop.close()
            ready.set()

    thread = threading.Thread(target=run)
    thread.start()
    ready.wait()
    if failure:
        thread.join()
        raise failure[0]
    try:
        yield server
    finally:
        loop.call_soon_threadsafe(stop.set)
        thread.join()
    if failure:
        raise failure[0]
