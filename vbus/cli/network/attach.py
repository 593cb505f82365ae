"""``vbus attach``: a board on another computer as a link on this one."""

import asyncio
from pathlib import Path
from typing import TYPE_CHECKING

import click

from vbus.cli.output import complain, detach_option, seconds_option, show
from vbus.core import exit_codes
from vbus.core.errors import value_errors

if TYPE_CHECKING:
    from vbus.serve.attach.attachment import AttachRequest
    from vbus.serve.attach.far_board import FarBoard


@click.command("attach")
@click.argument("url")
@click.option("--pty", "ptys", multiple=True, metavar="NAME", help="A PTY here; repeatable.")
@click.option(
    "--unix", "sockets", multiple=True, metavar="NAME", help="A Unix socket here; repeatable."
)
@click.option("--protocol", default="byte", metavar="NAME", help="What the links speak; else byte.")
@seconds_option("--patience", text="How long the board may be gone; else for ever.")
@seconds_option("--every", least=0.1, text="Print the round trips at this interval.")
@click.option("--json", "as_json", is_flag=True, help="Print JSON when ready and at the end.")
@detach_option
def command(
    url: str, ptys: tuple[str, ...], sockets: tuple[str, ...], protocol: str,
    patience: float | None, every: float | None, as_json: bool, detach: bool,
) -> int:  # fmt: skip
    """Make a board on another computer appear as a PTY or a Unix socket here, until Ctrl-C.

    URL is a link of the board as clients take it: zenoh:BOARD/CHIP?connect=ENDPOINT,
    tcp:HOST:PORT or unix:PATH. NAME is a name in the runtime directory, or a path; without one
    there is a PTY named after the board. "vbus ls" shows round trips and losses.
    """
    from vbus import plugins
    from vbus.core.values.settings import unknown
    from vbus.serve.attach.attachment import AttachRequest
    from vbus.serve.attach.far_board import FORMS, KINDS

    if protocol not in (known := plugins.names(plugins.PROTOCOLS)):
        raise click.BadParameter(unknown(protocol, known), param_hint="--protocol")
    kind, colon, rest = url.partition(":")
    if kind not in KINDS or not colon or not rest:
        raise click.BadParameter(
            f'"{url}" is no link of a board elsewhere; there are {FORMS}', param_hint="URL"
        )
    links = [*(_link("pty", name) for name in ptys), *(_link("unix", name) for name in sockets)]
    board: FarBoard | None = None
    if kind != "zenoh" or not detach:  # the threads of a network do not outlive a fork
        board = _looked_at(url, protocol)
    if not links:
        # Behind zenoh: stands the board's name.
        # With --detach a board over Zenoh is not asked before the fork, but its name stands in the
        # link.
        named = board.name if board else rest.partition("?")[0].partition("/")[0]
        if not named:
            raise click.UsageError(
                "what its board is called this link does not tell; give the one here a name with"
                " --pty NAME or --unix NAME"
            )
        links = [_link("pty", named)]
    name = Path(links[0]).name.removesuffix(".sock")
    if detach:
        from vbus.cli.run.detach import go_on_in_background

        go_on_in_background(name)
    if board is None:
        board = _looked_at(url, protocol)
    _serve(AttachRequest(url, name, tuple(links), protocol, patience), board, as_json, every)
    return exit_codes.OK


def _link(kind: str, name: str) -> str:
    """Return the address of a link here: a bare name is one in the runtime directory."""
    if not name or name.endswith("/"):
        raise click.BadParameter(f'"{name}" is no name for a link; write NAME or a path')
    return f"{kind}:{name}" if "/" in name else f"{kind}:$VBUS_RUNTIME/{name}"


def _looked_at(where: str, protocol: str) -> "FarBoard":
    """Ask the board what it is.

    Raises:
        TransportError: no board answers.
        click.BadParameter: this is no link.
    """
    from vbus.serve.attach.far_board import look_at

    with value_errors(click.BadParameter, param_hint="URL"):
        return look_at(where, protocol)


def _serve(wanted: "AttachRequest", board: "FarBoard", as_json: bool, every: float | None) -> None:
    """Serve until a signal; say what became of it."""
    from vbus.cli.status_lines import READY, attached_lines, distance, losses, round_trips
    from vbus.serve.attach.attachment import Attachment
    from vbus.serve.loop import run_until_signal, tell_ready

    # After a fork: its sockets belong to the process that stays.
    attachment = Attachment(wanted, board, complain)

    def ready() -> None:
        status = attachment.statistics()
        show(as_json, status, [*attached_lines(status, counts=False), READY])
        tell_ready()

    async def tell(seconds: float) -> None:
        while True:
            await asyncio.sleep(seconds)
            recent = attachment.trips.take_recent().summary("ns")
            status = attachment.statistics()
            show(as_json, status, [f"{round_trips(recent)}; {losses(status['attached'])}"])

    async def serve(stop: asyncio.Event) -> None:
        telling = asyncio.ensure_future(tell(every)) if every else None
        try:
            await attachment.serve(stop, ready)
        finally:
            if telling is not None:
                telling.cancel()

    try:
        run_until_signal(serve)
    finally:
        status = attachment.statistics()
        if attachment.served:
            show(as_json, status, [distance(status)])
