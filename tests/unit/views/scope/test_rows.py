"""Rows made from frames again: what was recorded, and the units people choose."""

from math import tau

import pytest

from tests.unit.views.conftest import board_of, read
from tests.unit.views.scope.decoded import Seen
from vbus.core.kernel import SECOND, US
from vbus.record.replay import Replay
from vbus.views.scope.frames import numbers, small
from vbus.views.scope.lane import Lane
from vbus.views.scope.recording import Columns, Recorder
from vbus.views.scope.rows import PacketRow, Rows


@pytest.mark.parametrize("column", [small, numbers])
def test_rows_are_those_of_the_frames_in_order_of_time(moved: bytes, column: Columns) -> None:
    header, entries = read(moved)
    recorder = Recorder(board_of(header), edges=True, strobes=True)
    recorder.start()
    Replay(recorder.board, entries, header.families).run()
    recorder.stop()
    description = recorder.lanes.described(False)
    frames = b"".join(recorder.take(column))
    seen = Seen(description, frames)
    rows = Rows(description)
    found = rows.take(frames)
    assert [when for when, *_ in found] == sorted(when for when, *_ in found)
    assert rows.now == seen.now
    assert [lane.full_name for lane in rows.lanes] == list(seen.names.values())
    drawn = [lane for lane in rows.lanes if lane.full_name in seen.drawn]
    assert 0 < len(drawn) < len(rows.lanes)
    for lane in drawn:
        mine = [(when, value) for when, of, value in found if of is lane]
        theirs = seen.rows[lane.full_name]
        if lane.kind == "packets":
            expected = [
                (at, PacketRow(span, text, kind))
                for at, span, text, kind in seen.packets(lane.full_name)
            ]
            assert mine == expected
        else:
            assert mine == [(when, value * lane.scale if lane.scale != 1 else value)
                            for when, value in theirs]  # fmt: skip
    assert len(found) == sum(len(seen.rows[lane.full_name]) for lane in drawn) > 300


def lane(unit: str, **of: int) -> Rows:
    told = Lane(0, "x", "real", "real position", "number", unit).described()
    return Rows({"axes": [{"name": "x", **of}], "lanes": [told]})


@pytest.mark.parametrize(
    ("rows", "units", "factor", "name"),
    [
        (lane("counts", counts_per_rev=2000), "counts", 1, "counts"),
        (lane("counts", counts_per_rev=2000), "rev", 1 / 2000, "rev"),
        (lane("counts", counts_per_rev=2000), "SI", tau / 2000, "rad"),
        (lane("counts"), "SI", 1, "counts"),
        (lane("A", counts_per_rev=2000), "SI", 1, "A"),
        (lane("", counts_per_rev=2000), "SI", 1, ""),
        (lane("counts/sample", counts_per_rev=2000), "rev", 1 / 2000, "rev/sample"),
        (lane("counts/sample", counts_per_rev=2000, sample=256 * US), "rev",
         SECOND / (256 * US) / 2000, "rev/s"),
        (lane("counts/sample", counts_per_rev=2000, sample=256 * US), "SI",
         tau * SECOND / (256 * US) / 2000, "rad/s"),
        (lane("microsteps", counts_per_rev=400), "rev", 1, "microsteps"),
    ],
)  # fmt: skip
def test_units_are_those_of_the_page(rows: Rows, units: str, factor: float, name: str) -> None:
    shown = rows.shown_in(rows.lanes[0], units)  # type: ignore[arg-type]
    assert shown == (pytest.approx(factor, rel=1e-12), name)
