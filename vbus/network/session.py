"""Zenoh sessions with safe defaults (nothing dialled by itself), and the boards found there."""

from __future__ import annotations

import contextlib
import json
import os
import socket
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Any, Final

from msgspec import Struct

from vbus.core.addresses import refused_endpoint
from vbus.core.errors import TransportError
from vbus.network import keys
from vbus.network.security import Security

if TYPE_CHECKING:
    import zenoh

LEASE_MS: Final = 1000
"""A computer that has gone silent is given up after this long; a dead process at once. It
trades the time until a loss is seen for stalls of a machine that are no loss. Not measured."""
ROUTER_LEASE_MS: Final = 3250
"""The same of a router: while others give it up, they give each other up. As long as a node may be
silent, unless its board file says how long, and what nodes add to that."""
RETRY_MS: Final = 1000
"""How long after a link was lost, and how often, it is tried again; not measured."""
OPEN_SECONDS: Final = 3.0
"""How long opening a session waits for an endpoint, where it waits at all: a router that is
started beside it needs less. Not measured."""
LARGEST_MESSAGE: Final = 128 << 20
"""Bytes of a message beyond which it is dropped unseen (Zenoh's own limit: 1 GiB)."""
MODES: Final = ("client", "peer", "router")
_PROTOCOLS: Final = ("tcp", "tls")


class Network(Struct, frozen=True):
    """Where a board or a router is on the network: ``[zenoh]`` of a board file.

    Attributes:
        listen: endpoints hosts, boards and routers may connect to.
        connect: endpoints of routers to connect to.
        security: certificates and rights, if any.
        grace_seconds: how long the session of a host that has vanished waits for its return.
        remote: other computers may be let in without certificates.
    """

    listen: tuple[str, ...] = ()
    connect: tuple[str, ...] = ()
    security: Security | None = None
    grace_seconds: float = 2.0
    remote: bool = False


def open_network(network: Network, lease_ms: int = LEASE_MS) -> zenoh.Session:
    """Open the session of a board or a router: it routes if it listens, else it is a client.

    Args:
        network: where it listens and connects.
        lease_ms: see :func:`open_session`.

    Raises:
        TransportError: see :func:`open_session`.
    """
    mode = "router" if network.listen else "client"
    return open_session(
        network.listen, network.connect, mode, network.security, OPEN_SECONDS, network.remote,
        lease_ms,
    )  # fmt: skip


FORKED: Final = (
    "this process was forked from one that has used Zenoh, whose threads a fork does not copy: a"
    ' link would wait for ever; start it anew (multiprocessing: the start method "spawn"), or fork'
    " before the first link over Zenoh is opened"
)
_opened: Final[list[int]] = []
"""The process that has opened a session."""


def open_session(
    listen: Sequence[str] = (),
    connect: Sequence[str] = (),
    mode: str = "peer",
    security: Security | None = None,
    wait: float | None = None,
    remote: bool = False,
    lease_ms: int = LEASE_MS,
) -> zenoh.Session:
    """Open a Zenoh session that talks to the given endpoints and to no others.

    There is no multicast scouting and no gossip: what is not named is not found. A topology that
    works is a star: one session with ``mode="router"`` that listens, and all others connected to it
    as ``"client"``. Two peers never find each other through a router, and two routers need some
    tenths of a second until each knows what the other has.

    Args:
        listen: endpoints to listen on, such as ``"tcp/127.0.0.1:7447"``; nowhere if empty.
        connect: endpoints to connect to, such as ``"tls/bench.example:7447"``.
        mode: ``"client"``, ``"peer"`` or ``"router"``.
        security: certificates and rights; needed by endpoints that begin with ``tls/``.
        wait: seconds to wait for an endpoint of ``connect``; without one the session is not
            opened. 0: open at once, connect when an endpoint is there, and again whenever it was
            lost; a client tries once, and has no session if none of them answers. None: 3 s for a
            client, else 0.
        remote: other computers may be let in without certificates.
        lease_ms: how long this session may be silent before others give it up.

    Raises:
        TransportError: an endpoint is none, cannot be listened on, or cannot be reached; says
            which, why, and what to do.
    """
    import zenoh

    if wait is None:
        wait = OPEN_SECONDS if mode == "client" else 0.0
    settings = _settings(listen, connect, mode, security, wait, lease_ms)
    for endpoint in listen:
        if refused := refused_endpoint(endpoint, remote):
            raise TransportError(refused)
    if _opened and _opened[0] != os.getpid():
        raise TransportError(FORKED)
    _opened[:] = [os.getpid()]
    config = zenoh.Config()
    for key, value in settings.items():
        config.insert_json5(key, json.dumps(value))
    try:
        return zenoh.open(config)
    except zenoh.ZError as error:
        raise TransportError(_why(error, listen, connect, security)) from error


def _settings(
    listen: Sequence[str],
    connect: Sequence[str],
    mode: str,
    security: Security | None,
    wait: float,
    lease_ms: int,
) -> dict[str, Any]:
    """Return Zenoh's settings by path."""
    if mode not in MODES:
        raise ValueError(f"mode {mode!r}; allowed are {', '.join(MODES)}")
    for endpoint in (*listen, *connect):
        check_endpoint(endpoint, security)
    waits = bool(connect) and (wait > 0 or mode == "client")
    settings: dict[str, Any] = {
        "mode": mode,
        "listen/endpoints": list(listen),
        "listen/exit_on_failure": True,
        "connect/endpoints": list(connect),
        "connect/exit_on_failure": waits,
        "connect/timeout_ms": int(wait * 1000) if waits else -1,
        "connect/retry": {
            "period_init_ms": RETRY_MS,
            "period_max_ms": RETRY_MS,
            "period_increase_factor": 1,
        },
        "scouting/multicast/enabled": False,
        "scouting/gossip/enabled": False,
        "scouting/delay": 0,
        "transport/link/tx/lease": lease_ms,
        "transport/link/rx/max_message_size": LARGEST_MESSAGE,
        "transport/link/protocols": list(_PROTOCOLS),
        "transport/unicast/open_timeout": 3000,
        "transport/unicast/accept_timeout": 3000,
        "transport/shared_memory/enabled": False,
        "adminspace/enabled": False,
    }
    if mode == "router":  # a peer that takes nothing for a lease would hold all others up
        settings["transport/link/tx/queue/congestion_control/block/wait_before_close"] = (
            lease_ms * 1000
        )
    if security is not None:
        settings.update(security.settings(listens=bool(listen)))
    return settings


def close_session(session: zenoh.Session) -> None:
    """Close a session; again is harmless. One that is cut off ends without a word to others."""
    import zenoh

    close: Callable[[], None] = session.close
    with contextlib.suppress(zenoh.ZError):
        close()


def check_endpoint(endpoint: str, security: Security | None = None) -> None:
    """Refuse what is no endpoint.

    Raises:
        TransportError: it is none, or it needs certificates and there are none.
    """
    protocol, _, address = endpoint.partition("/")
    host, _, port = address.rpartition(":")
    if protocol not in _PROTOCOLS or not host or not port.isdecimal() or int(port) > 65535:
        raise TransportError(
            f'"{endpoint}" is no endpoint; write "tcp/HOST:PORT" or "tls/HOST:PORT", such as'
            ' "tcp/127.0.0.1:7447"'
        )
    if protocol == "tls" and security is None:
        raise TransportError(
            f'"{endpoint}" needs certificates: give certificate, key and authority'
        )


def _why(
    error: Exception,
    listen: Sequence[str],
    connect: Sequence[str],
    security: Security | None,
) -> str:
    """Say why a session could not be opened."""
    text = str(error)
    if "listener" in text or "in use" in text:
        return (
            f"cannot listen on {', '.join(listen)}: {_reason(text)}; stop the process that has"
            " it, or choose another port"
        )
    for endpoint in connect:
        if security is not None and endpoint.startswith("tls/"):
            found = security.diagnose(endpoint)
            if found:
                return f"{endpoint} cannot be reached: {found}"
    if connect:
        return (
            f"{', '.join(connect)} cannot be reached: no process listens there; is the router or"
            " the board running (vbus ls), and is the endpoint right?"
        )
    return f"no Zenoh session: {_reason(text)}"


def _reason(text: str) -> str:
    """Cut what is of use to a person out of Zenoh's message."""
    for known in ("Address already in use", "Permission denied", "Cannot assign requested address"):
        if known in text:
            return known.lower()
    return text.partition(" at /")[0]


def free_endpoint(
    protocol: str = "tcp", host: str = "127.0.0.1", *, held: contextlib.ExitStack | None = None
) -> str:
    """Return an endpoint on a port that is free now.

    Args:
        protocol: its protocol.
        host: an address of this computer.
        held: until it is closed nobody is given the port who asks for any, and a router that has
            yet to start may listen there; without it the first process to listen has it.
    """
    with contextlib.ExitStack() as over:
        probe = (held or over).enter_context(socket.socket(socket.AF_INET, socket.SOCK_STREAM))
        # As Zenoh's own: of two such the system lets one listen where the other is only bound.
        probe.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        probe.bind((host, 0))
        return f"{protocol}/{host}:{probe.getsockname()[1]}"


ASK_SECONDS: Final = 1.0
"""How long tokens, and what each board tells of itself, are waited for; not measured."""


def boards_on(connect: Sequence[str], security: Security | None = None) -> list[dict[str, Any]]:
    """Return what each board on the network tells, in the order of their names.

    A board whose token is there and which does not answer gets an entry ``"error"``.

    Raises:
        TransportError: none of the endpoints can be reached.
    """
    # One that looks does not wait for a router that may come.
    session = open_session(connect=connect, mode="client", security=security, wait=0)
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
