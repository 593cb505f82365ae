"""The answer to HELLO: what a host learns of its board."""

from vbus.board.card.cards import Card
from vbus.board.host_selection import Selection
from vbus.board.pin_maps import wiring
from vbus.boardfile.sections import PinMapSection
from vbus.circuit.circuit import Circuit
from vbus.circuit.host_pins import HostPins
from vbus.protocols.port import ChipInfo, PortInfo
from vbus.protocols.requests import features


def port_info(
    board: Circuit,
    selection: Selection,
    pins: HostPins,
    promises: bool,
    pin_map: PinMapSection | None,
    card: Card | None,
) -> PortInfo:
    """Return what HELLO tells.

    Args:
        board: the board.
        selection: the host's chips.
        pins: what it has of their nets.
        promises: whether it may be given leases.
        pin_map: where its port pins lead, if it is a microcontroller.
        card: address decoding, if it speaks card addresses.
    """
    chips, sides = selection.chips, pins.side_names()
    program = f"step={board.clock_step};" if card is not None or pin_map is not None else ""
    if card is not None:
        program += card.program_text(lambda name: pins.output_of(board.find_pin(name)))
    return PortInfo(
        board.name,
        board.policy,
        board.rate if board.policy == "realtime" else 0.0,
        [
            ChipInfo(chip.name, chip.part, chip.FAMILY, chip.ADDRESS_BITS, cycle)
            for chip, cycle in zip(chips, selection.cycles, strict=True)
        ],
        pins.line_names(),
        pins.output_names(),
        sides,
        features(promises),
        wiring(pin_map, chips, selection.decoded, board.glue_of(chips), pins),
        card.text(sides) if card is not None else "",
        program,
    )
