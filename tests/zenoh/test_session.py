"""Sessions keep to themselves unless told otherwise."""

import os
import re
from pathlib import Path

import pytest

from tests.e2e.command import vbus
from tests.ports import free_endpoint
from vbus.core import exit_codes
from vbus.core.errors import TransportError
from vbus.network.session import check_endpoint, close_session, open_session


def sockets(kind: str) -> list[str]:
    """Return the local addresses of this process's sockets, as the system writes them."""
    mine = set()
    for descriptor in Path("/proc/self/fd").iterdir():
        try:
            match = re.fullmatch(r"socket:\[(\d+)\]", os.readlink(descriptor))
        except OSError:
            continue
        if match:
            mine.add(match[1])
    rows = [line.split() for line in Path(f"/proc/self/net/{kind}").read_text().splitlines()[1:]]
    return [row[1] for row in rows if row[9] in mine and (kind[:3] == "udp" or row[3] == "0A")]


@pytest.mark.parametrize(
    "endpoint",
    ["udp/127.0.0.1:7447", "tcp/:7447", "tcp/127.0.0.1", "tcp/127.0.0.1:x", "tcp/127.0.0.1:65536"],
)
def test_what_is_no_endpoint_is_refused(endpoint: str) -> None:
    with pytest.raises(TransportError, match=f'"{endpoint}" is no endpoint; write "tcp/HOST:PORT"'):
        check_endpoint(endpoint)
    check_endpoint("tcp/127.0.0.1:65535")


@pytest.mark.parametrize("mode", ["peer", "router"])
def test_a_session_listens_where_it_was_told_and_looks_for_nobody(mode: str) -> None:
    before = {kind: sockets(kind) for kind in ("tcp", "tcp6", "udp", "udp6")}
    endpoint = free_endpoint()
    session = open_session(listen=[endpoint], mode=mode)
    try:
        port = int(endpoint.rpartition(":")[2])
        after = {kind: sockets(kind) for kind in before}
        assert [found for found in after["tcp"] if found not in before["tcp"]] == [
            f"0100007F:{port:04X}"
        ]
        assert {kind: after[kind] for kind in ("tcp6", "udp", "udp6")} == {
            kind: before[kind] for kind in ("tcp6", "udp", "udp6")
        }
    finally:
        close_session(session)


def test_an_endpoint_somebody_has_is_named() -> None:
    endpoint = free_endpoint()
    session = open_session(listen=[endpoint], mode="router")
    with pytest.raises(
        TransportError, match=f"cannot listen on {endpoint}: address already in use"
    ):
        open_session(listen=[endpoint], mode="router")
    close_session(session)
    with pytest.raises(
        TransportError, match=f"{endpoint} cannot be reached: no process listens there"
    ):
        open_session(connect=[endpoint], mode="client", wait=0.2)


def test_a_client_that_does_not_wait_tries_an_endpoint_once() -> None:
    endpoint = free_endpoint()
    with pytest.raises(TransportError, match=f"{endpoint} cannot be reached"):
        open_session(connect=[endpoint], mode="client", wait=0)
    router = open_session(listen=[endpoint], mode="router")
    client = open_session(connect=[endpoint], mode="client", wait=0)
    assert list(client.info.routers_zid()) == [router.info.zid()]
    close_session(client)
    close_session(router)


def test_other_computers_are_let_in_without_certificates_only_where_that_is_meant() -> None:
    anywhere = f"tcp/0.0.0.0:{free_endpoint().rpartition(':')[2]}"
    with pytest.raises(TransportError, match=f'^"{anywhere}" lets other computers in; write "tcp/'):
        open_session(listen=[anywhere], mode="router")
    close_session(open_session(listen=[anywhere], mode="router", remote=True))


def test_a_router_for_other_computers_is_asked_for() -> None:
    done = vbus("router", "--listen", "tcp/0.0.0.0:0")
    assert done.returncode == exit_codes.NO_LINK
    assert "vbus router: --remote" in done.stderr


@pytest.mark.parametrize("endpoint", ["", "tcp", "tcp/:1", "tcp/a", "udp/a:1", "tcp/a:99999"])
def test_what_is_no_endpoint_is_named(endpoint: str) -> None:
    with pytest.raises(TransportError, match=f'"{endpoint}" is no endpoint'):
        open_session(connect=[endpoint])
