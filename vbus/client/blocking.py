"""Blocking counterparts of the client's asyncio classes: the same calls, done when they return.

A session that blocks never leaves a coroutine half-way, so one step carries it out. What a caller
gets is a class of the same name that stands before the asyncio object. A call that a derived class
puts in place of one of these is made by the other calls, too.
"""

import threading
import time
from collections.abc import Callable, Coroutine
from types import FunctionType, ModuleType
from typing import TYPE_CHECKING, Any, ClassVar, Final, TypeVar
from weakref import ref

from vbus.client.aio.waits import Core, Waits, ready_within
from vbus.core.wall_clock import monotonic

T = TypeVar("T")


class BlockingWaits(Waits):
    """Waiting that blocks the thread: whatever is awaited has happened when ``await`` is reached.

    Within ``async with`` no other thread has the session.
    """

    def __init__(self) -> None:
        self._taken = threading.Lock()

    async def __aenter__(self) -> None:
        self._taken.acquire()

    async def __aexit__(self, *why: object) -> None:
        self._taken.release()

    async def until_ready(self, fd: int, write: bool, deadline: float) -> bool:
        """Wait until ``fd`` can be read (or written, if asked); False if time ran out first."""
        return ready_within(fd, write, max(0.0, deadline - monotonic()))

    async def pause(self, seconds: float) -> None:
        """Wait for a while."""
        time.sleep(seconds)

    async def opened(self, open_link: Callable[[str], T], where: str) -> T:
        """Open a link."""
        return open_link(where)


_SPECIAL: Final = {"__init__": "__init__", "__aenter__": "__enter__", "__aexit__": "__exit__"}
"""The special methods that have a counterpart, and the name of that."""
_COPIED: Final = ("__doc__", "__module__", "__name__", "__qualname__")
_COROUTINE: Final = 0x80
"""Flag of the code of ``async def``: ``inspect``, which has it too, takes 10 ms to import."""


def run(steps: Coroutine[Any, Any, T]) -> T:
    """Carry out a coroutine of a session that blocks."""
    try:
        steps.send(None)
    except StopIteration as done:
        value: T = done.value
        return value
    steps.close()
    raise RuntimeError("a blocking session waited for an event loop")


def until_ready(fd: int, write: bool, deadline: float) -> bool:
    """Wait until ``fd`` can be read (or written, if asked); False if time ran out first."""
    return run(BlockingWaits().until_ready(fd, write, deadline))


class Blocking:
    """Stands before an asyncio object, of :attr:`_CORE`; has its attributes."""

    _CORE: ClassVar[type[Core]] = Core
    _core: Core

    def __init_subclass__(cls) -> None:
        """Let the asyncio object come to the calls and constants that a derived class changes.

        Raises:
            TypeError: it changes what the asyncio class uses inside; nothing would come to it.
        """
        if "_CORE" in vars(cls):
            return
        made = next(base for base in cls.__mro__ if "_CORE" in vars(base))
        changed: dict[str, Any] = {}
        for name in dir(cls._CORE):
            mine = _found(cls, name)
            # What is inherited, or Python's own, changes nothing inside.
            if name.startswith("__") or mine is _found(made, name):
                continue
            # Names with an underscore are not passed on: silence would leave the change without
            # effect.
            if name.startswith("_"):
                raise TypeError(
                    f"{cls.__qualname__}.{name}: {made.__name__} uses a function of this name"
                    " inside, and would not come to this one; take another name, or derive from"
                    f" {_found(made, '_CORE').__module__}.{made.__name__}, for asyncio, and pass"
                    " that to vbus.client.blocking.blocking()"
                )
            changed[name] = _forwarding(name, mine, _found(cls._CORE, name))
        if changed:
            cls._CORE = type(cls.__name__, (cls._CORE,), changed)
            _MADE[cls._CORE] = cls

    if not TYPE_CHECKING:  # which knows attributes by the stubs

        def __getattr__(self, name: str) -> Any:
            # Asked before it is set, as by copy(), it would ask itself without end.
            if name == "_core":
                raise AttributeError(name)
            return fronted(getattr(self._core, name))

        def __setattr__(self, name: str, value: object) -> None:
            setattr(self._core, name, core_of(value))


_MADE: Final[dict[type, type[Blocking]]] = {Core: Blocking}


def blocking(cls: type[Core], core: type[Core] | None = None) -> Any:
    """Return the blocking counterpart of an asyncio class.

    Args:
        cls: the class.
        core: a subclass of it that blocks, where ``cls`` itself is what waits.
    """
    # One counterpart for a class, wherever it is asked for: isinstance() must hold.
    made = _MADE.get(cls)
    if made is None:
        body: dict[str, Any] = {name: _without_aio(getattr(cls, name)) for name in _COPIED[:2]}
        body["_CORE"] = core or cls
        for name, value in vars(cls).items():
            if isinstance(value, property):
                body[name] = property(_call(value.fget), doc=value.__doc__)
            elif isinstance(value, FunctionType):
                if name in _SPECIAL or not name.startswith("_"):
                    body[_SPECIAL.get(name, name)] = _call(value)
            elif name.isupper() and not name.startswith("_"):
                body[name] = value  # a constant; attributes that change are those of the instance
        made = type(cls.__name__, tuple(map(blocking, cls.__bases__)), body)
        _MADE[cls] = _MADE[made._CORE] = made
    return made


def export(module: ModuleType, names: dict[str, Any]) -> None:
    """Give a module, by its ``globals()``, what is blocking of another one, and its constants."""
    here, constants = names["__name__"], module.__annotations__
    for name, value in vars(module).items():
        if isinstance(value, type) and issubclass(value, Core):
            for cls in value.__mro__[:-1]:
                made = blocking(cls)
                # Documented where users import it from.
                if made.__module__ in (cls.__module__, here):  # a chip's folder is no module here
                    made.__module__ = here
                    names[cls.__name__] = made
        elif name in constants and not name.startswith("_"):
            names[name] = value


def core_of(value: Any) -> Any:
    """Return the asyncio object that ``value`` stands before; else the value."""
    return value._core if isinstance(value, Blocking) else value


def fronted(value: Any) -> Any:
    """Return what stands before an asyncio object of the client; any other value as it is."""
    if not isinstance(value, Core):
        return value
    # A weak reference: an object that is in use keeps its identity, one that is not is let go.
    front = value.front and value.front()
    if front is None:
        cls = blocking(type(value))
        front = cls.__new__(cls)
        _stand(front, value)
    return front


def _stand(front: Blocking, core: Core) -> None:
    front.__dict__["_core"] = core
    core.front = ref(front)


def _found(cls: type, name: str) -> Any:
    """Return an attribute as its class has it, such as a property itself; None if there is none."""
    return next((vars(base)[name] for base in cls.__mro__ if name in vars(base)), None)


def _forwarding(name: str, mine: Any, known: Any) -> Any:
    """Return what an asyncio class has in the place of something that its front changes.

    Args:
        name: its name.
        mine: what the front has.
        known: what the asyncio class had.
    """
    if isinstance(mine, property):
        return property(lambda core: core_of(getattr(core.front(), name)))
    if not callable(mine):
        return mine

    def call(core: Core, /, *args: Any, **kwargs: Any) -> Any:
        assert core.front is not None
        return core_of(getattr(core.front(), name)(*args, **kwargs))

    async def steps(core: Core, /, *args: Any, **kwargs: Any) -> Any:
        return call(core, *args, **kwargs)

    waits = isinstance(known, FunctionType) and known.__code__.co_flags & _COROUTINE
    return steps if waits else call


def _call(function: Any) -> Any:
    """Return the blocking function that stands for a method."""
    call: Any
    if function.__name__ == "__init__":

        def call(self: Blocking, /, *args: Any, **kwargs: Any) -> None:
            given = {name: core_of(value) for name, value in kwargs.items()}
            core = self._CORE.__new__(self._CORE)
            _stand(self, core)
            self._CORE.__init__(core, *map(core_of, args), **given)

    elif function.__code__.co_flags & _COROUTINE:

        def call(self: Blocking, /, *args: Any, **kwargs: Any) -> Any:
            return fronted(run(function(self._core, *args, **kwargs)))

    else:

        def call(self: Blocking, /, *args: Any, **kwargs: Any) -> Any:
            return fronted(function(self._core, *args, **kwargs))

    for name in _COPIED:
        setattr(call, name, _without_aio(getattr(function, name)))
    call.__wrapped__ = function
    return call


def _without_aio(text: str | None) -> str | None:
    return text and text.replace("vbus.client.aio.", "vbus.client.")
