"""What a board file may say: its sections as frozen structs, each key with its title and unit.

These declarations are what the reader checks against, what its messages list, and what the pages
of ``docs/board-file`` are made from. The keys a chip or plant adds stand in its own ``OPTIONS``.
"""

from typing import Annotated, Final

from vbus.boardfile.cards import CardSection
from vbus.boardfile.key import NAMES, GlueSection, Section
from vbus.boardfile.key import key as _key
from vbus.options import Value
from vbus.protocols.serial_line import FRAMES, USUAL_FRAME

TIMES: Final = ("realtime", "lockstep", "slaved")
LEVELS: Final = ("off", "warn", "strict")
RESTS: Final = ("low", "high", "keep")

NO_PLANT: Final = "none"
"""In place of a plant's name: nothing is behind the axis, or nets drive its encoder inputs."""


class BoardSection(Section, frozen=True, kw_only=True):
    """``[board]``: the whole board, and how its time passes."""

    name: Annotated[str, _key("text", "name of the board; else the name of the file")] = ""
    time: Annotated[
        str,
        _key(
            "choice",
            "what moves time: the wall clock, the bus cycles, or the host's own time stamps",
            TIMES,
        ),
    ] = "realtime"
    rate: Annotated[
        float, _key("rate", "chip seconds per second of wall time (real time only)", low=0.001)
    ] = 1.0
    clock_step: Annotated[
        int, _key("s", "how far reading a clock moves time (lockstep and slaved)", low=1)
    ] = 1_000_000
    stall: Annotated[
        str,
        _key(
            "choice",
            "after the machine was too slow: make up the lost time, or leave it out",
            ("catch_up", "slip"),
        ),
    ] = "catch_up"
    seed: Annotated[int, _key("count", "seed of everything random", low=0, high=(1 << 63) - 1)] = 0
    power_on: Annotated[
        str,
        _key(
            "choice",
            "start with the reset that follows power-on, or with the reset over",
            ("reset", "done"),
        ),
    ] = "reset"


class ChipSection(Section, frozen=True, kw_only=True):
    """``[chips.NAME]``: one chip; the part adds keys of its own."""

    name: str
    part: Annotated[str, _key("text", "part number as ordered")]
    clock: Annotated[int, _key("Hz", "frequency at the CLK pin", low=1)]
    plant: Annotated[
        str, _key("text", 'the plant of a part with one axis; "none": no mechanics')
    ] = ""
    plants: Annotated[
        tuple[str, ...], _key(NAMES, "the plants of a part with several axes, in order")
    ] = ()
    node: Annotated[str, _key("text", "the node of the chip, on a board that has nodes")] = ""
    settings: dict[str, Value] = {}

    @property
    def axes(self) -> tuple[str, ...]:
        """The plants by axis, however they were written."""
        return (self.plant,) if self.plant else self.plants


class SwitchSection(Section, frozen=True, kw_only=True):
    """``[plants.NAME.switches.SWITCH]``: a home or limit switch on the way of an axis."""

    first: Annotated[int, _key("count", "first encoder count at which it is closed")]
    last: Annotated[int, _key("count", "last encoder count at which it is closed")]
    closed: Annotated[str, _key("choice", "electrical level while closed", ("low", "high"))] = "low"


class PlantSection(Section, frozen=True, kw_only=True):
    """``[plants.NAME]``: motor, load and encoder; the model adds keys of its own."""

    name: str
    model: Annotated[str, _key("text", "model of the mechanics, such as dc_motor")]
    settings: dict[str, Value] = {}
    switches: dict[str, SwitchSection] = {}


class NetSection(Section, frozen=True, kw_only=True):
    """``[nets]``: ``"NAME" = ["chip.pin", ...]``, or a table with these keys."""

    name: str
    pins: Annotated[tuple[str, ...], _key(NAMES, 'the pins soldered to it, as "chip.pin"')]
    rest: Annotated[
        str,
        _key("choice", "level while nothing drives it; else that of the first pin at rest", RESTS),
    ] = ""
    delay: Annotated[
        int, _key("s", "how long an edge takes from one node to the others", low=0)
    ] = 0


class NodeSection(Section, frozen=True, kw_only=True):
    """``[nodes.NAME]``: a part of the board that may run in a process or computer of its own."""

    name: str
    deadline: Annotated[
        int,
        _key(
            "s",
            "silence after which the other nodes give this node up (wall time)",
            low=100_000_000_000,
        ),
    ] = 3_000_000_000_000
    listen: Annotated[
        str,
        _key(
            "text",
            'where the other nodes reach it, such as "tcp/127.0.0.1:7447"; one node listens',
        ),
    ] = ""
    process: Annotated[
        str, _key("text", "nodes with the same name here share a process; else each has its own")
    ] = ""


class BusSection(Section, frozen=True, kw_only=True):
    """``[buses.NAME]``: chips that share D0-D7 and the strobes, each with its own select."""

    name: str
    chips: Annotated[tuple[str, ...], _key(NAMES, "chips of one family")]


class PinMapSection(Section, frozen=True, kw_only=True):
    """``[pinmaps.NAME]``: which port bit of a microcontroller is wired to which pins of chips."""

    name: str
    chips: Annotated[
        tuple[str, ...], _key(NAMES, "the chips that a pin without a chip's name means; else all")
    ] = ()
    low: Annotated[tuple[str, ...], _key(NAMES, "pins tied to ground")] = ()
    high: Annotated[tuple[str, ...], _key(NAMES, "pins tied to the supply")] = ()
    pins: dict[str, tuple[str, ...]] = {}


class HostSection(Section, frozen=True, kw_only=True):
    """``[[hosts]]``: a link on which a host may attach."""

    transport: Annotated[str, _key("text", 'the link, such as "pty:$VBUS_RUNTIME/x" or "tcp:5000"')]
    protocol: Annotated[
        str, _key("text", "the protocol of the link; else the usual one of such a link")
    ] = ""
    chips: Annotated[
        tuple[str, ...],
        _key(NAMES, "chips that the host reaches, in the order of SELECT's bits; else all"),
    ] = ()
    cycle: Annotated[
        int, _key("s", "duration of a whole bus cycle; 0 s: as the time policy has it", low=0)
    ] = 0
    card: Annotated[str, _key("text", "the card whose addresses the host uses")] = ""
    pinmap: Annotated[
        str, _key("text", "the pin map of a microcontroller whose port bits are the host")
    ] = ""
    remote: Annotated[
        bool,
        _key("flag", "other computers may attach (tcp and rfc2217, which ask for no password)"),
    ] = False
    awaited: Annotated[
        bool,
        _key("flag", "on a board with nodes: time does not begin before this host uses the link"),
    ] = False
    baud: Annotated[
        int,
        _key(
            "count", "bits per second of a serial line, in chip time; 0: bytes take no time", low=0
        ),
    ] = 0
    frame: Annotated[
        str, _key("choice", "data bits, parity and stop bits of the line", tuple(FRAMES))
    ] = USUAL_FRAME
    dtr: Annotated[tuple[str, ...], _key(NAMES, "pins that are low while DTR is on")] = ()
    rts: Annotated[tuple[str, ...], _key(NAMES, "pins that are low while RTS is on")] = ()
    breaks: Annotated[tuple[str, ...], _key(NAMES, "pins that are low during a break")] = ()
    reset: Annotated[
        tuple[str, ...],
        _key(NAMES, "pins that are low for change_time when DTR goes on, as on an Arduino"),
    ] = ()
    change_time: Annotated[
        int,
        _key("s", "how long a change of DTR, RTS or break takes before anything follows", low=0),
    ] = 1_000_000_000
    cts: Annotated[str, _key("text", "pin that turns CTS on while it is low; else it is on")] = ""
    dsr: Annotated[str, _key("text", "pin that turns DSR on while it is low; else it is on")] = ""

    @property
    def driven(self) -> dict[str, tuple[str, ...]]:
        """The pins that follow the host's own lines, by key."""
        return {"dtr": self.dtr, "rts": self.rts, "breaks": self.breaks, "reset": self.reset}

    @property
    def sensed(self) -> dict[str, str]:
        """The pins the host's input lines follow, by key."""
        return {"cts": self.cts, "dsr": self.dsr}


class ZenohSection(Section, frozen=True, kw_only=True):
    """``[zenoh]``: where the board is on the network, and who may use it."""

    listen: Annotated[
        tuple[str, ...],
        _key(NAMES, 'endpoints on which hosts and others connect, such as ["tcp/127.0.0.1:7447"]'),
    ] = ()
    connect: Annotated[tuple[str, ...], _key(NAMES, "endpoints of routers to connect to")] = ()
    certificate: Annotated[str, _key("text", "PEM file of the board's own certificate")] = ""
    key: Annotated[str, _key("text", "PEM file of its private key")] = ""
    authority: Annotated[
        str, _key("text", "PEM file of the authority whose certificates are accepted")
    ] = ""
    grace: Annotated[
        int, _key("s", "how long the session of a host that has vanished waits for the host", low=0)
    ] = 2_000_000_000_000
    remote: Annotated[
        bool, _key("flag", "other computers may attach without certificates, with all rights")
    ] = False
    allow: dict[str, tuple[str, ...]] | None = None


class RecordSection(Section, frozen=True, kw_only=True):
    """``[record]``: files that tell what happened."""

    journal: Annotated[
        str, _key("text", "file that takes every call of every host, for vbus replay")
    ] = ""
    durable: Annotated[
        str,
        _key(
            "choice",
            "what the journal holds whenever a host has its answer: all but the last 0.2 s, all"
            " even if the process is killed, or all even if the machine fails",
            ("no", "process", "machine"),
        ),
    ] = "no"
    report: Annotated[
        str,
        _key("text", "file that takes the violations at the end: .txt, .json, .xml or .sarif"),
    ] = ""
    suppress: Annotated[
        str, _key("text", "file of violations that are accepted, each with a reason")
    ] = ""
    coverage: Annotated[
        str,
        _key("text", "file that takes what hosts exercise, at the end: .txt, .json, .html, .xml"),
    ] = ""


class MetricsSection(Section, frozen=True, kw_only=True):
    """``[metrics]``: numbers for Prometheus."""

    listen: Annotated[
        str,
        _key("text", 'address such as "127.0.0.1:9100", port 0 for any free one; else none'),
    ] = ""
    remote: Annotated[bool, _key("flag", "other computers may be let in")] = False


class ScopeSection(Section, frozen=True, kw_only=True):
    """``[scope]``: the board in a browser."""

    listen: Annotated[
        str,
        _key(
            "text", 'address of the page, such as "127.0.0.1:0", port 0 for any free one; else none'
        ),
    ] = ""
    remote: Annotated[
        bool, _key("flag", "other computers may open the page; needs a certificate")
    ] = False
    certificate: Annotated[str, _key("text", "file of the certificate for TLS (PEM)")] = ""
    key: Annotated[str, _key("text", "file of its key (PEM)")] = ""
    sparse: Annotated[
        bool, _key("flag", "in real time, record four samples a second while no page is open")
    ] = False


class WaveSection(Section, frozen=True, kw_only=True):
    """``[waves.NAME]``: a waveform file."""

    name: str
    file: Annotated[str, _key("text", "the VCD file")]
    profile: Annotated[
        str,
        _key(
            "choice",
            "vectors, values and packets for GTKWave and Surfer; or single bits for sigrok",
            ("full", "sigrok"),
        ),
    ] = "full"
    signals: Annotated[
        tuple[str, ...],
        _key(NAMES, 'patterns such as "x.*"; else the buses and all pins but fast ones'),
    ] = ()
    trigger: Annotated[
        str, _key("text", "condition at which recording begins; else it begins at once")
    ] = ""
    before: Annotated[int, _key("s", "how much to show from before the trigger", low=0)] = 0
    duration: Annotated[int, _key("s", "how long to record; 0 s: to the end", low=0)] = 0
    sample: Annotated[
        int, _key("s", "interval at which values such as positions are sampled", low=1_000_000)
    ] = 1_000_000_000


class FaultSection(Section, frozen=True, kw_only=True):
    """``[[faults]]``: a fault that is armed from the beginning; it adds keys of its own."""

    fault: Annotated[str, _key("text", "name of the fault, such as jam")]
    target: Annotated[
        str, _key("text", 'chip "x", axis "x.2" or link "host0"; may be left out if there is one')
    ] = ""
    when: Annotated[
        str, _key("text", 'trigger at which it begins, such as "at 5 ms"; else now')
    ] = ""
    until: Annotated[str, _key("text", 'when it ends, such as "for 2 ms"; else as is usual')] = ""
    settings: dict[str, Value] = {}
    place: int = 0
    """Which of the file's ``[[faults]]`` it is."""


NO_HOST: Final = HostSection(transport="")
"""Stands for a host that could not be read, so that the others keep their places."""


class BoardFile(Section, frozen=True, kw_only=True):
    """A whole board file, checked: names resolve, quantities are plain numbers."""

    path: str
    board: BoardSection
    violations: dict[str, str]
    chips: tuple[ChipSection, ...]
    plants: tuple[PlantSection, ...]
    nets: tuple[NetSection, ...]
    glue: tuple[GlueSection, ...] = ()
    buses: tuple[BusSection, ...]
    cards: tuple[CardSection, ...]
    pinmaps: tuple[PinMapSection, ...]
    hosts: tuple[HostSection, ...]
    record: RecordSection = RecordSection()
    waves: tuple[WaveSection, ...] = ()
    nodes: tuple[NodeSection, ...] = ()
    zenoh: ZenohSection = ZenohSection()
    metrics: MetricsSection = MetricsSection()
    scope: ScopeSection = ScopeSection()
    faults: tuple[FaultSection, ...] = ()

    @property
    def has_glue(self) -> bool:
        """Whether there is glue, be it a card's own."""
        return bool(self.glue) or any(card.bus for card in self.cards)
