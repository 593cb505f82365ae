"""Waiting in asyncio tests: for an edge, for a packet on the bus, for an instant."""

import asyncio
from collections.abc import Callable
from functools import partial
from time import sleep
from typing import Any, Final

from vbus.chips.packets import Packet, calls
from vbus.circuit.stream import PacketTaker
from vbus.core.errors import VbusError, value_errors
from vbus.core.kernel import MS
from vbus.core.signals import EdgeTaker
from vbus.events.names import Names, unknown_packet
from vbus.events.watch import Watch, not_met, passing
from vbus.protocols.quantities import format_instant
from vbus.testing.clock import WITHIN, ps_of
from vbus.testing.tested_board import TestedBoard

STRIDE: Final = 10 * MS
"""Chip time that passes at most before other tasks have their turn; not measured."""
TURNS: Final = 8
"""Turns of the event loop in which what has come reaches whom it concerns, by way of others."""
LOOK: Final = 0.02
"""Seconds between looks at a board that others move; not measured. Patience is counted in looks, so
that time in which the machine itself stood still is not held against a host."""


class Triggers:
    """What a coroutine can wait for on its board, as cocotb's users know it.

    A trigger is armed by the call; only what comes later counts. On a lockstep board time passes
    while one is waited for, and stops at the very instant at which it comes; with ``by_hosts`` it
    is left to the hosts of other tasks or programs, as it always is with :meth:`packet`, and on
    boards whose time is the wall clock's or the host's own.

    Args:
        tested: the board.
    """

    def __init__(self, tested: TestedBoard) -> None:
        self._tested: Final = tested
        self._board: Final = tested.board
        self._waiting: Final[dict[asyncio.Future[Any], bool]] = {}
        """What is waited for, and whether time is to pass for it."""
        self._pump: asyncio.Task[None] | None = None
        self._come_now: bool = False
        """Whether something has come of which the tasks have not heard yet."""

    def at(self, instant: int | str, by_hosts: bool = False) -> asyncio.Future[int]:
        """Wait for an instant of chip time; gives it (ps).

        Raises:
            VbusError: it is over.
        """
        when = ps_of(instant)

        def arm(future: asyncio.Future[int]) -> Callable[[], None]:
            if when < self._board.now:
                now = format_instant(self._board.now)
                raise VbusError(f"at {format_instant(when)}: it is {now} already")
            timer = self._board.kernel.onlooker(lambda: self._come(future, when))
            timer.at(when)
            return timer.cancel

        return self._armed(arm, not by_hosts)

    def edge(
        self, pin: str, level: int | None = None, within: int | str = WITHIN, by_hosts: bool = False
    ) -> asyncio.Future[int]:
        """Wait for an edge at a pin, ``"x.HI"``; gives its instant (ps).

        Args:
            pin: chip and pin.
            level: the level it must go to; None: any.
            within: chip time after which it counts as not coming.
            by_hosts: leave time to the hosts.

        Raises:
            VbusError: there is no such pin, or (when awaited) no such edge has come.
        """
        to = "" if level is None else f" to {level}"
        what = f"an edge of {pin}{to}"

        def arm(future: asyncio.Future[int]) -> Callable[[], None]:
            with value_errors(VbusError):
                net = self._board.find_pin(pin).net

            def take(when: int, _: str, now: int) -> None:
                if level in (None, now):
                    self._come(future, when)

            watch = EdgeTaker(take)
            observe, unobserve = partial(net.observe, watch), partial(net.unobserve, watch)
            return self._bound(future, what, within, observe, unobserve)

        return self._armed(arm, not by_hosts)

    def packet(
        self, name: str, chip: str = "", within: int | str = WITHIN
    ) -> asyncio.Future[Packet]:
        """Wait for a packet on the bus, by its name in the manual (``"STT"``); gives it.

        Args:
            name: mnemonic of a command, or name of a register.
            chip: of which chip; "" is any.
            within: chip time after which it counts as not coming.

        Raises:
            VbusError: there is no such chip or packet, or (when awaited) none has come.
        """
        board = self._board
        self._check_packet(name, chip)

        def arm(future: asyncio.Future[Packet]) -> Callable[[], None]:
            def take(of: str, packet: Packet) -> None:
                if chip in ("", of) and name in calls(packet.name):
                    self._come(future, packet)

            watch = PacketTaker(take)
            observe, unobserve = partial(board.observe, watch), partial(board.unobserve, watch)
            return self._bound(future, f"a packet {name}", within, observe, unobserve)

        return self._armed(arm, False)

    def until(
        self, condition: str, within: int | str = WITHIN, by_hosts: bool = False
    ) -> asyncio.Future[int]:
        """Wait until a condition holds, ``"x.real > 400"``; gives that instant (ps).

        Args:
            condition: the condition; if it holds already, that is now.
            within: chip time after which it counts as not coming.
            by_hosts: leave time to the hosts.

        Raises:
            VbusError: it makes no sense on this board, or (when awaited) has not come to hold.
        """

        def arm(future: asyncio.Future[int]) -> Callable[[], None]:
            board = self._board
            watch = Watch(condition, board, met=lambda: self._come(future, board.now))
            return self._bound(future, watch, within, watch.begin, watch.end)

        return self._armed(arm, not by_hosts)

    def _check_packet(self, name: str, chip: str) -> None:
        """Refuse the name of a packet that no command or register has, where all are known."""
        if chip:
            with value_errors(VbusError):
                self._board.chip(chip)
        known = Names(self._board).packets(chip)
        if known and (unknown := unknown_packet(name, known)):
            raise VbusError(f"no packet {unknown}")

    # -- inside the board, at the instant itself ------------------------------------------------

    def _come(self, future: asyncio.Future[Any], result: Any) -> None:
        self._resolve(future, partial(future.set_result, result))

    def _fail(self, future: asyncio.Future[Any], sentence: str) -> None:
        self._resolve(future, partial(future.set_exception, VbusError(sentence)))

    def _resolve(self, future: asyncio.Future[Any], give: Callable[[], None]) -> None:
        self._come_now = True

        def resolve() -> None:
            if not future.done():
                give()

        future.get_loop().call_soon_threadsafe(resolve)

    def _bound(
        self,
        future: asyncio.Future[Any],
        what: str | Watch,
        within: int | str,
        begin: Callable[[], None],
        end: Callable[[], None],
    ) -> Callable[[], None]:
        """Begin to look for something, and fail after some chip time; return what ends both."""
        begun, length = self._board.now, ps_of(within)
        since = f"has not come within {within} of chip time, since {format_instant(begun)}"

        def late() -> None:
            text = f"{what} {since}" if isinstance(what, str) else not_met(what, begun, length)
            self._fail(future, text)

        timer = self._board.kernel.onlooker(late)
        timer.at(begun + length)
        begin()

        def disarm() -> None:
            end()
            timer.cancel()

        return disarm

    # -- in the loop of the test ----------------------------------------------------------------

    def _armed(
        self, arm: Callable[[asyncio.Future[Any]], Callable[[], None]], moves: bool
    ) -> asyncio.Future[Any]:
        loop = asyncio.get_running_loop()
        future: asyncio.Future[Any] = loop.create_future()
        disarm = self._tested.call(lambda: arm(future))

        def done(_: asyncio.Future[Any]) -> None:
            del self._waiting[future]
            self._tested.call(disarm)

        self._waiting[future] = moves and self._board.policy == "lockstep"
        future.add_done_callback(done)
        if self._pump is None or self._pump.done():
            self._pump = loop.create_task(self._run(), name="vbus time")
        return future

    async def _run(self) -> None:
        """Let time pass while a task waits for it; notice when nothing happens at all."""
        watch, board = self._tested.watch, self._board
        patience = self._tested.budget.polling
        seen, idle = (-1, -1), 0.0
        while self._waiting:
            if any(self._waiting.values()):
                self._tested.call(self._step)
                for _ in range(TURNS if self._come_now else 1):
                    await asyncio.sleep(0)
                self._come_now = False
                continue
            await asyncio.to_thread(sleep, LOOK)  # the loop's own clock may be stopped
            now = (board.now, watch.cycles)
            idle, seen = idle + LOOK if now == seen else 0.0, now
            if idle > patience:
                virtual = board.policy != "realtime"
                slow = "the machine was too slow, or no host acts: " if virtual else ""
                for future in tuple(self._waiting):
                    self._fail(
                        future,
                        f"{slow}nothing has happened on the board for {patience:g} s of wall time:"
                        f" it is {format_instant(board.now)}, after {watch.cycles} bus cycles",
                    )
                idle = 0.0

    def _step(self) -> None:
        """Let time pass to where something may happen next."""
        board, kernel = self._board, self._board.kernel

        def next_look() -> int:
            return min(kernel.next_stop, board.now + STRIDE)

        with self._tested.watch.excused():
            next(passing(lambda: self._come_now, next_look, board.run_until), None)
