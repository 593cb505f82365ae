"""Running boards that are shown together: what each tells, as one recording."""

import asyncio
import json
import time
from collections.abc import Callable, Sequence
from contextlib import ExitStack, closing, suppress
from threading import Thread
from typing import Any, Final

from vbus.cli.output import complain
from vbus.cli.sources import Feed
from vbus.core.errors import TransportError, VbusError, value_errors
from vbus.transports.base import ignore
from vbus.views.scope.merged import Merged

Take = Callable[[bytes], None]
OnLoop = Callable[..., object]
"""Has something done on the loop; RuntimeError: that has ended."""

LOOK_SECONDS: Final = 0.02
"""How often it is looked whether a node that has gone is back."""
GONE_SECONDS: Final = 0.5
"""How long a node may be gone before it is said: at the end all go, one after the other."""


class Feeds:
    """The frames of running boards, joined for a page.

    A node that goes while others of them are there may come back, and is then shown as before.

    Args:
        boards: their names.
        control: whether orders are given; to one board alone.
        samples: whether boards that run in real time record every sample from the start.

    Attributes:
        description: what a page gets first.

    Raises:
        TransportError: a board is not there, or has stopped.
        VbusError: a board refuses.
    """

    def __init__(self, boards: Sequence[str], control: bool = False, samples: bool = True) -> None:
        # Pausing one of several would leave their common time axis behind.
        if control and len(boards) > 1:
            raise VbusError(
                f"--control is for one board that has no nodes, and this is {', '.join(boards)}:"
                " each has a time of its own; leave it out"
            )
        self._merged: Merged | None = None
        self._boards: tuple[str, ...] = tuple(boards)
        self._samples: bool = samples
        self._inside: bool = False
        with ExitStack() as opened:
            self._feeds: list[Feed] = [opened.enter_context(closing(Feed(b))) for b in boards]
            begun = [_begun(feed, control, samples) for feed in self._feeds]
            if len(begun) > 1:
                with value_errors(VbusError):
                    self._merged = Merged(begun)
            opened.pop_all()  # :meth:`close` closes them, and those that take their places
        self.description: dict[str, Any] = begun[0] if self._merged is None else (
            self._merged.description
        )  # fmt: skip
        self._left: int = len(boards)
        self._show: Take = ignore
        self._ended: Callable[[], None] = ignore

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
        self._inside = on
        for feed in self._feeds:
            _tell(feed, registers=on)

    def look_at_samples(self, on: bool) -> None:
        """Have boards that run in real time record every sample, or a few only."""
        self._samples = on
        for feed in self._feeds:
            if _in_real_time(feed):
                _tell(feed, samples=on)

    def follow(
        self, loop: asyncio.AbstractEventLoop, take: Take, ended: Callable[[], None]
    ) -> None:
        """Have messages taken on a loop as they come, until the last of the boards has ended.

        Each is read in a thread of its own: a page is never what a board waits for.
        """
        self._show, self._ended = take, ended
        for part in range(len(self._feeds)):
            Thread(target=self._follow, args=(part, loop.call_soon_threadsafe), daemon=True).start()

    def _follow(self, part: int, on_loop: OnLoop) -> None:
        """Have taken what a part tells, and what it tells when it has come back."""
        merged = self._merged
        with suppress(OSError, ValueError, RuntimeError):  # closed while it was read
            while True:
                for message in self._feeds[part].messages():
                    if merged is None:
                        on_loop(self._show, message)
                    elif message[:1] != b"{":
                        on_loop(self._take, part, message)
                on_loop(self._over, part)
                if merged is None or "node" not in self._feeds[part].hello:
                    return
                description = self._back(part, on_loop)
                if description is None:
                    return
                on_loop(self._begin_again, part, description)

    def _take(self, part: int, message: bytes) -> None:
        assert self._merged is not None
        if frames := self._merged.take(part, message):
            self._show(frames)

    def _over(self, part: int) -> None:
        # Time of the others goes on without it: they are no longer held to where it ended.
        if self._merged is not None and (frames := self._merged.end(part)):
            self._show(frames)
        self._left -= 1
        if not self._left:
            self._ended()

    # -- nodes that go and come back ----------------------------------------------------------

    def _back(self, part: int, on_loop: OnLoop) -> dict[str, Any] | None:
        """Wait for a node as long as others are there; return what it tells first, if it is back.

        Raises:
            RuntimeError: the page is closed.
        """
        assert self._merged is not None
        board = self._boards[part]
        gone = time.monotonic()
        said = False
        while True:
            time.sleep(LOOK_SECONDS)
            if self._left <= 0:
                return None
            if not said and time.monotonic() - gone > GONE_SECONDS:
                said = True
                on_loop(self._event, part, "has gone")
            try:
                feed = Feed(board)
            except TransportError:
                continue
            self._feeds[part].close()
            self._feeds[part] = feed
            if "node" not in feed.hello:  # and gone again
                continue
            try:
                description = _begun(feed, False, self._samples, self._merged.came(part) - 1)
            except TransportError:  # and gone again
                continue
            except VbusError as error:
                complain(str(error))
                return None
            if not self._merged.fits(part, description):
                complain(f"{board} has come back with other axes or pins: it is shown no longer")
                return None
            if self._inside:
                _tell(feed, registers=True)
            return description

    def _begin_again(self, part: int, description: dict[str, Any]) -> None:
        assert self._merged is not None
        if self._left <= 0:  # meanwhile the others have ended
            self._feeds[part].close()
            return
        self._show(self._merged.begin_again(part, description))
        self._left += 1

    def _event(self, part: int, text: str) -> None:
        assert self._merged is not None
        if self._left > 0:
            self._show(self._merged.event(part, text))

    def close(self) -> None:
        """Watch no more."""
        self._left = 0
        for feed in self._feeds:
            feed.close()


def _tell(feed: Feed, **what: bool) -> None:
    """Have something recorded of a board, or no longer, unless it has gone."""
    with suppress(OSError):
        feed.send(json.dumps(what).encode() + b"\n")


def _begun(feed: Feed, control: bool, samples: bool, after: int = -1) -> dict[str, Any]:
    """Ask a board for its lanes, and what happens after an instant (ps); return what they are."""
    name = feed.hello.get("board", "")
    if control and "node" in feed.hello:
        raise VbusError(
            f"--control: {name} is a node: its time is that of all nodes, so it cannot be halted or"
            " written to from the page; leave it out"
        )
    samples = samples or not _in_real_time(feed)
    try:
        description: dict[str, Any] = feed.ask(
            "scope", control=control, samples=samples, after=after
        )
    except TransportError:
        raise
    except VbusError as error:
        raise VbusError(f"{name}: {error}") from None
    return description


def _in_real_time(feed: Feed) -> bool:
    """Whether it is real time that passes on a board: others are as fast as they are."""
    return bool(feed.hello["policy"] == "realtime" and feed.hello["rate"] != "max")
