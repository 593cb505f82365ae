"""State declared once: a part names its fields, and is saved and loaded by those names.

A class says what becomes of each of its attributes:

=================  ===============================================================================
``STATE``          what decides all that follows; each field as ``"name"`` or ``"name: kind"``
``WIRING``         what was set when the part was built, and is never saved; only what others set
                   beside its ``__init__``, and what holds things: of the rest the source says so
``DERIVED``        what follows from the other two; ``after_load()`` brings it up to date
``STATE_VERSION``  1 where none is named; above 1 ``migrate(version, state)`` returns the
                   present map of fields for that of an earlier version
=================  ===============================================================================

``before_save()``, where a part has one, is called before its fields are read; ``after_load()``
once every field of the whole tree has its value, inner parts first. A part's own fields are set
before those of the parts inside, numbers and flags first. A field may be a property, and one that
another object has is named with its place: ``"limit = inputs.limit"`` is saved as ``limit``.
``"*"`` in ``WIRING`` or ``DERIVED`` is everything, in a class that has no state.

A field without a kind is an integer of 64 bits. The other kinds:

=========================  =======================================================================
``int``                    an integer of any size
``value``                  a number, a text, true or false
``bool``, ``float``        one of that type
``str``, ``i64 | bool``    one of that type
``bytes[128]``             so many; ``bytes[...]``: any number of them
``list[K]``, ``tuple[K]``  as many of kind K as there are; ``list[K, ...]``: any number of them;
                           ``list[K, name]``: as many as attribute ``name`` has
``set[K]``, ``heap[K]``    any number of them, in order
``(K, L)``                 a row: a tuple of one of each
``bytearray``              as many bytes, which stay in their place; ``bytearray[...]``: any number
``part``, ``part | None``  another part, by its own declaration
``parts``                  a list of parts, or of None
``checkpoint[name]``       what ``checkpoint()`` gave of the part at attribute ``name``, or nothing
``saved[name]``            what ``save()`` has given of it
=========================  =======================================================================

Compiled classes refuse or convert what interpreted ones take, so everything is checked before
anything is set.
"""

from vbus.core.state.fields import (
    UNDECLARED,
    Names,
    Saved,
    checkpoint,
    load,
    rollback,
    save,
    validate,
)

__all__ = [
    "UNDECLARED", "Names", "Saved", "checkpoint", "load", "rollback", "save", "validate",
]  # fmt: skip
