"""What cannot be seen in one key alone: names that must exist, owners there may be one of."""

from collections.abc import Hashable

from vbus import plugins
from vbus.board import cards
from vbus.board.metrics_checks import check_metrics, check_scope
from vbus.board.network_checks import NETWORK_SCHEME, check_network
from vbus.board.node_checks import NodeChecks
from vbus.board.serial_checks import check_serial
from vbus.boardfile.cards import ACCESSES, CardSection
from vbus.boardfile.lines import Path
from vbus.boardfile.sections import NO_PLANT, BoardFile, ChipSection
from vbus.boardfile.source import Source
from vbus.chips.base import Chip
from vbus.chips.tables import PinRow
from vbus.circuit import circuit
from vbus.kernel import Clock, Kernel
from vbus.signals import Rule
from vbus.values.settings import listed, quoted, rule_hint, rule_names, suggestion

MOST_CHIPS = 16
"""Chips one session can select: SELECT carries 16 bits."""


def check(file: BoardFile, known: dict[str, list[str]], source: Source) -> None:
    """Check a board file as a whole.

    Args:
        file: what could be read.
        known: every name of a section, those included that could not be read.
        source: takes the mistakes.
    """
    _Checks(file, known, source).run()


class _Checks:
    def __init__(self, file: BoardFile, known: dict[str, list[str]], source: Source) -> None:
        self._file: BoardFile = file
        self._known: dict[str, list[str]] = known
        self._source: Source = source
        self._parts: dict[str, Chip] = {}
        """A specimen of each chip: pins and axes may depend on part number and settings."""
        self._specimens: dict[Hashable, Chip] = {}
        self._owners: dict[str, str] = {}

    def run(self) -> None:
        if NO_PLANT in self._known["plants"]:
            self._source.fail(
                ("plants", NO_PLANT), f'"{NO_PLANT}" stands for no plant; choose another name'
            )
        if not self._known["chips"]:
            self._source.fail((), "the board is empty: it needs at least one [chips.NAME]")
        self._chips()
        self._buses()
        self._nets()
        for card in self._file.cards:
            self._card(card)
        if self._file.has_glue or self._file.pinmaps:
            self._wiring()
        self._hosts()
        check_serial(self._file, self._parts, self._source)
        NodeChecks(self._file, self._known, self._source).run()
        check_network(self._file, self._source)
        if self._file.faults:
            from vbus.board.fault_checks import check_links

            check_links(self._file, NETWORK_SCHEME, self._source)
        check_metrics(self._file, self._source)
        check_scope(self._file, self._source)
        self._violations()

    def _exists(self, path: Path, kind: str, name: str) -> bool:
        """Tell whether there is a table ``[kind.name]``; complain at ``path`` if not."""
        names = self._known[kind]
        if name in names:
            return True
        hint = suggestion(name, names)
        self._source.fail(path, f"there is no [{kind}.{name}]; {hint}this file has {listed(names)}")
        return False

    # -- chips and plants ---------------------------------------------------------------------

    def _chips(self) -> None:
        users: dict[str, str] = {}
        for chip in self._file.chips:
            path: Path = ("chips", chip.name)
            self._specimen(chip, path)
            self._axes(chip, path)
            for axis, plant in enumerate(chip.axes):
                if plant == NO_PLANT:
                    continue
                place: Path = (*path, "plant") if chip.plant else (*path, "plants", axis)
                if not self._exists(place, "plants", plant):
                    continue
                mine = f"chips.{chip.name}" + (f" axis {axis + 1}" if chip.plants else "")
                if plant in users:
                    self._source.fail(
                        place,
                        f'plant "{plant}" is driven by {users[plant]} already; every axis needs a'
                        " plant of its own",
                    )
                users.setdefault(plant, mine)

    def _specimen(self, chip: ChipSection, path: Path) -> None:
        cls = plugins.chip_class(chip.part)
        if cls.PARTS and chip.part not in cls.PARTS:
            hint = suggestion(chip.part, cls.PARTS)
            self._source.fail(
                (*path, "part"), f"found {quoted(chip.part)}; {hint}known are {listed(cls.PARTS)}"
            )
            return
        alike = chip.part, chip.clock, *sorted(chip.settings.items())
        try:
            if alike not in self._specimens:
                self._specimens[alike] = cls(
                    chip.name, chip.part, Kernel(), Clock(chip.clock), chip.settings
                )
            self._parts[chip.name] = self._specimens[alike]
        except ValueError as error:
            self._source.fail(path, str(error))

    def _axes(self, chip: ChipSection, path: Path) -> None:
        part = self._parts.get(chip.name)
        axes = part.axis_count if part is not None else plugins.chip_class(chip.part).AXES
        if chip.plant and chip.plants:
            self._source.fail((*path, "plants"), 'write either "plant" or "plants", not both')
        elif axes == 0:
            if chip.axes:
                self._source.fail(
                    (*path, "plant" if chip.plant else "plants"),
                    f"{chip.part} has no axis; leave the plant out",
                )
        elif axes == 1 and chip.plants:
            self._source.fail(
                (*path, "plants"), f'{chip.part} has one axis; write plant = "{chip.plants[0]}"'
            )
        elif not chip.axes:
            key = 'plant = "NAME"' if axes == 1 else f"plants = [...] with up to {axes} names"
            self._source.fail(
                path,
                f"no plant: write {key}, and a [plants.NAME] with the motor, load and encoder",
            )
        elif len(chip.axes) > axes:
            self._source.fail(
                (*path, "plants"),
                f"{chip.part} has {axes} axes, and {len(chip.axes)} plants are named",
            )

    # -- wires --------------------------------------------------------------------------------

    def _buses(self) -> None:
        for bus in self._file.buses:
            families: dict[str, str] = {}
            if not bus.chips:
                self._source.fail(("buses", bus.name), "a bus joins at least one chip")
            for place, name in enumerate(bus.chips):
                path: Path = ("buses", bus.name, "chips", place)
                if not self._exists(path, "chips", name) or name not in self._parts:
                    continue
                chip = self._parts[name]
                families.setdefault(chip.FAMILY, name)
                if len(families) > 1:
                    first = next(iter(families.values()))
                    self._source.fail(
                        path,
                        f'"{name}" is a {chip.FAMILY} and "{first}" is not; one bus joins chips of'
                        " one family",
                    )
                    break
                for row in chip.pin_rows:
                    if row.shared:
                        self._own(path, f"{name}.{row.name}", f"bus {bus.name}")

    def _own(self, path: Path, pin: str, owner: str) -> None:
        other = self._owners.setdefault(pin, owner)
        if other != owner:
            self._source.fail(
                path, f'pin "{pin}" is on {other} already; a pin is soldered to one net'
            )

    def _pin(self, path: Path, name: str) -> PinRow | None:
        chip, dot, pin = name.partition(".")
        if not dot:
            self._source.fail(path, f'found "{name}"; write a pin as "chip.pin", such as "x./RST"')
            return None
        if not self._exists(path, "chips", chip) or chip not in self._parts:
            return None
        rows = {row.name: row for row in self._parts[chip].pin_rows}
        if pin not in rows:
            self._source.fail(
                path, f'"{chip}" has no pin "{pin}"; {suggestion(pin, rows)}it has {listed(rows)}'
            )
        return rows.get(pin)

    def _nets(self) -> None:
        for net in self._file.nets:
            outputs: dict[str, PinRow] = {}
            width = 0
            for place, name in enumerate(net.pins):
                path: Path = ("nets", net.name, place)
                row = self._pin(path, name)
                if row is None:
                    continue
                self._own(path, name, f'net "{net.name}"')
                if width and row.width != width:
                    self._source.fail(
                        path, f'"{name}" has {row.width} wires, "{net.pins[0]}" has {width}'
                    )
                width = width or row.width
                if row.direction == "out":
                    if outputs:
                        self._source.fail(
                            path,
                            f'"{name}" and "{next(iter(outputs))}" are both outputs and would'
                            " always fight; join an output to inputs or to open-drain pins",
                        )
                    outputs[name] = row
            if not net.pins:
                self._source.fail(("nets", net.name), "a net joins at least one pin")

    def _wiring(self) -> None:
        from vbus.board.glue_checks import check_glue
        from vbus.board.pin_map_checks import PinMapChecks

        ends = check_glue(self._file, self._parts, self._source)
        self._pin_maps: PinMapChecks = PinMapChecks(
            self._parts, self._known["chips"], self._file, ends, self._source
        )
        for section in self._file.pinmaps:
            self._pin_maps.check(section)

    # -- cards and hosts ----------------------------------------------------------------------

    def _card(self, card: CardSection) -> None:
        from vbus.board.glue_checks import check_card_bus, check_card_without_bus

        path: Path = ("cards", card.name)
        if card.bus:
            check_card_bus(card, self._known["chips"], self._file.glue, self._source)
        else:
            check_card_without_bus(card, self._source)
        for place, name in enumerate(card.chips):
            if self._exists((*path, "chips", place), "chips", name) and name in self._parts:
                self._decode(card, (*path, "decode"), self._parts[name])
        if card.decode and not card.chips:
            self._source.fail(path, f'"decode" needs chips: which ones are behind "{card.decode}"?')
        self._card_interrupt(card, path)
        self._card_circuit(card, path)
        offsets: dict[int, int] = {}
        for place, port in enumerate(card.ports):
            where: Path = (*path, "ports", place)
            if not port.chip or not self._exists((*where, "chip"), "chips", port.chip):
                continue
            if port.offset in offsets:
                self._source.fail(
                    (*where, "offset"),
                    f"offset {port.offset} is decoded by row {offsets[port.offset] + 1} already",
                )
            offsets.setdefault(port.offset, place)
            chip = self._parts.get(port.chip)
            if chip is not None and port.address not in cards.addresses(chip):
                highest = max(cards.addresses(chip))
                self._source.fail(
                    (*where, "address"),
                    f'found {port.address}; addresses of "{port.chip}" are 0 to {highest}',
                )

    def _card_interrupt(self, card: CardSection, path: Path) -> None:
        for key, what in (
            ("signal", "a signal"), ("acknowledge", "an acknowledge"), ("line", "a line"),
        ):  # fmt: skip
            if getattr(card, key) and not card.interrupt:
                self._source.fail((*path, key), f'{what} needs "interrupt": which output sends it?')
        if card.fixed and not card.memory:
            self._source.fail((*path, "fixed"), 'a fixed address needs "memory = true"')
        if card.fixed % 4096:
            self._source.fail(
                (*path, "fixed"), f"found {card.fixed}; a page begins at 4096 times n"
            )
        for output in card.interrupt.split():
            self._card_output(output, (*path, "interrupt"))

    def _card_circuit(self, card: CardSection, path: Path) -> None:
        if card.sense == "edge" and not card.interrupt:
            self._source.fail(
                (*path, "sense"), 'to sense an edge needs "interrupt": of which output?'
            )
        if card.acknowledge_at and not card.acknowledge:
            self._source.fail(
                (*path, "acknowledge_at"),
                f'an address to acknowledge at needs "acknowledge": {listed(ACCESSES)}',
            )
        if card.has_circuit and card.name in self._known["chips"]:
            self._source.fail(
                path,
                f"a chip is called {quoted(card.name)} too; its interrupt has pins of its own"
                f' ("{card.name}./INT"): give the card another name',
            )
        if not card.line:
            return
        if any(net.name == card.line for net in self._file.nets):
            self._source.fail(
                (*path, "line"), f"there is a net {quoted(card.line)} already; choose another name"
            )
        others = [other for other in self._file.cards if other.line == card.line]
        if len(others) < 2:
            lines = sorted({other.line for other in self._file.cards if other.line} - {card.line})
            hint = suggestion(card.line, lines)
            self._source.fail(
                (*path, "line"),
                f"no other card is on line {quoted(card.line)}; {hint}a line is shared by two cards"
                " or more",
            )
        elif others[0].sense != card.sense:
            self._source.fail(
                (*path, "sense"),
                f"card {quoted(others[0].name)} senses the {others[0].sense} of the same line;"
                " cards on one line have one sense",
            )

    def _card_output(self, named: str, path: Path) -> None:
        name, _, pin = named.partition(".")
        if self._exists(path, "chips", name):
            part = self._parts.get(name)
            outputs = [
                row.name
                for row in (part.pin_rows if part is not None else ())
                if row.direction != "in" and row.width == 1 and not (row.strobe or row.wave)
            ]
            if part is not None and pin not in outputs:
                known = listed(f"{name}.{output}" for output in outputs)
                self._source.fail(path, f"found {quoted(named)}; outputs are {known}")

    def _decode(self, card: CardSection, path: Path, chip: Chip) -> None:
        known = cards.decodes(chip)
        if card.decode and card.decode not in known:
            hint = suggestion(card.decode, known)
            self._source.fail(path, f"found {quoted(card.decode)}; {hint}known are {listed(known)}")

    def _hosts(self) -> None:
        links: dict[str, int] = {}
        for place, host in enumerate(self._file.hosts):
            path: Path = ("hosts", place)
            if not host.transport:
                continue
            scheme, colon, _ = host.transport.partition(":")
            if colon:
                self._plugin((*path, "transport"), plugins.TRANSPORTS, scheme)
            else:
                self._source.fail(
                    (*path, "transport"),
                    f"found {quoted(host.transport)}; write SCHEME:ADDRESS, such as"
                    ' "pty:$VBUS_RUNTIME/x" or "tcp:5000"',
                )
            if host.protocol:
                self._plugin((*path, "protocol"), plugins.PROTOCOLS, host.protocol)
            if host.transport in links and scheme != NETWORK_SCHEME:
                self._source.fail(
                    (*path, "transport"),
                    f'"{host.transport}" is the link of hosts[{links[host.transport] + 1}] already;'
                    " every host needs one of its own",
                )
            links.setdefault(host.transport, place)
            for number, name in enumerate(host.chips):
                self._exists((*path, "chips", number), "chips", name)
            reached = list(host.chips) or self._known["chips"]
            if len(reached) > MOST_CHIPS:
                self._source.fail(
                    path, f"it reaches {len(reached)} chips; a session selects {MOST_CHIPS} at most"
                )
            if host.card and self._exists((*path, "card"), "cards", host.card):
                self._behind_card((*path, "card"), host.card, reached)
            if host.pinmap and self._exists((*path, "pinmap"), "pinmaps", host.pinmap):
                for section in self._file.pinmaps:
                    if section.name == host.pinmap:
                        self._pin_maps.host((*path, "pinmap"), host, section, reached)

    def _plugin(self, path: Path, group: str, name: str) -> None:
        if name not in plugins.names(group):
            self._source.fail(path, f"found {quoted(name)}; {plugins.known(group, name)}")

    def _behind_card(self, path: Path, name: str, reached: list[str]) -> None:
        for card in self._file.cards:
            if card.name == name:
                for verb, chips in (
                    ("decodes to", card.decoded), ("is interrupted by", card.interrupting),
                ):  # fmt: skip
                    for chip in chips:
                        if chip and chip not in reached:
                            self._source.fail(
                                path,
                                f'card "{name}" {verb} "{chip}", which is not among the chips of'
                                f" this host: {listed(reached)}",
                            )

    # -- rules --------------------------------------------------------------------------------

    def _violations(self) -> None:
        wanted = [name for name in self._file.violations if name != "default"]
        own = [*circuit.RULES, *(r for c in self._parts.values() for r in c.RULES)]
        known = rule_names(rule.name for rule in own)
        if all(name in known for name in wanted):
            return
        known |= rule_names(rule.name for rule in all_rules())
        for name in wanted:
            if name not in known:
                self._source.fail(("violations", name), f"unknown rule; {rule_hint(name, known)}")


def all_rules() -> list[Rule]:
    """Return every rule of the board and of every chip that is registered, sorted by name.

    Chips whose plug-in is broken are left out.
    """
    rules = {rule.name: rule for rule in circuit.RULES}
    for chip in plugins.chip_classes():
        rules.update({rule.name: rule for rule in chip.RULES})
    return [rules[name] for name in sorted(rules)]
