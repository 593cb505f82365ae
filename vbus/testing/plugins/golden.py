"""Goldens: runs that were right, in a file beside the test, and compared with the run now."""

import io
import json
import shlex
import tomllib
from difflib import unified_diff
from pathlib import Path
from typing import Final

from vbus.core.errors import VbusError, content, write_errors
from vbus.protocols.quantities import format_instant, parse_duration
from vbus.record.format import JournalReader
from vbus.serve.output_file import write_file
from vbus.testing.tested_board import TestedBoard
from vbus.views.runs.difference import Tolerance, cost_differences, motor_differences
from vbus.views.runs.motion import AxisCourse, Move
from vbus.views.runs.run import Run, Said, recorded_run

FORMAT: Final = 1
_SHOWN: Final = 40
"""Lines of a difference between transcripts that are shown."""
_ROW: Final = 20
"""Positions in a line of the file."""


def run_of_test(tested: TestedBoard) -> Run:
    """Return what has happened on a test's board.

    Raises:
        VbusError: the run has no golden: the test did to its board what no host can do.
    """
    if tested.board.policy == "realtime":
        raise VbusError(
            "vbus_golden: a board in real time is at another instant in every run; leave rate out"
        )
    reader = JournalReader(io.BytesIO(tested.journal()))
    try:
        return recorded_run(reader)
    except VbusError as error:
        raise VbusError(
            f"vbus_golden: what the test did to its board past hosts, clock and faults is in no"
            f" journal: {error}"
        ) from error


# -- the file -------------------------------------------------------------------------------------


def text_of(run: Run, test: str) -> str:
    """Return the file that keeps a run of a test."""
    lines = [
        f"# What the host does in {test}, and what comes of it.",
        "# pytest --vbus-golden=update writes this file anew.",
        f"format = {FORMAT}",
        f"vbus = {_quoted(run.vbus)}",
        f"cycles = {run.cycles}",
        f"chip_time = {_quoted(format_instant(run.duration))}",
        "host = [",
        *(f"  {_quoted(said.asked)}," for said in run.host),
        "]",
    ]
    for axis, course in run.axes.items():
        lines += [
            "",
            f"[axes.{_quoted(axis)}]",
            f"model = {_quoted(run.models[axis])}",
            f"final = {course.final}",
            f"peak_error = {course.peak_error}",
        ]
        for move in course.moves:
            lines += [
                "",
                f"[[axes.{_quoted(axis)}.moves]]",
                f"begin = {_quoted(format_instant(move.begin))}",
                "path = [  # counts, once in a millisecond",
            ]
            rows = (move.path[place : place + _ROW] for place in range(0, len(move.path), _ROW))
            lines += [f"  {', '.join(map(str, row))}," for row in rows]
            lines.append("]")
    return "\n".join(lines) + "\n"


def _quoted(text: str) -> str:
    return json.dumps(text, ensure_ascii=False)


def read_golden(path: Path) -> Run:
    """Return the run that a golden keeps.

    Raises:
        VbusError: it cannot be read, or is none.
    """
    data = content(path)
    try:
        table = tomllib.loads(data.decode())
        if table["format"] != FORMAT:
            raise ValueError(f"it is of format {table['format']}; this vbus reads {FORMAT}")
        axes = {
            axis: AxisCourse(
                tuple(
                    Move(parse_duration(move["begin"]), tuple(map(int, move["path"])))
                    for move in one.get("moves", [])
                ),
                int(one["final"]),
                int(one["peak_error"]),
            )
            for axis, one in table["axes"].items()
        }
        return Run(
            host=[Said(0, asked, asked) for asked in table["host"]],
            axes=axes,
            cycles=int(table["cycles"]),
            duration=parse_duration(table["chip_time"]),
            models={axis: str(one["model"]) for axis, one in table["axes"].items()},
            vbus=str(table["vbus"]),
        )
    except KeyError as error:
        raise VbusError(f"{path}: this is no golden: it has no {error}") from None
    except (ValueError, TypeError, AttributeError) as error:
        raise VbusError(f"{path}: this is no golden: {error}") from None


# -- the verdict ----------------------------------------------------------------------------------


def complaints(was: Run, now: Run, tolerance: Tolerance) -> list[str]:
    """Return what a run does otherwise than its golden, as lines; none if it is as it was."""
    lines = _host(was, now)
    if was.axes.keys() != now.axes.keys():
        names = " and ".join(", ".join(run.axes) or "none" for run in (was, now))
        lines.append(f"the axes of the board are others: {names}")
    else:
        for found in (
            *motor_differences(was.axes, now.axes, tolerance),
            *cost_differences(was, now, tolerance),
        ):
            lines += found.lines("golden", "now")
    return [*_versions(was, now), *lines] if lines else []


def _host(was: Run, now: Run) -> list[str]:
    before, after = ([said.asked for said in run.host] for run in (was, now))
    lines = list(unified_diff(before, after, "golden", "now", lineterm="", n=2))
    if not lines:
        return []
    more = [f"... and {len(lines) - _SHOWN} lines more"] if len(lines) > _SHOWN else []
    return ["the host does something else:", *(f"  {line}" for line in lines[:_SHOWN]), *more]


def _versions(was: Run, now: Run) -> list[str]:
    """Say what may be the reason, other than the driver."""
    lines = [
        f"{axis} was recorded with {was.models[axis]}, this is {now.models[axis]}: another model of"
        " the motor moves otherwise, which is no fault of the driver; look at what differs, and"
        " update"
        for axis in was.models
        if axis in now.models and was.models[axis] != now.models[axis]
    ]
    if was.vbus != now.vbus:
        lines.append(f"recorded with vbus {was.vbus}, this is {now.vbus}")
    return lines


def judge(tested: TestedBoard, test: str, path: Path, tolerance: Tolerance, update: bool) -> str:
    """Compare a run with its golden, or write that; return why the test fails, or "".

    Args:
        tested: the test's board.
        test: its node id.
        path: the golden.
        tolerance: how far from it the run may be.
        update: write it.

    Raises:
        VbusError: the run has no golden; or the golden cannot be read or written.
    """
    now = run_of_test(tested)
    again = f"pytest {shlex.quote(test)} --vbus-golden=update"
    if update:
        with write_errors(path):
            path.parent.mkdir(parents=True, exist_ok=True)
        write_file(path, text_of(now, test).encode())
        return ""
    if not path.exists():
        return f"there is no golden {path}: look at what the test does, and record it: {again}"
    lines = complaints(read_golden(path), now, tolerance)
    if not lines:
        return ""
    return "\n".join(
        [f"it is not as in {path}:", *(f"  {line}" for line in lines), f"if this is right: {again}"]
    )
