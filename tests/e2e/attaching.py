"""A board attached for real, in a thread of the test."""

import asyncio
import threading
from collections.abc import Iterator
from contextlib import contextmanager

from vbus.serve.attach.attachment import Attachment, AttachRequest
from vbus.serve.attach.far_board import look_at
from vbus.serve.loop import HostLoop


class Attached:
    """An attachment, what it has said, and how it ended."""

    def __init__(self, wanted: AttachRequest) -> None:
        self.said: list[str] = []
        self.attachment = Attachment(wanted, look_at(wanted.where, wanted.protocol), self.say)
        self.failure: BaseException | None = None
        self.ended = threading.Event()

    def say(self, sentence: str) -> None:
        self.said.append(sentence)

    @property
    def reconnections(self) -> int:
        return self.attachment.reconnections

    @property
    def lost(self) -> int:
        return self.attachment.trips.lost

    @property
    def round_trips(self) -> int:
        return self.attachment.trips.all.count


@contextmanager
def attached(
    where: str, *links: str, protocol: str = "byte", patience: float | None = None
) -> Iterator[Attached]:
    """Attach ``where`` as ``links`` while the block runs; errors at the start are raised here."""
    made = Attached(AttachRequest(where, "near", links, protocol, patience))
    ready = threading.Event()
    loop = HostLoop()
    stop = asyncio.Event()

    def run() -> None:
        try:
            loop.run_until_complete(made.attachment.serve(stop, ready.set))
        except BaseException as error:
            made.failure = error
        finally:
            loop.close()
            made.ended.set()
            ready.set()

    thread = threading.Thread(target=run)
    thread.start()
    ready.wait()
    if made.failure is not None and not made.attachment.served:
        thread.join()
        raise made.failure
    try:
        yield made
    finally:
        if not made.ended.is_set():
            loop.call_soon_threadsafe(stop.set)
        thread.join()
