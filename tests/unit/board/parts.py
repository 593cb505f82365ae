"""Parts of an invented maker, so that whole messages can be tested without a real chip's tables."""

from tests.unit.board.toy import Toy
from vbus.chips.family import Family
from vbus.chips.tables import CardRow, PinRow
from vbus.core.entry_points import EntryPoint
from vbus.core.options import Option
from vbus.core.signals import Plant, Rule

HERE = "tests.unit.board.parts"


class Acme(Toy):
    FAMILY = "acme"
    PARTS = ("ACME-1", "ACME-2")
    PINS = (
        *Toy.PINS,
        PinRow("/RST", "in"),
        PinRow("/SYNC", "od"),
        PinRow("READY", "out"),
    )
    RULES = (*Toy.RULES, Rule("acme.slow", "ACME-1", "Look at least once a second."))
    OPTIONS = (
        Option("busy_clk", "count", 120, "length of the busy pulse", low=1, high=800),
        Option("mode", "choice", "plain", "how it counts", ("plain", "gray")),
        Option("settle", "s", 5_000_000, "time to settle", low=1_000_000, high=10**9),
        Option("gain", "ratio", 1.0, "gain of the input", low=0.5),
        Option("swap", "flag", False, "swap A and B"),
        Option("label", "text", "", "what is printed on it"),
    )
    CARD_DECODES = {
        "isa": (CardRow(0, 0, 0), CardRow(2, write=1), CardRow(4, read=1, bits=0x80)),
        "reset": (CardRow(0, 0, 0), CardRow(1, write=2)),
    }

    def connect(self, axis: int, plant: Plant) -> None:
        if "drive" not in plant.TAKES:
            raise ValueError(f"{self.part} gives a servo command; this plant takes step pulses")
        self.plants: dict[int, Plant] = {**getattr(self, "plants", {}), axis: plant}

    def power_on(self, done: bool) -> None:
        self.powered = "done" if done else "reset"


class Twin(Acme):
    FAMILY = "twin"
    AXES = 2
    PARTS = ("TWIN-1",)
    OPTIONS = (Option("seed", "count", 0, "seed of its jitter"),)


class Grumpy(Acme):
    PARTS = ()
    OPTIONS = ()

    def __init__(self, *args, **kwargs) -> None:  # type: ignore[no-untyped-def]
        super().__init__(*args, **kwargs)
        if self.clock.hz > 6_000_000:
            raise ValueError("GRUMPY runs at 6 MHz at most")


class Motor(Plant):
    OPTIONS = (
        Option("supply", "V", None, "supply of the amplifier", low=1, high=60),
        Option("inertia", "kg*m^2", 1e-6, "inertia of rotor and load"),
        Option("lines", "count", 500, "lines of the encoder", low=1),
    )


class Steps(Plant):
    TAKES = ("pulses",)


NOT_A_CHIP = 3

FAMILY = Family(
    "acme",
    chip="parts:Acme",
    home="tests.unit.board",
    upsets="parts:Motor",
    packets="no_such_module:Packets",
    host="parts:NOT_A_CHIP",
)

ENTRIES = {
    "vbus.chips": {
        "ACME": f"{HERE}:Acme",
        "TWIN": f"{HERE}:Twin",
        "GRUMPY": f"{HERE}:Grumpy",
        "BROKEN": "tests.unit.board.no_such_module:Chip",
        "ODD": f"{HERE}:NOT_A_CHIP",
    },
    "vbus.plants": {"motor": f"{HERE}:Motor", "steps": f"{HERE}:Steps"},
    "vbus.protocols": {"byte": f"{HERE}:NOT_A_CHIP", "text": f"{HERE}:NOT_A_CHIP"},
    "vbus.transports": dict.fromkeys(("pty", "rfc2217", "tcp"), f"{HERE}:NOT_A_CHIP"),
}


def entry_points(group: str) -> list[EntryPoint]:
    return [EntryPoint(name, value, group) for name, value in ENTRIES[group].items()]
