"""What is asked of Python's interpreter: to search no garbage, to hear signals; never compiled."""

import gc
from collections.abc import Iterator
from contextlib import contextmanager


@contextmanager
def collection_held() -> Iterator[None]:
    """Pause the garbage collector during imports and while a board is built: their objects stay."""
    collects = gc.isenabled()
    gc.disable()
    try:
        yield
    finally:
        if collects:
            gc.enable()


def keep_what_is_made() -> None:
    """Search from now on, and never among what there is already."""
    # What lasts as long as the board is never garbage: no search goes through it again.
    gc.freeze()
    gc.enable()


def check_interrupts() -> None:
    """Let Ctrl-C interrupt a long computation.

    Python runs the handlers of signals when it begins an interpreted function; a compiled one never
    asks for them.

    Raises:
        KeyboardInterrupt: Ctrl-C was pressed.
    """
