"""Live views of a running board: whoever connects is told what happens on its buses.

Beside a board's status socket stands one whose name ends in ``.watch``. Who connects gets lines of
JSON: first what the status socket tells, then lists that begin with their kind: ``"c"``, instant,
host, chip, write, address, byte: a bus cycle; ``"v"``, instant, chip, rule, clause, severity,
measured, limit, detail: a violation; ``"t"``, instant, values by chip; ``"lost"``, how many
lines were left out because they were not taken in time.

Who answers with a line ``{"wave": {...}}``, keys as in a board file's ``[waves.NAME]`` with times
in ps, gets a line ``["wave"]`` and after it nothing but a waveform, until it has its duration or
the connection ends; or ``["refused", reason]``. One with ``{"until": CONDITION}`` gets
``["waiting"]``, or that refusal, and ``["until", instant]`` as soon as the condition holds.

Who answers with ``{"scope": {}}`` gets a line ``["scope", description]`` and after it frames of the
board's lanes (see :mod:`vbus.scope.frames`): four bytes with their length, little-endian, and as
many of them. What is not taken in time is left out. ``{"registers": true}`` then has the chips'
registers among them, ``false`` no longer. ``{"samples": false}``, also within ``{"scope": {}}``,
leaves samples out between one sending and the next, ``true`` no longer. With ``{"scope": {"after":
PS}}`` nothing that happens until that instant is told: who asks has it. One with ``{"pins":
{"chip": NAME, "pins": [PIN, ...]}}`` gets ``["pins", description]``, or that refusal, and frames
with the edges of these pins.

Who answers with ``{"scope": {"control": true}}``, and may give orders, has a session of the board
with it: further lines are orders (see :mod:`vbus.server.control`), those of
:class:`~vbus.server.manual_host.ManualHost` among them. Each is answered among the frames by a
message that is JSON and begins with ``{``; so is one with ``"control"`` whenever time is made to
stand still or go, and one with ``"scope"``, a description, when the board has gone back: frames
after it are of a recording that begins there.
"""

import asyncio
import errno
import io
import json
import os
import select
from collections.abc import Callable
from contextlib import suppress
from functools import partial
from typing import Annotated, Any, Final

import msgspec

from vbus.board.board import Board
from vbus.boardfile.sections import WaveSection
from vbus.errors import VbusError
from vbus.events.watch import Watch
from vbus.scope.frames import LASTING, numbers
from vbus.scope.lanes import Lateness
from vbus.scope.pin_recording import PinRecorder
from vbus.scope.recording import Recorder
from vbus.server.control import Control, refusal_of
from vbus.server.jump import JumpBack
from vbus.server.local_socket import Connection, OnEnd
from vbus.server.manual_host import ManualHost
from vbus.server.steps import Steps
from vbus.signals import Observer, Violation
from vbus.trace.wave.wave import DONE, Wave
from vbus.transports.base import Link

EVERY_SECONDS: Final = 0.05
"""How often lines are sent."""
UNSEEN_SECONDS: Final = 0.25
"""The same of frames without samples: nobody looks at them now."""
MOST_PENDING: Final = 1 << 20
"""Bytes kept for somebody who does not read."""
MOST_WAVE: Final = 1 << 26
"""The same of a waveform."""
MOST_FRAMES: Final = 1 << 24
"""The same of frames."""
MOST_ANSWERS: Final = 2 * MOST_FRAMES
"""The same of frames, and answers to orders among them."""
LAST_SECONDS: Final = 1.0
"""How long a board that ends waits for somebody who reads nothing."""
MOST_LINES: Final = 20_000
"""Lines kept between two sendings; the rest is counted as lost."""


class _Wanted(msgspec.Struct):
    """What a scope asks for first."""

    control: bool = False
    samples: bool = True
    after: Annotated[int, msgspec.Meta(ge=-1)] = -1


class _BufferedText(io.StringIO):
    """A text file whose text goes to a connection's buffer."""

    def __init__(self, buffer: bytearray) -> None:
        super().__init__()
        self._buffer: bytearray = buffer

    def write(self, text: str) -> int:
        """Take text.

        Raises:
            OSError: the other end does not read.
        """
        if len(self._buffer) > MOST_WAVE:
            raise OSError(errno.ENOBUFS, "the other end does not read")
        self._buffer += text.encode("ascii", "replace")
        return len(text)


class RemoteWatcher(Connection, Observer):
    """Somebody who watches a board from another process.

    Args:
        loop: the event loop.
        link: the connection.
        on_end: called once when it is over.
        board: the board.
        status: what is sent first.
        late: tells how the board keeps to the wall clock.
        control: what can be ordered of the board.
        steps: who makes its time stand still.
        jump: brings it back to an earlier instant.
    """

    def __init__(
        self,
        loop: asyncio.AbstractEventLoop,
        link: Link,
        on_end: OnEnd,
        board: Board,
        status: bytes,
        late: Callable[[], Lateness],
        control: Control,
        steps: Steps,
        jump: JumpBack,
    ) -> None:
        super().__init__(loop, link, on_end)
        self._jump: JumpBack = jump
        self._inside: bool = False
        self._samples: bool = True
        self.pending += status + b"\n"
        self._control: Control = control
        self._steps: Steps = steps
        self._manual: ManualHost | None = None
        self._board: Board = board
        self._lines: list[list[Any]] = []
        self._lost: int = 0
        self._timer: asyncio.TimerHandle | None = None
        self._wave: Wave | None = None
        self._late: Callable[[], Lateness] = late
        self._recorder: Recorder | None = None
        self._pins: PinRecorder | None = None
        self._until: Watch | None = None

    def begin(self) -> None:
        """Watch from now on."""
        super().begin()
        self._board.observe(self)
        self._send()

    def bus_cycle(
        self, when: int, host: str, chip: str, write: bool, address: int, data: int
    ) -> None:
        """Take down a bus cycle."""
        self._add(["c", when, host, chip, write, address, data])

    def violation(self, violation: Violation) -> None:
        """Take down a violation."""
        self._add(["v", *msgspec.structs.astuple(violation)])

    def _add(self, line: list[Any]) -> None:
        if len(self._lines) < MOST_LINES:
            self._lines.append(line)
        else:
            self._lost += 1

    def take(self, line: bytes) -> None:
        """Begin the waveform, the lanes, or to look for the condition, that is asked for."""
        if self._recorder is not None:
            for told in line.splitlines():
                self._told(self._recorder, told)
            return
        if self._asked:
            return
        try:
            asked = json.loads(line)
            if "scope" in asked:
                wanted = msgspec.convert(asked["scope"], _Wanted)
                self._samples = wanted.samples
                self._begin_scope(wanted.control, wanted.after)
                return
            if "pins" in asked:
                self._begin_pins(PinRecorder(self._board, **asked["pins"]))
                return
            if "until" in asked:
                self._until = Watch(str(asked["until"]), self._board, met=self._met)
                self._until.begin()
                self._lines.append(["waiting"])
                return
            section = msgspec.convert({"name": "", "file": "", **asked["wave"]}, WaveSection)
            self._wave = Wave(
                self._board, _BufferedText(self.pending), section.profile, section.signals,
                section.trigger, section.before, section.duration, section.sample,
            )  # fmt: skip
        except (ValueError, KeyError, TypeError, VbusError) as error:
            self._lines.append(["refused", str(error)])
            return
        self._board.unobserve(self)
        self._lines.clear()
        self.pending += b'["wave"]\n'
        self._wave.start()

    def _told(self, recorder: Recorder, line: bytes) -> None:
        """The page wants registers or samples, or gives an order."""
        try:
            asked = json.loads(line)
        except (ValueError, RecursionError):
            asked = None
        if isinstance(asked, dict) and "registers" in asked:
            self._inside = asked["registers"] is True
            recorder.look_inside(self._inside)
        elif isinstance(asked, dict) and "samples" in asked:
            self._samples = asked["samples"] is not False
            recorder.look_at_samples(self._samples)
            if self._timer is not None:
                self._timer.cancel()
            self._send()
        elif (manual := self._manual) is not None:
            back = partial(self._jump.begin, own=self, port=manual.port)
            self._control.take(line, self._answer, {**manual.orders(), "back": back})

    @property
    def watches(self) -> str:
        """Who this is, in words."""
        if self._recorder is not None:
            return "a scope or viewer"
        for what, one in (
            ("a viewer of pins", self._pins), ("a waveform", self._wave), ("vbus wait", self._until)
        ):  # fmt: skip
            if one is not None:
                return what
        return "a monitor"

    def step_aside(self) -> None:
        """Let go of the board: it goes back."""
        assert self._recorder is not None
        assert self._manual is not None
        self._send_frames(self._recorder)
        self._recorder.stop()
        self._manual.end(go_on=False)

    def step_in(self) -> None:
        """Hold and watch it again; what is told begins anew there."""
        assert self._manual is not None
        self._manual.attach()
        self._recorder = Recorder(self._board, edges=False, late=self._late)
        self._answer({"scope": self._described(self._recorder)})
        self._recorder.look_at_samples(self._samples)
        self._recorder.start()
        self._recorder.look_inside(self._inside)

    @property
    def _asked(self) -> bool:
        """Whether something else than lines was asked for."""
        return any(one is not None for one in (
            self._wave, self._recorder, self._pins, self._until,
        ))  # fmt: skip

    def _begin_scope(self, control: bool, after: int) -> None:
        refusal = refusal_of(self._link.fd) if control else ""
        if refusal:
            raise VbusError(refusal)
        self._board.unobserve(self)
        self._lines.clear()
        self._recorder = Recorder(self._board, edges=False, late=self._late)
        if control:
            self._manual = ManualHost(self._board, self._steps)
        told = self._described(self._recorder)
        self.pending += json.dumps(["scope", told]).encode() + b"\n"
        self._recorder.look_at_samples(self._samples)
        self._recorder.start(after)
        if control:
            self._steps.changed.append(self._steps_changed)
            self._tell_steps()

    def _described(self, recorder: Recorder) -> dict[str, Any]:
        told = recorder.lanes.described(live=True, control=self._manual is not None)
        return told if self._manual is None else {**told, "manual": self._manual.described()}

    def _steps_changed(self) -> None:
        # A step may end within a bus cycle: nothing is sent, and nobody hung up on, before its end.
        self.loop.call_soon(self._tell_steps)

    def _tell_steps(self) -> None:
        if self.open and self._recorder is not None:
            self._send_frames(self._recorder)
            self._answer({"control": self._steps.told()})

    def _answer(self, answer: dict[str, Any]) -> None:
        """Send an answer at once; who orders and does not read is hung up on."""
        self._message(json.dumps(answer).encode())
        if len(self.pending) > MOST_ANSWERS:
            self.end()
        else:
            self.flush()

    def _message(self, message: bytes) -> None:
        self.pending += len(message).to_bytes(4, "little") + message

    def _begin_pins(self, pins: PinRecorder) -> None:
        self._board.unobserve(self)
        self._lines.clear()
        self._pins = pins
        self.pending += json.dumps(["pins", pins.described()]).encode() + b"\n"
        pins.start()

    def _send_frames(self, recorder: Recorder | PinRecorder) -> None:
        if len(self.pending) >= MOST_FRAMES:
            recorder.leave_out()
            return
        frames = recorder.take(numbers)
        lasting = []
        while frames[0][0] in LASTING:
            lasting.append(frames.pop(0))
        for message in (*lasting, b"".join(frames)):
            self._message(message)

    def _met(self) -> None:
        assert self._until is not None
        self._until.end()
        self._lines.append(["until", self._board.now])

    def _send(self) -> None:
        lines, self._lines = self._lines, []
        if self._recorder is not None:
            self._send_frames(self._recorder)
        elif self._pins is not None:
            self._send_frames(self._pins)
        elif self._wave is not None:
            if self._wave.state == DONE and not self.pending:
                self.end()
        elif len(self.pending) < MOST_PENDING:
            board = self._board
            values = {chip.name: chip.telemetry() for chip in board.chips}
            lines.append(["t", board.now, values])
            if self._lost:
                lines.append(["lost", self._lost])
                self._lost = 0
            self.pending += "".join(json.dumps(line) + "\n" for line in lines).encode()
        else:
            self._lost += len(lines)
        if self.open:
            self.flush()
        if self.open:
            pause = EVERY_SECONDS if self._samples else UNSEEN_SECONDS
            self._timer = self.loop.call_later(pause, self._send)

    def end(self) -> None:
        """Watch no more; may be called again."""
        if self.open:
            if self._timer is not None:
                self._timer.cancel()
            if self._manual is not None:
                self._steps.changed.remove(self._steps_changed)
                self._manual.end()
            if self._wave is not None:
                self._wave.stop()
            elif (recorder := self._recorder or self._pins) is not None:
                recorder.stop()
                self._send_last()  # there is room for what is new then
                self._send_frames(recorder)
                self._send_last()
            else:
                self._board.unobserve(self)
            if self._until is not None:
                self._until.end()
        super().end()

    def _send_last(self) -> None:
        """Send what is pending: a run that was short may end with most of it, and waits for it.

        Not for somebody who has read nothing for a while, or orders and does not read.
        """
        if len(self.pending) > MOST_ANSWERS:
            return
        room = select.poll()
        room.register(self._link.fd, select.POLLOUT)
        with suppress(OSError):  # nobody is there any more
            while self.pending and room.poll(LAST_SECONDS * 1000):
                del self.pending[: os.write(self._link.fd, self.pending)]
