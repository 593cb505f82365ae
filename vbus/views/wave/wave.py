"""Waveforms: what happens on a board as a VCD file for GTKWave, Surfer or sigrok."""

from bisect import bisect_left
from collections import deque
from collections.abc import Callable, Iterable
from operator import itemgetter
from typing import Final, TextIO

from vbus.board.board import Board
from vbus.chips.packets import Packet
from vbus.circuit.stream import PacketReader, PacketStream
from vbus.core.errors import VbusError, import_errors
from vbus.core.kernel import MS
from vbus.core.signals import Reading, Violation
from vbus.events.watch import Watch
from vbus.views.wave.changes import Changes
from vbus.views.wave.signals import FULL, PROFILES, Signal, signals_of, values_of
from vbus.views.wave.vcd_file import Change, VcdFile

# Some 100 MB: minutes of a driver, with what it shows from before the trigger.
RING: Final = 1_000_000
"""Changes buffered while a trigger is waited for."""

WAITING: Final = "waiting"
RECORDING: Final = "recording"
DONE: Final = "done"


class Wave(PacketReader):
    """Records a board from :meth:`start` to :meth:`stop`, or from a trigger for a while.

    A file that takes no more (a full disk, a closed pipe) ends the recording; the board goes on.

    Args:
        board: the board.
        file: takes the text.
        profile: ``"full"`` (vectors, values of the chips, commands, violations) or ``"sigrok"``
            (single bits with plain names).
        signals: patterns of names, as in ``"x.*"``; none: everything but pins with fast waveforms.
        trigger: the condition that must come to hold; what holds from the beginning must cease
            to first. "": none.
        before: how much to show from before the trigger (ps).
        duration: how long to record (ps); 0 for no limit.
        sample: how often the chips' own values are looked at (ps).
        report: takes a sentence when the file takes no more.

    Raises:
        VbusError: profile, trigger or pattern make no sense; says what does.
        PluginError: pyvcd is not installed.
    """

    def __init__(
        self,
        board: Board,
        file: TextIO,
        profile: str = FULL,
        signals: Iterable[str] = (),
        trigger: str = "",
        before: int = 0,
        duration: int = 0,
        sample: int = MS,
        report: Callable[[str], None] | None = None,
    ) -> None:
        if profile not in PROFILES:
            raise VbusError(f"profile {profile!r}: allowed are {', '.join(PROFILES)}")
        with import_errors("waveforms need pyvcd", "pyvcd"):
            import vcd  # noqa: F401
        self.board: Board = board
        self.state: str = "new"
        self.error: str = ""
        """Why the file takes no more, or ""."""
        self.changes: int = 0
        """Changes written."""
        self._file: VcdFile = VcdFile(file, profile)
        self._report: Callable[[str], None] | None = report
        self._before: int = before
        self._duration: int = duration
        self._end: int = -1
        self._sample: int = max(1, sample)
        self._trigger: Watch | None = None
        if trigger:
            self._trigger = Watch(trigger, board, "trigger", self._triggered, anew=True)
        self.signals: list[Signal] = signals_of(board, list(signals))
        nets = {one.name: one for one in self.signals if one.net}
        self._others: dict[str, Signal] = {one.name: one for one in self.signals if not one.net}
        self._words: dict[str, Signal] = {}
        """What shows the packets of a chip, by its name, where they are shown."""
        if profile == FULL:
            words = {chip.name: self._others.get(f"{chip.name}.packet") for chip in board.chips}
            self._words = {name: word for name, word in words.items() if word is not None}
        shown = [chip for chip in board.chips if chip.name in self._words]
        self._stream: PacketStream = PacketStream.of(shown, (self,))
        """Of its own: equal polls are not decoded again. Packets that are not shown are none."""
        self._values: dict[Signal, Reading] = {}
        """Values at the beginning of the ring, and later the latest written."""
        self._latest: dict[Signal, Reading] = {}
        """The latest values of the chips."""
        self._changes: Changes = Changes(board.kernel, nets, self._stream)
        self._ring: deque[Change] = deque()
        # No part of the state of the board: a waveform changes no hash.
        self._timer = board.kernel.onlooker(self._look)

    # -- beginning and end --------------------------------------------------------------------

    def start(self) -> None:
        """Begin to record, or to wait for the trigger."""
        if self.state != "new":
            raise VbusError("a waveform can be started once; make another one")
        now = self.board.now
        nets = [(signal, signal.net) for signal in self.signals if signal.net is not None]
        self._values = {signal: net.value for signal, net in nets}
        values = values_of(self.board)
        self._values |= {self._others[k]: value for k, value in values.items() if k in self._others}
        self._latest = dict(self._values)
        for _, net in nets:
            net.observe(self._changes)
        self.board.observe(self._changes)
        self._timer.at(now + self._sample)
        self.state = WAITING
        # Without a trigger it is as if one came now.
        if self._trigger is None:
            self._begin(now, now)
        else:
            self._trigger.begin()

    def stop(self) -> None:
        """End the recording and close the text; the file stays open. May be called again."""
        if self.state in (WAITING, RECORDING):
            self.board.catch_up()
            if self._trigger is not None:
                self._trigger.flush()
            self._drain(self.board.now + 1)
            self._finish(self.board.now)

    def _finish(self, when: int) -> None:
        if self.state in (WAITING, RECORDING):
            recording = self.state == RECORDING
            self.state = DONE
            self._timer.cancel()
            if self._trigger is not None:
                self._trigger.end()
            self.board.unobserve(self._changes)
            for signal in self.signals:
                if signal.net is not None:
                    signal.net.unobserve(self._changes)
            if recording and not self.error:
                self._guarded(lambda: self._file.close(when))

    def _guarded(self, write: Callable[[], None]) -> bool:
        """Write; tell whether it worked. A file that takes no more ends the recording."""
        try:
            write()
        except (OSError, ValueError) as error:
            reason = error.strerror if isinstance(error, OSError) else str(error)
            self.error = f"the waveform ends after {self.changes} changes: {reason}"
            self._finish(self.board.now)
            if self._report is not None:
                self._report(self.error)
            return False
        return True

    # -- what happens -------------------------------------------------------------------------

    def packet(self, chip: str, packet: Packet) -> None:
        """Take down what bus cycles say."""
        # A packet that was cut short is known to have ended only now.
        signal, text = self._words[chip], packet.text
        self._changes.note(self._stream.latest, signal, text)
        # Such a packet says the same each time: a poll is decoded once.
        if packet.kind in self._stream.decoders[chip].APART:
            _, write, address, data = packet.cycles[0]
            self._changes.say(chip, write, address, data, signal, text)

    def violation(self, violation: Violation) -> None:
        """Take down a violation."""
        signal = self._others.get(f"{violation.chip}.violation")
        if signal is not None:
            self._changes.note(violation.when, signal, violation.rule)

    def settled(self, now: int) -> None:
        """Everything before ``now`` has been reported."""
        self._drain(now)

    def _look(self) -> None:
        """Look at what the chips tell of themselves; they are up to date after that."""
        now = self.board.now
        for name, value in values_of(self.board).items():
            signal = self._others.get(name)
            if signal is not None and self._latest.get(signal) != value:
                self._latest[signal] = value
                self._changes.note(now, signal, value)
        self._drain(now)
        if self.state in (WAITING, RECORDING):
            self._timer.at(now + self._sample)

    # -- from changes to the file -------------------------------------------------------------

    def _drain(self, now: int) -> None:
        """Sort out what happened before ``now``: lazy chips report late."""
        self._changes.drain(now)
        pending, recording = self._changes.pending, self.state == RECORDING
        # What happens at the end itself is written, too.
        until = min(now, self._end + 1) if recording and self._end >= 0 else now
        done = bisect_left(pending, until, key=itemgetter(0))
        changes = pending[:done]
        del pending[:done]
        if not recording:
            for change in changes:
                self._ring.append(change)
                self._forget(change[0])
        elif self._write(changes):
            if 0 <= self._end < now:
                self._finish(self._end)
            else:
                self._guarded(self._file.flush)

    def _forget(self, when: int) -> None:
        """Keep of the ring what a recording from instant ``when`` on would show."""
        ring = self._ring
        # What leaves the ring becomes the value that the head of the file has.
        while ring and (ring[0][0] < when - self._before or len(ring) > RING):
            _, old, kept = ring.popleft()
            self._values[old] = kept

    def _triggered(self) -> None:
        """The trigger's condition has come to hold."""
        now = self.board.now
        self._drain(now)
        self._forget(now)
        if self.state == WAITING:
            self._begin(max(0, now - self._before), now)

    def _begin(self, first: int, trigger: int) -> None:
        """Write the head, and what is buffered from before the trigger."""
        self.state = RECORDING
        if self._duration:
            self._end = trigger + self._duration
        if not self._guarded(lambda: self._file.begin(self.signals, self._values, first)):
            return
        ring, self._ring = self._ring, deque()
        self._write([*ring])

    def _write(self, changes: list[Change]) -> bool:
        """Write some changes in order of time; tell whether it worked."""
        if not self._guarded(lambda: self._file.write(changes)):
            return False
        self.changes += len(changes)
        return True
