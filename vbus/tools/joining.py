"""Which link of a running board a program joins it by."""

from typing import Any, Final

from vbus.errors import TransportError

_ORDER: Final = ("unix", "tcp", "pty")
"""Kinds of links, best first: sockets take several programs at once, a terminal takes one."""


def link_of(name: str, firmware: bool = False) -> str:
    """Return a link of the running board ``name`` that speaks the byte protocol.

    Links whose host has a card come first (``firmware``: a pin map); among those the order is that
    of :data:`_ORDER`.

    Raises:
        TransportError: no board of that name answers, or it has no such link.
    """
    from vbus.server.registry import running

    boards = list(running())
    found = next((board for board in boards if board["board"] == name), None)
    if found is None:
        names = ", ".join(sorted(str(board["board"]) for board in boards)) or "none"
        raise TransportError(
            f'no board called "{name}" runs on this machine; running are: {names}; "vbus run FILE"'
            " starts one"
        )
    if "error" in found:
        raise TransportError(f"{name}: {found['error']}")
    every = found.get("links", [])  # a router has none
    links = [link for link in every if link["protocol"] == "byte" and _kind(link) in _ORDER]
    if not links:
        there = ", ".join(f"{link['url']} ({link['protocol']})" for link in every)
        raise TransportError(
            f"{name} has no link a program could join by (byte protocol on a Unix socket, TCP or a"
            f" PTY); it has: {there or 'none'}; add a [[hosts]] entry to its board file"
        )
    links.sort(key=lambda link: _ORDER.index(_kind(link)))
    for link in links:
        if _kind(link) != "pty" and _described(str(link["url"]), firmware):
            return str(link["url"])
    return str(links[0]["url"])


def _kind(link: dict[str, Any]) -> str:
    return str(link["url"]).partition(":")[0]


def _described(url: str, firmware: bool) -> bool:
    from vbus.client import connect

    try:
        with connect(url) as bus:
            return bool(bus.info.wiring if firmware else bus.info.card)
    except TransportError:
        return False
