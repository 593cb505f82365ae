"""Live views of a running board: each connection gets what happens on its buses.

The order ``watch`` of a board's socket (:mod:`vbus.serve.local_socket`) asks for one thing:
``{"do": "watch", WHAT: {...}}`` is answered by a description, or refused; then come messages:

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
orders, those of :class:`~vbus.serve.manual_host.ManualHost` among them. Each is answered as ever;
beside the answers comes a JSON object with ``"control"`` whenever time is made to stand still or
go, and one with ``"scope"``, a description, when the board has gone back: frames after it are of a
recording that begins there.

Who does not read has so much stored, and the board is not looked at until there is room again.
"""

import errno
import io
import json
from collections.abc import Callable, Iterator
from typing import Annotated, Any, ClassVar, Final, NamedTuple

import msgspec

from vbus.board.board import Board
from vbus.boardfile.sections import WaveSection
from vbus.core.errors import VbusError
from vbus.core.signals import Observer, Violation
from vbus.events.watch import Watch
from vbus.serve.local_socket import EVERY_SECONDS, Connection, Control, WatchView
from vbus.serve.manual_host import ManualHost
from vbus.serve.orders.jump import JumpBack
from vbus.serve.time.steps import Steps
from vbus.views.scope.frames import LASTING, numbers
from vbus.views.scope.lanes import Lateness
from vbus.views.scope.pin_recording import PinRecorder
from vbus.views.scope.recording import Recorder
from vbus.views.wave.wave import DONE, Wave

UNSEEN_SECONDS: Final = 0.25
"""The same of frames without samples: the page is not shown now."""
MOST_PENDING: Final = 1 << 20
"""Bytes stored for a watcher that does not read events: a bound of memory."""
MOST_WAVE: Final = 1 << 26
"""The same of a waveform, which ends there; a bound of memory."""
MOST_EVENTS: Final = 20_000
"""Events stored between two sendings; the rest is counted as lost. A bound of memory."""


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


class BoardView(WatchView):
    """A view of a served board.

    Args:
        connection: who watches.
        watched: the board, and what belongs to it.
        given: options.
    """

    WHO: ClassVar[str]
    """Who asks for it, in words."""

    def __init__(self, connection: Connection, watched: Watched, given: Any) -> None:
        super().__init__(connection)
        self._watched: Watched = watched
        self._board: Board = watched.board


class _Events(msgspec.Struct, forbid_unknown_fields=True):
    until: str = ""


class EventsView(BoardView, Observer):
    """Bus cycles, violations and values, one by one."""

    WHO = "a monitor"

    def __init__(self, connection: Connection, watched: Watched, given: Any) -> None:
        super().__init__(connection, watched, given)
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
        self._add(["v", *violation])

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


class WaveView(BoardView, io.StringIO):
    """A waveform: a text file whose text goes to who watches."""

    WHO = "a waveform"

    def __init__(self, connection: Connection, watched: Watched, given: Any) -> None:
        super().__init__(connection, watched, given)
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
        if len(self._text) + len(self.connection.pending) > MOST_WAVE:
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


class FramesView(BoardView):
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

    def __init__(self, connection: Connection, watched: Watched, given: Any) -> None:
        super().__init__(connection, watched, given)
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

    def __init__(self, connection: Connection, watched: Watched, given: Any) -> None:
        super().__init__(connection, watched, given)
        wanted = msgspec.convert(given, _Scope)
        if wanted.control and connection.refusal:
            raise VbusError(connection.refusal)
        self._steps: Steps = watched.steps
        self._after: int = wanted.after
        self._inside: bool = False
        self._see_samples(wanted.samples)
        self.recorder: Recorder = self._new_recorder()
        self._manual: ManualHost | None = None
        if wanted.control:
            manual = self._manual = ManualHost(self._board, self._steps)
            connection.orders = {
                **manual.orders(),
                "back": lambda request: watched.jump.begin(request, self, manual.port),
            }

    def _new_recorder(self) -> Recorder:
        return Recorder(self._board, edges=False, late=self._watched.late)

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
            self.send()
        elif self._manual is not None:
            self._watched.control.take(line, self.connection)

    def step_aside(self) -> None:
        """Let go of the board: it goes back."""
        assert self._manual is not None
        self.take_news()
        self.recorder.stop()
        self._manual.end(go_on=False)

    def step_in(self) -> None:
        """Hold and watch it again; the recording begins anew there."""
        assert self._manual is not None
        self._manual.attach()
        self.recorder = self._new_recorder()
        self.connection.answer({"scope": self.described()})
        self._record()

    def _steps_changed(self) -> None:
        # A step may end within a bus cycle: nothing is sent, no watcher cut off, before its end.
        self.connection.loop.call_soon(self._tell_steps)

    def _tell_steps(self) -> None:
        if self.connection.view is self:
            self.take_news()
            self.connection.answer({"control": self._steps.status()})

    def end(self) -> None:
        """Record no more, and let time go on."""
        if self._manual is not None:
            self._steps.changed.remove(self._steps_changed)
            self._manual.end()
        super().end()


VIEWS: Final[dict[str, type[BoardView]]] = {
    "events": EventsView, "wave": WaveView, "scope": ScopeView, "pins": PinsView,
}  # fmt: skip
"""What can be asked for, by the word."""


def view_of(watched: Watched, connection: Connection, given: dict[str, Any]) -> BoardView:
    """Return what a connection asks to watch.

    Args:
        watched: the board, and what belongs to it.
        connection: who watches.
        given: what is asked for, by its word, with its options.

    Raises:
        ValueError: there is no such thing, or its options make no sense.
        VbusError: they make no sense on this board, or are not allowed.
    """
    if len(given) != 1 or not VIEWS.keys() & given:
        raise ValueError(f"one of these can be asked for: {', '.join(VIEWS)}")
    ((what, options),) = given.items()
    return VIEWS[what](connection, watched, options)
