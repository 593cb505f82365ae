"""Error numbers of the byte protocol's ``'X'`` reply."""

from typing import Final

UNKNOWN_REQUEST: Final = 1
NO_SUCH: Final = 2
"""No such line, pin, chip or address in this session."""
BAD_AT: Final = 3
"""AT before the last AT, the board is not slaved, or time would run past its end."""
BAD_LENGTH: Final = 4
BAD_VERSION: Final = 5
CLOSED: Final = 6
NO_ROOM: Final = 7
"""The board can take no more hosts: it has no descriptor left."""
DEADLOCK: Final = 8
"""SELECT of a chip that is claimed by a session which waits for this one."""
