"""``vbus exec --sweep``: the same program again and again, at other phases of the chips' cycle."""

import io
import re
import tempfile
from collections.abc import Callable
from dataclasses import dataclass
from typing import Final

import click
import msgspec

from vbus.board.board import Board
from vbus.board.build import build
from vbus.boardfile.sections import BoardFile, HostSection, RecordSection
from vbus.boardfile.source import Source
from vbus.cli.hosted.beside import Ran, run_beside
from vbus.core.errors import ConfigError
from vbus.plugins import family_of
from vbus.protocols.quantities import format_instant

_TIMES: Final = re.compile(r" x\d+$")
_STOPPED: Final = (130, 143)
"""What a program ends with that SIGINT or SIGTERM has ended: the sweep ends too."""


def cycle_of(board: Board) -> int:
    """Return the longest cycle of the board's chips (ps), as they have it after a reset.

    Raises:
        ConfigError: the family of none of them says how long it is.
    """
    cycles = [
        chip.clock.ps(int(clocks)) - chip.clock.ps(0)
        for chip in board.chips
        if (clocks := family_of(chip.part).object("cycle"))
    ]
    if not cycles:
        raise ConfigError(
            "--sweep: nobody says how long a cycle of these chips is; say so, as in"
            " --sweep 16:500us"
        )
    return max(cycles)


@dataclass(frozen=True, slots=True)
class SweepRun:
    """What came of one run, by the columns of the table.

    Attributes:
        exit: the exit code.
        stdout: what the program has said.
        bus: the bus cycles, equal ones in a row as one: how often a driver polls is its own affair.
        rules: rules that were broken.
        axes: what became of each axis.
    """

    exit: tuple[str, ...]
    stdout: tuple[str, ...]
    bus: tuple[str, ...]
    rules: tuple[str, ...]
    axes: tuple[str, ...]


_COLUMNS: Final = ("exit", "stdout", "bus", "rules", "axes")


def _turn(ran: Ran, said: str, bus: str) -> SweepRun:
    lines = [_TIMES.sub("", line) for line in bus.splitlines() if not line.startswith("!")]
    folded = [line for place, line in enumerate(lines) if lines[place - 1 : place] != [line]]
    return SweepRun(
        (str(ran.code),),
        tuple(said.splitlines()),
        tuple(folded),
        tuple(sorted(f"{chip} {rule}" for chip, rule in ran.findings.first)),
        tuple(ran.outcome.lines(sizes=False)),
    )


def sweep(
    count: int,
    cycle: int,
    file: BoardFile,
    source: Source,
    host: HostSection,
    command: Callable[[str], list[str]],
    limit: int | None = None,
) -> int:
    """Run a program so many times, each time the chips a part of their cycle further ahead.

    Returns the program's exit code; 1 if the outcomes differ.

    Args:
        count: number of runs.
        cycle: the chips' cycle (ps); 0: the longest one of the board.
        file: the board.
        source: the same as text.
        host: what the program reaches.
        command: gives program and arguments, for the address of the link.
        limit: chip time that each run may take (ps); see
            :func:`vbus.cli.hosted.beside.run_on_board`.

    Raises:
        ConfigError: the board runs in real time, or the cycle is not known.
    """
    if file.board.time == "realtime":
        raise ConfigError(
            "--sweep: in real time no two runs are alike; the board must be lockstep or slaved"
        )
    file = msgspec.structs.replace(file, record=RecordSection(), waves=())
    cycle = cycle or cycle_of(build(file, source))
    turns: list[SweepRun] = []
    for turn in range(count):
        bus = io.StringIO()
        with tempfile.TemporaryFile() as said:
            ahead = turn * cycle // count
            ran = run_beside(file, source, host, command, bus, ahead, said, limit)
            said.seek(0)
            turns.append(_turn(ran, said.read().decode(errors="replace"), bus.getvalue()))
        if ran.code in _STOPPED:
            return ran.code
    for line in table(turns, cycle):
        click.echo(line)
    return int(turns[0].exit[0]) if len(set(turns)) == 1 else 1


def table(turns: list[SweepRun], cycle: int) -> list[str]:
    """Return the outcomes as a table, and where they differ.

    Args:
        turns: the outcomes in the order of the runs.
        cycle: the chips' cycle (ps).
    """
    kinds: dict[str, dict[tuple[str, ...], str]] = {name: {} for name in _COLUMNS}
    rows = []
    for number, turn in enumerate(turns):
        row = [f"+{format_instant(number * cycle // len(turns))}"]
        for name in _COLUMNS:
            known = kinds[name]
            row.append(known.setdefault(getattr(turn, name), _letter(len(known))))
        rows.append(row)
    if len(set(turns)) == 1:
        ahead = format_instant(cycle)
        return [f"{len(turns)} runs, the chips up to {ahead} ahead: one outcome"]
    lines = [f"{'chips':12}{''.join(f'{name:8}' for name in _COLUMNS)}".rstrip()]
    lines += [f"{row[0]:12}{''.join(f'{cell:8}' for cell in row[1:])}".rstrip() for row in rows]
    for name in _COLUMNS:
        (first, letter), *others = kinds[name].items()
        lines += [
            f"{name} {other}: {_difference(first, outcome, letter)}" for outcome, other in others
        ]
    return lines


def _letter(number: int) -> str:
    return chr(ord("a") + number) if number < 26 else f"#{number + 1}"


def _difference(first: tuple[str, ...], other: tuple[str, ...], letter: str) -> str:
    """Return where two outcomes part, in one sentence."""
    place = 0
    while first[place : place + 1] == other[place : place + 1]:
        place += 1
    has = f'"{other[place]}"' if place < len(other) else "nothing"
    had = f'"{first[place]}"' if place < len(first) else "nothing"
    return f"line {place + 1} is {has}; in {letter} it is {had}"
