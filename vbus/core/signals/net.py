"""Wires and the pins connected to them."""

from collections.abc import Callable
from typing import ClassVar, Final, TypeVar

from mypy_extensions import mypyc_attr

from vbus.core.kernel.kernel import Kernel, Task
from vbus.core.signals.observer import Observer
from vbus.core.state import Names

LOW: Final = 0
HIGH: Final = 1
Z: Final = -1
"""A pin that drives nothing (three-state off, or open drain released)."""

Listed = TypeVar("Listed")


def _without(listed: tuple[Listed, ...], one: Listed) -> tuple[Listed, ...]:
    left = list(listed)
    left.remove(one)
    return tuple(left)


class Watcher(Task):
    """Calls back when one of several nets has changed.

    The callback runs once per batch of changes, at the same instant, after their cause has
    returned: several lines moved by one request are seen as one event.
    """

    WIRING: ClassVar[Names] = ("*",)

    def __init__(self, kernel: Kernel, callback: Callable[[], None]) -> None:
        self._kernel: Kernel = kernel
        self._callback: Callable[[], None] = callback
        self._pending: bool = False
        self.deaf: bool = False
        """Whether changes are not for it: a bus moves between two hosts' ways of using it."""
        self.alone: tuple[Watcher, ...] = (self,)
        """What the nets have whose only watcher this is: one tuple for all of them."""

    def notify(self) -> None:
        """Queue the callback, unless it is queued already."""
        if not self._pending and not self.deaf:
            self._pending = True
            self._kernel.soon(self)

    def run(self) -> None:
        """Tell of what has changed."""
        # Before the call: what moves in it is another event.
        self._pending = False
        self._callback()


@mypyc_attr(allow_interpreted_subclasses=True)
class Guard:
    """Computes what happens on several nets, whose levels it sets only when they are needed."""

    WIRING: ClassVar[Names] = ("*",)

    def pin_moved(self) -> None:
        """A pin on one of the nets has moved, or a listener comes: the levels must be set now."""
        raise NotImplementedError

    def come_true(self) -> None:
        """Give the nets the levels they would have: by itself, those they have."""

    def cut_short(self) -> None:
        """Hold edges are about to come before their instant: by itself, there are none."""


class Pin:
    """One part's connection to a net, made by :meth:`Net.solder`.

    Args:
        name: the manual's name, with its slash or tilde (``"/CS"``).
        net: the wire it is soldered to.
        open_drain: the pin can only pull low; driving :data:`HIGH` lets go.
    """

    STATE: ClassVar[Names] = ("level",)
    WIRING: ClassVar[Names] = ("name", "net", "on_heard", "open_drain")

    def __init__(self, name: str, net: "Net", open_drain: bool) -> None:
        self.name: str = name
        self.net: Net = net
        self.level: int = Z
        self.open_drain: bool = open_drain
        self.on_heard: Callable[[], None] | None = None

    @property
    def value(self) -> int:
        """Electrical level of the net as it stands: 0, 1, or 0..255 for D0-D7."""
        return self.net.value

    def drive(self, level: int) -> None:
        """Put ``level`` on the net (0, 1, or 0..255 for a bundle); :data:`Z` lets go."""
        # An open-drain pin has no transistor that pulls up.
        if self.open_drain and level == HIGH:
            level = Z
        if level != self.level:
            net = self.net
            # A part that is no chip begins to drive a wire, or lets go: who listens to it may
            # change.
            if net.width != 8 and self.on_heard is None and (level == Z) != (self.level == Z):
                heard = net.heard
                self.level = level
                # Chips show what they drive by now before it is fought.
                net.tell_drivers()
                net.resolve()
                net.first_heard(heard)
                return
            self.level = level
            net.resolve()

    def release(self) -> None:
        """Stop driving."""
        self.drive(Z)

    def move(self, net: "Net") -> None:
        """Solder the pin to another net: how a board joins wires before it starts."""
        old, self.net = self.net, net
        old.unsolder(self)
        net.pins = (*net.pins, self)
        for watcher in old.watchers:
            if watcher not in net.watchers:
                net.watchers = (*net.watchers, watcher)
        net.resolve()
        net.tell_drivers()


class Net:
    """A wire, or a bundle of wires that always move together (D0-D7).

    Attributes:
        name: as the board file or the manual calls it.
        width: number of wires, 1 or 8.
        rest: what is read while no pin drives: 0 or 1 (a pull), or :data:`Z` to keep the last.
        value: electrical level now.
        previous: level before the last batch of changes.
        changed_at: instant of the last change (ps).
        let_go_at: instant at which the last driver let go (ps); -1 if that never happened.
        clash: called with the net when two push-pull pins disagree.
        bends: faults that make another level of the one that is driven, in order.
        guard: computes the net's level, and sets it only when it is needed; or None.
    """

    STATE: ClassVar[Names] = ("value", "history: tuple[i64]")
    WIRING: ClassVar[Names] = (
        "bends", "clash", "guard", "name", "observers", "pins", "rest", "watchers", "width",
    )  # fmt: skip
    DERIVED: ClassVar[Names] = (
        "_batch",
        "_let_go",
        "changed_at",
        "clashing",
        "let_go_at",
        "previous",
    )

    def __init__(self, kernel: Kernel, name: str, *, rest: int = HIGH, width: int = 1) -> None:
        self.kernel: Kernel = kernel
        self.name: str = name
        self.width: int = width
        self.rest: int = rest
        self.value: int = 0 if rest == Z else rest
        self.previous: int = self.value
        self.changed_at: int = 0
        self.let_go_at: int = -1
        self._batch: int = -1
        self._let_go: int = -1
        # Tuples take less than lists, and most nets of a large board share the empty ones.
        self.pins: tuple[Pin, ...] = ()
        self.watchers: tuple[Watcher, ...] = ()
        self.observers: tuple[Observer, ...] = ()
        self.clash: Callable[[Net], None] | None = None
        self.clashing: bool = False
        self.bends: tuple[Callable[[int], int], ...] = ()
        self.guard: Guard | None = None

    def solder(self, name: str, *, open_drain: bool = False) -> Pin:
        """Join a part's pin to the net."""
        pin = Pin(name, self, open_drain)
        self.pins = (*self.pins, pin)
        return pin

    def unsolder(self, pin: Pin) -> None:
        """Take a pin off the net."""
        self.pins = _without(self.pins, pin)

    @property
    def before(self) -> int:
        """Level before the batch of changes under way.

        What a latch takes whose strobe ends in this batch: data that moves together with the
        trailing edge comes too late.
        """
        return self.previous if self._batch == self.kernel.batch else self.value

    @property
    def heard(self) -> bool:
        """Whether anybody would notice an edge: a joined input, an observer, who fights it."""
        return bool(self.watchers) or bool(self.observers) or self.contested

    @property
    def contested(self) -> bool:
        """Whether a part that is no chip drives a single wire: then a chip's edge is a clash."""
        if self.width != 8:
            for pin in self.pins:
                if pin.level != Z and pin.on_heard is None:
                    return True
        return False

    @property
    def driven(self) -> bool:
        """Whether any pin drives the net now."""
        return any(pin.level != Z for pin in self.pins)

    @property
    def floats(self) -> bool:
        """Whether no pin drives the net, nor did before the batch of changes under way.

        A latch whose strobe ends in this batch takes the last level of the wires.
        """
        return not self.driven and self._let_go != self.kernel.batch

    def watch(self, watcher: Watcher) -> None:
        """Notify ``watcher`` of every change from now on."""
        heard = self.heard
        # Most nets have one watcher: its tuple is shared by them all.
        self.watchers = (*self.watchers, watcher) if self.watchers else watcher.alone
        self.first_heard(heard)

    def observe(self, observer: Observer) -> None:
        """Report every edge to ``observer`` from now on."""
        # Edges that were left out until now must have been, for one who looks.
        if self.guard is not None:
            self.guard.pin_moved()
        heard = self.heard
        self.observers = (*self.observers, observer)
        self.kernel.observed += 1
        self.kernel.observations += 1
        self.first_heard(heard)

    def first_heard(self, before: bool) -> None:
        """First or last listener: start or stop recording edges.

        The outputs of a chip without listeners have moved only when the chip was asked.
        """
        self.tell_drivers()
        if not before and self.width != 8:
            self.previous, self.changed_at, self.let_go_at = self.value, 0, -1

    def unobserve(self, observer: Observer) -> None:
        """Stop reporting to ``observer``."""
        self.observers = _without(self.observers, observer)
        self.kernel.observed -= 1
        self.tell_drivers()

    def bend(self, bend: Callable[[int], int]) -> None:
        """Let a fault make another level of the one that is driven, after those that are there."""
        self.bends = (*self.bends, bend)

    def unbend(self, bend: Callable[[int], int]) -> None:
        """Let a fault bend the net no more."""
        self.bends = _without(self.bends, bend)

    def tell_drivers(self) -> None:
        """Let the driving chips know that a listener has come or gone."""
        for pin in self.pins:
            if pin.on_heard is not None:
                pin.on_heard()

    def resolve(self) -> None:
        """Work out the level from all pins; tell watchers and observers if it changed."""
        if self.guard is not None:
            self.guard.pin_moved()
        level = Z
        fight = False
        for pin in self.pins:
            if pin.level != Z:
                if level == Z:
                    level = pin.level
                elif pin.level != level:
                    # A pin that only pulls low may do so; a push-pull pin of another level is a
                    # short.
                    fight = fight or not pin.open_drain
                    # Of a short the low side wins, as in TTL.
                    level &= pin.level
        if fight and not self.clashing and self.clash is not None:
            self.clashing = True
            self.clash(self)
        self.clashing = fight
        if level == Z:
            self.let_go_at = self.kernel.now
            self._let_go = self.kernel.batch
            level = self.value if self.rest == Z else self.rest
        if self.bends:
            for bend in self.bends:
                level = bend(level)
        if level != self.value:
            # The level before the batch stays: two edges of one batch have one before.
            if self._batch != self.kernel.batch:
                self._batch = self.kernel.batch
                self.previous = self.value
            self.value = level
            self.changed_at = self.kernel.now
            for observer in self.observers:
                observer.edge(self.kernel.now, self.name, level)
            for watcher in self.watchers:
                watcher.notify()

    def put(self, level: int) -> None:
        """Set the level of a wire that has moved without listeners: it has no history."""
        self.value = self.previous = level
        self.changed_at, self.let_go_at, self._batch = 0, -1, -1

    @property
    def history(self) -> tuple[int, ...]:
        """Level before the last change, its instant, and when the last driver let go.

        A wire without listeners has no history: its chips drive it only when they are asked, and
        a question must change nothing. Of D0-D7 the AC limits need every change.
        """
        if not self.heard and self.width != 8:
            return (self.value, 0, -1)
        return (self.previous, self.changed_at, self.let_go_at)

    @history.setter
    def history(self, history: tuple[int, ...]) -> None:
        self.previous, self.changed_at, self.let_go_at = history

    def after_load(self) -> None:
        """Find out whether pins disagree, without a report: their levels have been loaded."""
        if self.guard is not None:
            self.guard.pin_moved()
        level = Z
        fight = False
        for pin in self.pins:
            if pin.level != Z:
                # Snapshots hold levels, and a report of this was filed when it began.
                if level != Z and pin.level != level:
                    fight = fight or not pin.open_drain
                level = pin.level
        self.clashing = fight
