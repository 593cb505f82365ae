"""``[scope]`` of a board file: an address that can be listened on, and is meant."""

from vbus.addresses import loopback_like, stays_here
from vbus.board.metrics_checks import metrics_address
from vbus.board.sections import BoardFile
from vbus.board.source import Source


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
