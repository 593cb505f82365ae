"""Checks of ``[[faults]]`` that need no board: triggers, ends, and on which node they are."""

from vbus import plugins
from vbus.boardfile.lines import Path
from vbus.boardfile.sections import BoardFile, FaultSection
from vbus.boardfile.source import Mistakes
from vbus.core.values.settings import listed, quoted
from vbus.faults.row import LINK, NET, PART, WIRE, misfit
from vbus.faults.table import faults
from vbus.faults.trigger import read_until, read_when


def check_faults(file: BoardFile, scheme: str) -> Mistakes:
    """Check triggers and ends, and faults of links; messages go over links of ``scheme``."""
    for section in file.faults:
        fault = faults()[section.fault]
        path: Path = ("faults", section.place)
        # In place of a trigger that makes no sense, so that the end is checked all the same.
        when = read_when(None)
        try:
            when = read_when(section.when or None)
        except ValueError as error:
            reason = str(error).partition(": ")[2]
            yield (*path, "when"), f"found {quoted(section.when)}; {reason}"
        try:
            read_until(section.until or None, when, fault)
        except ValueError as error:
            yield (*path, "until"), str(error)
        number = section.target.removeprefix("host") or "0"
        if fault.target == LINK and number.isdecimal() and int(number) < len(file.hosts):
            link = file.hosts[int(number)].transport
            said = misfit(fault, f"host{int(number)}", link, link.partition(":")[0] == scheme)
            if said:
                yield (*path, "target"), said


def homes_of(file: BoardFile, section: FaultSection) -> dict[str, str]:
    """Return the nodes a fault of a board with nodes is on, and its target as each has it.

    A fault of a wire is at every end of it.

    Raises:
        ValueError: there is no such target, or it must be named because several would do.
    """
    fault = faults()[section.fault]
    homes = {chip.name: chip.node for chip in file.chips}
    if fault.target == LINK:
        number = section.target.removeprefix("host") if section.target else "0"
        if not number.isdecimal() or int(number) >= len(file.hosts):
            raise ValueError(f'there is no link "{section.target or "host0"}": count the [[hosts]]')
        nodes = [homes[(host.chips or tuple(homes))[0]] for host in file.hosts]
        place = int(number)
        return {nodes[place]: f"host{nodes[:place].count(nodes[place])}"}
    if fault.target == WIRE:
        wires = {net.name: net for net in file.nets if net.delay}
        if section.target not in wires and (section.target or len(wires) != 1):
            said = f'there is no wire "{section.target}" between nodes'
            if wires and not section.target:
                said = "say on which wire"
            known = f"; there are {listed(wires)}" if wires else ""
            raise ValueError(f"{fault.name}: {said}{known}")
        net = wires[section.target or next(iter(wires))]
        return {homes[pin.partition(".")[0]]: net.name for pin in net.pins}
    if fault.target == PART:
        raise ValueError(f"{fault.name}: a board with nodes has no glue")
    for net in file.nets:
        if fault.target == NET and net.name == section.target:
            return {homes[pin.partition(".")[0]]: net.name for pin in net.pins}
    chip = section.target.partition(".")[0]
    if not chip:
        fits = [
            chip.name
            for chip in file.chips
            if fault.exists_for(plugins.chip_class(chip.part).FAMILY)
        ]
        if len(fits) != 1:
            raise ValueError(f"{fault.name}: say on which target; there are {listed(homes)}")
        return {homes[fits[0]]: fits[0]}
    if chip not in homes:
        raise ValueError(f'{fault.name}: there is no chip "{chip}"; there are {listed(homes)}')
    return {homes[chip]: section.target}
