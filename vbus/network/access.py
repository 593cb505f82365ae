"""Answers hosts that lack a right: Zenoh itself drops what is forbidden without a word."""

from __future__ import annotations

import logging
from typing import Final

import zenoh

from vbus.network import keys
from vbus.network.security import Security, expand

ASK_SECONDS: Final = 10.0
"""How long a board that has no turn may take to say why it refuses; then a general message says it.
Where nobody is to say it, the network ends the question at once. Not measured."""

log = logging.getLogger("vbus")


def ask_access(session: zenoh.Session, key: str) -> str:
    """Return why the session's own certificate does not do for ``key``.

    Empty if it does, or if the router there does not say: one that is not of vbus.
    """
    asked = f"{session.info.zid()} {key}"
    for reply in session.get(keys.ACCESS, timeout=ASK_SECONDS, payload=asked):
        if reply.ok is not None:
            return reply.ok.payload.to_string()
    return ""


def refusal(security: Security, name: str, key: str) -> str:
    """Return why the holder of a certificate may not use ``key``; empty if it may.

    Args:
        security: the rights.
        name: common name of the certificate; empty if it showed none.
        key: the whole key.
    """
    if security.allow is None:
        return ""
    if not name:
        return f"a host without a certificate may use nothing here, and so not {key}"
    rights = security.allow.get(name)
    if rights is None:
        return (
            f'the holder of the certificate "{name}" may use nothing here, and so not {key}; see'
            " [zenoh.allow] of the process that listens there"
        )
    asked = zenoh.KeyExpr(key)
    if any(zenoh.KeyExpr(f"{keys.ROOT}/{right}").includes(asked) for right in expand(rights)):
        return ""
    shown = ", ".join(rights) or "nothing"
    return (
        f'the holder of the certificate "{name}" may use {shown} here, but not {key}; see'
        " [zenoh.allow] of the process that listens there"
    )


def answer_access(session: zenoh.Session, security: Security) -> zenoh.Queryable[None]:
    """Answer hosts that ask why their requests get no answer.

    A host sends its session's id and a key; its certificate is that of the link it came by.
    """

    def answer(query: zenoh.Query) -> None:
        try:
            asked = query.payload.to_bytes()[:1024].decode() if query.payload is not None else ""
            zid, _, key = asked.partition(" ")
            for link in session.info.links():
                if str(link.zid) == zid:
                    name = link.auth_identifier or ""
                    query.reply(keys.ACCESS, refusal(security, name, key))
                    return
        except Exception:
            log.exception("internal error while telling a host what it may use")

    return session.declare_queryable(keys.ACCESS, answer, complete=True)
