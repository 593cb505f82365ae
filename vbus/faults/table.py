"""Every fault there is, family by family."""

from typing import Final

from msgspec.structs import replace

from vbus import plugins
from vbus.core.options import Option
from vbus.faults.row import AXIS, CHIP, COUNTED, LASTS, LINK, NET, ONCE, PART, WIRE, Fault
from vbus.faults.upsets import ChipFaults

_COUNTS: Final = float(1 << 30)
_LEVEL: Final = Option("level", "count", 1, "electrical level it shows", low=0, high=1)
_WAY: Final = Option(
    "cycles", "choice", "both", "the bus cycles it concerns", ("read", "write", "both")
)

MECHANICS: Final = (
    Fault("jam", "mechanics", "The shaft stands, whatever the motor does.", AXIS, LASTS),
    Fault("slip", "mechanics", "The encoder misses a share of the motion.", AXIS, LASTS,
          (Option("share", "ratio", 0.5, "share of the motion that is lost", low=0.0, high=1.0),)),
    Fault("coupling_break", "mechanics", "The motor turns and the encoder stands.", AXIS, LASTS),
    Fault("load_step", "mechanics", "A constant torque of the load is added.", AXIS, LASTS,
          (Option("torque", "N*m", 0.02, "torque; positive pulls backward"),), shaft=True),
    Fault("friction", "mechanics", "Dry and viscous friction are added.", AXIS, LASTS,
          (Option("coulomb", "N*m", 0.01, "dry friction, turning and at rest", low=0.0),
           Option("viscous", "N*m*s", 0.0, "friction that grows with speed", low=0.0)),
          shaft=True),
    Fault("backlash", "mechanics", "The encoder follows the shaft with play.", AXIS, LASTS,
          (Option("gap", "count", 20, "the play", low=1, high=_COUNTS),)),
    Fault("end_stop", "mechanics", "Something hard stands in the shaft's way.", AXIS, LASTS,
          (Option("ahead", "count", 100, "how far ahead of it; negative: behind", low=-_COUNTS,
                  high=_COUNTS),), shaft=True),
    Fault("motor_reversed", "mechanics", "The motor's wires are swapped.", AXIS, LASTS),
    Fault("supply_sag", "mechanics", "The amplifier's supply falls.", AXIS, LASTS,
          (Option("supply", "V", 6.0, "what is left of it", low=0.0),), shaft=True),
    Fault("amplifier_off", "mechanics", "The amplifier gives the motor nothing.", AXIS, LASTS),
    Fault("overheated", "mechanics", "The motor gives a part of its torque.", AXIS, LASTS,
          (Option("torque", "ratio", 0.5, "what is left of it", low=0.0, high=1.0),),
          shaft=True),
    Fault("lost_steps", "mechanics", "A stepper does not make all its steps.", AXIS, LASTS,
          (Option("every", "count", 10, "one pulse of so many is lost", low=1, high=_COUNTS),)),
)  # fmt: skip

ENCODER: Final = (
    Fault("a_stuck", "encoder", "Channel A does not move.", AXIS, LASTS, (_LEVEL,)),
    Fault("b_stuck", "encoder", "Channel B does not move.", AXIS, LASTS, (_LEVEL,)),
    Fault("a_open", "encoder", "The wire of channel A is off; the input is pulled high.", AXIS,
          LASTS),
    Fault("b_open", "encoder", "The wire of channel B is off; the input is pulled high.", AXIS,
          LASTS),
    Fault("ab_swapped", "encoder", "A and B are exchanged: it counts backwards.", AXIS, LASTS),
    Fault("glitch", "encoder", "Channel A shows a pulse. One shorter than the chip's filter must"
          " change nothing; a longer one is counted until it ends.", AXIS, LASTS,
          (Option("width", "s", 50_000, "how long it is", low=1, high=10**12),)),
    Fault("index_missing", "encoder", "The index does not come.", AXIS, LASTS),
    Fault("index_double", "encoder", "A second index follows the first.", AXIS, LASTS,
          (Option("distance", "count", 40, "how far above it, a multiple of 4", low=4,
                  high=_COUNTS),)),
    Fault("offset_jump", "encoder", "The count jumps.", AXIS, ONCE,
          (Option("counts", "count", 100, "by how much", low=-_COUNTS, high=_COUNTS),)),
)  # fmt: skip

_LIMIT: Final = Option("switch", "choice", "limit+", "which one", ("limit+", "limit-"))
SWITCHES: Final = (
    Fault("limit_stuck", "switches", "A limit switch is closed, or never closes.", AXIS, LASTS,
          (_LIMIT, Option("state", "choice", "closed", "how it is stuck", ("closed", "open")))),
    Fault("limit_bouncing", "switches", "A limit switch closes and opens, again and again.", AXIS,
          LASTS,
          (_LIMIT, Option("period", "s", 1_000_000_000, "from one closing to the next; half of it"
                          " closed", low=2_000_000))),
    Fault("home_never", "switches", "The home switch does not close.", AXIS, LASTS),
)  # fmt: skip

CHIP_FAULTS: Final = (
    Fault("clock_stopped", "chip", "CLK stands: nothing inside goes on, and the motor stands with"
          " it.", CHIP, LASTS),
    Fault("clock_off", "chip", "The oscillator is off its frequency.", CHIP, LASTS,
          (Option("ppm", "count", 100, "by how many millionths; negative: slow", low=-100_000,
                  high=100_000),)),
    Fault("supply_dip", "chip", "The supply fails for an instant: the power-on reset runs.", CHIP,
          ONCE),
)  # fmt: skip

BUS: Final = (
    Fault("bit_stuck", "bus", "A data line is shorted.", CHIP, COUNTED,
          (Option("bit", "count", 0, "which of D0 to D7", low=0, high=7), _LEVEL)),
    Fault("byte_flipped", "bus", "Bits of a byte are inverted on its way.", CHIP, COUNTED,
          (Option("mask", "count", 0xFF, "the bits", low=1, high=255), _WAY)),
    Fault("strobe_lost", "bus", "The chip does not see a strobe.", CHIP, COUNTED, (_WAY,)),
    Fault("strobe_doubled", "bus", "A strobe is broken in two.", CHIP, COUNTED,
          (_WAY,
           Option("at", "s", 30_000, "how long after its beginning it breaks", low=1_000,
                  high=10**9),
           Option("gap", "s", 20_000, "for how long", low=1_000, high=10**9))),
    Fault("answer_late", "bus", "The chip's answer comes too late: the host takes what the lines"
          " have shown before.", CHIP, COUNTED),
    Fault("bus_pulled", "bus", "Data lines that nothing drives keep nothing: they show a level.",
          CHIP, LASTS, (_LEVEL,)),
    Fault("contention", "bus", "Another driver is on the data lines too.", CHIP, COUNTED,
          (Option("data", "count", 0, "with this byte", low=0, high=255),)),
)  # fmt: skip

GLUE: Final = (
    Fault("net_stuck", "glue", "A wire is shorted to ground or to the supply.", NET, LASTS,
          (_LEVEL,)),
    Fault("part_slow", "glue", "The outputs of a part of glue follow later.", PART, LASTS,
          (Option("by", "s", 100_000, "by how much", low=1, high=10**12),)),
)  # fmt: skip

WIRES: Final = (
    Fault("wire_late", "wire", "Edges of other nodes come later than the wire's delay.", WIRE,
          LASTS, (Option("by", "s", 1_000_000_000, "by how much", low=1, high=10**12),)),
    Fault("wire_lost", "wire", "Edges of other nodes do not come.", WIRE, LASTS),
    Fault("wire_doubled", "wire", "Each edge of another node comes, goes, and comes again.", WIRE,
          LASTS,
          (Option("gap", "s", 10_000_000, "from one to the next", low=1, high=10**12),)),
    Fault("wire_reordered", "wire", "Of each two edges the second comes before the first.", WIRE,
          LASTS,
          (Option("gap", "s", 10_000_000, "from one to the other", low=1, high=10**12),)),
    Fault("wire_cut", "wire", "The wire is cut: no other node drives it here.", WIRE,
          LASTS),
)  # fmt: skip

TRANSPORT: Final = (
    Fault("answers_late", "transport", "Answers wait, then all come at once.", LINK, LASTS),
    Fault("answer_lost", "transport", "The request is carried out, its answer is lost.", LINK,
          COUNTED),
    Fault("half_answer", "transport", "Half of an answer comes, then silence.", LINK, LASTS),
    Fault("link_closed", "transport", "The link is closed.", LINK, ONCE),
    Fault("link_dead", "transport", "The link is open, and no host answers.", LINK, LASTS),
)  # fmt: skip

_THERE_OR_BACK: Final = Option(
    "way", "choice", "both", "the messages it concerns: to the board, from it, or both",
    ("request", "reply", "both"),
)  # fmt: skip
_EVERY: Final = Option("every", "count", 1, "one of each so many, on each way", low=1, high=_COUNTS)

NETWORK: Final = (
    Fault("messages_late", "network", "Messages wait, then all come, in their order.", LINK, LASTS,
          (_THERE_OR_BACK,)),
    Fault("message_lost", "network", "A message does not come.", LINK, COUNTED,
          (_THERE_OR_BACK, _EVERY)),
    Fault("message_doubled", "network", "A message comes twice.", LINK, COUNTED,
          (_THERE_OR_BACK, _EVERY)),
    Fault("messages_reordered", "network", "Of two messages of a host the second comes first.",
          LINK, COUNTED, (_THERE_OR_BACK,)),
    Fault("link_cut", "network", "Nothing comes either way, and hosts seem to have gone.", LINK,
          LASTS),
)  # fmt: skip


def faults() -> dict[str, Fault]:
    """Return every fault by name, those of the registered chip families among them.

    Switches are wired to the limit inputs a family has. A fault that several families have by one
    name is one, with the parameters of all.
    """
    families = plugins.families()
    limited = tuple(one.name for one in families if one.limits)
    chips: dict[str, Fault] = {}
    for one in families:
        upsets = one.load("upsets", ChipFaults)
        for row in upsets.FAULTS if upsets is not None else ():
            other = chips.get(row.name, row)
            named = (*other.families, one.name)
            parameters = tuple(dict.fromkeys((*other.parameters, *row.parameters)))
            chips[row.name] = replace(other, parameters=parameters, families=named)
    switches = (replace(row, families=limited) for row in SWITCHES)
    rows = (
        *MECHANICS, *ENCODER, *switches, *chips.values(), *CHIP_FAULTS, *BUS, *GLUE, *WIRES,
        *TRANSPORT, *NETWORK,
    )  # fmt: skip
    return {row.name: row for row in rows}
