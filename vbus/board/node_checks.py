"""Boards with nodes: which chip is where, and what may lie between nodes."""

from collections.abc import Iterable

from vbus.addresses import refused_endpoint
from vbus.boardfile.lines import Path
from vbus.boardfile.sections import BoardFile
from vbus.boardfile.source import Source
from vbus.values.settings import NAME_FORM, listed, suggestion


class NodeChecks:
    """Checks what nodes make of a board file.

    Args:
        file: what could be read.
        known: every name of a section, those included that could not be read.
        source: takes the mistakes.
    """

    def __init__(self, file: BoardFile, known: dict[str, list[str]], source: Source) -> None:
        self._file: BoardFile = file
        self._nodes: list[str] = known["nodes"]
        self._source: Source = source
        self._home: dict[str, str] = {chip.name: chip.node for chip in file.chips}

    def run(self) -> None:
        """Check; mistakes go to the source."""
        self._chips()
        self._nets()
        if self._nodes:
            for bus in self._file.buses:
                self._together(("buses", bus.name, "chips"), bus.chips, f'bus "{bus.name}"')
            lines: dict[str, list[str]] = {}
            for card in self._file.cards:
                chips = [*card.decoded, *card.interrupting]
                self._together(("cards", card.name), chips, f'card "{card.name}"')
                if card.line:
                    others = lines.setdefault(card.line, [])
                    others += chips
                    self._together(("cards", card.name, "line"), others, f'line "{card.line}"')
            for pin_map in self._file.pinmaps:
                chips = list(pin_map.chips) or list(self._home)
                self._together(("pinmaps", pin_map.name), chips, f'pin map "{pin_map.name}"')
            for place, host in enumerate(self._file.hosts):
                chips = list(host.chips) or list(self._home)
                self._together(("hosts", place), chips, "this host")
            self._faults()

    def _chips(self) -> None:
        used = set()
        for chip in self._file.chips:
            path: Path = ("chips", chip.name, "node")
            if chip.node in self._nodes:
                used.add(chip.node)
            elif chip.node:
                hint = suggestion(chip.node, self._nodes)
                self._source.fail(
                    path,
                    f"there is no [nodes.{chip.node}]; {hint}this file has {listed(self._nodes)}",
                )
            elif self._nodes:
                self._source.fail(
                    ("chips", chip.name),
                    f"to which node does it belong? write node = one of {listed(self._nodes)}",
                )
        for node in self._nodes:
            if node not in used:
                self._source.fail(("nodes", node), f'no chip has node = "{node}"')

        for section in self._file.nodes:
            if refused := refused_endpoint(section.listen, self._file.zenoh.remote):
                self._source.fail(("nodes", section.name, "listen"), refused)
        self._processes()
        listening = [node.name for node in self._file.nodes if node.listen]
        for name in listening[1:]:
            self._source.fail(
                ("nodes", name, "listen"),
                f"node {listening[0]} listens already; one node does, and the others connect to it",
            )

    def _processes(self) -> None:
        """Check which nodes share a process."""
        for section in self._file.nodes:
            path: Path = ("nodes", section.name)
            if section.process and not NAME_FORM.fullmatch(section.process):
                self._source.fail(
                    (*path, "process"),
                    "a name begins with a letter and goes on with letters, digits, - and _",
                )

    def _nets(self) -> None:
        for net in self._file.nets:
            path: Path = ("nets", net.name)
            homes = self._homes(pin.partition(".")[0] for pin in net.pins)
            if len(homes) > 1 and not net.delay:
                self._source.fail(
                    path,
                    f"its pins are on the nodes {listed(homes)}; say how long an edge takes between"
                    f' them: "{net.name}" = {{ pins = [...], delay = "2 us" }}',
                )
            elif len(homes) < 2 and net.delay:
                where = f"all its pins are on node {homes[0]}" if homes else "there are no nodes"
                self._source.fail((*path, "delay"), f"a delay is for wires between nodes; {where}")

    def _homes(self, chips: Iterable[str]) -> list[str]:
        """Return the nodes of some chips, in the order of the file."""
        found = {self._home.get(chip, "") for chip in chips}
        return [node for node in self._nodes if node in found]

    def _together(self, path: Path, chips: Iterable[str], what: str) -> None:
        homes = self._homes(chips)
        if len(homes) > 1:
            self._source.fail(
                path,
                f"{what} reaches chips of the nodes {listed(homes)}; only wires with a delay go"
                " from node to node: name the chips of one",
            )

    def _faults(self) -> None:
        from vbus.board.fault_checks import homes_of

        for fault in self._file.faults:
            try:
                homes_of(self._file, fault)
            except (ValueError, LookupError) as error:
                self._source.fail(("faults", fault.place, "target"), str(error))
