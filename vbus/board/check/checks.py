"""What cannot be seen in one key alone: owners there may be one of, and parts that must fit."""

from collections.abc import Callable, Generator, Hashable, Iterable, Mapping

from vbus import plugins
from vbus.board.card import cards
from vbus.board.check.network_checks import NETWORK_SCHEME, check_network
from vbus.board.check.node_checks import check_nodes
from vbus.boardfile.cards import CardSection
from vbus.boardfile.lines import Path
from vbus.boardfile.sections import NO_PLANT, BoardFile, ChipSection, HostSection
from vbus.boardfile.source import Mistakes, Source, absent
from vbus.chips.base import Chip
from vbus.chips.tables import PinRow
from vbus.circuit import circuit
from vbus.core.kernel import Clock, Kernel
from vbus.core.signals import Rule
from vbus.core.values.settings import (
    among,
    listed,
    quoted,
    rule_hint,
    rule_names,
    suggestion,
    unknown,
)
from vbus.protocols.serial_line import USUAL_FRAME

MOST_CHIPS = 16
"""Chips one session can select: SELECT carries 16 bits."""
MODEM_SCHEMES = ("rfc2217",)
"""Schemes of links that carry modem lines and breaks."""
_TIMELESS = {
    "serial": "a real line takes its own time: its speed stands in the address, ?baud=9600",
    "zenoh": "messages over the network are no serial line",
}
"""Links a line's speed means nothing to, and why."""


def check(file: BoardFile, known: Callable[[str], list[str]], source: Source) -> None:
    """Check a board file as a whole.

    Args:
        file: what could be read.
        known: returns every name of a section, those included that could not be read.
        source: takes the mistakes.
    """
    for path, message in _Checks(file, known, source).run():
        source.fail(path, message)


class _Checks:
    def __init__(self, file: BoardFile, known: Callable[[str], list[str]], source: Source) -> None:
        self._file: BoardFile = file
        self._known: Callable[[str], list[str]] = known
        self._source: Source = source
        self._parts: dict[str, Chip] = {}
        """A specimen of each chip: pins and axes may depend on part number and settings."""
        self._owners: dict[str, str] = {}

    def run(self) -> Mistakes:
        if NO_PLANT in self._known("plants"):
            yield ("plants", NO_PLANT), f'"{NO_PLANT}" stands for no plant; choose another name'
        if not self._known("chips"):
            yield (), "the board is empty: it needs at least one [chips.NAME]"
        yield from self._specimens()
        yield from self._chips()
        yield from self._buses()
        yield from self._nets()
        for card in self._file.cards:
            yield from self._card(card, ("cards", card.name))
        glue: Mapping[str, tuple[str, ...]] = {}
        # Boards without any do not import what checks it.
        if self._file.has_glue or self._file.pinmaps:
            glue = yield from self._wiring()
        for card in self._file.cards:
            yield from self._interrupts(card, glue)
        yield from self._hosts()
        yield from check_nodes(self._file, self._known("nodes"))
        yield from check_network(self._file)
        if self._file.faults:
            from vbus.board.check.fault_checks import check_faults

            yield from check_faults(self._file, NETWORK_SCHEME)
        yield from self._violations()

    # -- chips and plants ---------------------------------------------------------------------

    def _specimens(self) -> Mistakes:
        specimens: dict[Hashable, Chip] = {}
        for chip in self._file.chips:
            path: Path = ("chips", chip.name)
            cls = plugins.chip_class(chip.part)
            if cls.PARTS and chip.part not in cls.PARTS:
                yield (*path, "part"), unknown(chip.part, cls.PARTS)
                continue
            # Equal chips share a specimen: a board of 16 axes makes one.
            alike = chip.part, chip.clock, *sorted(chip.settings.items())
            try:
                if alike not in specimens:
                    specimens[alike] = cls(
                        chip.name, chip.part, Kernel(), Clock(chip.clock), chip.settings
                    )
                self._parts[chip.name] = specimens[alike]
            except ValueError as error:
                yield path, str(error)

    def _chips(self) -> Mistakes:
        users: dict[str, str] = {}
        for chip in self._file.chips:
            path: Path = ("chips", chip.name)
            yield from self._axes(chip, path)
            for axis, plant in enumerate(chip.axes):
                if plant == NO_PLANT:
                    continue
                if plant in users:
                    yield (
                        (*path, "plant") if chip.plant else (*path, "plants", axis),
                        f'plant "{plant}" is driven by {users[plant]} already; every axis needs a'
                        " plant of its own",
                    )
                of_axis = f" axis {axis + 1}" if chip.plants else ""
                users.setdefault(plant, f"chips.{chip.name}{of_axis}")

    def _axes(self, chip: ChipSection, path: Path) -> Mistakes:
        part = self._parts.get(chip.name)
        axes = part.axis_count if part is not None else plugins.chip_class(chip.part).AXES
        if chip.plant and chip.plants:
            yield (*path, "plants"), 'write either "plant" or "plants", not both'
        elif axes == 0 and chip.axes:
            key = "plant" if chip.plant else "plants"
            yield (*path, key), f"{chip.part} has no axis; leave the plant out"
        elif axes == 1 and chip.plants:
            message = f'{chip.part} has one axis; write plant = "{chip.plants[0]}"'
            yield (*path, "plants"), message
        elif axes and not chip.axes:
            key = 'plant = "NAME"' if axes == 1 else f"plants = [...] with up to {axes} names"
            yield (
                path,
                f"no plant: write {key}, and a [plants.NAME] with the motor, load and encoder",
            )
        elif len(chip.axes) > axes:
            named = len(chip.axes)
            yield (*path, "plants"), f"{chip.part} has {axes} axes, and {named} plants are named"

    # -- wires --------------------------------------------------------------------------------

    def _buses(self) -> Mistakes:
        for bus in self._file.buses:
            if not bus.chips:
                yield ("buses", bus.name), "a bus joins at least one chip"
            families: dict[str, str] = {}
            for place, name in enumerate(bus.chips):
                path: Path = ("buses", bus.name, "chips", place)
                if name not in self._parts:
                    continue
                chip = self._parts[name]
                families.setdefault(chip.FAMILY, name)
                if len(families) > 1:
                    first = next(iter(families.values()))
                    yield (
                        path,
                        f'"{name}" is a {chip.FAMILY} and "{first}" is not; one bus joins chips of'
                        " one family",
                    )
                    break
                for row in chip.pin_rows:
                    if row.shared:
                        yield from self._own(path, f"{name}.{row.name}", f"bus {bus.name}")

    def _own(self, path: Path, pin: str, owner: str) -> Mistakes:
        other = self._owners.setdefault(pin, owner)
        if other != owner:
            yield path, f'pin "{pin}" is on {other} already; a pin is soldered to one net'

    def _nets(self) -> Mistakes:
        for net in self._file.nets:
            found: list[PinRow] = []
            output = ""
            if not net.pins and not self._file.has_glue:  # glue may be wired to it
                yield ("nets", net.name), "a net joins at least one pin"
            for place, name in enumerate(net.pins):
                path: Path = ("nets", net.name, place)
                chip, dot, pin = name.partition(".")
                rows = {row.name: row for row in self._pin_rows(chip)}
                if not dot:
                    yield path, f'found "{name}"; write a pin as "chip.pin", such as "x./RST"'
                elif chip not in (names := self._known("chips")):
                    yield path, absent("chips", chip, names)
                elif rows and pin not in rows:
                    yield path, f'"{chip}" has no pin "{pin}"; {among(pin, rows, "it has")}'
                if pin not in rows:
                    continue
                row = rows[pin]
                yield from self._own(path, name, f'net "{net.name}"')
                if found and row.width != found[0].width:
                    width = found[0].width
                    yield path, f'"{name}" has {row.width} wires, "{net.pins[0]}" has {width}'
                found.append(row)
                if row.direction == "out" and output:
                    yield (
                        path,
                        f'"{name}" and "{output}" are both outputs and would always fight; join an'
                        " output to inputs or to open-drain pins",
                    )
                elif row.direction == "out":
                    output = name

    def _pin_rows(self, chip: str) -> Iterable[PinRow]:
        return self._parts[chip].pin_rows if chip in self._parts else ()

    def _outputs(self, chips: Iterable[str], but: str = "in") -> list[str]:
        """Return the single wires of some chips that neither strobe nor oscillate."""
        return [
            f"{chip}.{row.name}"
            for chip in chips
            for row in self._pin_rows(chip)
            if row.direction != but and row.width == 1 and not (row.strobe or row.wave)
        ]

    def _wiring(self) -> Generator[tuple[Path, str], None, Mapping[str, tuple[str, ...]]]:
        """Check glue and pin maps; return the outputs of each part of glue."""
        from vbus.board.check.glue_checks import check_glue
        from vbus.board.check.pin_map_checks import PinMapChecks

        ends = check_glue(self._file, self._parts, self._source)
        self._pin_maps: PinMapChecks = PinMapChecks(
            self._parts, self._known("chips"), self._file, ends
        )
        for section in self._file.pinmaps:
            yield from self._pin_maps.check(section)
        return ends.outputs

    # -- cards --------------------------------------------------------------------------------

    def _card(self, card: CardSection, path: Path) -> Mistakes:
        from vbus.board.check.glue_checks import check_card

        yield from check_card(card, self._known("chips"), self._file.glue)
        known = [cards.decodes(self._parts[name]) for name in card.chips if name in self._parts]
        wrong = [circuits for circuits in known if card.decode not in circuits]
        for circuits in wrong if card.decode else ():
            yield (*path, "decode"), unknown(card.decode, circuits)
        if card.bus and card.decoded and not wrong and len(known) == len(card.chips):
            yield from self._beside(card, path)
        yield from self._card_circuit(card, path)
        if card.line:
            yield from self._card_line(card, path)
        offsets: dict[int, int] = {}
        for place, port in enumerate(card.ports):
            where: Path = (*path, "ports", place)
            if port.chip not in self._known("chips"):
                continue
            row = offsets.setdefault(port.offset, place)
            if row != place:
                message = f"offset {port.offset} is decoded by row {row + 1} already"
                yield (*where, "offset"), message
            chip = self._parts.get(port.chip)
            if chip is not None and port.address not in (there := cards.addresses(chip)):
                yield (
                    (*where, "address"),
                    f'found {port.address}; addresses of "{port.chip}" are 0 to {max(there)}',
                )

    def _beside(self, card: CardSection, path: Path) -> Mistakes:
        """Check that no register of a card stands where a chip answers by its table."""
        taken = {r.offset: name for name, rows in cards.rows_of(card, self._parts) for r in rows}
        for row in card.registers:
            if row.at in taken:
                chip = quoted(taken[row.at])
                message = f"{chip} answers at {row.at} already; move the register, or the chip"
                yield (*path, "registers", row.name, "at"), message

    def _card_circuit(self, card: CardSection, path: Path) -> Mistakes:
        if card.fixed % 4096:
            yield (*path, "fixed"), f"found {card.fixed}; a page begins at 4096 times n"
        if card.has_circuit and card.name in self._known("chips"):
            yield (
                path,
                f"a chip is called {quoted(card.name)} too; its interrupt has pins of its own"
                f' ("{card.name}./INT"): give the card another name',
            )

    def _interrupts(self, card: CardSection, glue: Mapping[str, tuple[str, ...]]) -> Mistakes:
        """Check the outputs that interrupt; ``glue`` has those of each part."""
        path: Path = ("cards", card.name, "interrupt")
        chips = self._known("chips")
        for output, name in zip(card.interrupt.split(), card.interrupting, strict=True):
            if name not in chips and name not in glue:
                yield path, absent("chips", name, chips)
                continue
            if name not in chips and card.has_circuit:
                yield (
                    path,
                    f"{quoted(output)} is an output of glue: make the flip-flop or the shared line"
                    ' of glue too, and leave out "acknowledge" and "line"',
                )
            known = glue[name] if name in glue else self._outputs([name])
            if (name in self._parts or name in glue) and output.removeprefix("!") not in known:
                yield path, f"found {quoted(output)}; outputs are {listed(known)}"
            elif output.startswith("!") and card.has_circuit:
                yield (path, f'{quoted(output)}: "acknowledge" and "line" turn no output round')

    def _card_line(self, card: CardSection, path: Path) -> Mistakes:
        if any(net.name == card.line for net in self._file.nets):
            message = f"there is a net {quoted(card.line)} already; choose another name"
            yield (*path, "line"), message
        others = [other for other in self._file.cards if other.line == card.line]
        # A line with one card on it is most often a misspelt one.
        if len(others) < 2:
            hint = suggestion(card.line, {one.line for one in self._file.cards} - {card.line})
            yield (
                (*path, "line"),
                f"no other card is on line {quoted(card.line)}; {hint}a line is shared by two cards"
                " or more",
            )
        elif others[0].sense != card.sense:
            yield (
                (*path, "sense"),
                f"card {quoted(others[0].name)} senses the {others[0].sense} of the same line;"
                " cards on one line have one sense",
            )

    # -- hosts --------------------------------------------------------------------------------

    def _hosts(self) -> Mistakes:
        links: dict[str, int] = {}
        for place, host in enumerate(self._file.hosts):
            path: Path = ("hosts", place)
            # One that could not be read; a blank stands there, so that the others keep their
            # numbers.
            if not host.transport:
                continue
            scheme, colon, _ = host.transport.partition(":")
            if not colon:
                yield (
                    (*path, "transport"),
                    f"found {quoted(host.transport)}; write SCHEME:ADDRESS, such as"
                    ' "pty:$VBUS_RUNTIME/x" or "tcp:5000"',
                )
            elif scheme not in plugins.names(plugins.TRANSPORTS):
                likely = plugins.known(plugins.TRANSPORTS, scheme)
                yield (*path, "transport"), f"found {quoted(scheme)}; {likely}"
            # The network is one link for any number of hosts.
            if host.transport in links and scheme != NETWORK_SCHEME:
                yield (
                    (*path, "transport"),
                    f'"{host.transport}" is the link of hosts[{links[host.transport] + 1}] already;'
                    " every host needs one of its own",
                )
            links.setdefault(host.transport, place)
            reached = list(host.chips) or self._known("chips")
            if len(reached) > MOST_CHIPS:
                message = f"it reaches {len(reached)} chips; a session selects {MOST_CHIPS} at most"
                yield path, message
            yield from self._behind_card((*path, "card"), host.card, reached)
            for section in self._file.pinmaps:
                if section.name == host.pinmap:
                    yield from self._pin_maps.host((*path, "pinmap"), host, section, reached)
            yield from self._serial_line(host, path, scheme)

    def _behind_card(self, path: Path, name: str, reached: list[str]) -> Mistakes:
        for card in self._file.cards:
            for verb, chips in (
                ("decodes to", card.decoded), ("is interrupted by", card.interrupting),
            ):  # fmt: skip
                for chip in chips:
                    if card.name == name and chip in self._known("chips") and chip not in reached:
                        yield (
                            path,
                            f'card "{name}" {verb} "{chip}", which is not among the chips of this'
                            f" host: {listed(reached)}",
                        )

    def _serial_line(self, host: HostSection, path: Path, scheme: str) -> Mistakes:
        if host.baud and scheme in _TIMELESS:
            yield (*path, "baud"), f"{_TIMELESS[scheme]}; take baud out"
        elif host.baud and self._file.board.time == "slaved":
            yield (
                (*path, "baud"),
                "on a slaved board the host's own time stamps say when things happen; take baud"
                " out",
            )
        elif not host.baud and host.frame != USUAL_FRAME:
            yield (*path, "frame"), "frames take no time without baud; write baud = 9600"
        pins: list[tuple[Path, str, str]] = [
            ((*path, key, number), name, "out")
            for key, names in host.driven.items()
            for number, name in enumerate(names)
        ]
        pins += [((*path, key), name, "") for key, name in host.sensed.items() if name]
        for where, name, wrong in pins:
            # At the key: one sentence for all the pins in its list.
            if scheme not in MODEM_SCHEMES:
                yield (
                    where[:3],
                    f"{scheme} carries no modem lines and no break; write a transport that does:"
                    f" {listed(MODEM_SCHEMES)}",
                )
            elif self._file.nodes:
                yield where[:3], "modem lines are for boards without nodes"
            elif name not in (fit := self._outputs(host.chips or self._parts, wrong)):
                yield where, f"found {quoted(name)}; it may be {listed(fit)}"

    # -- rules --------------------------------------------------------------------------------

    def _violations(self) -> Mistakes:
        wanted = [name for name in self._file.violations if name != "default"]
        own = [*circuit.RULES, *(r for c in self._parts.values() for r in c.RULES)]
        known = rule_names(rule.name for rule in own)
        # Rules of other families are for a hint alone: that loads every plug-in.
        if all(name in known for name in wanted):
            return
        known |= rule_names(rule.name for rule in all_rules())
        for name in wanted:
            if name not in known:
                yield ("violations", name), f"unknown rule; {rule_hint(name, known)}"


def all_rules() -> list[Rule]:
    """Return every rule of the board and of every chip that is registered, sorted by name.

    Chips whose plug-in is broken are left out.
    """
    rules = {rule.name: rule for rule in circuit.RULES}
    for chip in plugins.chip_classes():
        rules.update({rule.name: rule for rule in chip.RULES})
    return [rules[name] for name in sorted(rules)]
