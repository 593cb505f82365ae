"""What a board, a node, or an attachment to a board elsewhere says of itself, as lines."""

from typing import Any, Final

READY: Final = "ready; Ctrl-C stops it"
"""The last line of what serves until Ctrl-C, once it is ready."""

DURABLE: Final = {
    "no": "of a process that is killed, the last 0.2 s may be missing",
    "process": "has all that was answered, also if the process is killed",
    "machine": "has all that was answered, also if the machine fails",
}
"""What a journal says of itself, by the setting ``durable``."""

DAY: Final = 24 * 3600 * 10**12
"""How long before the end of chip time it is shown (ps)."""


def ready_lines(status: dict[str, Any]) -> list[str]:
    """Return the lines about a board that is ready."""
    time = status["policy"]
    # The usual rate is not worth a word: chip time is wall time.
    if time == "realtime" and status["rate"] != 1:
        time += f", rate {status['rate']}"
    lines = [f"{status['board']}: {time}, process {status['pid']}", *_parts(status, counts=False)]
    if "journal" in status:
        journal = status["journal"]
        lines.append(f"  journal {journal['file']}: {DURABLE[journal['durable']]}")
    if status.get("priority"):
        lines.append(f"  scheduling {status['priority']}")
    return lines + _metrics(status)


def listed_lines(status: dict[str, Any]) -> list[str]:
    """Return the lines of ``vbus ls`` about a board, a router or an attachment."""
    if "error" in status:
        owner = f"; it is process {status['pid']}" if "pid" in status else ""
        return [status["error"] + owner]
    if "router" in status:
        listen = ", ".join(status["router"]["listen"])
        return [f"{status['board']}: process {status['pid']}, {listen}"]
    if "attached" in status:
        return attached_lines(status)
    time = status["policy"]
    if time == "realtime":
        rate = status["rate"]
        time += f" x{rate if isinstance(rate, str) else f'{rate:g}'}"
    lines = [
        f"{status['board']}: process {status['pid']}, {time}, chip time"
        f" {_seconds(status['time_ps'])}, lag {_seconds(status['lag_ps'])} (worst"
        f" {_seconds(status['worst_lag_ps'])}), {status['counters']['violations']} violations"
    ]
    if status.get("worst_overload"):
        lines.append(f"  {_overload(status['overload'], status['worst_overload'])}")
    if status.get("time_left_ps", DAY) < DAY:
        lines.append(f"  chip time ends in {_seconds(status['time_left_ps'])}")
    if "node" in status:
        lines += _node_lines(status["node"])
    return [*lines, *_parts(status), *_metrics(status)]


def attached_lines(status: dict[str, Any], counts: bool = True) -> list[str]:
    """Return the lines about an attachment.

    Args:
        status: what ``vbus ls --json`` shows of it.
        counts: whether they count what has passed.
    """
    attached = status["attached"]
    gone = "" if attached["state"] == "ready" else f", {attached['state']}"
    board = f" (board {attached['board']}, {attached['policy']})" if attached["board"] else ""
    lines = [
        f"{status['board']}: process {status['pid']}, attached to {attached['to']}{board}{gone}",
        *_parts(status, counts),
    ]
    return [*lines, f"  {distance(status)}"] if counts else lines


def _parts(status: dict[str, Any], counts: bool = True) -> list[str]:
    """Return a line for each chip and each link; with ``counts``, what has passed there too."""
    from vbus.core.values.units import show

    lines = []
    for chip in status["chips"]:
        line = f"  chip {chip['name']}: {chip['part']}"
        # Of a chip elsewhere an attachment knows neither.
        if "clock_hz" in chip:
            line += f" at {show(chip['clock_hz'], 'Hz')}"
        if counts and "reads" in chip:
            line += f", {chip['reads']} reads, {chip['writes']} writes"
        lines.append(line)
    for link in status["links"]:
        chips = ", ".join(link["chips"])
        line = f"  link {link['url']}: {link['protocol']} protocol{chips and f', to {chips}'}"
        if counts:
            if "attached" in status:
                away = ", away" if status["attached"]["state"] != "ready" else ""
                line += f"{away}, {link['sessions']} hosts"
            else:
                line += f", {link['state']}"
            line += f", {link['received']} bytes in, {link['sent']} out"
        lines.append(line)
    return lines


def _metrics(status: dict[str, Any]) -> list[str]:
    return [f"  metrics {status['metrics']}"] if status["metrics"] else []


def _node_lines(node: dict[str, Any]) -> list[str]:
    """Return what ``vbus ls`` shows of a node of a larger board."""
    others = ", ".join(f"{name} ({state})" for name, state in node["others"].items()) or "none"
    name = f"  node {node['node']} of {node['board']}: {node['state']}"
    # Only nodes in real time compare their clocks; the others wait for each other's grants.
    if "skew" not in node:
        waits = f", waits for {', '.join(node['waits_for'])}" if node["waits_for"] else ""
        granted = _seconds(node["granted_ps"])
        return [f"{name}, round {node['round']}, granted {granted}{waits}; others: {others}"]
    if node["keeps_epoch"]:
        clock = "keeps the epoch"
    elif node["clock_shared"]:
        clock = "goes by the same clock"
    else:
        offset, uncertainty = node["clock_offset_ns"] / 1000, node["clock_uncertainty_ns"] / 1000
        clock = f"clock differs by {offset:.0f} us ±{uncertainty:.0f} us"
    return [
        f"{name}, {clock}; others: {others}",
        f"  {skew_line(node['skew'])}; {node['late_edges']} late edges (worst"
        f" {_seconds(node['worst_late_ps'])}), {node['late_orders']} late orders",
    ]


def skew_line(skew: dict[str, int]) -> str:
    """Return in one line how far apart the clocks of nodes were."""
    values = ", ".join(f"{name} {skew[f'{name}_ns'] / 1000:.0f} us" for name in _SHARES)
    uncertainty = skew["uncertainty_ns"] / 1000
    return (
        f"wall skew between nodes: {values} over {skew['marks']} marks, each ±{uncertainty:.0f} us"
    )


def distance(status: dict[str, Any]) -> str:
    """Return how far away the board was so far, and what was lost."""
    attached = status["attached"]
    trips = round_trips(attached["round_trips"])
    return f"{attached['answers']} answers, {trips}; {losses(attached)}"


_SHARES: Final = ("p50", "p99", "max")
"""What is shown of a histogram: half, 99 % and all of its values are at most these."""


def round_trips(summary: dict[str, Any]) -> str:
    """Return a histogram of round trips in words."""
    if not summary["count"]:
        return "no round trips"
    values = ", ".join(f"{name} {_us(summary[f'{name}_ns'])}" for name in _SHARES)
    return f"{summary['count']} round trips: {values}"


def losses(attached: dict[str, Any]) -> str:
    """Return what was lost in words."""
    return f"{attached['answers_lost']} answers lost, {attached['reconnections']} reconnections"


def _us(ns: int) -> str:
    # From 10 ms on, four digits of microseconds say less than two of milliseconds.
    return f"{ns / 1000:.0f} us" if ns < 10_000_000 else f"{ns / 1_000_000:.0f} ms"


def _overload(times: float, worst: float) -> str:
    if not times:
        return f"keeps up; was overloaded {worst:.2f} times"
    return (
        f"overloaded: chip time runs at {100 / times:.0f} % of its rate at best, {times:.2f} times"
        f" this machine would be enough (worst {worst:.2f})"
    )


def _seconds(ps: int) -> str:
    return f"{ps / 1e12:.3f} s" if ps >= 10**12 else f"{ps / 1e9:.3f} ms"
