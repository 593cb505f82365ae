"""``vbus fit``: the numbers of a motor from a recorded move."""

from collections.abc import Iterator
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

import click

from vbus.cli.output import no_progress, positive, reading, refuse_given, show, time_option
from vbus.core.errors import CaptureError, VbusError, read_errors

if TYPE_CHECKING:
    from vbus.boardfile.sections import BoardFile, PlantSection
    from vbus.views.fit.fit import Fit
    from vbus.views.fit.moves import RecordedMove

_CAPTURES: Final = (".csv", ".txt", ".vcd", ".sr")
"""How names of captures and tables end."""


@click.command("fit")
@click.argument("board", metavar="AXIS.toml", type=click.Path(path_type=Path))
@click.argument("run", metavar="RUN", type=click.Path(path_type=Path))
@click.option("--axis", metavar="CHIP[.N]", default="", help="The axis; else the only dc_motor.")
@time_option("--from", "begin", text="Begin at this instant.")
@time_option("--to", "end", text="End at this instant.")
@click.option("--map", "maps", multiple=True, metavar="SIGNAL=CHANNEL[,...]",
              help="Of a capture: channels of pwm, sign, a and b.")  # fmt: skip
@click.option("--period", callback=positive, default="256 us", show_default=True, metavar="TIME",
              help="Of a capture: take the PWM's mean over this.")  # fmt: skip
@click.option("--samplerate", metavar="FREQUENCY", help="Of a capture without times.")
@click.option("--json", "as_json", is_flag=True, help="Print a JSON object.")
@no_progress
def command(
    board: Path, run: Path, axis: str, begin: int | None, end: int | None, maps: tuple[str, ...],
    period: int, samplerate: str | None, as_json: bool, no_progress: bool,
) -> int:  # fmt: skip
    """Find inertia, friction and torque constant of an axis from a recorded move.

    RUN is a journal (.vbj), a table (.csv) of time, command (-1 to 1) or volts, counts and perhaps
    current, or a capture (.vcd, .sr) of PWM and encoder. The dc_motor of AXIS.toml is given the
    recorded drive, and its numbers are changed until it goes where the encoder went. What else the
    file says of it (resistance, inductance, supply, encoder) is taken as true.

    Prints the lines for the board file, each with the half of its 95 % interval, and what the run
    cannot tell.
    """
    from vbus.board.config import read_board_file
    from vbus.core.kernel import SECOND
    from vbus.views.fit.fit import MotorFit

    if run.suffix.lower() not in _CAPTURES:
        of_capture = ("period", "samplerate", "maps")
        refuse_given(of_capture, f"is of captures and tables, and {run} is read as a journal")
    file, _ = read_board_file(board)
    axis, plant = _plant_of(file, axis)
    move = _move(run, axis, plant, (dict(_pairs(maps)), period, samplerate), no_progress)
    ends = end / SECOND if end is not None else float("inf")
    name = str(run)
    fit = MotorFit(plant.settings, move.cut(name, (begin or 0) / SECOND, ends), name).fit()
    value = {"axis": axis, "plant": plant.name, **asdict(fit)}
    show(as_json, value, _lines(axis, plant.name, fit), 2)
    return 0


def _pairs(maps: tuple[str, ...]) -> Iterator[tuple[str, str]]:
    from vbus.views.fit.moves import CHANNELS

    for pair in ",".join(maps).split(",") if maps else ():
        signal, _, channel = (part.strip() for part in pair.partition("="))
        if signal not in CHANNELS or not channel:
            raise click.UsageError(
                f'--map: found "{pair}"; write SIGNAL=CHANNEL; signals are {", ".join(CHANNELS)}'
            )
        yield signal, channel


def _plant_of(file: "BoardFile", axis: str) -> "tuple[str, PlantSection]":
    """Return the axis that is meant, as ``"x.1"``, and its motor."""
    sections = {plant.name: plant for plant in file.plants if plant.model == "dc_motor"}
    motors = {
        f"{chip.name}.{number}": sections[name]
        for chip in file.chips
        for number, name in enumerate(chip.axes, 1)
        if name in sections
    }
    wanted = axis if "." in axis or not axis else f"{axis}.1"
    if not axis and len(motors) == 1:
        (wanted,) = motors
    if wanted not in motors:
        there = f"its axes with one are {', '.join(motors)}" if motors else "it has none"
        what = (
            f'"{wanted}" is no axis with a dc_motor' if axis else "which axis is meant is not said"
        )
        if not axis and not motors:
            what = "a fit needs a chip whose plant is a dc_motor"
        raise VbusError(f"{file.path}: {what}; {there}; choose with --axis, or add one to [plants]")
    return wanted, motors[wanted]


def _move(
    run: Path, axis: str, plant: "PlantSection", wires: tuple[dict[str, str], int, str | None],
    quiet: bool,
) -> "RecordedMove":  # fmt: skip
    """Read a move, of whatever file it is in."""
    from vbus.cli.sources import opened, tell_damage
    from vbus.cli.test.conform import hertz_of, opened_capture
    from vbus.nodes.machine import board_of
    from vbus.plant.dc_motor import DcMotor
    from vbus.views.fit import moves

    wiring, period, samplerate = wires
    kind = run.suffix.lower()
    if kind not in _CAPTURES:
        with opened(run, "replaying", quiet) as reader:
            move = moves.journal_move(board_of(reader.header, str(run)), reader, str(run), axis)
            tell_damage(run, reader.damage)
            return move
    if kind in (".vcd", ".sr") or wiring:
        with opened_capture(run, hertz_of(samplerate)) as (capture, _, _):
            return moves.capture_move(capture, str(run), wiring, period)
    with reading(run, CaptureError) as raw, read_errors(run, CaptureError):
        text = raw.read().decode("utf-8-sig", "replace")
    gain = float(DcMotor(plant.settings).settings["gain"])
    return moves.table_move(text.splitlines(), str(run), gain)


def _lines(axis: str, plant: str, fit: "Fit") -> Iterator[str]:
    by_name: dict[str, Any] = {one.name: one for one in fit.found}
    yield f"# {axis}: the model is {fit.rms:.2g} counts off in the mean (rounding alone: 0.29)"
    yield f"[plants.{plant}]"
    for name, unit in (
        ("torque_constant", "N*m/A"), ("back_emf", "V*s"), ("inertia", "kg*m^2"),
        ("viscous_friction", "N*m*s"), ("coulomb_friction", "N*m"), ("static_friction", "N*m"),
        ("load_torque", "N*m"),
    ):  # fmt: skip
        one = by_name.get(name)
        value = one.value if one else fit.settings[name]
        if name in fit.held:
            mark = "of the file"
        elif one is None:
            of = "torque_constant" if name == "back_emf" else "coulomb_friction"
            mark = f"beside {of} as in the file"
        else:
            mark = f"+- {one.error:.2g} {unit}{'' if one.sure else ', NOT known from this run'}"
        line = f'{name} = "{value:.5g} {unit}"'
        yield f"{line:<46}# {mark}"
    for title, value, error, unit in fit.ratios:
        yield f"# {title} = {value:.5g} +- {error:.2g} {unit}"
    for one in fit.found:
        if not one.sure:
            yield f"# cannot tell {one.name} to 2 %: {one.why}"
    for note in fit.notes:
        yield f"# {note}"
