"""What happened in a recorded run: the host's packets, the motion of every axis, what it cost."""

import tomllib
from collections import Counter
from dataclasses import dataclass, field
from typing import Any, Final

from vbus import plugins
from vbus.board.build import build
from vbus.board.config import read_board_text
from vbus.boardfile.sections import BoardFile
from vbus.chips.packets import STATUS, WHOLE, Packet
from vbus.circuit.stream import PacketReader, PacketStream
from vbus.core.errors import VbusError
from vbus.core.signals import Violation
from vbus.record.format import Header, JournalReader
from vbus.record.replay import Replay
from vbus.record.view import shown
from vbus.version import __version__
from vbus.views.runs.motion import AxisCourse, Motion

_OUTSIDE: Final = ("hosts", "record", "waves", "metrics", "zenoh")
"""Sections of a board file that say nothing of the machine on the board."""


@dataclass(slots=True)
class Said:
    """A packet of the host; one it reads again before it writes anything else is a poll.

    Attributes:
        when: instant at which it was complete, the last time (ps).
        asked: chip, and what the host did: without what the chip answered.
        text: the same with the answer, the last time.
        clause: clause of the chip's specification, or "".
        begun: instant of its first bus cycle, the first time (ps).
    """

    when: int
    asked: str
    text: str
    clause: str = ""
    begun: int = 0


@dataclass(slots=True)
class Run:
    """What happened in a run.

    Attributes:
        host: the packets of its hosts, in their order.
        axes: what each axis did, by its name, as ``"x.1"``.
        cycles: bus cycles.
        duration: chip time (ps).
        violations: how often each chip's host broke a rule.
        models: model and version of the plant of each axis, as ``"dc_motor 1"``.
        vbus: the version that this was found out with.
    """

    host: list[Said] = field(default_factory=list)
    axes: dict[str, AxisCourse] = field(default_factory=dict)
    cycles: int = 0
    duration: int = 0
    violations: Counter[tuple[str, str]] = field(default_factory=Counter)
    models: dict[str, str] = field(default_factory=dict)
    vbus: str = __version__


class _Host(PacketReader):
    """Takes down what hosts do."""

    def __init__(self, run: Run) -> None:
        self._run = run
        self._polled: dict[str, Said] = {}
        """What has been read since the host wrote."""

    def packet(self, chip: str, packet: Packet) -> None:
        """Take a packet down."""
        answered = packet.kind in (WHOLE, STATUS) and not packet.cycles[-1].write
        text = f"{chip} {packet.text}"
        asked = f"{chip} {packet.name}" if answered else text
        # How often a driver polls depends on the machine of its time, not on the driver.
        again = self._polled.get(asked)
        if again is not None:
            again.when, again.text = packet.end, text
            return
        said = Said(packet.end, asked, text, packet.clause, packet.begin)
        self._run.host.append(said)
        if answered:
            self._polled[asked] = said
        else:
            # What is read after a write is asked anew, even if it was read before.
            self._polled.clear()

    def bus_cycle(
        self, when: int, host: str, chip: str, write: bool, address: int, data: int
    ) -> None:
        """Count a cycle."""
        self._run.cycles += 1

    def violation(self, violation: Violation) -> None:
        """Count a violation."""
        self._run.violations[violation.chip, violation.rule] += 1


def recorded_run(reader: JournalReader) -> Run:
    """Return what happened in a run, from its journal: its motors move as it is played again.

    Args:
        reader: the journal.

    Raises:
        VbusError: the journal is damaged or not closed, or its run is another one when it is
            played again.
    """
    header = reader.header
    # The motors are in no journal: they have to move once more.
    if not header.text:
        raise VbusError("it was recorded on a board made in Python, which cannot be built again")
    file, source = read_board_text(header.text, header.file)
    board = build(file, source)
    run = Run(models=models_of(file))
    host = _Host(run)
    stream = PacketStream(header.families, header.settings, (host,))
    motion = Motion(board)
    outcome = Replay(board, shown(reader, stream), header.families).run()
    axes = motion.stop()
    found = outcome.divergence
    if found is not None:
        raise VbusError(
            f"its run is another one when it is played again: entry {found.entry} differs"
            f" ({found.where}); it was recorded with vbus {header.vbus}, this is {__version__}, and"
            ' "vbus replay" shows more'
        )
    # What came after the last entry is not known, so neither is where the motors came to rest.
    if not outcome.ended:
        raise VbusError(
            f"it was not closed ({reader.damage or 'its end is missing'}):"
            " record it again, and end it with vbus stop or Ctrl-C"
        )
    # Only now: a packet that the host left open is one of its packets.
    stream.finish()
    run.axes = axes
    run.duration = board.now
    return run


def models_of(file: BoardFile) -> dict[str, str]:
    """Return model and version of the plant of each axis of a board."""
    model = {plant.name: plant.model for plant in file.plants}
    return {
        f"{chip.name}.{number}": f"{model[plant]} {plugins.plant_class(model[plant]).MODEL}"
        for chip in file.chips
        for number, plant in enumerate(chip.axes, 1)
        if plant in model
    }


def other_board(was: Header, now: Header) -> str:
    """Say what of the boards of two runs differs first; "" if they are the same machine."""
    tables = [
        {key: value for key, value in tomllib.loads(header.text).items() if key not in _OUTSIDE}
        for header in (was, now)
    ]
    return _first_other("", *tables)


def _first_other(place: str, was: Any, now: Any) -> str:
    if not (isinstance(was, dict) and isinstance(now, dict)):
        return "" if was == now else f"{place} = {was!r} in one and {now!r} in the other"
    # In the order of the file: the message names what a reader meets first.
    for key in [*was, *(key for key in now if key not in was)]:
        inner = f"{place}.{key}" if place else key
        if key not in was or key not in now:
            return f"{inner} stands in the {'first' if key in was else 'second'} alone"
        found = _first_other(inner, was[key], now[key])
        if found:
            return found
    return ""
