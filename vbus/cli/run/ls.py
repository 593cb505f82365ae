"""``vbus ls``: the boards that run on this machine."""

import os
from typing import Any, Final

import click

from vbus.cli import exit_codes
from vbus.cli.output import complain, show
from vbus.core.errors import TransportError

DAY: Final = 24 * 3600 * 10**12
"""How long before the end of chip time it is shown (ps)."""


@click.command("ls")
@click.argument("names", metavar="[NAME]...", nargs=-1)
@click.option(
    "--zenoh", "endpoints", multiple=True, metavar="ENDPOINT", help="Look on this network too."
)
@click.option("--json", "as_json", is_flag=True, help="Print JSON; instants and spans in ps.")
def command(names: tuple[str, ...], endpoints: tuple[str, ...], as_json: bool) -> int:
    """List the boards that run on this machine, with their chips, links, time and lag.

    Boards elsewhere that "vbus attach" has brought here are listed with their round trips; others
    on the network where --zenoh, $VBUS_ZENOH or a router on this machine says where to look. With
    NAMES, only those; the exit code is 4 if one of them does not run or does not answer.
    """
    from vbus.serve.registry import running

    found = list(running())
    found += _elsewhere(endpoints, {(board["board"], board.get("pid")) for board in found})
    boards = [board for board in found if not names or board["board"] in names]
    answering = {board["board"] for board in boards if "error" not in board}
    missing = [name for name in names if name not in answering]
    lines = (line for board in boards for line in _lines(board))
    show(as_json, boards, lines if boards or names else ["no board is running"])
    for name in missing:
        complain(f'no board called "{name}" answers; "vbus ls" shows which do')
    return exit_codes.NO_LINK if missing else exit_codes.OK


def _elsewhere(
    endpoints: tuple[str, ...], known: set[tuple[str, int | None]]
) -> list[dict[str, Any]]:
    """Return what boards on the network tell that were not found on this machine."""
    from vbus.network import places

    wanted = endpoints or tuple(filter(None, os.environ.get("VBUS_ZENOH", "").split(",")))
    wanted = wanted or places.endpoints_at(places.router_place())
    if not wanted:
        return []
    from vbus.network.session import boards_on

    try:
        boards = boards_on(wanted, places.security_of({}, "vbus ls"))
    except TransportError as error:
        complain(str(error))
        return []
    return [board for board in boards if (board["board"], board.get("pid")) not in known]


def _lines(board: dict[str, Any]) -> list[str]:
    if "error" in board:
        owner = f"; it is process {board['pid']}" if "pid" in board else ""
        return [board["error"] + owner]
    if "router" in board:
        return [f"{board['board']}: process {board['pid']}, {', '.join(board['router']['listen'])}"]
    if "attached" in board:
        from vbus.cli.status_lines import attached_lines

        return attached_lines(board)
    from vbus.core.values.units import show

    time = board["policy"]
    if time == "realtime":
        time += f" x{_plain(board['rate'])}"
    lines = [
        f"{board['board']}: process {board['pid']}, {time}, chip time {_seconds(board['time_ps'])},"
        f" lag {_seconds(board['lag_ps'])} (worst {_seconds(board['worst_lag_ps'])}),"
        f" {board['counters']['violations']} violations"
    ]
    if board.get("worst_overload"):
        lines.append(f"  {_overload(board['overload'], board['worst_overload'])}")
    if board.get("time_left_ps", DAY) < DAY:
        lines.append(f"  chip time ends in {_seconds(board['time_left_ps'])}")
    if "node" in board:
        lines += _node_lines(board["node"])
    for chip in board["chips"]:
        lines.append(
            f"  chip {chip['name']}: {chip['part']} at {show(chip['clock_hz'], 'Hz')},"
            f" {chip['reads']} reads, {chip['writes']} writes"
        )
    for link in board["links"]:
        lines.append(
            f"  link {link['url']}: {link['protocol']} to {', '.join(link['chips'])},"
            f" {link['state']}, {link['received']} bytes in, {link['sent']} out"
        )
    if board["metrics"]:
        lines.append(f"  metrics {board['metrics']}")
    return lines


def _node_lines(node: dict[str, Any]) -> list[str]:
    """Return what ``vbus ls`` shows of a node of a larger board."""
    others = ", ".join(f"{name} ({state})" for name, state in node["others"].items()) or "none"
    if "skew" not in node:
        waits = f", waits for {', '.join(node['waits_for'])}" if node["waits_for"] else ""
        return [
            f"  node {node['node']} of {node['board']}: {node['state']}, round {node['round']},"
            f" granted {_seconds(node['granted_ps'])}{waits}; others: {others}"
        ]
    skew = node["skew"]
    clock = (
        "keeps the epoch"
        if node["keeps_epoch"]
        else "goes by the same clock"
        if node["clock_shared"]
        else f"clock differs by {node['clock_offset_ns'] / 1000:.0f} us"
        f" ±{node['clock_uncertainty_ns'] / 1000:.0f} us"
    )
    return [
        f"  node {node['node']} of {node['board']}: {node['state']}, {clock}; others: {others}",
        f"  skew p50 {skew['p50_ns'] / 1000:.0f} us, p99 {skew['p99_ns'] / 1000:.0f} us, max"
        f" {skew['max_ns'] / 1000:.0f} us over {skew['marks']} marks, each"
        f" ±{skew['uncertainty_ns'] / 1000:.0f} us;"
        f" {node['late_edges']} late edges (worst {_seconds(node['worst_late_ps'])}),"
        f" {node['late_orders']} late orders",
    ]


def _overload(times: float, worst: float) -> str:
    if not times:
        return f"keeps up; was overloaded {worst:.2f} times"
    return (
        f"overloaded: chip time runs at {100 / times:.0f} % of its rate at best, {times:.2f} times"
        f" this machine would be enough (worst {worst:.2f})"
    )


def _seconds(ps: int) -> str:
    if ps >= 10**12:
        return f"{ps / 1e12:.3f} s"
    return f"{ps / 1e9:.3f} ms"


def _plain(rate: float | str) -> str:
    return rate if isinstance(rate, str) else f"{rate:g}"
