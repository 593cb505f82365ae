"""What a board file may say: its sections as frozen structs, each key with its title and unit.

These declarations are what the reader checks against, what its messages list, and what the pages
of ``docs/board-file`` are made from. The keys a chip or plant adds stand in its own ``OPTIONS``.
"""

import re
from collections.abc import Iterator
from typing import Annotated, Final

from vbus import plugins
from vbus.boardfile.cards import CardSection
from vbus.boardfile.key import NAME, Further, Kinds, Names, Section, Wires, row
from vbus.chips.base import Chip
from vbus.core.errors import ConfigError
from vbus.core.options import Option, Value
from vbus.core.signals.axis import SWITCHES
from vbus.core.values.settings import among, quoted
from vbus.protocols.serial_line import FRAMES, USUAL_FRAME

TIMES: Final = ("realtime", "lockstep", "slaved")
LEVELS: Final = ("off", "warn", "strict")
RESTS: Final = ("low", "high", "keep")
CPU_FAMILIES: Final = ("stm32f1", "stm32f4")


NO_PLANT: Final = "none"
"""In place of a plant's name: nothing is behind the axis, or nets drive its encoder inputs."""


class BoardSection(Section, frozen=True, kw_only=True):
    """``[board]``: the whole board, and how its time passes."""

    name: Annotated[str, row("name of the board; else the name of the file", NAME)] = ""
    time: Annotated[str, row(
        "what moves time: the wall clock, the bus cycles, or the host's own time stamps",
        choices=TIMES)] = "realtime"  # fmt: skip
    rate: Annotated[
        float, row("chip seconds per second of wall time (real time only)", "rate", low=0.001)
    ] = 1.0
    clock_step: Annotated[
        int, row("how far reading a clock moves time (lockstep and slaved)", "s", low=1)
    ] = 1_000_000
    stall: Annotated[str, row(
        "after the machine was too slow: make up the lost time, or leave it out",
        choices=("catch_up", "slip"))] = "catch_up"  # fmt: skip
    seed: Annotated[int, row("seed of everything random", low=0, high=(1 << 63) - 1)] = 0
    power_on: Annotated[str, row(
        "start with the reset that follows power-on, or with the reset over",
        choices=("reset", "done"))] = "reset"  # fmt: skip


def _parts() -> Iterator[Further]:
    names: dict[type[Chip], list[str]] = {}
    for name in plugins.names(plugins.CHIPS):
        names.setdefault(plugins.chip_class(name), []).append(re.escape(name))
    return ((f"^({'|'.join(own)})", chip.PARTS, chip.OPTIONS) for chip, own in names.items())


class ChipSection(Section, frozen=True, kw_only=True):
    """``[chips.NAME]``: one chip; the part adds keys of its own."""

    KINDS = Kinds("part", lambda part: plugins.chip_class(part).OPTIONS, _parts)
    name: str
    part: Annotated[str, row("part number as ordered")]
    clock: Annotated[int, row("frequency at the CLK pin", "Hz", low=1)]
    plant: Annotated[str, row(
        'the plant of a part with one axis; "none": no mechanics',
        ref="plants|none")] = ""  # fmt: skip
    plants: Annotated[
        Names, row("the plants of a part with several axes, in order", ref="plants|none")
    ] = ()
    node: Annotated[str, row("the node of the chip, on a board that has nodes", ref="nodes")] = ""
    settings: dict[str, Value] = {}

    @property
    def axes(self) -> tuple[str, ...]:
        """The plants by axis, however they were written."""
        return (self.plant,) if self.plant else self.plants


class SwitchSection(Section, frozen=True, kw_only=True):
    """``[plants.NAME.switches.SWITCH]``: a home or limit switch on the way of an axis."""

    first: Annotated[int, row("first encoder count at which it is closed")]
    last: Annotated[int, row("last encoder count at which it is closed")]
    closed: Annotated[str, row("electrical level while closed", choices=("low", "high"))] = "low"


def _models() -> Iterator[Further]:
    for name in plugins.names(plugins.PLANTS):
        model = plugins.plant_class(name)
        file = "(:.+)?" if plugins.has_file(model) else ""
        yield f"^{re.escape(name)}{file}$", (name,), model.OPTIONS


class PlantSection(Section, frozen=True, kw_only=True):
    """``[plants.NAME]``: motor, load and encoder; the model adds keys of its own."""

    KINDS = Kinds("model", lambda model: plugins.plant_class(model).OPTIONS, _models)
    name: str
    model: Annotated[str, row("model of the mechanics, such as dc_motor")]
    settings: dict[str, Value] = {}
    switches: Annotated[dict[str, SwitchSection], row("switch", choices=SWITCHES)] = {}


class NetSection(Section, frozen=True, kw_only=True):
    """``[nets]``: ``"NAME" = ["chip.pin", ...]``, or a table with these keys."""

    SHORT = "pins"
    ANY_NAME = True
    name: str
    pins: Annotated[Names, row('the pins soldered to it, as "chip.pin"')]
    rest: Annotated[str, row(
        "level while nothing drives it; else that of the first pin at rest",
        choices=RESTS)] = ""  # fmt: skip
    delay: Annotated[int, row("how long an edge takes from one node to the others", "s", low=0)] = 0


class NodeSection(Section, frozen=True, kw_only=True):
    """``[nodes.NAME]``: a part of the board that may run in a process or computer of its own."""

    name: str
    deadline: Annotated[int, row(
        "silence after which the other nodes give this node up (wall time)",
        "s", low=100_000_000_000)] = 3_000_000_000_000  # fmt: skip
    listen: Annotated[
        str, row('where the other nodes reach it, such as "tcp/127.0.0.1:7447"; one node listens')
    ] = ""
    process: Annotated[
        str, row("nodes with the same name here share a process; else each has its own", NAME)
    ] = ""


class BusSection(Section, frozen=True, kw_only=True):
    """``[buses.NAME]``: chips that share D0-D7 and the strobes, each with its own select."""

    name: str
    chips: Annotated[Names, row("chips of one family", ref="chips")]


class PinMapSection(Section, frozen=True, kw_only=True):
    """``[pinmaps.NAME]``: which port bit of a microcontroller is wired to which pins of chips."""

    name: str
    chips: Annotated[
        Names, row("the chips that a pin without a chip's name means; else all", ref="chips")
    ] = ()
    low: Annotated[Names, row("pins tied to ground")] = ()
    high: Annotated[Names, row("pins tied to the supply")] = ()
    pins: Wires = {}


class HostSection(Section, frozen=True, kw_only=True):
    """``[[hosts]]``: a link on which a host may attach."""

    transport: Annotated[str, row('the link, such as "pty:$VBUS_RUNTIME/x" or "tcp:5000"')]
    protocol: Annotated[str, row(
        "the protocol of the link; else the usual one of such a link",
        ref=plugins.PROTOCOLS)] = ""  # fmt: skip
    chips: Annotated[Names, row(
        "chips that the host reaches, in the order of SELECT's bits; else all",
        ref="chips")] = ()  # fmt: skip
    cycle: Annotated[
        int, row("how long a bus cycle takes; 0 s: 1 us, in real time the chip's least", "s", low=0)
    ] = 0
    card: Annotated[str, row("the card whose addresses the host uses", ref="cards")] = ""
    pinmap: Annotated[
        str, row("the pin map of a microcontroller whose port bits are the host", ref="pinmaps")
    ] = ""
    remote: Annotated[
        bool, row("other computers may attach (tcp and rfc2217, which ask for no password)")
    ] = False
    awaited: Annotated[
        bool, row("on a board with nodes: time does not begin before this host uses the link")
    ] = False
    baud: Annotated[
        int, row("bits per second of a serial line, in chip time; 0: bytes take no time", low=0)
    ] = 0
    frame: Annotated[
        str, row("data bits, parity and stop bits of the line", choices=tuple(FRAMES))
    ] = USUAL_FRAME
    dtr: Annotated[Names, row("pins that are low while DTR is on")] = ()
    rts: Annotated[Names, row("pins that are low while RTS is on")] = ()
    breaks: Annotated[Names, row("pins that are low during a break")] = ()
    reset: Annotated[
        Names, row("pins that are low for change_time when DTR goes on, as on an Arduino")
    ] = ()
    change_time: Annotated[int, row(
        "how long a change of DTR, RTS or break takes before anything follows",
        "s", low=0)] = 1_000_000_000  # fmt: skip
    cts: Annotated[str, row("pin that turns CTS on while it is low; else it is on")] = ""
    dsr: Annotated[str, row("pin that turns DSR on while it is low; else it is on")] = ""

    @property
    def driven(self) -> Wires:
        """The pins that follow the host's own lines, by key."""
        return {"dtr": self.dtr, "rts": self.rts, "breaks": self.breaks, "reset": self.reset}

    @property
    def sensed(self) -> dict[str, str]:
        """The pins the host's input lines follow, by key."""
        return {"cts": self.cts, "dsr": self.dsr}


class ZenohSection(Section, frozen=True, kw_only=True):
    """``[zenoh]``: where the board is on the network, and who may use it."""

    listen: Annotated[
        Names, row('endpoints on which hosts and others connect, such as ["tcp/127.0.0.1:7447"]')
    ] = ()
    connect: Annotated[Names, row("endpoints of routers to connect to")] = ()
    certificate: Annotated[
        str, row("PEM file of the board's own certificate", needs="key authority")
    ] = ""
    key: Annotated[str, row("PEM file of its private key", needs="certificate authority")] = ""
    authority: Annotated[str, row(
        "PEM file of the authority whose certificates are accepted",
        needs="certificate key")] = ""  # fmt: skip
    grace: Annotated[
        int, row("how long the session of a host that has vanished waits for the host", "s", low=0)
    ] = 2_000_000_000_000
    remote: Annotated[
        bool, row("other computers may attach without certificates, with all rights")
    ] = False
    allow: Wires | None = None


class RecordSection(Section, frozen=True, kw_only=True):
    """``[record]``: files that tell what happened."""

    journal: Annotated[str, row("file that takes every call of every host, for vbus replay")] = ""
    durable: Annotated[str, row(
        "what the journal holds whenever a host has its answer: all but the last 0.2 s, all even "
        "if the process is killed, or all even if the machine fails",
        choices=("no", "process", "machine"))] = "no"  # fmt: skip
    report: Annotated[
        str, row("file that takes the violations at the end: .txt, .json, .xml or .sarif")
    ] = ""
    suppress: Annotated[str, row("file of violations that are accepted, each with a reason")] = ""
    coverage: Annotated[
        str, row("file that takes what hosts exercise, at the end: .txt, .json, .html, .xml")
    ] = ""


class MetricsSection(Section, frozen=True, kw_only=True):
    """``[metrics]``: numbers for Prometheus."""

    listen: Annotated[
        str, row('address such as "127.0.0.1:9100", port 0 for any free one; else none')
    ] = ""
    remote: Annotated[bool, row("other computers may be let in")] = False


class ScopeSection(Section, frozen=True, kw_only=True):
    """``[scope]``: the board in a browser."""

    listen: Annotated[
        str, row('address of the page, such as "127.0.0.1:0", port 0 for any free one; else none')
    ] = ""
    remote: Annotated[bool, row("other computers may open the page; needs a certificate")] = False
    certificate: Annotated[str, row("file of the certificate for TLS (PEM)", needs="key")] = ""
    key: Annotated[str, row("file of its key (PEM)", needs="certificate")] = ""
    sparse: Annotated[
        bool, row("in real time, record four samples a second while no page is open")
    ] = False


class WaveSection(Section, frozen=True, kw_only=True):
    """``[waves.NAME]``: a waveform file."""

    name: str
    file: Annotated[str, row("the VCD file")]
    profile: Annotated[str, row(
        "vectors, values and packets for GTKWave and Surfer; or single bits for sigrok",
        choices=("full", "sigrok"))] = "full"  # fmt: skip
    signals: Annotated[
        Names, row('patterns such as "x.*"; else the buses and all pins but fast ones')
    ] = ()
    trigger: Annotated[str, row("condition at which recording begins; else it begins at once")] = ""
    before: Annotated[int, row("how much to show from before the trigger", "s", low=0)] = 0
    duration: Annotated[int, row("how long to record; 0 s: to the end", "s", low=0)] = 0
    sample: Annotated[
        int, row("interval at which values such as positions are sampled", "s", low=1_000_000)
    ] = 1_000_000_000


def _fault_keys(name: str) -> tuple[Option, ...]:
    from vbus.faults.table import faults

    known = faults()
    if name not in known:
        raise ConfigError(f"there is no fault {quoted(name)}; {among(name, known, 'known are')}")
    return known[name].parameters


def _faults() -> Iterator[Further]:
    from vbus.faults.table import faults

    return ((f"^{re.escape(name)}$", (name,), row.parameters) for name, row in faults().items())


class FaultSection(Section, frozen=True, kw_only=True):
    """``[[faults]]``: a fault that is armed from the beginning; it adds keys of its own."""

    KINDS = Kinds("fault", _fault_keys, _faults)
    fault: Annotated[str, row("name of the fault, such as jam")]
    target: Annotated[
        str, row('chip "x", axis "x.2" or link "host0"; may be left out if there is one')
    ] = ""
    when: Annotated[str, row('trigger at which it begins, such as "at 5 ms"; else now')] = ""
    until: Annotated[str, row('when it ends, such as "for 2 ms"; else as is usual')] = ""
    settings: dict[str, Value] = {}
    place: int = 0
    """Which of the file's ``[[faults]]`` it is."""


NO_HOST: Final = HostSection.blank()
"""Stands for a host that could not be read, so that the others keep their places."""


class GlueSection(Section, frozen=True, kw_only=True):
    """``[glue.NAME]``: one part; ``pins`` and ``equations`` say what its pins are wired to."""

    name: str
    part: Annotated[str, row('part number without package, such as "74HC138"; "PLD": equations')]
    delay: Annotated[
        int, row("how long its outputs take to follow its inputs", "s", low=0, high=10**15)
    ] = 0
    low: Annotated[Names, row("its inputs that are tied to ground")] = ()
    high: Annotated[Names, row("its inputs that are tied to the supply")] = ()
    hosts: Annotated[Names, row('its pins that hosts drive or see, as side pins "NAME.pin"')] = ()
    pins: Wires = {}
    equations: dict[str, Annotated[str, row('write an equation in quotes, such as "A & !B"')]] = {}


class CpuSection(Section, frozen=True, kw_only=True):
    """``[cpu]``: clock, memory and peripherals of a processor that an emulator runs."""

    clock: Annotated[int, row("clock of the processor", "Hz", low=0)] = 0
    cycles: Annotated[int, row("clock cycles that each instruction takes", low=1, high=1000)] = 1
    access: Annotated[int, row(
        "clock cycles that each byte on the bus of its card takes on top",
        low=0, high=1000)] = 4  # fmt: skip
    family: Annotated[str, row(
        "whose peripherals a Cortex-M has; else stm32f1 with cortex-m3, stm32f4 with cortex-m4",
        choices=CPU_FAMILIES)] = ""  # fmt: skip
    rom: Annotated[int, row("where the program memory begins; 0: where it usually is", low=0)] = 0
    rom_size: Annotated[int, row("its size in bytes; 0: as usual", low=0, high=1 << 28)] = 0
    ram: Annotated[int, row("where the RAM begins; 0: where it usually is", low=0)] = 0
    ram_size: Annotated[int, row("its size in bytes; 0: as usual", low=0, high=1 << 28)] = 0
    vectors: Annotated[
        int, row("address of the vector table; 0: the beginning of the program memory", low=0)
    ] = 0
    uart: Annotated[
        int, row("address of the serial port (MC68681, channel A) of a 68000; 0: none", low=0)
    ] = 0


class BoardFile(Section, frozen=True, kw_only=True):
    """A whole board file, checked: names resolve, quantities are plain numbers."""

    path: str
    board: BoardSection = BoardSection()
    violations: dict[str, Annotated[str, row("", choices=LEVELS)]] = {}
    chips: tuple[ChipSection, ...] = ()
    plants: tuple[PlantSection, ...] = ()
    nets: tuple[NetSection, ...] = ()
    glue: tuple[GlueSection, ...] = ()
    buses: tuple[BusSection, ...] = ()
    cards: tuple[CardSection, ...] = ()
    pinmaps: tuple[PinMapSection, ...] = ()
    cpu: CpuSection = CpuSection()
    nodes: tuple[NodeSection, ...] = ()
    hosts: tuple[HostSection, ...] = ()
    record: RecordSection = RecordSection()
    waves: tuple[WaveSection, ...] = ()
    zenoh: ZenohSection = ZenohSection()
    metrics: MetricsSection = MetricsSection()
    scope: ScopeSection = ScopeSection()
    faults: tuple[FaultSection, ...] = ()

    @property
    def has_glue(self) -> bool:
        """Whether there is glue, be it a card's own."""
        return bool(self.glue) or any(card.bus for card in self.cards)
