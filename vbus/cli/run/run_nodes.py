"""``vbus run`` for boards with nodes: all in this process, or some of them."""

from typing import TYPE_CHECKING

import click

from vbus.cli import exit_codes
from vbus.cli.output import complain, show

if TYPE_CHECKING:
    from collections.abc import Sequence

    from vbus.boardfile.sections import BoardFile, ScopeSection
    from vbus.boardfile.source import Source
    from vbus.nodes.node import Node
    from vbus.serve.nodes.nodes import NodeOptions
    from vbus.serve.server import Server
    from vbus.serve.time.priority import Priority


def run(
    file: "BoardFile",
    source: "Source",
    options: "NodeOptions",
    as_json: bool,
    priority: "Priority",
    scope: "ScopeSection | None" = None,
) -> int:
    """Run nodes of a board; return the exit code.

    Args:
        file: the board.
        source: its text.
        options: which nodes, and how.
        as_json: print JSON when ready.
        priority: what the process runs with.
        scope: where the page is to be, with all nodes on this computer; None for none here.

    Raises:
        VbusError: what stops it; see :func:`~vbus.serve.nodes.nodes.serve_nodes`.
    """
    from vbus.cli.status_lines import READY, ready_lines
    from vbus.nodes.machine import trace_hash
    from vbus.serve.nodes.nodes import serve_nodes

    def ready(servers: "list[Server]") -> None:
        states = [server.statistics() | {"priority": str(priority)} for server in servers]
        lines = [line for state in states for line in ready_lines(state)]
        show(as_json, {"nodes": states}, [*lines, READY])
        priority.pin()

    async def show_scope() -> None:
        from vbus.cli.look.scope_process import show_board

        if scope is not None and scope.listen:
            await show_board(file.board.name, scope)

    outcome = serve_nodes(file, source, options, ready, complain, show_scope)
    if outcome.over:
        now = max(node.board.now for node in outcome.nodes)
        end = f"the scenario is over at {now / 1e9:.6f} ms"
        if len(outcome.nodes) == len(file.nodes):
            end += f"; trace hash {trace_hash(outcome.nodes)}"
        click.echo(end)
    if outcome.skew.get("marks"):
        click.echo(skew_line(outcome.skew))
    if outcome.skew:
        click.echo(late_line(outcome.nodes))
    return exit_codes.FAILURE if outcome.lost else exit_codes.OK


def is_first(file: "BoardFile", names: "Sequence[str]") -> bool:
    """Whether the first node of a board is among these; all are, if none is named."""
    return bool(file.nodes) and (not names or file.nodes[0].name in names)


def skew_line(skew: dict[str, int]) -> str:
    """Return in one line how far apart nodes were."""
    return (
        f"wall skew between nodes: p50 {skew['p50_ns'] / 1000:.0f} us, p99"
        f" {skew['p99_ns'] / 1000:.0f} us, max {skew['max_ns'] / 1000:.0f} us over"
        f" {skew['marks']} marks, each ±{skew['uncertainty_ns'] / 1000:.0f} us"
    )


def late_line(nodes: "Sequence[Node]") -> str:
    """Return in some words how many edges came after their instant."""
    late = sum(node.late for node in nodes)
    if not late:
        return "no edge came late"
    worst = max(node.worst_late for node in nodes) / 1e6
    return f"{late} {'edge' if late == 1 else 'edges'} came late, the worst by {worst:.0f} us"
