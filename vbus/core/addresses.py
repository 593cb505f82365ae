"""Addresses on a network: which of them other computers reach."""

from ipaddress import ip_address


def stays_here(host: str) -> bool:
    """Tell whether only this computer reaches an address; a name may be anybody's."""
    if host == "localhost":
        return True
    try:
        return ip_address(host.strip("[]")).is_loopback
    # Not looked up: what a name means may change between here and the bind.
    except ValueError:
        return False


def loopback_like(host: str) -> str:
    """Return the loopback address of a kind: IPv6 has brackets."""
    return "[::1]" if ":" in host else "127.0.0.1"


def meant(address: str, instead: str, where: str) -> str:
    """Return why an address is refused that lets other computers in."""
    return (
        f'"{address}" lets other computers in; write "{instead}", or say remote = true {where} if'
        " that is meant"
    )


def refused_link(scheme: str, path: str, remote: bool) -> str:
    """Return why a link may not listen at an address; empty if it may.

    Args:
        scheme: of the link, such as ``tcp``.
        path: ``[HOST:]PORT``; without a host it is this computer.
        remote: whether other computers may be let in.
    """
    host, _, port = path.rpartition(":")
    if not port.isdigit() or int(port) > 65535:
        form = f'"{scheme}:PORT" or "{scheme}:HOST:PORT"'
        return f'"{scheme}:{path}": write {form} with a port of 0 to 65535'
    if remote or not host or stays_here(host):
        return ""
    return meant(f"{scheme}:{path}", f"{scheme}:{port}", "for this host")


def refused_endpoint(endpoint: str, remote: bool) -> str:
    """Return why no process may listen on an endpoint; empty if one may.

    Args:
        endpoint: ``tcp/HOST:PORT``, where hosts show no certificate; or another.
        remote: whether other computers may be let in all the same.
    """
    kind, _, address = endpoint.partition("/")
    host, _, port = address.rpartition(":")
    if remote or kind != "tcp" or stays_here(host):
        return ""
    return meant(
        endpoint, f"tcp/{loopback_like(host)}:{port}", "in [zenoh] (vbus router: --remote)"
    )
