"""Live views of a running board: each connection gets what happens on its buses.

Beside a board's status socket stands one whose name ends in ``.watch``. What comes there are
messages, each with its length in front: four bytes, little-endian. The first is what the status
socket gives. The watcher then asks for one thing by a line of JSON, ``{WHAT: {...}}``, and gets
``["refused", reason]``, or ``[WHAT, description]`` and after it what was asked for:

``events``
    lists that begin with their kind: ``"c"``, instant, host, chip, write, address, byte: a bus
    cycle; ``"v"``, instant, chip, rule, clause, severity, measured, limit, detail: a violation;
    ``"t"``, instant, values by chip; ``"lost"``, how many of these were left out. With ``"until":
    CONDITION`` also ``"until"``, instant, as soon as the condition holds.
``wave``
    a waveform, until it has its duration or the connection ends. Keys as in a board file's
    ``[waves.NAME]``, with times in ps.
``scope``
    frames of the board's lanes; see :mod:`vbus.views.scope.frames`. With ``"after": PS`` nothing
    that happens until that instant is sent: the watcher has it. With ``"samples": false`` samples
    between one sending and the next are left out. A further line ``{"samples": true}`` or ``false``
    changes that, ``{"registers": true}`` has the chips' registers among the frames, ``false`` no
    longer.
``pins``
    frames with the edges of pins: ``"chip": NAME, "pins": [PIN, ...]``.

With ``"control": true`` a scope that may give orders has a session of the board: further lines are
orders (see :mod:`vbus.serve.orders.control`), those of
:class:`~vbus.serve.manual_host.ManualHost` among them. Each is answered by a message that is a JSON
object; so is one with ``"control"`` whenever time is made to stand still or go, and one with
``"scope"``, a description, when the board has gone back: frames after it are of a recording that
begins there.

Who does not read has so much stored, and the board is not looked at until there is room again.
"""

import asyncio
import errno
import io
import json
import os
import select
from collections.abc import Callable, Iterator
from contextlib import suppress
from functools import partial
from typing import Annotated, Any, ClassVar, Final, NamedTuple

import msgspec

from vbus.board.board import Board
from vbus.boardfile.sections import WaveSection
from vbus.core.errors import VbusError
from vbus.core.signals import Observer, Violation
from vbus.events.watch import Watch
from vbus.serve.local_socket import Connection, OnEnd
from vbus.serve.manual_host import ManualHost
from vbus.serve.orders.control import Control, refusal_of
from vbus.serve.orders.jump import JumpBack
from vbus.serve.time.steps import Steps
from vbus.transports.base import Link
from vbus.views.scope.frames import LASTING, numbers
from vbus.views.scope.lanes import Lateness
from vbus.views.scope.pin_recording import PinRecorder
from vbus.views.scope.recording import Recorder
from vbus.views.wave.wave import DONE, Wave

EVERY_SECONDS: Final = 0.05
"""How often news are sent."""
UNSEEN_SECONDS: Final = 0.25
"""The same of frames without samples: the page is not shown now."""
MOST_PENDING: Final = 1 << 20
"""Bytes stored for a watcher that does not read events."""
MOST_WAVE: Final = 1 << 26
"""The same of a waveform, which ends there."""
MOST_FRAMES: Final = 1 << 24
"""The same of frames."""
MOST_ANSWERS: Final = 2 * MOST_FRAMES
"""The same of frames, and answers to orders among them."""
LAST_SECONDS: Final = 1.0
"""How long a board that ends waits for a watcher that reads nothing (s)."""
MOST_EVENTS: Final = 20_000
"""Events stored between two sendings; the rest is counted as lost."""


class Watched(NamedTuple):
    """What there is to watch.

    Attributes:
        board: the board.
        late: tells how the board keeps to the wall clock.
        control: what can be ordered of the board.
        steps: who makes its time stand still.
        jump: brings it back to an earlier instant.
    """

    board: Board
    late: Callable[[], Lateness]
    control: Control
    steps: Steps
    jump: JumpBack


class RemoteWatcher(Connection):
    """A watcher of a board in another process.

    Args:
        loop: the event loop.
        link: the connection.
        on_end: called once when it is over.
        status: what is sent first.
        watched: the board, and what belongs to it.

    Attributes:
        view: what was asked for, once it was.
    """

    def __init__(
        self,
        loop: asyncio.AbstractEventLoop,
        link: Link,
        on_end: OnEnd,
        status: bytes,
        watched: Watched,
    ) -> None:
        super().__init__(loop, link, on_end)
        self.watched: Watched = watched
        self.view: WatchView | None = None
        self._away: bool = False
        self._timer: asyncio.TimerHandle | None = None
        self.message(status)

    def begin(self) -> None:
        """Say what the board is, and wait to be asked."""
        super().begin()
        self.flush()

    @property
    def refusal(self) -> str:
        """Why who watches may give no orders; "" if they may."""
        return refusal_of(self._link.fd)

    def message(self, data: bytes) -> None:
        """Have a message sent."""
        self.pending += len(data).to_bytes(4, "little") + data

    def answer(self, answer: dict[str, Any]) -> None:
        """Send an answer at once; who orders and does not read is hung up on."""
        self.message(json.dumps(answer).encode())
        if len(self.pending) > MOST_ANSWERS:
            self.end()
        else:
            self.flush()

    def take(self, line: bytes) -> None:
        """Begin what is asked for, or take a line for it."""
        for one in line.splitlines():
            if self.view is not None:
                self.view.take(one)
            elif self.open:
                self._ask(one)

    def _ask(self, line: bytes) -> None:
        try:
            asked = json.loads(line)
            if not isinstance(asked, dict) or len(asked) != 1 or not VIEWS.keys() & asked:
                raise ValueError(f"one of these can be asked for: {', '.join(VIEWS)}")
            ((what, given),) = asked.items()
            view = VIEWS[what](self, given)
        except (ValueError, KeyError, TypeError, RecursionError, VbusError) as error:
            self.message(json.dumps(["refused", str(error)]).encode())
            self.flush()
            return
        self.view = view
        self.message(json.dumps([what, view.described()]).encode())
        view.begin()
        self.send()

    def news(self) -> None:
        """Take what is new; of a board that is not looked at, for want of room, nothing is."""
        assert self.view is not None
        if len(self.pending) >= self.view.most:
            if not self._away:
                self._away = True
                self.view.look_away()
            return
        if self._away:
            self._away = False
            self.view.look_again()
        for message in self.view.news():
            self.message(message)

    def send(self) -> None:
        """Send what is new, now and in a while."""
        if self.view is None:
            return
        if self._timer is not None:
            self._timer.cancel()
        self.news()
        if self.view.over and not self.pending:
            self.end()
        if self.open:
            self.flush()
        if self.open:
            self._timer = self.loop.call_later(self.view.pause, self.send)

    def end(self) -> None:
        """Watch no more; may be called again."""
        if self._timer is not None:
            self._timer.cancel()
        view, self.view = self.view, None
        if view is not None:
            view.end()
        super().end()

    def end_with_board(self) -> None:
        """Send what is left, for a run that was short may end with most of it; then end."""
        view, self.view = self.view, None
        if view is not None:
            if self._away:
                view.look_again()
            view.end()
            self._send_last()  # there is room for what is new then
            if len(self.pending) < view.most:
                for message in view.news():
                    self.message(message)
            self._send_last()
        self.end()

    def _send_last(self) -> None:
        """Send what is pending, and wait for it.

        Not for a watcher that has read nothing for a while, or orders and does not read.
        """
        if len(self.pending) > MOST_ANSWERS:
            return
        room = select.poll()
        room.register(self._link.fd, select.POLLOUT)
        with suppress(OSError):  # the watcher has gone
            while self.pending and room.poll(LAST_SECONDS * 1000):
                del self.pending[: os.write(self._link.fd, self.pending)]


class WatchView:
    """What a watcher has asked for, made from a board.

    Args:
        watcher: the watcher.
        given: the watcher's options.

    Attributes:
        most: bytes stored for a watcher that does not read.
        pause: how long until the next news (s).
        over: whether there is no more to come.
    """

    WHO: ClassVar[str]
    """Who asks for it, in words."""

    most: int = MOST_FRAMES
    pause: float = EVERY_SECONDS
    over: bool = False

    def __init__(self, watcher: RemoteWatcher, given: Any) -> None:
        self._watcher: RemoteWatcher = watcher
        self._board: Board = watcher.watched.board

    def described(self) -> Any:
        """Return what it is; sent first."""
        return {}

    def begin(self) -> None:
        """Look at the board from now on."""

    def take(self, line: bytes) -> None:
        """Take a line of who watches."""

    def news(self) -> Iterator[bytes]:
        """Give what is new, as messages."""
        yield from ()

    def look_away(self) -> None:
        """There is no room for more: look at the board no longer."""

    def look_again(self) -> None:
        """There is room again."""

    def end(self) -> None:
        """Let go of the board; what is new by now can still be taken."""


class _Events(msgspec.Struct, forbid_unknown_fields=True):
    until: str = ""


class EventsView(WatchView, Observer):
    """Bus cycles, violations and values, one by one."""

    WHO = "a monitor"

    def __init__(self, watcher: RemoteWatcher, given: Any) -> None:
        super().__init__(watcher, given)
        self.most = MOST_PENDING
        until = msgspec.convert(given, _Events).until
        self._until: Watch | None = None
        if until:
            self._until = Watch(until, self._board, met=self._met)
        self._events: list[list[Any]] = []
        self._lost: int = 0

    def begin(self) -> None:
        """Look at the board from now on."""
        self._board.observe(self)
        if self._until is not None:
            self._until.begin()

    def bus_cycle(
        self, when: int, host: str, chip: str, write: bool, address: int, data: int
    ) -> None:
        """Take down a bus cycle."""
        self._add(["c", when, host, chip, write, address, data])

    def violation(self, violation: Violation) -> None:
        """Take down a violation."""
        self._add(["v", *msgspec.structs.astuple(violation)])

    def _add(self, event: list[Any]) -> None:
        if len(self._events) < MOST_EVENTS:
            self._events.append(event)
        else:
            self._lost += 1

    def _met(self) -> None:
        assert self._until is not None
        self._until.end()
        self._events.append(["until", self._board.now])

    def news(self) -> Iterator[bytes]:
        """Give what is new, and the values."""
        board, events = self._board, self._events
        events.append(["t", board.now, {chip.name: chip.telemetry() for chip in board.chips}])
        if self._lost:
            events.append(["lost", self._lost])
        self._events, self._lost = [], 0
        for event in events:
            yield json.dumps(event).encode()

    def look_away(self) -> None:
        """Count cycles that are not sent."""
        self._lost -= self._board.reads + self._board.writes
        self._board.unobserve(self)

    def look_again(self) -> None:
        """Take them down again."""
        self._lost += self._board.reads + self._board.writes
        self._board.observe(self)

    def end(self) -> None:
        """Take nothing down any more."""
        if self in self._board.observers:
            self._board.unobserve(self)
        if self._until is not None:
            self._until.end()


class WaveView(WatchView, io.StringIO):
    """A waveform: a text file whose text goes to who watches."""

    WHO = "a waveform"

    def __init__(self, watcher: RemoteWatcher, given: Any) -> None:
        super().__init__(watcher, given)
        self.most = 2 * MOST_WAVE
        self._text: bytearray = bytearray()
        section = msgspec.convert({"name": "", "file": "", **given}, WaveSection)
        self._wave: Wave = Wave(
            self._board, self, section.profile, section.signals,
            section.trigger, section.before, section.duration, section.sample,
        )  # fmt: skip

    def begin(self) -> None:
        """Record it from now on."""
        self._wave.start()

    def write(self, text: str) -> int:
        """Take text.

        Raises:
            OSError: who watches does not read.
        """
        if len(self._text) + len(self._watcher.pending) > MOST_WAVE:
            raise OSError(errno.ENOBUFS, "the other end does not read")
        self._text += text.encode("ascii", "replace")
        return len(text)

    def news(self) -> Iterator[bytes]:
        """Give the text there is by now."""
        self.over = self._wave.state == DONE
        if self._text:
            yield bytes(self._text)
            self._text.clear()

    def end(self) -> None:
        """End the recording."""
        self._wave.stop()


class FramesView(WatchView):
    """Frames that a recorder makes.

    Attributes:
        recorder: what records.
    """

    recorder: Recorder | PinRecorder

    def news(self) -> Iterator[bytes]:
        """Give what is new: those frames by themselves that last."""
        frames = self.recorder.take(numbers)
        while frames[0][0] in LASTING:
            yield frames.pop(0)
        yield b"".join(frames)

    def look_away(self) -> None:
        """Record nothing."""
        self.recorder.stop()

    def look_again(self) -> None:
        """Record again, and say what is left out."""
        self.recorder.leave_out()
        self.recorder.start()

    def begin(self) -> None:
        """Record from now on."""
        self.recorder.start()

    def end(self) -> None:
        """Record no more."""
        self.recorder.stop()


class PinsView(FramesView):
    """The pins of a chip."""

    WHO = "a viewer of pins"

    def __init__(self, watcher: RemoteWatcher, given: Any) -> None:
        super().__init__(watcher, given)
        self.recorder: PinRecorder = PinRecorder(self._board, **given)

    def described(self) -> Any:
        """Return what the pins are."""
        return self.recorder.described()


class _Scope(msgspec.Struct, forbid_unknown_fields=True):
    control: bool = False
    samples: bool = True
    after: Annotated[int, msgspec.Meta(ge=-1)] = -1


class ScopeView(FramesView):
    """All lanes of a board; and orders, if that is asked for and allowed."""

    WHO = "a scope or viewer"

    def __init__(self, watcher: RemoteWatcher, given: Any) -> None:
        super().__init__(watcher, given)
        wanted = msgspec.convert(given, _Scope)
        if wanted.control and watcher.refusal:
            raise VbusError(watcher.refusal)
        self._steps: Steps = watcher.watched.steps
        self._after: int = wanted.after
        self._inside: bool = False
        self._see_samples(wanted.samples)
        self.recorder: Recorder = self._new_recorder()
        self._manual: ManualHost | None = None
        if wanted.control:
            self._manual = ManualHost(self._board, self._steps)

    def _new_recorder(self) -> Recorder:
        return Recorder(self._board, edges=False, late=self._watcher.watched.late)

    def _see_samples(self, on: bool) -> None:
        self._samples: bool = on
        self.pause = EVERY_SECONDS if on else UNSEEN_SECONDS

    def described(self) -> Any:
        """Return what the lanes are, and what there is to take in hand."""
        page = self.recorder.lanes.described(live=True, control=self._manual is not None)
        return page if self._manual is None else {**page, "manual": self._manual.described()}

    def begin(self) -> None:
        """Record from now on."""
        self._record(self._after)
        if self._manual is not None:
            self._steps.changed.append(self._steps_changed)
            self._tell_steps()

    def _record(self, after: int = -1) -> None:
        self.recorder.look_at_samples(self._samples)
        self.recorder.start(after)
        self.recorder.look_inside(self._inside)

    def look_again(self) -> None:
        """Record again, and say what is left out."""
        self.recorder.leave_out()
        self._record()

    def take(self, line: bytes) -> None:
        """The page wants registers or samples, or gives an order."""
        try:
            asked = json.loads(line)
        except (ValueError, RecursionError):
            asked = None
        if isinstance(asked, dict) and "registers" in asked:
            self._inside = asked["registers"] is True
            self.recorder.look_inside(self._inside)
        elif isinstance(asked, dict) and "samples" in asked:
            self._see_samples(asked["samples"] is not False)
            self.recorder.look_at_samples(self._samples)
            self._watcher.send()
        elif (manual := self._manual) is not None:
            jump, control = self._watcher.watched.jump, self._watcher.watched.control
            back = partial(jump.begin, own=self, port=manual.port)
            control.take(line, self._watcher.answer, {**manual.orders(), "back": back})

    def step_aside(self) -> None:
        """Let go of the board: it goes back."""
        assert self._manual is not None
        self._watcher.news()
        self.recorder.stop()
        self._manual.end(go_on=False)

    def step_in(self) -> None:
        """Hold and watch it again; the recording begins anew there."""
        assert self._manual is not None
        self._manual.attach()
        self.recorder = self._new_recorder()
        self._watcher.answer({"scope": self.described()})
        self._record()

    def _steps_changed(self) -> None:
        # A step may end within a bus cycle: nothing is sent, no watcher cut off, before its end.
        self._watcher.loop.call_soon(self._tell_steps)

    def _tell_steps(self) -> None:
        if self._watcher.view is self:
            self._watcher.news()
            self._watcher.answer({"control": self._steps.told()})

    def end(self) -> None:
        """Record no more, and let time go on."""
        if self._manual is not None:
            self._steps.changed.remove(self._steps_changed)
            self._manual.end()
        super().end()


VIEWS: Final[dict[str, type[WatchView]]] = {
    "events": EventsView, "wave": WaveView, "scope": ScopeView, "pins": PinsView,
}  # fmt: skip
"""What can be asked for, by the word."""
