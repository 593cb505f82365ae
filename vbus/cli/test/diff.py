"""``vbus diff``: two recorded runs on the same board, and what differs between them."""

from collections.abc import Iterable
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Final

import click

from vbus.cli.output import complain, no_progress, show
from vbus.cli.sources import opened
from vbus.core import exit_codes

if TYPE_CHECKING:
    from vbus.record.format import Header
    from vbus.views.runs.difference import Difference
    from vbus.views.runs.run import Run

_PERCENT: Final = click.FloatRange(min=0)


@click.command("diff")
@click.argument("first", metavar="A.vbj", type=click.Path(path_type=Path))
@click.argument("second", metavar="B.vbj", type=click.Path(path_type=Path))
@click.option("--counts", type=click.IntRange(min=0), metavar="N", default=0,
              help="Positions that are no more apart than this agree.")  # fmt: skip
@click.option("--time", type=_PERCENT, default=0.0, metavar="PERCENT",
              help="Times of moves that are no more apart agree.")  # fmt: skip
@click.option("--cycles", type=_PERCENT, default=0.0, metavar="PERCENT",
              help="Numbers of bus cycles that are no more apart agree.")  # fmt: skip
@click.option("--json", "as_json", is_flag=True, help="Print JSON; instants in ps.")
@no_progress
def command(
    first: Path, second: Path, counts: int, time: float, cycles: float, as_json: bool,
    no_progress: bool,
) -> int:  # fmt: skip
    """Compare two journals of the same board, as of two versions of a driver.

    Tells the first packet that is another one, with the first other answer and instant if they were
    before it, and what the motors did otherwise: moves, their times, overshoot, positions, the peak
    error; then bus cycles, chip time and violations. Motors are looked at once in a millisecond.

    The exit code is 0 if nothing differs, 1 if something does, and 2 if the journals cannot be
    compared.
    """
    from vbus.core.errors import VbusError
    from vbus.views.runs.difference import Tolerance, differences

    try:
        runs = _runs([first, second], no_progress)
    except VbusError as error:
        complain(str(error))
        return exit_codes.USAGE
    found = list(differences(runs[0], runs[1], Tolerance(counts, time / 100, cycles / 100)))
    value = {
        "equal": not found,
        "runs": [_summary(*one) for one in zip((first, second), runs, strict=True)],
        "differences": [asdict(one) for one in found],
    }
    show(as_json, value, _lines([first, second], runs, found))
    return exit_codes.FAILURE if found else exit_codes.OK


def _runs(paths: list[Path], quiet: bool) -> "list[Run]":
    """Return what happened in both runs.

    Raises:
        VbusError: they cannot be compared.
    """
    from vbus.core.errors import VbusError
    from vbus.views.runs.run import other_board, recorded_run

    headers: list[Header] = []
    for path in paths:
        with opened(path) as reader:
            headers.append(reader.header)
    other = other_board(*headers)
    if other:
        raise VbusError(f"{paths[0]} and {paths[1]} were recorded on different boards: {other}")
    runs = []
    for path in paths:
        with opened(path, "replaying", quiet) as reader:
            try:
                runs.append(recorded_run(reader))
            except VbusError as error:
                where = "" if str(path) in str(error) else f"{path}: "
                raise VbusError(f"{where}{error}") from error
    return runs


def _summary(path: Path, run: "Run") -> dict[str, object]:
    return {
        "journal": str(path),
        "packets": len(run.host),
        "cycles": run.cycles,
        "duration_ps": run.duration,
        "moves": {
            axis: [
                {"begin_ps": move.begin, "duration_ps": move.duration, "begins_at": move.path[0],
                 "ends_at": move.path[-1], "overshoot": move.overshoot}
                for move in course.moves
            ]
            for axis, course in run.axes.items()
        },
    }  # fmt: skip


def _lines(paths: list[Path], runs: "list[Run]", found: "list[Difference]") -> Iterable[str]:
    from vbus.core.kernel import MS

    for path, run in zip(paths, runs, strict=True):
        moves = sum(len(course.moves) for course in run.axes.values())
        yield (
            f"{path}: packets {len(run.host)}, bus cycles {run.cycles}, moves {moves}, chip time"
            f" {run.duration / MS:.6g} ms"
        )
    if not found:
        yield "no difference"
    for one in found:
        yield from one.lines()
