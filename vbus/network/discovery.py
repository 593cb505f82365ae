"""The boards of a network, found by their liveliness tokens."""

import json
from collections.abc import Sequence
from typing import Any, Final

from vbus.network import keys
from vbus.network.security import Security
from vbus.network.session import close_session, open_session

ASK_SECONDS: Final = 1.0
"""How long tokens, and what each board tells of itself, are waited for."""


def boards_on(connect: Sequence[str], security: Security | None = None) -> list[dict[str, Any]]:
    """Return what each board on the network tells, in the order of their names.

    A board whose token is there and which does not answer gets an entry ``"error"``.

    Raises:
        TransportError: none of the endpoints can be reached.
    """
    session = open_session(connect=connect, mode="client", security=security)
    try:
        tokens = session.liveliness().get(keys.OWNERS, timeout=ASK_SECONDS)
        owners = {str(token.ok.key_expr).split("/")[1] for token in tokens if token.ok is not None}
        found = []
        for board in sorted(owners):
            answers = []
            for reply in session.get(keys.status(board), timeout=ASK_SECONDS):
                if reply.ok is not None:
                    answers.append(json.loads(reply.ok.payload.to_bytes()))
            at = ",".join(connect)
            found += answers or [
                {"board": board, "error": f"is on the network of {at}, but does not answer"}
            ]
        return found
    finally:
        close_session(session)
