"""``vbus router``: where boards and hosts of several processes or computers meet."""

import os
import signal
from contextlib import ExitStack

import click

from vbus.tools.ready_lines import READY

DEFAULT = "tcp/127.0.0.1:7447"


@click.command("router")
@click.argument("file", required=False)
@click.option("--listen", multiple=True, metavar="ENDPOINT", help=f"Else {DEFAULT}; repeatable.")
@click.option("--connect", multiple=True, metavar="ENDPOINT", help="Another router; repeatable.")
@click.option("--remote", is_flag=True, help="Let other computers in without certificates.")
def command(
    file: str | None, listen: tuple[str, ...], connect: tuple[str, ...], remote: bool
) -> None:
    """Run a Zenoh router until Ctrl-C: boards and hosts connect to it and find each other.

    FILE is a TOML file with a section [zenoh] as in board files: endpoints, certificates, rights.
    The options stand above it. A port of 0 takes a free one.
    """
    from vbus.network import places
    from vbus.network.access import answer_access
    from vbus.network.session import Network, close_session, free_endpoint, open_network
    from vbus.server.readiness import tell_ready

    network = Network()
    if file is not None:
        from vbus.board.config import read_zenoh_file
        from vbus.server.serving import network_of

        network = network_of(read_zenoh_file(file))
    endpoints = listen or network.listen or (DEFAULT,)
    endpoints = tuple(
        free_endpoint(*endpoint.removesuffix(":0").split("/", 1))
        if endpoint.endswith(":0")
        else endpoint
        for endpoint in endpoints
    )
    network = Network(
        endpoints,
        connect or network.connect,
        network.security,
        remote=remote or network.remote,
    )
    with ExitStack() as stack:
        session = open_network(network)
        stack.callback(close_session, session)
        # C's handler writes to the pipe: Python's would not run for a signal that comes just before
        # the read below, and an Event's lock may be held by wait() when a handler sets it.
        ended, end = os.pipe()
        os.set_blocking(end, False)
        signal.set_wakeup_fd(end)
        for number in (signal.SIGINT, signal.SIGTERM):
            signal.signal(number, lambda *_: None)
        place = places.register(places.router_place(), endpoints)
        stack.callback(places.unregister, place)
        access = answer_access(session, network.security) if network.security else None
        click.echo(f"router: {', '.join(endpoints)}")
        for endpoint in network.connect:
            click.echo(f"  connected to {endpoint}")
        click.echo(READY)
        tell_ready()
        os.read(ended, 1)
        del access
