"""``vbus plot``: the motion of a recorded run as a picture."""

import io
from bisect import bisect_right
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from itertools import groupby
from operator import itemgetter
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

import click

from vbus.cli.output import no_progress, time_option
from vbus.core.errors import OptionError, VbusError, import_errors
from vbus.protocols.quantities import format_instant
from vbus.serve.output_file import write_file

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from vbus.views.scope.lane import Lane
    from vbus.views.scope.rows import Units

_METADATA: Final[dict[str, dict[str, Any]]] = {
    ".svg": {"Date": None}, ".png": {}, ".pdf": {"CreationDate": None},
}  # fmt: skip
"""By the end of a file's name: what is said in it of its making."""

_STYLE: Final = {
    "svg.hashsalt": "vbus", "svg.fonttype": "none", "font.size": 9.0, "axes.grid": True,
    "axes.axisbelow": True, "grid.color": "#e4e4e4", "axes.edgecolor": "#444444",
    "legend.frameon": False, "lines.linewidth": 1.2, "savefig.dpi": 120,
    "axes.formatter.useoffset": False,
}  # fmt: skip
"""What all pictures have, whatever a user has set for his own."""


@contextmanager
def picture(path: Path, width: float, height: float) -> Iterator["Figure"]:
    """Give a figure to draw in, and write it to a file at the end.

    Args:
        path: its name ends in ``.svg``, ``.png`` or ``.pdf``.
        width: in inches.
        height: in inches.

    Raises:
        OptionError: the name ends otherwise.
        VbusError: the file cannot be written.
        PluginError: matplotlib is not installed.
    """
    kind = path.suffix.lower()
    if kind not in _METADATA:
        raise OptionError(f"{path}: a picture's name ends in {', '.join(_METADATA)}")
    with import_errors("pictures need matplotlib", "matplotlib"):
        import matplotlib
        from matplotlib.figure import Figure
    drawn = io.BytesIO()
    # A user's own settings would make another picture of the same run.
    with matplotlib.rc_context():
        matplotlib.rcdefaults()
        matplotlib.rcParams.update(_STYLE)
        figure = Figure(figsize=(width, height), layout="constrained")
        yield figure
        figure.savefig(drawn, format=kind[1:], metadata=_METADATA[kind])
    write_file(path, drawn.getvalue())


LANES: Final = ("desired", "real", "error", "velocity", "output")
"""What is drawn of an axis by default."""
TOGETHER: Final = (("desired", "real"), ("velocity", "profile"))
"""Lanes that are drawn over each other where they have one unit: the first wide and pale."""

COLUMN_INCHES: Final = 6.0
PANEL_INCHES: Final = 1.7
# Four points in each: more than a column's 720 pixels at 120 dpi can show.
SLOTS: Final = 2000
"""How many slots of time are drawn where there are more rows than a reader can see."""
MARGIN_INCHES: Final = 0.6

_SPANS: Final = ((10**12, "s"), (10**9, "ms"), (10**6, "us"), (10**3, "ns"))
_SPAN_DIVISIONS: Final = 5
"""So many of a unit at least are seen, or a smaller one is taken."""

Panel = list["Lane"]


@click.command("plot")
@click.argument("journal", type=click.Path(path_type=Path))
@click.option("-o", "--output", required=True, type=click.Path(path_type=Path),
              help="The picture: .svg, .png or .pdf.")  # fmt: skip
@click.option("--axis", "axes", multiple=True, metavar="NAME", help="This axis; else all.")
@click.option("--lane", "lanes", multiple=True, metavar="NAME",
              help=f"This lane of an axis; else {', '.join(LANES)}.")  # fmt: skip
@time_option("--from", "begin", text="Begin at this instant.")
@time_option("--to", "end", text="End at this instant.")
@click.option("--units", type=click.Choice(["counts", "rev", "SI"]), default="counts",
              show_default=True, help="As on the scope's page.")  # fmt: skip
@no_progress
def command(
    journal: Path, output: Path, axes: tuple[str, ...], lanes: tuple[str, ...], begin: int | None,
    end: int | None, units: "Units", no_progress: bool,
) -> int:  # fmt: skip
    """Draw the motion of a recorded run.

    The journal is played again for it. A column for each axis, over one time axis: desired and real
    position, error, velocity and motor output, or the lanes that are asked for. The same journal
    gives the same picture.
    """
    from vbus.cli.look.scope import recorded_code, recorded_of

    recorded = recorded_of(journal, strobes=False, quiet=no_progress)
    draw(recorded.description, recorded.frames, output, axes, lanes or LANES, begin, end, units)
    return recorded_code(recorded)


def draw(
    description: dict[str, Any],
    frames: Sequence[bytes],
    output: Path,
    axes: Sequence[str] = (),
    lanes: Sequence[str] = LANES,
    begin: int | None = None,
    end: int | None = None,
    units: "Units" = "counts",
) -> None:
    """Draw a run.

    Args:
        description: the description that comes before the first frame.
        frames: the recording.
        output: file to write.
        axes: names of axes; none: all.
        lanes: names of lanes of an axis.
        begin: instant (ps) at which it begins; None: the beginning.
        end: instant at which it ends; None: the end of the run.
        units: what counts are shown in.

    Raises:
        VbusError: there is no such axis or lane, or nothing between these instants.
        PluginError: matplotlib is not installed.
    """
    from vbus.views.scope.rows import Rows

    rows = Rows(description)
    known = [axis["name"] for axis in description["axes"]]
    columns = {axis: _panels(rows.lanes, axis, lanes) for axis in _chosen("axis", axes, known)}
    there = [lane.name for lane in rows.lanes if lane.axis in columns]
    deep = max(map(len, columns.values()), default=0)
    # Lanes by default may be missing on a chip; one that was asked for may not.
    if lanes != LANES or not deep:
        _chosen("lane", lanes, there)
    courses: dict[Lane, list[tuple[int, float]]] = {
        lane: [] for panels in columns.values() for panel in panels for lane in panel
    }
    for when, lane, value in rows.take(b"".join(frames)):
        if lane in courses:
            courses[lane].append((when, value))
    first = begin or 0
    last = rows.now if end is None else end
    if not first < last:
        if end is None and not first:
            raise VbusError("nothing to draw: no chip time passed in this run")
        if end is None:
            raise VbusError(
                f"nothing to draw from {format_instant(first)} on: the run ends at"
                f" {format_instant(last)}"
            )
        raise VbusError(
            f"nothing to draw between {format_instant(first)} and {format_instant(last)}: the end"
            " must come after the beginning"
        )
    per, name = next(
        (span for span in _SPANS if last - first >= _SPAN_DIVISIONS * span[0]), (1, "ps")
    )
    size = COLUMN_INCHES * len(columns), PANEL_INCHES * deep + MARGIN_INCHES
    with picture(output, *size) as figure:
        drawn = figure.subplots(deep, len(columns), sharex=True, squeeze=False)
        for number, (axis, panels) in enumerate(columns.items()):
            drawn[0][number].set_title(f"{description['board']}: {axis}", loc="right")
            for place, panel in enumerate(panels):
                _draw_panel(drawn[place][number], panel, rows.shown_in(panel[0], units), [
                    _between(courses[lane], first, last) for lane in panel
                ], per)  # fmt: skip
            for rest in drawn[len(panels) :, number]:
                rest.set_visible(False)
            lowest = drawn[len(panels) - 1][number]
            lowest.tick_params(labelbottom=True)
            lowest.set_xlabel(f"time ({name})")
            lowest.set_xlim(first / per, last / per)


def _chosen(what: str, names: Sequence[str], known: Sequence[str]) -> Sequence[str]:
    """Return the names that are asked for, or all."""
    for name in names:
        if name not in known:
            raise VbusError(
                f"no {what} is called {name}; there are {', '.join(dict.fromkeys(known))}"
            )
    return names or known


def _panels(all_lanes: Sequence["Lane"], axis: str, names: Sequence[str]) -> list[Panel]:
    """Return the lanes of an axis: those that belong together in one panel."""
    panels: list[Panel] = []
    for lane in all_lanes:
        if lane.axis != axis or lane.name not in names:
            continue
        for panel in panels:
            pair = (panel[0].name, lane.name)
            if len(panel) == 1 and pair in TOGETHER and panel[0].unit == lane.unit:
                panel.append(lane)
                break
        else:
            panels.append([lane])
    return panels


def _between(rows: list[tuple[int, float]], first: int, last: int) -> list[tuple[int, float]]:
    """Return the rows of a lane between two instants, with what it has at both."""
    # A value holds until the next row: the one before the beginning is part of the picture.
    begin = bisect_right(rows, first, key=itemgetter(0))
    end = bisect_right(rows, last, key=itemgetter(0))
    held = [(first, rows[begin - 1][1])] if begin else []
    found = [*held, *rows[begin:end]]
    return _thinned([*found, (last, found[-1][1])], first, last) if found else []


def _thinned(rows: list[tuple[int, float]], first: int, last: int) -> list[tuple[int, float]]:
    """Return what a reader can see: in each slot the first, the least, the greatest, the last."""
    if len(rows) <= 4 * SLOTS:
        return rows
    drawn: list[tuple[int, float]] = []
    for _, slot in groupby(rows, lambda row: (row[0] - first) * SLOTS // (last - first)):
        inside = list(slot)
        by_value = sorted(inside, key=itemgetter(1))
        # Extremes stay, so that a spike of one sample is still seen.
        drawn += sorted({inside[0], by_value[0], by_value[-1], inside[-1]})
    return drawn


def _draw_panel(
    axes: Any,
    panel: Panel,
    unit: tuple[float, str],
    values: list[list[tuple[int, float]]],
    per: int,
) -> None:
    factor, name = unit
    for number, (lane, rows) in enumerate(zip(panel, values, strict=True)):
        below = number == 0 and len(panel) > 1
        axes.step(
            [when / per for when, _ in rows],
            [value * factor for _, value in rows],
            where="post", label=lane.title, gid=lane.full_name,
            color="#b8b8b8" if below else "#1f6fb4", linewidth=4 if below else 1.2,
        )  # fmt: skip
    axes.set_ylabel(name or "of full scale")
    axes.legend(loc="upper left", bbox_to_anchor=(0, 1.16), ncols=len(panel), borderpad=0)
