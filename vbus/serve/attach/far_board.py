"""What a board tells a client of itself, and which wire format its link speaks."""

from dataclasses import dataclass
from typing import Any, Final

from vbus.client import connect
from vbus.client.blocking import until_ready
from vbus.core.errors import ProtocolError, TransportError
from vbus.core.wall_clock import monotonic
from vbus.protocols.frames import MARK, frame
from vbus.protocols.requests import REQUESTS, VERSION
from vbus.serve.attach.upstream import opened

KINDS: Final = ("zenoh", "tcp", "unix")
"""What links of a remote board begin with."""
FORMS: Final = "zenoh:BOARD/CHIP?connect=ENDPOINT, tcp:HOST:PORT and unix:PATH"

HELLO_SECONDS: Final = 1.0
"""How long a board may take to answer HELLO before other wire formats are tried; not measured."""
ANSWER_SECONDS: Final = 2.0
"""How long it may then take to answer them; not measured."""
_TAGS: Final = {bytes((MARK,)): "framed", b"e": "text"}
"""First bytes of answers; text begins "error"."""


@dataclass(frozen=True, slots=True)
class FarBoard:
    """A board somewhere else.

    Attributes:
        name: its name; empty where its link does not tell.
        policy: who is master of its time; empty where its link does not tell.
        protocol: what its link speaks.
        chips: name, part and family of the chips its link reaches.
    """

    name: str
    policy: str
    protocol: str
    chips: tuple[dict[str, Any], ...]

    def check(self, found: "FarBoard", where: str) -> None:
        """Compare a board that answers now with this one.

        Raises:
            TransportError: it is another one.
        """
        if found.name != self.name:
            raise TransportError(f"{where} leads to the board {found.name} now, not to {self.name}")


def look_at(where: str, protocol: str) -> FarBoard:
    """Ask the board behind a link what it is.

    Args:
        where: the link.
        protocol: what is to be spoken here.

    Raises:
        TransportError: no board answers, or its wire format cannot carry the other; says why
            and what to do.
        ValueError: this is no link.
    """
    spoken = "byte" if where.startswith("zenoh:") else _spoken(where)
    if spoken not in ("byte", protocol):
        raise TransportError(
            f"{where} speaks the {spoken} protocol, of which {protocol} cannot be made here; attach"
            f' with --protocol {spoken}, or to a link of that board with protocol = "byte"'
        )
    if spoken != "byte":
        return FarBoard("", "", spoken, ())
    try:
        with connect(where) as bus:
            info = bus.info
    except ProtocolError as error:
        raise TransportError(f"{where}: {error}") from error
    chips = tuple(
        {"name": chip.name, "part": chip.part, "family": chip.family} for chip in info.chips
    )
    return FarBoard(info.board, info.policy, spoken, chips)


def _spoken(where: str) -> str:
    """Return which wire format a link speaks, by what it answers.

    A session of its own is asked: HELLO first, which the byte protocol answers; if that gives
    nothing, an empty frame and the end of a line, which the others answer.
    """
    link = opened(where)
    try:
        for asked, seconds in ((REQUESTS["HELLO"].pack(VERSION), HELLO_SECONDS),
                               (frame(0, b"") + b"\n", ANSWER_SECONDS)):  # fmt: skip
            link.write(memoryview(asked))
            if until_ready(link.fd, False, monotonic() + seconds):
                return _TAGS.get(link.read()[:1], "byte")
    finally:
        link.close()
    return "byte"  # a client says best what is wrong with it
