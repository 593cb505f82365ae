"""What a board, or an attachment to one elsewhere, tells of itself, as lines for people."""

from typing import Any, Final

READY: Final = "ready; Ctrl-C stops it"
"""The last of them."""

DURABLE: Final = {
    "no": "of a process that is killed, the last 0.2 s may be missing",
    "process": "has all that was answered, also if the process is killed",
    "machine": "has all that was answered, also if the machine fails",
}
"""What a journal says of itself, by the setting ``durable``."""


def ready_lines(status: dict[str, Any]) -> list[str]:
    """Return the lines about a board that is ready."""
    from vbus.core.values.units import show

    time = status["policy"]
    if time == "realtime" and status["rate"] != 1:
        time += f", rate {status['rate']}"
    lines = [f"{status['board']}: {time}, process {status['pid']}"]
    for chip in status["chips"]:
        lines.append(f"  chip {chip['name']}: {chip['part']} at {show(chip['clock_hz'], 'Hz')}")
    for link in status["links"]:
        chips = ", ".join(link["chips"])
        lines.append(f"  link {link['url']}: {link['protocol']} protocol, to {chips}")
    if "journal" in status:
        journal = status["journal"]
        lines.append(f"  journal {journal['file']}: {DURABLE[journal['durable']]}")
    if status.get("priority"):
        lines.append(f"  scheduling {status['priority']}")
    if status["metrics"]:
        lines.append(f"  metrics {status['metrics']}")
    return lines


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
        f"{status['board']}: process {status['pid']}, attached to {attached['to']}{board}{gone}"
    ]
    lines += [f"  chip {chip['name']}: {chip['part']}" for chip in status["chips"]]
    for link in status["links"]:
        chips = ", ".join(link["chips"])
        line = f"  link {link['url']}: {link['protocol']} protocol{chips and f', to {chips}'}"
        if counts:
            line += ", away" if attached["state"] != "ready" else ""
            line += f", {link['sessions']} hosts, {link['received']} bytes in, {link['sent']} out"
        lines.append(line)
    if counts:
        lines.append(f"  {distance(status)}")
    return lines


def distance(status: dict[str, Any]) -> str:
    """Return how far away the board was so far, and what was lost."""
    attached = status["attached"]
    trips = round_trips(attached["round_trips"])
    return f"{attached['answers']} answers, {trips}; {losses(attached)}"


def round_trips(summary: dict[str, Any]) -> str:
    """Return a histogram of round trips in words."""
    if not summary["count"]:
        return "no round trips"
    values = ", ".join(f"{name} {_us(summary[f'{name}_ns'])}" for name in ("p50", "p99", "max"))
    return f"{summary['count']} round trips: {values}"


def losses(attached: dict[str, Any]) -> str:
    """Return what was lost in words."""
    return f"{attached['answers_lost']} answers lost, {attached['reconnections']} reconnections"


def _us(ns: int) -> str:
    return f"{ns / 1000:.0f} us" if ns < 10_000_000 else f"{ns / 1_000_000:.0f} ms"
