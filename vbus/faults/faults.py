"""The faults of one board: armed, acting, over."""

import hashlib
from collections import deque
from collections.abc import Callable, Mapping
from heapq import heappop, heappush
from typing import ClassVar, Final

from vbus.chips.base import Chip
from vbus.circuit.circuit import Circuit
from vbus.core.kernel import US
from vbus.core.options import Option, Value, with_defaults
from vbus.core.signals import Observer
from vbus.core.state import Names
from vbus.core.values.settings import allowed, among, check_value, quoted
from vbus.core.values.units import DIMENSIONS
from vbus.faults.armed import ACTING, BEGUN, ENDED, FAILED, OVER, WAITING, Armed, Evidence
from vbus.faults.bus import BusFault
from vbus.faults.effects import FaultEffects
from vbus.faults.row import AXIS, LASTS, LINK, ONCE, Fault
from vbus.faults.state import RECORD, Record, armed_of, record
from vbus.faults.table import faults
from vbus.faults.targets import find_target
from vbus.faults.trigger import (
    AT,
    COMMAND,
    CONDITION,
    CYCLE,
    EDGE,
    FOR,
    NOW,
    POSITION,
    RATE,
    read_until,
    read_when,
)
from vbus.faults.watch import ConditionWatch, begins, write_of


def check_parameters(fault: Fault, given: Mapping[str, object]) -> dict[str, Value]:
    """Return every parameter of ``fault``: as given, or its default.

    Raises:
        ValueError: one it does not have, or a value that cannot be; says what is allowed.
    """
    rows = {row.name: row for row in fault.parameters}
    result: dict[str, Value] = {row.name: row.default for row in fault.parameters}  # type: ignore[misc]
    for key, value in given.items():
        row = rows.get(key)
        if row is None:
            raise ValueError(f'{fault.name} has no "{key}"; {among(key, rows, "it has")}')
        result[key] = _value(fault, row, value)
    _fits(fault, result)
    return result


def _value(fault: Fault, row: Option, value: object) -> Value:
    try:
        if row.kind in DIMENSIONS and isinstance(value, int | float):
            return with_defaults((row,), {row.name: value})[row.name]
        if row.kind in ("count", "ratio") and isinstance(value, str):
            value = int(value, 0) if row.kind == "count" else float(value)
        return check_value(value, row)
    except ValueError as error:
        reason = str(error) if "invalid literal" not in str(error) else allowed(row)
        raise ValueError(f"{fault.name}: {row.name} = {quoted(value)}: {reason}") from None


def _fits(fault: Fault, values: dict[str, Value]) -> None:
    if fault.name == "index_double" and int(values["distance"]) % 4:
        raise ValueError(
            f"index_double: distance = {values['distance']}: an index lies where A and B are low,"
            " so write a multiple of 4"
        )


LOOK: Final = 100 * US
"""How often a trigger looks at a position."""
LONGEST_LOG: Final = 1000
"""Pieces of evidence that are stored."""

_BEGIN: Final = 0
_END: Final = 1
_LOOK: Final = 2
_TOGGLE: Final = 3
_CALL: Final = 4
_STOP: Final = 5


class Faults(Observer):
    """What is broken, or will be, on one board; ``board.faults``.

    Everything happens at exact instants of chip time: a trigger that is met by a bus cycle or an
    edge lets its fault begin at that same instant, after it. Mechanics feel it from their next
    period on.

    Args:
        board: the board.

    Attributes:
        log: evidence, oldest first; the latest thousand.
    """

    STATE: ClassVar[Names] = (
        "_last", "_serial", f"records: list[{RECORD}, ...]", "due: heap[(i64, i64, i64, i64)]",
        "acts: part",
    )  # fmt: skip
    WIRING: ClassVar[Names] = ("log",)
    DERIVED: ClassVar[Names] = ("_armed", "_calls", "_queue", "_watching")

    def __init__(self, board: Circuit) -> None:
        self._board: Circuit = board
        self.log: deque[Evidence] = deque(maxlen=LONGEST_LOG)
        self._armed: dict[int, Armed] = {}
        self._last: int = 0
        self.acts: FaultEffects = FaultEffects(board, self.later, self._armed)
        self._queue: list[tuple[int, int, int, int]] = []
        self._calls: dict[int, Callable[[], None]] = {}
        self._serial: int = 0
        self._timer = board.kernel.timer(self._due, saved=False)
        self._watching: bool = False

    # -- what people call ---------------------------------------------------------------------

    def arm(
        self,
        name: str,
        target: str = "",
        when: str | int | None = None,
        until: str | int | None = None,
        **parameters: object,
    ) -> Armed:
        """Arm a fault.

        Args:
            name: see :func:`~vbus.faults.table.faults`.
            target: ``"x"``, ``"x.2"`` (second axis) or ``"host0"``; may be left out where there
                is one only.
            when: trigger as a text, or an instant (ps); now if None.
            until: end as a text, or a duration (ps).
            parameters: the fault's own, in SI units, times in ps; texts with a unit, as in a
                board file, will do too.

        Raises:
            ValueError: no such fault, target, trigger or parameter, or one that does not fit;
                the message says what there is.
        """
        fault = self.find(name)
        place = find_target(self._board, fault, target, self.acts.links)
        trigger = read_when(when)
        end = read_until(until, trigger, fault)
        armed = Armed(
            self._last + 1, fault, place, trigger, end, check_parameters(fault, parameters)
        )
        self._prepare(armed)
        # A host may hold the promise of a byte that the fault is about to change.
        self._board.end_leases()
        self._last += 1
        self._armed[armed.number] = armed
        self._note("arm", [name, place, trigger.text, end.text, armed.values])
        self._settle_watch()
        self._start(armed)
        return armed

    def clear(self, which: Armed | int | str = "all") -> list[Armed]:
        """End faults, or call them off: one, by its number, all of a name, or ``"all"``.

        Returns:
            Those that were waiting or acting.

        Raises:
            ValueError: there is none of that number or name.
        """
        number = which.number if isinstance(which, Armed) else which
        live = self.live()
        if isinstance(number, str) and number.lstrip("#").isdecimal():
            number = int(number.lstrip("#"))
        if number != "all":
            known = [
                armed for armed in self._armed.values() if number in (armed.number, armed.name)
            ]
            if not known:
                names = sorted({armed.name for armed in self._armed.values()})
                there = among(str(number), names, "there are")
                raise ValueError(f'no fault "{number}" is armed; {there}')
            live = [armed for armed in live if armed in known]
        self._board.end_leases()
        for armed in live:
            self._note("clear", [armed.number])
            armed.cleared = True
            if armed.state == ACTING:
                self._end(armed, "cleared")
            self._finish(armed)
        return live

    def live(self) -> list[Armed]:
        """Return the faults that wait or act, oldest first."""
        return [armed for armed in self._armed.values() if armed.state != OVER]

    def all(self) -> list[Armed]:
        """Return every fault that was ever armed, oldest first."""
        return list(self._armed.values())

    def unfired(self) -> list[Armed]:
        """Return the faults that were armed, never began and were not called off."""
        return [armed for armed in self._armed.values() if not armed.fired and not armed.cleared]

    # -- looking up ---------------------------------------------------------------------------

    @staticmethod
    def find(name: str) -> Fault:
        """Return the row of the fault called ``name``.

        Raises:
            ValueError: there is none.
        """
        known = faults()
        if name not in known:
            raise ValueError(f'there is no fault "{name}"; {among(name, known, "there are")}')
        return known[name]

    def _chip_of(self, armed: Armed) -> Chip | None:
        if not armed.fault.of_chip:
            return self._board.chips[0] if len(self._board.chips) == 1 else None
        return self._board.chip(armed.target.partition(".")[0])

    # -- triggers -----------------------------------------------------------------------------

    def _prepare(self, armed: Armed) -> None:
        """Check that the trigger fits the board, before anything is changed."""
        when, chip, of = armed.when, self._chip_of(armed), armed.fault.target
        if when.kind in (EDGE, CONDITION):
            armed.watcher = self._watch(armed)
        if when.kind in (COMMAND, POSITION) and chip is None:
            raise ValueError(f'when = "{when.text}": a fault of a {of} has no {when.kind}')
        if when.kind == COMMAND and chip is not None:
            armed.writes = write_of(chip, when.name)
        if when.kind == POSITION:
            place = armed.target if armed.fault.target == AXIS else f"{armed.target}.1"
            if place not in self._board.axes:
                raise ValueError(f'when = "{when.text}": no plant is behind {place}')
        if when.kind == RATE:
            # By number, name and target: one fault more changes the draws of no other one.
            seed = f"{self._board.seed} fault {armed.number} {armed.name} {armed.target}"
            armed.draws = int.from_bytes(hashlib.sha256(seed.encode()).digest()[:4], "big")

    def _start(self, armed: Armed) -> None:
        """Wait for the trigger."""
        when, now = armed.when, self._board.now
        if when.kind == NOW or (when.kind == AT and when.number <= now):
            self._begin(armed)
        elif when.kind == AT:
            self._push(when.number, _BEGIN, armed.number)
        elif when.kind == CYCLE:
            if armed.fault.of_cycles and when.number == 1:
                self._begin(armed)
        elif when.kind == POSITION:
            armed.side = 1 if self._position(armed) < when.number else -1
            self._push(now + LOOK, _LOOK, armed.number)
        elif armed.watcher is not None:
            armed.watcher.begin()
        elif when.kind == RATE:
            if armed.until.kind == FOR and armed.fault.acts != LASTS:
                self._push(now + armed.until.span, _STOP, armed.number)
            self._draw(armed)

    def _watch(self, armed: Armed) -> ConditionWatch:
        """Return what waits for an edge or a condition."""
        text, chip = armed.when.name, self._chip_of(armed)
        if armed.when.kind == EDGE:
            place = f"{chip.name}.{text}" if "." not in text and chip is not None else text
            net = self._board.find_pin(place).net
            text = f'"{net.name}" {"rises" if armed.when.number else "falls"}'
        return ConditionWatch(text, self._board, chip, lambda: self._met(armed))

    def _unwatch(self, armed: Armed) -> None:
        if armed.watcher is not None:
            armed.watcher.end()
            armed.watcher = None

    def _position(self, armed: Armed) -> int:
        place = armed.target if armed.fault.target == AXIS else f"{armed.target}.1"
        axis = self.acts.axis(place)
        axis.chip.advance()
        return axis.count

    def _draw(self, armed: Armed) -> None:
        """Set the next instant of a stream: uniform, with the mean that was asked for."""
        # A congruential generator modulo 2^32 with the multiplier of Numerical Recipes: its whole
        # state is one number, which a snapshot saves.
        armed.draws = (armed.draws * 1664525 + 1013904223) & 0xFFFFFFFF
        # Never 0: a stream of faults at one instant would let no time pass.
        gap = 1 + (2 * armed.when.number * armed.draws >> 32)
        self._push(self._board.now + gap, _BEGIN, armed.number)

    def bus_cycle(
        self, when: int, host: str, chip: str, write: bool, address: int, data: int
    ) -> None:
        """A bus cycle has been made: what waited for it begins, what was to last for it ends."""
        names = chip.split("+")
        for armed in self.live():
            chip_of = self._chip_of(armed)
            if chip_of is not None and chip_of.name not in names:
                continue
            if armed.state == ACTING:
                bus = self.acts.placed.get(armed.number)
                once = armed.until.kind == ONCE or armed.when.kind == RATE
                mine = armed.fault.of_cycles and not (
                    isinstance(bus, BusFault) and not bus.concerns(write)
                )
                if once and mine:
                    self._push(when, _END, armed.number)
            elif armed.when.kind == CYCLE:
                armed.seen += 1
                # A fault of cycles is there before its cycle: from the end of the one before.
                early = armed.fault.of_cycles
                if armed.seen == armed.when.number - early:
                    self._met(armed)
            elif armed.when.kind == COMMAND and write and begins(armed.writes, address, data):
                self._met(armed)

    def _met(self, armed: Armed) -> None:
        """A bus cycle has met a trigger. A fault of cycles must be there for the next one."""
        if armed.fault.of_cycles:
            self._begin(armed)
        else:
            self._push(self._board.now, _BEGIN, armed.number)

    # -- time ---------------------------------------------------------------------------------

    def _push(self, when: int, kind: int, number: int) -> None:
        self._serial += 1
        # By the serial number, what is due at one instant happens in the order in which it was set.
        heappush(self._queue, (max(when, self._board.now), self._serial, kind, number))
        self._timer.at(self._queue[0][0])

    def later(self, when: int, call: Callable[[], None]) -> None:
        """Call back at instant ``when`` (ps)."""
        self._calls[self._serial + 1] = call
        self._push(when, _CALL, self._serial + 1)

    def _due(self) -> None:
        now = self._board.now
        while self._queue and self._queue[0][0] <= now:
            _, _, kind, number = heappop(self._queue)
            if kind == _CALL:
                call = self._calls.pop(number, None)
                if call is not None:
                    call()
            elif self._armed[number].state != OVER:
                self._happen(self._armed[number], kind)
        if self._queue:
            self._timer.at(self._queue[0][0])

    def _happen(self, armed: Armed, kind: int) -> None:
        if kind == _BEGIN and armed.state == WAITING:
            self._begin(armed)
        elif kind == _BEGIN and armed.when.kind == RATE:
            self._draw(armed)
        elif kind in (_END, _STOP):
            if armed.state == ACTING:
                self._end(armed, "")
            if kind == _STOP or armed.when.kind != RATE:
                self._finish(armed)
        elif kind == _LOOK and armed.state == WAITING:
            here = self._position(armed)
            if (here - armed.when.number) * armed.side >= 0:
                self._begin(armed)
            else:
                self._push(self._board.now + LOOK, _LOOK, armed.number)
        elif kind == _TOGGLE and armed.state == ACTING:
            armed.seen ^= 1
            self.acts.axis(armed.target).end(armed)
            self._push(self._board.now + int(armed.values["period"]) // 2, _TOGGLE, armed.number)

    # -- beginning and ending -----------------------------------------------------------------

    def _begin(self, armed: Armed) -> None:
        fault = armed.fault
        armed.state = ACTING
        if armed.name == "limit_bouncing":  # whatever its trigger has counted
            armed.seen = 0
        try:
            text = self.acts.begin(armed)
        except ValueError as error:
            self._tell(armed, FAILED, str(error))
            if fault.target != LINK:
                self._finish(armed)
                return
        else:
            armed.fired += 1
            self._tell(armed, BEGUN, text)
        self._unwatch(armed)
        if armed.name == "limit_bouncing":
            self._push(self._board.now + int(armed.values["period"]) // 2, _TOGGLE, armed.number)
        rated = armed.when.kind == RATE
        if fault.acts == ONCE or (fault.target == LINK and armed.single):
            # It is over as soon as it has begun; a stream goes on.
            if rated:
                armed.state = WAITING
            else:
                self._finish(armed)
        elif armed.until.kind == FOR and (not rated or fault.acts == LASTS):
            self._push(self._board.now + armed.until.span, _END, armed.number)
        if rated:
            self._draw(armed)
        self._settle_watch()

    def _end(self, armed: Armed, text: str) -> None:
        armed.state = WAITING
        change = self.acts.end(armed)
        if armed.fired:
            self._tell(armed, ENDED, ", ".join(filter(None, (text, change))))

    def _finish(self, armed: Armed) -> None:
        armed.state = OVER
        self._unwatch(armed)
        self._settle_watch()

    def _settle_watch(self) -> None:
        """Look at bus cycles, and promise hosts nothing, only while a fault wants it."""
        live = self.live()
        self._board.disturbed = bool(live)
        wanted = any(armed.when.kind in (CYCLE, COMMAND) or armed.fault.of_cycles for armed in live)
        if wanted != self._watching:
            self._watching = wanted
            if wanted:
                self._board.observe(self)
            else:
                self._board.unobserve(self)

    def _note(self, order: str, values: list[object]) -> None:
        for observer in (*self._board.listeners, *self._board.observers):
            observer.outside(order, values)

    def _tell(self, armed: Armed, what: str, text: str) -> None:
        now = self._board.now
        self.log.append(Evidence(now, armed.number, armed.name, armed.target, what, text))
        for observer in (*self._board.listeners, *self._board.observers):
            observer.fault(now, armed.name, armed.target, what, text)

    # -- state --------------------------------------------------------------------------------

    def before_save(self) -> None:
        """What conditions have seen at this instant is taken into account."""
        for armed in self.live():
            if armed.watcher is not None:
                armed.watcher.flush()

    @property
    def records(self) -> list[Record]:
        """Every fault that was ever armed, as plain numbers and texts; the log stays out."""
        return [record(armed) for armed in self._armed.values()]

    @records.setter
    def records(self, records: list[Record]) -> None:
        self.acts.leave()
        for armed in self.live():
            self._finish(armed)
        self._armed.clear()
        known = faults() if records else {}
        for row in records:
            self._armed[row[0]] = armed_of(row, known[row[1]])

    @property
    def due(self) -> list[tuple[int, int, int, int]]:
        """What is due when, but for what acting faults have asked for."""
        return [entry for entry in self._queue if entry[2] != _CALL]

    @due.setter
    def due(self, due: list[tuple[int, int, int, int]]) -> None:
        self._queue = due
        self._calls = {}
        self._timer.cancel()

    def go_on(self) -> None:
        """Everything is loaded: let what acts on chips and buses act again."""
        self.acts.go_on([a for a in self._armed.values() if a.state == ACTING])
        for armed in self.live():
            if armed.when.kind in (EDGE, CONDITION) and armed.state == WAITING:
                armed.watcher = self._watch(armed)
                armed.watcher.begin()
        if self._queue:
            self._timer.at(self._queue[0][0])
        self._settle_watch()
