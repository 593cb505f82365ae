"""Where a board is on the network: addresses, certificates and rights that fit each other."""

import re
from ipaddress import ip_address
from typing import Final

from vbus.boardfile.sections import BoardFile, ZenohSection
from vbus.boardfile.source import Mistakes
from vbus.core.addresses import loopback_like, meant, refused_endpoint, refused_link, stays_here
from vbus.core.values.settings import quoted

NETWORK_SCHEME: Final = "zenoh"
EXAMPLE: Final = "127.0.0.1:9100"
_SOCKETS: Final = ("tcp", "rfc2217")
"""Schemes of links that listen at an address of the network."""
_ENDPOINT: Final = re.compile(r"(tcp|tls)/(\[[0-9a-fA-F:.]+\]|[^/:#?]+):(\d{1,5})")
_RIGHT: Final = re.compile(r"(?:serve )?(\*\*|\*|[^/*$?#]+)(/(\*\*|\*|[^/*$?#]+))*")


def metrics_address(text: str, remote: bool) -> tuple[str, int]:
    """Return host and port of an address such as ``127.0.0.1:9100``; port 0 is any free one.

    Args:
        text: the address; IPv6 in brackets.
        remote: whether other computers may be let in.

    Raises:
        ValueError: it is none, or other computers would be let in; says what to write.
    """
    match = re.fullmatch(r"(\[[0-9a-fA-F:.]+\]|[^\[\]:/]+):(\d{1,5})", text)
    if match is None or int(match[2]) > 65535:
        form = f'HOST:PORT with a port of 0 to 65535, such as "{EXAMPLE}"'
        raise ValueError(f"found {quoted(text)}; write {form}")
    host = match[1].strip("[]")
    try:
        address = ip_address("127.0.0.1" if host == "localhost" else host)
    except ValueError:
        raise ValueError(
            f'{quoted(text)}: "{host}" is no address; write numbers, such as "{EXAMPLE}"'
        ) from None
    if not address.is_loopback and not remote:
        raise ValueError(meant(text, f"{loopback_like(host)}:{match[2]}", "in [metrics]"))
    return str(address), int(match[2])


def check_network(file: BoardFile) -> Mistakes:
    """Check ``[metrics]``, ``[scope]``, ``[zenoh]`` and the hosts on the network."""
    scope, metrics = file.scope, file.metrics
    for kind, listen, remote in (
        ("metrics", metrics.listen, metrics.remote), ("scope", scope.listen, True),
    ):  # fmt: skip
        try:
            host, port = metrics_address(listen or EXAMPLE, remote)
        except ValueError as error:
            yield (kind, "listen"), str(error)
            continue
        if kind == "scope" and not stays_here(host) and not (scope.remote and scope.certificate):
            yield (
                (kind, "listen"),
                f'"{listen}" lets other computers in; write "{loopback_like(host)}:{port}", or'
                " remote = true with certificate and key in [scope] if that is meant",
            )
    if scope.remote and not scope.certificate:
        yield (
            ("scope", "remote"),
            "pages go to other computers by TLS alone; give certificate and key",
        )
    yield from check_zenoh(file.zenoh)
    yield from _hosts(file)


def check_zenoh(zenoh: ZenohSection) -> Mistakes:
    """Check ``[zenoh]`` by itself."""
    for key, endpoints in (("listen", zenoh.listen), ("connect", zenoh.connect)):
        for place, endpoint in enumerate(endpoints):
            match = _ENDPOINT.fullmatch(endpoint)
            wrong = refused_endpoint(endpoint, zenoh.remote) if key == "listen" else ""
            if match is None or not 0 < int(match[3]) < 65536:
                wrong = (
                    f'found {quoted(endpoint)}; write "tcp/HOST:PORT" or "tls/HOST:PORT", such as'
                    ' "tcp/127.0.0.1:7447"'
                )
            elif match[1] == "tls" and not zenoh.certificate:
                wrong = (
                    f"{quoted(endpoint)} needs certificates: give certificate, key and authority"
                )
            elif match[1] == "tcp" and zenoh.certificate and key == "listen":
                wrong = (
                    f"{quoted(endpoint)} lets hosts in that show no certificate; write"
                    f' "tls/{endpoint[4:]}", or leave certificate, key and authority out'
                )
            if wrong:
                yield ("zenoh", key, place), wrong
    whole = zenoh.certificate and zenoh.key and zenoh.authority
    if zenoh.allow is not None and not whole:
        yield (
            ("zenoh", "allow"),
            "rights belong to names in certificates; give certificate, key and authority",
        )
    for name, keys in (zenoh.allow or {}).items():
        for place, key in enumerate(keys):
            if not _RIGHT.fullmatch(key):
                yield (
                    ("zenoh", "allow", name, place),
                    f"found {quoted(key)}; write a key below vbus/, such as"
                    ' "BOARD/CHIP/bus", "BOARD/**" or "**"',
                )


def _hosts(file: BoardFile) -> Mistakes:
    nodes = {chip.name: chip.node for chip in file.chips}
    earlier: dict[str, int] = {}
    for place, host in enumerate(file.hosts):
        scheme, _, rest = host.transport.partition(":")
        path = ("hosts", place, "transport")
        # An address with a variable is looked at when it is opened.
        if scheme in _SOCKETS and "$" not in rest:
            if refused := refused_link(scheme, rest.partition("?")[0], host.remote):
                yield path, refused
        if scheme != NETWORK_SCHEME:
            continue
        node = nodes.get(host.chips[0], "") if host.chips else ""
        if rest:
            yield (
                path,
                f'found {quoted(host.transport)}; write "zenoh:" and nothing behind it: where on'
                " the network the board is stands in [zenoh]",
            )
        elif node in earlier:
            yield (
                path,
                f"hosts[{earlier[node] + 1}] is on the network already; one entry serves any number"
                " of hosts, and chips = [...] says what they reach",
            )
        earlier.setdefault(node, place)
