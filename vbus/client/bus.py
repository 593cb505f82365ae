"""A bus over any link, blocking."""

from vbus.client.aio import bus as aio
from vbus.client.blocking import BlockingWaits, blocking, export, fronted, run


class _BlockingBus(aio.Bus):
    _WAITS = BlockingWaits


blocking(aio.Bus, _BlockingBus)
export(aio, globals())


def connect(where: str, timeout: float = aio.TIMEOUT, wait: str | None = None) -> aio.Bus:
    """Open a session with a board and ask what is attached: see :func:`vbus.client.aio.connect`."""
    return fronted(run(_BlockingBus._connect(where, timeout, wait)))


connect.__doc__ = aio.connect.__doc__
