"""``vbus run``: a board at the disposal of its hosts until Ctrl-C."""

from collections.abc import Awaitable, Callable, Sequence
from typing import TYPE_CHECKING, Any

import click

from vbus.cli.look.scope_page import PageRequest, refuse_detached, scope_options
from vbus.cli.output import (
    complain,
    endpoint_option,
    refuse_given,
    seconds_option,
    serving_options,
    show,
)
from vbus.cli.status_lines import READY, ready_lines, skew_line
from vbus.core import exit_codes
from vbus.core.errors import value_errors
from vbus.core.interpreter import collection_held

if TYPE_CHECKING:
    from vbus.boardfile.sections import BoardFile
    from vbus.boardfile.source import Source
    from vbus.nodes.node import Node
    from vbus.serve.nodes.nodes import NodeOptions
    from vbus.serve.server import Server
    from vbus.serve.time.priority import Priority


@click.command("run")
@click.argument("board")
@serving_options
@click.option(
    "--durable", type=click.Choice(["process", "machine"]), help="What the journal must survive."
)
@scope_options
@click.option(
    "--priority", metavar="CLASS",
    help="fifo, or fifo:1 to fifo:99: ahead of all usual processes, in locked memory.",
)  # fmt: skip
@click.option("--cpu", type=click.IntRange(0), metavar="N", help="Run on this processor alone.")
@click.option("--node", "nodes", multiple=True, metavar="NAME", help="Only this node; repeatable.")
@click.option("--scenario", metavar="FILE", help="Nodes: what hosts do at given instants.")
@click.option("--trace", metavar="FILE", help="Nodes: write what happened, for vbus trace.")
@click.option("--snapshot", metavar="FILE", help="Nodes: write this node's state, to rejoin.")
@seconds_option(
    "--patience", default=0,
    text="Nodes: how long a lost node may take to rejoin; else it is an error at once.",
)  # fmt: skip
@endpoint_option("--listen", multiple=True, text="Nodes: let the others connect.")
@endpoint_option("--connect", multiple=True, text="Nodes: meet the others there.")
@collection_held()
def command(
    board: str, rate: float | None, record: dict[str, str], durable: str | None, metrics: str,
    page: PageRequest, start: str | None, priority: str | None, cpu: int | None, as_json: bool,
    detach: bool, **of_nodes: Any,
) -> int:  # fmt: skip
    """Run a board and serve its links until Ctrl-C.

    BOARD is a board file. Prints what is attached where, once every link is open. A board with
    nodes runs in this process as a whole, or with --node in as many processes as you like.
    """
    from vbus.board.config import read_board_file
    from vbus.serve.serving import paced, recorded, serve_read
    from vbus.serve.time.priority import Priority

    with value_errors(click.BadParameter, param_hint="--priority"):
        wanted = Priority.of(priority, cpu)
    # Before anything else: a mistake in the file is the likeliest, and costs no fork.
    file, source = read_board_file(board)
    refuse_detached(page.asked, detach)
    if page.control and file.nodes:
        raise click.UsageError(
            "--scope-control is for boards without nodes: a node's time is that of all nodes, so no"
            " page can halt it; with --scope it can be seen"
        )
    shown = page.of(file.scope)
    if shown.listen and detach:
        complain("[scope] is left out of a run in the background; see: vbus scope NAME")
    if detach:
        from vbus.cli.run.detach import go_on_in_background

        go_on_in_background(".".join([file.board.name, *of_nodes["nodes"]]))
    # After the fork: locked memory is not passed on to a child.
    wanted.take()
    file = recorded(file, record | ({"durable": durable} if durable else {}), metrics)
    given = {key: value for key, value in of_nodes.items() if value}
    if file.nodes:
        from vbus.serve.nodes.nodes import NodeOptions

        given |= {"start": start} if start is not None else {}
        file = paced(file, rate)
        # One page shows all nodes of a computer: only the process of the first of them starts it.
        here = page.asked or is_first(file, of_nodes["nodes"])

        async def show_machine() -> None:
            if here:
                await page.show(file.board.name, shown)

        return _run_nodes(file, source, NodeOptions(**given), as_json, wanted, show_machine)
    refuse_given(given, f"is for boards with nodes; {board} has none")

    def ready(server: "Server") -> None:
        status = server.statistics() | {"priority": str(wanted)}
        show(as_json, status, [*ready_lines(status), READY])
        wanted.pin()

    async def show_first(server: "Server") -> None:
        await page.show(server.board.name, shown)

    serve_read(file, source, rate, ready, complain, start or "", show_first)
    return exit_codes.OK


def _run_nodes(
    file: "BoardFile",
    source: "Source",
    options: "NodeOptions",
    as_json: bool,
    priority: "Priority",
    show_scope: Callable[[], Awaitable[None]],
) -> int:
    """Run nodes of a board; return the exit code.

    Args:
        file: the board.
        source: its text.
        options: which nodes, and how.
        as_json: print JSON when ready.
        priority: what the process runs with.
        show_scope: shows all nodes on this computer, before they begin.

    Raises:
        VbusError: what stops it; see :func:`~vbus.serve.nodes.nodes.serve_nodes`.
    """
    from vbus.nodes.machine import trace_hash
    from vbus.serve.nodes.nodes import serve_nodes

    def ready(servers: "list[Server]") -> None:
        states = [server.statistics() | {"priority": str(priority)} for server in servers]
        lines = [line for state in states for line in ready_lines(state)]
        show(as_json, {"nodes": states}, [*lines, READY])
        priority.pin()

    outcome = serve_nodes(file, source, options, ready, complain, show_scope)
    if outcome.over:
        now = max(node.board.now for node in outcome.nodes)
        end = f"the scenario is over at {now / 1e9:.6f} ms"
        # The hash is that of the whole machine; a process with some of its nodes has a part.
        if len(outcome.nodes) == len(file.nodes):
            end += f"; trace hash {trace_hash(outcome.nodes)}"
        click.echo(end)
    if outcome.skew.get("marks"):
        click.echo(skew_line(outcome.skew))
    if outcome.skew:
        click.echo(late_line(outcome.nodes))
    return exit_codes.FAILURE if outcome.lost else exit_codes.OK


def is_first(file: "BoardFile", names: Sequence[str]) -> bool:
    """Whether the first node of a board is among these; all are, if none is named."""
    return bool(file.nodes) and (not names or file.nodes[0].name in names)


def late_line(nodes: Sequence["Node"]) -> str:
    """Return in some words how many edges came after their instant."""
    late = sum(node.late for node in nodes)
    if not late:
        return "no edge came late"
    worst = max(node.worst_late for node in nodes) / 1e6
    return f"{late} {'edge' if late == 1 else 'edges'} came late, the worst by {worst:.0f} us"
