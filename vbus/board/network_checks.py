"""``[zenoh]`` of a board file: endpoints, certificates and rights that fit each other."""

import re
from typing import Final

from vbus.addresses import refused_endpoint, refused_link
from vbus.boardfile.sections import BoardFile, ZenohSection
from vbus.boardfile.source import Source
from vbus.values.settings import quoted

NETWORK_SCHEME: Final = "zenoh"
_SOCKETS: Final = ("tcp", "rfc2217")
"""Schemes of links that listen at an address of the network."""
_ENDPOINT: Final = re.compile(r"(tcp|tls)/(\[[0-9a-fA-F:.]+\]|[^/:#?]+):(\d{1,5})")
_RIGHT: Final = re.compile(r"(?:serve )?(\*\*|\*|[^/*$?#]+)(/(\*\*|\*|[^/*$?#]+))*")


def check_network(file: BoardFile, source: Source) -> None:
    """Check ``[zenoh]`` and the hosts on the network; mistakes go to ``source``."""
    check_zenoh(file.zenoh, source)
    _check_hosts(file, source)


def check_zenoh(zenoh: ZenohSection, source: Source) -> None:
    """Check ``[zenoh]`` by itself; mistakes go to ``source``."""
    _check_endpoints(zenoh, source)
    _check_certificates(zenoh, source)
    _check_rights(zenoh, source)


def _check_endpoints(zenoh: ZenohSection, source: Source) -> None:
    for key, endpoints in (("listen", zenoh.listen), ("connect", zenoh.connect)):
        for place, endpoint in enumerate(endpoints):
            match = _ENDPOINT.fullmatch(endpoint)
            if match is None or not 0 < int(match[3]) < 65536:
                source.fail(
                    ("zenoh", key, place),
                    f'found {quoted(endpoint)}; write "tcp/HOST:PORT" or "tls/HOST:PORT", such as'
                    ' "tcp/127.0.0.1:7447"',
                )
            elif match[1] == "tls" and not zenoh.certificate:
                source.fail(
                    ("zenoh", key, place),
                    f"{quoted(endpoint)} needs certificates: give certificate, key and authority",
                )
            elif match[1] == "tcp" and zenoh.certificate and key == "listen":
                source.fail(
                    ("zenoh", key, place),
                    f"{quoted(endpoint)} lets hosts in that show no certificate; write"
                    f' "tls/{endpoint[4:]}", or leave certificate, key and authority out',
                )
            elif key == "listen" and (refused := refused_endpoint(endpoint, zenoh.remote)):
                source.fail(("zenoh", key, place), refused)


def _check_certificates(zenoh: ZenohSection, source: Source) -> None:
    files = {"certificate": zenoh.certificate, "key": zenoh.key, "authority": zenoh.authority}
    missing = [name for name, path in files.items() if not path]
    if missing and len(missing) < len(files):
        source.fail(
            ("zenoh",),
            f"certificate, key and authority belong together; missing: {', '.join(missing)}",
        )
    if zenoh.allow is not None and missing:
        source.fail(
            ("zenoh", "allow"),
            "rights belong to names in certificates; give certificate, key and authority",
        )


def _check_rights(zenoh: ZenohSection, source: Source) -> None:
    for name, keys in (zenoh.allow or {}).items():
        for place, key in enumerate(keys):
            if not _RIGHT.fullmatch(key):
                source.fail(
                    ("zenoh", "allow", name, place),
                    f"found {quoted(key)}; write a key below vbus/, such as"
                    ' "BOARD/CHIP/bus", "BOARD/**" or "**"',
                )


def _check_hosts(file: BoardFile, source: Source) -> None:
    nodes = {chip.name: chip.node for chip in file.chips}
    earlier: dict[str, int] = {}
    for place, host in enumerate(file.hosts):
        scheme, _, rest = host.transport.partition(":")
        path = ("hosts", place, "transport")
        # An address with a variable is looked at when it is opened.
        if scheme in _SOCKETS and "$" not in rest:
            if refused := refused_link(scheme, rest, host.remote):
                source.fail(path, refused)
        if scheme != NETWORK_SCHEME:
            continue
        node = nodes.get(host.chips[0], "") if host.chips else ""
        if rest:
            source.fail(
                path,
                f'found {quoted(host.transport)}; write "zenoh:" and nothing behind it: where on'
                " the network the board is stands in [zenoh]",
            )
        elif node in earlier:
            source.fail(
                path,
                f"hosts[{earlier[node] + 1}] is on the network already; one entry serves any number"
                " of hosts, and chips = [...] says what they reach",
            )
        earlier.setdefault(node, place)
