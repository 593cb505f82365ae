"""``vbus router``: where boards and hosts of several processes or computers meet."""

import os
from contextlib import ExitStack
from typing import TYPE_CHECKING, Final

import click

from vbus.cli.output import endpoint_option
from vbus.cli.status_lines import READY
from vbus.core import exit_codes
from vbus.core.addresses import refused_endpoint

if TYPE_CHECKING:
    import asyncio

    from vbus.network.session import Network

DEFAULT: Final = "tcp/127.0.0.1:7447"
NAME: Final = "router"
"""What vbus ls, wait, logs and stop call a router in the background."""


@click.command("router")
@click.argument("file", required=False)
@endpoint_option("--listen", multiple=True, text=f"Else {DEFAULT}; repeatable.")
@endpoint_option("--connect", multiple=True, text="Another router; repeatable.")
@click.option("--remote", is_flag=True, help="Let other computers in without certificates.")
@click.option(
    "--detach", is_flag=True, help="Return when ready; vbus ls, stop and logs call it router."
)
def command(
    file: str | None, listen: tuple[str, ...], connect: tuple[str, ...], remote: bool, detach: bool,
) -> int:  # fmt: skip
    """Run a Zenoh router until Ctrl-C: boards and hosts connect to it and find each other.

    FILE is a TOML file with a section [zenoh] as in board files: endpoints, certificates, rights.
    An option replaces what the file says. Port 0 is any free one.
    """
    from vbus.network.session import Network, free_endpoint

    network = Network()
    if file is not None:
        from vbus.board.config import read_zenoh_file
        from vbus.serve.serving import network_of

        network = network_of(read_zenoh_file(file))
    # Port 7447 is Zenoh's own.
    endpoints = listen or network.listen or (DEFAULT,)
    endpoints = tuple(
        free_endpoint(*endpoint.removesuffix(":0").split("/", 1))
        if endpoint.endswith(":0")
        else endpoint
        for endpoint in endpoints
    )
    if remote and not any(refused_endpoint(endpoint, remote=False) for endpoint in endpoints):
        raise click.UsageError(
            f"--remote: no other computer comes in without a certificate at {' '.join(endpoints)};"
            " write an address of the network, or leave --remote out"
        )
    network = Network(
        endpoints, connect or network.connect, network.security, remote=remote or network.remote
    )
    if detach:
        from vbus.cli.run.detach import go_on_in_background

        go_on_in_background(NAME)
    _serve(network, detach)
    return exit_codes.OK


def _serve(network: "Network", listed: bool) -> None:
    """Serve until a signal.

    Args:
        network: where it listens, and who may use it.
        listed: whether vbus ls shows it, under :data:`NAME`.
    """
    from vbus.network import places
    from vbus.network.access import answer_access
    from vbus.network.session import ROUTER_LEASE_MS, close_session, open_network

    with ExitStack() as stack:
        if listed:
            _own_name(stack)
        # Before the imports of a loop: hosts wait for a router that was started anew.
        session = open_network(network, ROUTER_LEASE_MS)
        stack.callback(close_session, session)
        place = places.register(places.router_place(), network.listen)
        stack.callback(places.unregister, place)
        access = answer_access(session, network.security) if network.security else None
        _tell_until_signal(network, listed)
        # Zenoh stops answering when the object goes: it has to live as long as the router.
        del access


def _own_name(held: ExitStack) -> None:
    """Own the name of a router in the background, for as long as what holds it is open.

    Raises:
        NameInUseError: one runs already.
    """
    from vbus.core.errors import NameInUseError
    from vbus.serve.registry import own_board

    try:
        held.enter_context(own_board(NAME))
    except NameInUseError as error:
        raise NameInUseError(
            f'a "{NAME}" runs already in the background; "vbus stop {NAME}" stops it'
        ) from error


def _tell_until_signal(network: "Network", listed: bool) -> None:
    """Say that it is ready, and answer ``vbus ls`` if it is listed."""
    from asyncio import get_running_loop

    from vbus.serve.local_socket import Control, LocalSocket
    from vbus.serve.loop import run_until_signal, tell_ready
    from vbus.serve.registry import socket_path
    from vbus.transports.base import ignore

    found = {"listen": network.listen, "connect": network.connect}
    control = Control(ignore, "a router takes no orders")
    control.orders["status"] = lambda _: {"board": NAME, "pid": os.getpid(), "router": found}

    async def serve(stop: "asyncio.Event") -> None:
        with ExitStack() as stack:
            if listed:
                local = LocalSocket(control)
                stack.callback(local.close)
                local.open(get_running_loop(), socket_path(NAME))
            click.echo(f"router: {', '.join(network.listen)}")
            for endpoint in network.connect:
                click.echo(f"  connected to {endpoint}")
            click.echo(READY)
            tell_ready()
            await stop.wait()

    run_until_signal(serve)
