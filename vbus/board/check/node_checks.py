"""Boards with nodes: which chip is where, and what may lie between nodes."""

from collections.abc import Iterable, Iterator

from vbus.boardfile.lines import Path
from vbus.boardfile.sections import BoardFile
from vbus.boardfile.source import Mistakes
from vbus.core.addresses import refused_endpoint
from vbus.core.values.settings import listed, quoted


def check_nodes(file: BoardFile, nodes: list[str]) -> Mistakes:
    """Check what nodes make of a board file.

    Args:
        file: what could be read.
        nodes: the name of every node, those included that could not be read.
    """
    home = {chip.name: chip.node for chip in file.chips}
    for name in nodes:
        if name not in home.values():
            yield ("nodes", name), f'no chip has node = "{name}"'
    for chip in file.chips:
        if nodes and not chip.node:
            yield (
                ("chips", chip.name),
                f"to which node does it belong? write node = {' or '.join(map(quoted, nodes))}",
            )
    listening = [node.name for node in file.nodes if node.listen]
    for node in file.nodes:
        path: Path = ("nodes", node.name, "listen")
        if refused := refused_endpoint(node.listen, file.zenoh.remote):
            yield path, refused
        if node.name in listening[1:]:
            yield (
                path,
                f"node {listening[0]} listens already; one node does, and the others connect to it",
            )

    def homes(chips: Iterable[str]) -> list[str]:
        found = {home.get(chip, "") for chip in chips}
        return [node for node in nodes if node in found]

    for net in file.nets:
        path = ("nets", net.name)
        over = homes(pin.partition(".")[0] for pin in net.pins)
        if len(over) > 1 and not net.delay:
            yield (
                path,
                f"its pins are on the nodes {listed(over)}; say how long an edge takes between"
                f' them: "{net.name}" = {{ pins = [...], delay = "2 us" }}',
            )
        elif len(over) < 2 and net.delay:
            where = f"all its pins are on node {over[0]}" if over else "there are no nodes"
            yield (*path, "delay"), f"a delay is for wires between nodes; {where}"
    if not nodes:
        return
    for path, chips, what in _together(file, list(home)):
        if len(over := homes(chips)) > 1:
            yield (
                path,
                f"{what} reaches chips of the nodes {listed(over)}; only wires with a delay go"
                " from node to node: name the chips of one",
            )
    for fault in file.faults:
        from vbus.board.check.fault_checks import homes_of

        try:
            homes_of(file, fault)
        except (ValueError, LookupError) as error:
            yield ("faults", fault.place, "target"), str(error)


def _together(file: BoardFile, chips: list[str]) -> Iterator[tuple[Path, Iterable[str], str]]:
    """Give what keeps to one node: where it stands, the chips it reaches, and what it is."""
    for bus in file.buses:
        yield ("buses", bus.name, "chips"), bus.chips, f'bus "{bus.name}"'
    lines: dict[str, list[str]] = {}
    for card in file.cards:
        own = [*card.decoded, *card.interrupting]
        yield ("cards", card.name), own, f'card "{card.name}"'
        if card.line:
            others = lines.setdefault(card.line, [])
            others += own
            yield ("cards", card.name, "line"), others, f'line "{card.line}"'
    for pin_map in file.pinmaps:
        yield ("pinmaps", pin_map.name), pin_map.chips or chips, f'pin map "{pin_map.name}"'
    for place, host in enumerate(file.hosts):
        yield ("hosts", place), host.chips or chips, "this host"
