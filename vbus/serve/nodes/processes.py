"""Which nodes of a machine share a process, and where its processes meet."""

import contextlib
import socket
from dataclasses import dataclass
from typing import Final

from vbus.boardfile.sections import BoardFile
from vbus.core.addresses import stays_here
from vbus.core.errors import ConfigError, TransportError
from vbus.network.places import endpoints_at, router_place
from vbus.network.session import check_endpoint, free_endpoint

LOOK_SECONDS: Final = 1.0
"""How long it may take to see whether a process listens at an endpoint (s); not measured."""


@dataclass(frozen=True, slots=True)
class Process:
    """Some nodes of a machine that run in one process.

    Attributes:
        name: the text that the nodes have as ``process``; without one the node's own name.
        nodes: their names, in the order of the board file.
    """

    name: str
    nodes: tuple[str, ...]


@dataclass(frozen=True, slots=True)
class Meeting:
    """Where the processes of a machine meet.

    Attributes:
        router: endpoint of the router to be started for them; empty if none is.
        connect: endpoints given to them in place of the board file's; none if it says enough.
        said: the same for people; empty if they need not meet.
    """

    router: str = ""
    connect: tuple[str, ...] = ()
    said: str = ""


def processes_of(file: BoardFile) -> tuple[Process, ...]:
    """Return the processes of a checked board file, each where its first node stands.

    Raises:
        ConfigError: the board has no nodes.
    """
    if not file.nodes:
        raise ConfigError(
            f'{file.path}: there is no [nodes.NAME]; "vbus run" runs a board without nodes'
        )
    nodes: dict[str, list[str]] = {}
    for node in file.nodes:
        nodes.setdefault(node.process or node.name, []).append(node.name)
    return tuple(Process(name, tuple(names)) for name, names in nodes.items())


def endpoint_parts(endpoint: str) -> tuple[str, str, int]:
    """Return protocol, host and port of an endpoint that has been checked."""
    protocol, _, address = endpoint.partition("/")
    host, _, port = address.rpartition(":")
    return protocol, host, int(port)


def meeting_of(
    file: BoardFile, router: str = "", held: contextlib.ExitStack | None = None
) -> Meeting:
    """Return where the processes of a machine on this computer meet.

    Args:
        file: the board file.
        router: endpoint at which a router is wanted, whatever the board file says; port 0 is any
            free one.
        held: keeps a free port for the router, until it is closed.

    Raises:
        TransportError: no process listens where the board file says, and none here may.
    """
    if router:
        check_endpoint(router)
        protocol, host, port = endpoint_parts(router)
        endpoint = router if port else free_endpoint(protocol, host, held=held)
        return Meeting(endpoint, (endpoint,), endpoint)
    for node in file.nodes:
        if node.listen:
            return Meeting(said=f"{node.listen}, where node {node.name} listens")
    if file.zenoh.connect:
        return _named(file.zenoh.connect)
    if len(processes_of(file)) < 2:
        return Meeting()
    there = endpoints_at(router_place())
    if there:
        return Meeting("", there, f"{', '.join(there)}, a router that runs already")
    endpoint = free_endpoint(held=held)
    return Meeting(endpoint, (endpoint,), endpoint)


def _named(connect: tuple[str, ...]) -> Meeting:
    """Return how processes meet at routers that the board file names."""
    for endpoint in connect:
        check_endpoint(endpoint.replace("tls/", "tcp/", 1))
        if _listens(endpoint):
            return Meeting(said=f"{endpoint}, a router that runs already")
    for endpoint in connect:
        protocol, host, _ = endpoint_parts(endpoint)
        if protocol == "tcp" and stays_here(host):
            return Meeting(endpoint, (), endpoint)
    raise TransportError(
        f"no process listens at {', '.join(connect)}, and no router for it is started from here: it"
        " is not of this computer alone, or has certificates; start it (vbus router), or have one"
        " here instead: --router tcp/127.0.0.1:0"
    )


def _listens(endpoint: str) -> bool:
    """Whether a process listens at an endpoint."""
    _, host, port = endpoint_parts(endpoint)
    with contextlib.suppress(OSError):
        socket.create_connection((host.strip("[]"), port), LOOK_SECONDS).close()
        return True
    return False
