"""``[metrics]`` of a board file: an address that can be listened on, and is meant."""

import re
from ipaddress import ip_address
from typing import Final

from vbus.addresses import loopback_like, meant, stays_here
from vbus.boardfile.sections import BoardFile
from vbus.boardfile.source import Source
from vbus.values.settings import quoted

EXAMPLE: Final = "127.0.0.1:9100"


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
        raise ValueError(f'found {quoted(text)}; write "HOST:PORT", such as "{EXAMPLE}"')
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


def check_metrics(file: BoardFile, source: Source) -> None:
    """Check ``[metrics]``; mistakes go to ``source``."""
    if file.metrics.listen:
        try:
            metrics_address(file.metrics.listen, file.metrics.remote)
        except ValueError as error:
            source.fail(("metrics", "listen"), str(error))


def check_scope(file: BoardFile, source: Source) -> None:
    """Check ``[scope]``; mistakes go to ``source``."""
    scope = file.scope
    if (scope.certificate == "") != (scope.key == ""):
        source.fail(("scope",), "certificate and key belong together")
    if not scope.listen:
        return
    where = ("scope", "listen")
    try:
        host, port = metrics_address(scope.listen, remote=True)
    except ValueError as error:
        source.fail(where, str(error))
        return
    if not stays_here(host) and not (scope.remote and scope.certificate):
        source.fail(
            where,
            f'"{scope.listen}" lets other computers in; write "{loopback_like(host)}:{port}", or'
            " remote = true with certificate and key in [scope] if that is meant",
        )
