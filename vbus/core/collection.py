"""Python's search for garbage, held while what stays is made."""

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
