"""What a machine can promise in real time: its settings, and a measurement."""

import os
import select
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Final

from vbus.core.errors import VbusError
from vbus.serve.time.priority import Priority
from vbus.transports.linux import TimerFd, clock_discipline

OK: Final = "ok"
WARN: Final = "warn"
FAIL: Final = "fail"


@dataclass(frozen=True, slots=True)
class Diagnosis:
    """One thing looked at.

    Attributes:
        state: ``"ok"``, ``"warn"`` (something cannot be used) or ``"fail"`` (nothing will work).
        what: the thing.
        detail: what was found.
        advice: what to do; empty if it is in order.
    """

    state: str
    what: str
    detail: str
    advice: str = ""

    def __str__(self) -> str:
        text = f"{self.state:<5} {self.what}: {self.detail}"
        return f"{text}\n      {self.advice}" if self.advice else text


def found(
    good: object, what: str, detail: str, wrong: str, advice: str, state: str = WARN
) -> Diagnosis:
    """Return what was found of a thing: ``detail`` if it is good, else ``wrong`` and the advice."""
    return Diagnosis(OK, what, detail) if good else Diagnosis(state, what, wrong, advice)


# Long beside the cost of setting a timer, and a thousand measurements a second.
WAIT_NS: Final = 1_000_000
"""What is waited for again and again."""
# Above a twentieth, late wakings say more of other machines than of this one.
MUCH: Final = 0.05
"""Share of the time that other machines on the same processors may take."""
GOVERNORS: Final = "/sys/devices/system/cpu/cpu*/cpufreq/scaling_governor"


def promises() -> Iterator[Diagnosis]:
    """Say what keeps a server from its instants: class, timers, frequency, load."""
    try:
        with _fifo():
            pass
    except VbusError as error:
        yield Diagnosis(WARN, "real-time class", "vbus run --priority is refused", str(error))
    else:
        yield Diagnosis(OK, "real-time class", "vbus run --priority fifo:1 to fifo:99")
    slack = int(Path("/proc/self/timerslack_ns").read_text()) / 1000
    yield Diagnosis(OK, "timer slack", f"{slack:g} us later than asked; none with --priority")
    governors = sorted({place.read_text().strip() for place in Path("/").glob(GOVERNORS[1:])})
    text = ", ".join(governors) or "none: the processors' frequency is not chosen here"
    advice = "processors take time to wake up: cpupower frequency-set -g performance"
    yield found(governors in ([], ["performance"]), "governor", text, text, advice)
    yield _clock()
    yield _load()


def _clock() -> Diagnosis:
    try:
        discipline = clock_discipline()
    except OSError as error:
        return Diagnosis(WARN, "clock", f"the system does not tell: {error.strerror}")
    if discipline is None:
        advice = "nodes on several computers follow each other's clocks better with chrony or ptp4l"
        return Diagnosis(OK, "clock", f"nothing disciplines it; {advice}")
    away, slew = discipline
    return Diagnosis(OK, "clock", f"within {away} us of true time, slewed by {slew:+.1f} ppm")


def _load() -> Diagnosis:
    load, count = os.getloadavg()[0], len(os.sched_getaffinity(0))
    spent = [int(word) for word in Path("/proc/stat").read_text().split("\n")[0].split()[1:9]]
    # The eighth number of the line is "steal" (proc(5)).
    stolen = spent[7] / max(sum(spent), 1)
    text = f"{load:.1f} on {count} processors; {stolen:.1%} of their time went to other machines"
    if stolen > MUCH:
        return Diagnosis(WARN, "load", text, "instants are met as the host of this machine likes")
    if load > count:
        return Diagnosis(WARN, "load", text, "end other work, or take --priority and --cpu")
    return Diagnosis(OK, "load", text)


def latency(seconds: float) -> Iterator[Diagnosis]:
    """Measure how late this process wakes, in the usual class and in that of ``--priority``.

    Args:
        seconds: how long each measurement lasts.
    """
    yield Diagnosis(OK, "latency", _late(seconds))
    try:
        with _fifo():
            late = _late(seconds)
    except VbusError:
        return  # a line above says so
    yield Diagnosis(OK, "latency with --priority fifo", late)


@contextmanager
def _fifo() -> Iterator[None]:
    """In the class of ``--priority``, and back."""
    wanted = Priority.of("fifo", None)
    wanted.take()
    try:
        yield
    finally:
        wanted.give_back()


def _late(seconds: float) -> str:
    timer, poll = TimerFd(), select.epoll()
    late: list[int] = []
    try:
        poll.register(timer.fd, select.EPOLLIN)
        end = time.monotonic_ns() + int(seconds * 1e9)
        while (now := time.monotonic_ns()) < end or not late:
            timer.set(WAIT_NS)
            poll.poll()
            timer.acknowledge()
            # The timer counts from its setting, so what is beyond WAIT_NS was lost in waking.
            late.append(time.monotonic_ns() - now - WAIT_NS)
    finally:
        poll.close()
        timer.close()
    late.sort()
    last = len(late) - 1
    p50, p99, most = (late[place] / 1000 for place in (last // 2, last * 99 // 100, last))
    return f"{len(late)} waits of 1 ms: p50 {p50:.0f} us, p99 {p99:.0f} us, max {most:.0f} us late"
