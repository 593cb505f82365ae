"""Running boards that are shown together: what each tells, as one recording."""

import asyncio
import json
import time
from collections.abc import Callable, Sequence
from contextlib import ExitStack, closing, suppress
from functools import partial
from threading import Thread
from typing import Any, Final

from vbus.errors import TransportError, VbusError
from vbus.scope.merged import Merged
from vbus.tools.monitor import Feed
from vbus.tools.output import complain

Take = Callable[[bytes], None]

NODES_SECONDS: Final = 2.0
"""How long nodes of a machine may take to begin after the first of them."""


def boards_of(names: Sequence[str]) -> list[str]:
    """Return the boards of some names; a machine stands for its nodes on this computer.

    Nodes that begin within two seconds are waited for; of those that do not, it is said.
    """
    from vbus.server.registry import watch_path

    boards: list[str] = []
    for name in names:
        boards += [name] if watch_path(name).exists() else _nodes_of(name) or [name]
    return list(dict.fromkeys(boards))


def _nodes_of(machine: str) -> list[str]:
    from vbus.server.registry import missing_of, nodes_of

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


class Feeds:
    """What running boards tell whoever shows them.

    Args:
        boards: their names.
        control: whether orders are given; to one board alone.
        samples: whether boards that run in real time record every sample from the start.

    Attributes:
        description: what a page is told first.

    Raises:
        TransportError: a board is not there, or has stopped.
        VbusError: a board refuses.
    """

    def __init__(self, boards: Sequence[str], control: bool = False, samples: bool = True) -> None:
        if control and len(boards) > 1:
            raise VbusError(
                f"--control is for one board that has no nodes, and this is {', '.join(boards)}:"
                " each has a time of its own; leave it out"
            )
        self._merged: Merged | None = None
        with ExitStack() as opened:
            self._feeds: list[Feed] = [opened.enter_context(closing(Feed(b))) for b in boards]
            told = [_begun(feed, control, samples) for feed in self._feeds]
            if len(told) > 1:
                try:
                    self._merged = Merged(told)
                except ValueError as error:
                    raise VbusError(str(error)) from None
            self._opened: ExitStack = opened.pop_all()
        self.description: dict[str, Any] = told[0] if self._merged is None else (
            self._merged.description
        )  # fmt: skip
        self._left: int = len(boards)

    @property
    def hellos(self) -> list[dict[str, Any]]:
        """What each board said of itself."""
        return [feed.hello for feed in self._feeds]

    def send(self, data: bytes) -> None:
        """Ask every board for something else.

        Raises:
            OSError: one has gone.
        """
        for feed in self._feeds:
            feed.send(data)

    def look_inside(self, on: bool) -> None:
        """Have the registers recorded, or no longer."""
        with suppress(OSError):  # a board has gone
            self.send(json.dumps({"registers": on}).encode() + b"\n")

    def look_at_samples(self, on: bool) -> None:
        """Have boards that run in real time record every sample, or a few only."""
        with suppress(OSError):  # a board has gone
            for feed in self._feeds:
                if _in_real_time(feed):
                    feed.send(json.dumps({"samples": on}).encode() + b"\n")

    def follow(
        self, loop: asyncio.AbstractEventLoop, take: Take, ended: Callable[[], None]
    ) -> None:
        """Have messages taken on a loop as they come, until the last of the boards has ended.

        Each is read in a thread of its own: a page is never what a board waits for.
        """
        for part, feed in enumerate(self._feeds):
            over = partial(self._over, part, take, ended)
            of_part = take if self._merged is None else partial(self._take, part, take)
            Thread(target=_follow, args=(feed, loop, of_part, over), daemon=True).start()

    def _take(self, part: int, take: Take, message: bytes) -> None:
        assert self._merged is not None
        if message[:1] != b"{" and (frames := self._merged.take(part, message)):
            take(frames)

    def _over(self, part: int, take: Take, ended: Callable[[], None]) -> None:
        if self._merged is not None and (frames := self._merged.end(part)):
            take(frames)
        self._left -= 1
        if not self._left:
            ended()

    def close(self) -> None:
        """Watch no more."""
        self._opened.close()


def _begun(feed: Feed, control: bool, samples: bool) -> dict[str, Any]:
    """Ask a board for its lanes; return what they are."""
    name = feed.hello.get("board", "")
    if control and "node" in feed.hello:
        raise VbusError(
            f"--control: {name} is a node: its time is that of all nodes, so it cannot be halted or"
            " written to from the page; leave it out"
        )
    asked = {"scope": {"control": control, "samples": samples or not _in_real_time(feed)}}
    feed.send(json.dumps(asked).encode() + b"\n")
    told = next((item for item in feed if item[0] in ("scope", "refused")), None)
    if told is None:
        raise TransportError(f'board "{name}" has stopped')
    if told[0] == "refused":
        raise VbusError(f"{name}: {told[1]}")
    description: dict[str, Any] = told[1]
    return description


def _in_real_time(feed: Feed) -> bool:
    """Whether it is real time that passes on a board: others are as fast as they are."""
    return bool(feed.hello["policy"] == "realtime" and feed.hello["rate"] != "max")


def _follow(
    feed: Feed, loop: asyncio.AbstractEventLoop, take: Take, ended: Callable[[], None]
) -> None:
    with suppress(OSError, ValueError, RuntimeError):  # closed while it was read
        for message in feed.messages():
            loop.call_soon_threadsafe(take, message)
        loop.call_soon_threadsafe(ended)
