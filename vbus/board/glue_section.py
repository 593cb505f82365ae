"""``[glue.NAME]``: a part of glue and what its pins are wired to."""

from typing import Annotated

from vbus.board.section import NAMES, Section
from vbus.board.section import key as _key


class GlueSection(Section, frozen=True, kw_only=True):
    """``[glue.NAME]``: one part; ``pins`` and ``equations`` say what its pins are wired to."""

    name: str
    part: Annotated[
        str, _key("text", 'part number without package, such as "74HC138"; "PLD": equations')
    ]
    delay: Annotated[
        int, _key("s", "how long its outputs take to follow its inputs", low=0, high=10**15)
    ] = 0
    low: Annotated[tuple[str, ...], _key(NAMES, "its inputs that are tied to ground")] = ()
    high: Annotated[tuple[str, ...], _key(NAMES, "its inputs that are tied to the supply")] = ()
    hosts: Annotated[
        tuple[str, ...], _key(NAMES, 'its pins that hosts drive or see, as side pins "NAME.pin"')
    ] = ()
    pins: dict[str, tuple[str, ...]] = {}
    equations: dict[str, str] = {}
