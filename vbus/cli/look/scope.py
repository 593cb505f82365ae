"""``vbus scope``: a board seen in a browser, live or as a recording."""

import asyncio
import json
import os
import sys
from collections.abc import Awaitable, Callable, Sequence
from contextlib import AsyncExitStack, closing, suppress
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

import click

from vbus.cli.look.scope_page import SCOPE_ADDRESS, PagePlace, said_as, start_scope
from vbus.cli.output import no_progress, refuse_given, seconds_option, time_option
from vbus.cli.sources import boards_of, opened, replay_code
from vbus.core import exit_codes
from vbus.core.addresses import stays_here
from vbus.core.errors import VbusError, value_errors

if TYPE_CHECKING:
    from vbus.cli.look.foxglove_lanes import FoxgloveServer
    from vbus.cli.look.scope_feeds import Feeds
    from vbus.cli.look.scope_server import ScopeServer
    from vbus.cli.look.sigrok_server import SigrokServer
    from vbus.views.scope.recording import Recorded

    Server = ScopeServer | FoxgloveServer
    Take = Callable[[bytes], None]

# A page that is loaded anew is gone for less.
LOOK_SECONDS: Final = 0.5
"""How often a scope that outlives its board looks whether a page is open."""
_PLACE: Final = ("listen", "remote", "certificate", "key")
"""Parameters that say where a page is served."""


@click.command("scope")
@click.argument("sources", metavar="SOURCE...", nargs=-1, required=True)
@click.option("-o", "--output", type=click.Path(path_type=Path),
              help="Write one HTML file; or an MCAP file, if its name ends in .mcap.")  # fmt: skip
@click.option(
    "--control", is_flag=True, help="Let pages pause and step the board, break it, use its bus."
)
@time_option("--at", text="With --control, of a journal: it goes on as a board from here.")
@click.option("--strobes", is_flag=True, help="Of a journal: the lines of the host buses too.")
@click.option(
    "--listen",
    default=SCOPE_ADDRESS,
    metavar="HOST:PORT",
    help="Where the page is served; port 0: a free one.",
)
@click.option("--remote", is_flag=True, help="Let other computers in; needs a certificate.")
@click.option("--certificate", type=click.Path(path_type=Path), help="Certificate for TLS (PEM).")
@click.option("--key", type=click.Path(path_type=Path), help="Key of the certificate (PEM).")
@click.option(
    "--foxglove", is_flag=False, flag_value="127.0.0.1:8765", metavar="[HOST:PORT]",
    help="Serve a running board for Foxglove, not the page.",
)  # fmt: skip
@click.option(
    "--sigrok", is_flag=False, flag_value="127.0.0.1:5555", metavar="[HOST:PORT]",
    help="Serve the pins of a running board for PulseView and sigrok-cli, not the page.",
)  # fmt: skip
@click.option("--chip", default="", metavar="NAME", help="With --sigrok: the chip.")
@click.option("--pin", "pins", multiple=True, metavar="NAME",
              help="With --sigrok: this pin; else the host bus, and others.")  # fmt: skip
@click.option(
    "--sparse", is_flag=True,
    help="While no page is open, take down few samples of a board in real time: four a second.",
)  # fmt: skip
@seconds_option("--stay", text="End so long after the board if no page is open.")
@no_progress
def command(
    sources: tuple[str, ...], output: Path | None, control: bool, at: int | None, strobes: bool,
    listen: str, remote: bool, certificate: Path | None, key: Path | None, foxglove: str | None,
    sigrok: str | None, chip: str, pins: tuple[str, ...], sparse: bool, stay: float | None,
    no_progress: bool,
) -> int:  # fmt: skip
    """See motion, bus and time of a board in a browser.

    SOURCE is a journal, which is played again for it, or the name of a running board. Several, such
    as the journals of all nodes of a machine, are shown on one time axis; the name of a machine
    shows all of its nodes that run on this computer. Prints a link that can be used once; with -o
    it writes a page that any browser can open, or an MCAP file. Ends with Ctrl-C. With --control a
    journal goes on where it ends, or at --at, as a board of its own, paused at first.
    """
    source = sources[0]
    journals = [Path(name) for name in sources if Path(name).is_file()]
    journal = bool(journals)
    others = [name for name in sources if not Path(name).is_file()]
    # One time axis: a run that is over has none in common with a board that goes on.
    if journal and others:
        raise click.UsageError(
            f"{journals[0]} is a journal and {others[0]} is none; show runs that are over, or"
            " boards that run"
        )
    if len(sources) > 1 and (sigrok is not None or (journal and control)):
        option = "--sigrok" if sigrok is not None else "--control"
        raise click.UsageError(f"{option} is for one board, and these are {len(sources)}")
    if output is not None:
        if output.suffix not in ("", ".html", ".htm", ".mcap"):
            raise click.UsageError(f"-o {output}: a page ends in .html, Foxglove's file in .mcap")
        if not journal:
            raise click.UsageError(
                f"-o is for journals, and {source} is none: {_no_file(Path(source))}"
            )
        served = ("control", "at", "foxglove", "sigrok", "chip", "pins", "sparse", "stay")
        refuse_given((*served, *_PLACE), "is of what is served, and -o writes a file")
        return _show_journals(journals, None, output, strobes, no_progress)
    if sigrok is None:
        refuse_given(("chip", "pins"), "goes with --sigrok")
    if journal:
        refuse_given(("sparse", "stay"), f"is for boards that run, and {source} is a journal")
    else:
        refuse_given(("strobes",), f"is for journals, and {source} is none")
    if foxglove is not None or sigrok is not None:
        if foxglove is not None:
            refuse_given(("sigrok",), "and --foxglove are two servers; start one for each")
        else:
            refuse_given(("certificate", "key"), "is for TLS, which --sigrok has none of")
        of_page = ("listen", "control", "at", "sparse", "stay")
        refuse_given(of_page, "is of the page; --foxglove and --sigrok serve none")
    address = foxglove or sigrok or listen
    if remote and stays_here(address.rpartition(":")[0]):
        option = "--foxglove" if foxglove else "--sigrok" if sigrok else "--listen"
        raise click.UsageError(
            f"--remote: no other computer reaches {address}; write an address of the network, such"
            f" as {option} 0.0.0.0:0, or leave --remote out"
        )
    if foxglove is not None:
        if journal:
            raise click.UsageError(f"--foxglove is for boards that run; of {source} write a file"
                                   " with -o FILE.mcap")  # fmt: skip
        place = PagePlace(foxglove, remote, certificate, key, "--foxglove")

        def lanes(feeds: "Feeds", at_end: AsyncExitStack) -> "tuple[FoxgloveServer, Take]":
            server = place.foxglove_server(feeds.description)
            return server, server.add

        _serve_boards(sources, lanes, stay=0)
        return exit_codes.OK
    if sigrok is not None:
        if journal:
            raise click.UsageError(f"--sigrok is for boards that run; of {source} write a file"
                                   ' with "vbus wave --profile sigrok"')  # fmt: skip
        from vbus.cli.look.sigrok_server import SigrokServer
        from vbus.serve.loop import run_until_signal

        place = PagePlace(sigrok, remote, option="--sigrok", plain=True)
        probe = SigrokServer(source, chip, pins, place.host, place.port, said_as("sigrok"))
        run_until_signal(lambda stop: _served(probe, stop.wait))
        return exit_codes.OK
    place = PagePlace(listen, remote, certificate, key)
    if journal and control:
        from vbus.cli.look.scope_fork import fork

        if remote:
            raise click.UsageError("a copy of a board is for this computer: leave out --remote")
        from vbus.boardfile.sections import ScopeSection

        show = partial(start_scope, scope=ScopeSection(listen=listen), control=True)
        fork(Path(source), at, show, no_progress)
        return exit_codes.OK
    if at is not None:
        raise click.UsageError("--at is for a journal that goes on as a board, with --control")
    if journal:
        return _show_journals(journals, place, None, strobes, no_progress)
    if stay is not None:
        _own_output()
    page = partial(_page_of_boards, place, stay, control, sparse)
    _serve_boards(sources, page, stay, control, samples=not sparse)
    return exit_codes.OK


def _own_output() -> None:
    """Keep the output to this process: others that it starts would hold it as long as it stays."""
    sys.stdout, sys.stderr = (os.fdopen(os.dup(fd), "w", buffering=1) for fd in (1, 2))
    with open(os.devnull, "w") as nothing:
        for fd in (1, 2):
            os.dup2(nothing.fileno(), fd)


def _no_file(path: Path) -> str:
    return (
        "it is a directory; name a journal in it"
        if path.is_dir() else 'there is no such file; "vbus run BOARD --journal FILE" writes one'
    )  # fmt: skip


def recorded_of(path: Path, strobes: bool, quiet: bool) -> "Recorded":
    """Play a journal again for its lanes; say so if it is damaged or differs."""
    from vbus.nodes.machine import board_of
    from vbus.views.scope.recording import replayed

    with opened(path, "replaying", quiet) as reader:
        board = board_of(reader.header, str(path))
        recorded = replayed(board, reader, reader.header.families, strobes)
        replay_code(path, recorded.outcome, reader.damage)
    return recorded


def together(parts: "Sequence[Recorded]") -> tuple[dict[str, Any], list[bytes]]:
    """Return the description of one run, or of several on one time axis, for a page."""
    if len(parts) == 1:
        return parts[0].description, parts[0].frames
    from vbus.views.scope.merged import Merged

    with value_errors(VbusError):
        merged = Merged([part.description for part in parts])
    frames: list[bytes] = []
    for number, part in enumerate(parts):
        frames += [merged.take(number, frame) for frame in part.frames]
    # In the order of their ends, so that time goes on in those that ran longer.
    frames += [merged.end(number) for number in merged.by_end()]
    return merged.description, [frame for frame in frames if frame]


def recorded_code(recorded: "Recorded") -> int:
    """Return the exit code of what was played again: whether it ran as it was recorded."""
    return exit_codes.OK if recorded.outcome.divergence is None else exit_codes.FAILURE


def _show_journals(
    paths: Sequence[Path], place: PagePlace | None, output: Path | None, strobes: bool, quiet: bool
) -> int:
    """Serve runs that are over at a place, or write them into a file; return the exit code."""
    from vbus.cli.look.scope_bookmarks import of_journal

    recorded = [recorded_of(path, strobes, quiet) for path in paths]
    description, frames = together(recorded)
    bookmarks = of_journal(paths[0])
    if output is not None:
        from vbus.serve.output_file import write_file

        if output.suffix == ".mcap":
            from vbus.cli.look.foxglove_lanes import mcap_file as made
        else:
            from vbus.views.scope.page_file import one_file as made
        write_file(output, made(description | {"bookmarks": bookmarks.all}, frames))
    elif place is not None:
        from vbus.serve.loop import run_until_signal
        from vbus.views.scope.stream import Stream

        # Nothing is forgotten of a run that is over: a page may ask for its beginning.
        stream = Stream(description, most=None)
        for part in frames:
            stream.add(part)
        run_until_signal(lambda stop: _served(place.server(stream, bookmarks), stop.wait))
    return max(map(recorded_code, recorded))


def _page_of_boards(
    place: PagePlace, stay: float | None, control: bool, sparse: bool, feeds: "Feeds",
    at_end: AsyncExitStack,
) -> "tuple[ScopeServer, Take]":  # fmt: skip
    """Return what serves the page of running boards."""
    from vbus.cli.look.scope_bookmarks import journal_of, keep_with_journal, of_board
    from vbus.cli.look.scope_control import BoardOrders
    from vbus.cli.look.scope_fork import Forks
    from vbus.views.clauses import clause_frame
    from vbus.views.scope.stream import Stream

    hellos = feeds.hellos

    def begun(description: dict[str, Any]) -> Stream:
        stream = Stream(description)
        # Clauses first: labels of packets name them.
        stream.add(clause_frame(chip["family"] for one in hellos for chip in one["chips"]))
        return stream

    orders = None
    if control:
        forks = Forks(f"{place.host}:0")
        at_end.push_async_callback(forks.end)
        orders = BoardOrders(feeds, forks.open)
    bookmarks = of_board(hellos[0]["board"])
    for hello in hellos:
        at_end.callback(keep_with_journal, bookmarks, journal_of(hello), hello)
    order = orders.order if orders else None
    server = place.server(begun(feeds.description), bookmarks, stay, order)
    server.on_registers = feeds.look_inside
    if sparse:
        server.on_pages = feeds.look_at_samples

    def take(message: bytes) -> None:
        if message[:1] != b"{":
            server.add(message)
            return
        answer = json.loads(message)
        if "control" in answer:
            server.tell(answer["control"])
        elif "scope" in answer:  # the board has gone back
            server.begin_again(begun(answer["scope"]))
        elif orders is not None:
            orders.answered(answer)

    return server, take


def _serve_boards(
    names: Sequence[str],
    made: "Callable[[Feeds, AsyncExitStack], tuple[Server, Take]]",
    stay: float | None,
    control: bool = False,
    samples: bool = True,
) -> None:
    """Serve running boards by what is made of what they tell."""
    from vbus.cli.look.scope_feeds import Feeds
    from vbus.serve.loop import run_until_signal

    with closing(Feeds(boards_of(names), control, samples)) as feeds:

        async def show(stop: asyncio.Event) -> None:
            async with AsyncExitStack() as at_end:
                server, take = made(feeds, at_end)

                async def over() -> None:
                    ended = asyncio.Event()
                    feeds.follow(asyncio.get_running_loop(), take, ended.set)
                    await _over(server, stop, ended, stay)

                await _served(server, over)

        run_until_signal(show)


async def _served(server: "Server | SigrokServer", over: "Callable[[], Awaitable[Any]]") -> None:
    """Serve until ``over`` returns."""
    await server.start()
    try:
        await over()
    finally:
        await server.stop()


async def _over(
    server: "Server", stop: asyncio.Event, ended: asyncio.Event, stay: float | None
) -> None:
    """Return when the page is needed no longer."""
    from vbus.serve.loop import done_before, first_of

    await first_of((stop, ended))
    if stay:
        # Who reads what the run has printed reads it to its end now.
        for stream in (sys.stdout, sys.stderr):
            with suppress(OSError):  # a link that nobody read any more is still in it
                stream.close()
        sys.stdout = sys.stderr = open(os.devnull, "w")  # noqa: SIM115
    alone = 0.0
    while stay is None or alone <= stay:
        if not await done_before([stop], asyncio.sleep(LOOK_SECONDS)):
            break
        # A page that is loaded anew is gone for a moment, so the time begins again with it.
        alone = 0.0 if server.pages else alone + LOOK_SECONDS
