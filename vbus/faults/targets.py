"""Which chip, axis or link a fault is about."""

from vbus.chips.base import Chip
from vbus.circuit.circuit import Circuit
from vbus.core.signals.wire import WireEnd
from vbus.core.values.settings import among, listed
from vbus.faults.glue import net_of
from vbus.faults.row import CHIP, LINK, NET, PART, WIRE, Fault, LinkActs
from vbus.plant.shaft import Shaft


def find_target(board: Circuit, fault: Fault, target: str, links: LinkActs | None) -> str:
    """Return the full name of what ``target`` means for ``fault``: "x", "x.1", "host0".

    Args:
        board: the board.
        fault: the fault.
        target: as it was given; may be empty where there is one only.
        links: those that are served now, if any.

    Raises:
        ValueError: there is no such thing, or the fault does not exist for it.
    """
    if fault.target == LINK:
        name = target or "host0"
        if not name.startswith("host") or not name[4:].isdecimal():
            raise ValueError(
                f'{fault.name} target "{target}": write "host0" for the first [[hosts]]'
            )
        if links is not None:
            links.check(fault.name, name)
        return name
    if fault.target == WIRE:
        return _wire(board, fault, target)
    if fault.target == NET:
        return _net(board, fault, target)
    if fault.target == PART:
        return _part(board, fault, target)
    chip_name, _, number = target.partition(".")
    if not chip_name:
        fits = [chip for chip in board.chips if fault.exists_for(chip.FAMILY)]
        if len(fits) != 1:
            names = listed(c.name for c in fits or board.chips)
            raise ValueError(f"{fault.name}: say on which target; there are {names}")
        chip_name = fits[0].name
    chip = board.chip(chip_name)
    if not fault.exists_for(chip.FAMILY):
        raise ValueError(
            f'{fault.name} exists for {listed(fault.families)}; "{chip.name}" is a {chip.part}'
        )
    if fault.target == CHIP:
        if number:
            raise ValueError(f'{fault.name} is a fault of the chip: write "{chip.name}"')
        if fault.family == "bus" and chip.BUS is None:
            raise ValueError(f"{fault.name}: the bus of a {chip.part} is not known here")
        return chip.name
    return _axis(board, fault, chip, number or "1")


def _wire(board: Circuit, fault: Fault, target: str) -> str:
    wires = [name for name, net in board.nets.items() if isinstance(net, WireEnd)]
    if not wires:
        raise ValueError(f"{fault.name} is for wires between nodes, and none ends here")
    if target not in wires and (target or len(wires) > 1):
        known = f"there is no wire {target} here" if target else "say on which wire"
        raise ValueError(f"{fault.name}: {known}; there are {listed(wires)}")
    return target or wires[0]


def _net(board: Circuit, fault: Fault, target: str) -> str:
    named = [name for name, net in board.nets.items() if net.width == 1]
    known = f' the wires with names are {listed(named)}; a pin such as "u1.1Y" means its wire'
    if not target:
        raise ValueError(f"{fault.name}: say on which wire;{known}")
    try:
        net = net_of(board, target)
    except ValueError as error:
        raise ValueError(f"{fault.name}: {error};{known}") from None
    if net.width > 1:
        raise ValueError(f"{fault.name}: {target} is a bundle; bit_stuck breaks one of its wires")
    return target


def _part(board: Circuit, fault: Fault, target: str) -> str:
    parts = [part.name for part in board.glue.parts]
    if target not in parts:
        said = f'there is no part of glue "{target}"' if target else "say on which part of glue"
        raise ValueError(f"{fault.name}: {said}; {among(target, parts, 'there are')}")
    return target


def _axis(board: Circuit, fault: Fault, chip: Chip, number: str) -> str:
    if not number.isdecimal() or not 1 <= int(number) <= chip.axis_count:
        axes = f'axes of "{chip.name}" are 1 to {chip.axis_count}'
        if not chip.axis_count:
            axes = f"a {chip.part} has no axis"
        raise ValueError(f'{fault.name} target "{chip.name}.{number}": {axes}')
    place = f"{chip.name}.{int(number)}"
    plant = board.axes.get(place)
    if plant is None:
        raise ValueError(f"{fault.name}: no plant is behind {place}")
    if fault.shaft and not isinstance(plant, Shaft):
        raise ValueError(
            f"{fault.name} needs a plant with a shaft, dc_motor or stepper; {place} has"
            f" {type(plant).__name__}"
        )
    if fault.name == "lost_steps" and "drive" in plant.TAKES and "pulses" not in plant.TAKES:
        raise ValueError(f"lost_steps needs a stepper; {place} has {type(plant).__name__}")
    if fault.name == "supply_sag" and not (
        isinstance(plant, Shaft) and plant.mechanics().supply >= 0.0
    ):
        raise ValueError(f"supply_sag needs a dc_motor; {place} has {type(plant).__name__}")
    return place
