"""The lines about a board that is ready."""

from typing import Any, Final

READY: Final = "ready; Ctrl-C stops it"
"""The last of them."""

DURABLE: Final = {
    "no": "of a process that is killed, the last 0.2 s may be missing",
    "process": "has all that was answered, also if the process is killed",
    "machine": "has all that was answered, also if the machine fails",
}
"""What a journal says of itself, by the setting ``durable``."""


def lines_of(status: dict[str, Any]) -> list[str]:
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
