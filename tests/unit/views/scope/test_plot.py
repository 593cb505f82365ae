"""``vbus plot``: what is drawn is what the journal says."""

import re
import sys
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import pytest
from matplotlib.figure import Figure

from tests.unit.views.conftest import board_of, read
from tests.unit.views.scope.decoded import Seen
from vbus.cli.look import plot
from vbus.cli.look.plot import picture
from vbus.core.errors import PluginError, VbusError
from vbus.core.kernel import MS, SECOND, US
from vbus.views.scope.recording import Recorded, replayed

SVG = "{http://www.w3.org/2000/svg}"


@pytest.fixture(scope="module")
def run(moved: bytes) -> Recorded:
    header, entries = read(moved)
    return replayed(board_of(header), entries, header.families)


@pytest.fixture
def figures(monkeypatch: pytest.MonkeyPatch) -> list[Figure]:
    """The figures that were written."""
    found: list[Figure] = []
    save = Figure.savefig

    def kept(self: Figure, *args: Any, **options: Any) -> None:
        found.append(self)
        save(self, *args, **options)

    monkeypatch.setattr(Figure, "savefig", kept)
    return found


def lines(figure: Figure) -> dict[str, list[tuple[float, float]]]:
    return {
        str(line.get_gid()): list(zip(*line.get_data(), strict=True))  # type: ignore[call-overload]
        for axes in figure.axes
        for line in axes.lines
    }


def test_lines_are_the_values_of_the_run(
    run: Recorded, figures: list[Figure], tmp_path: Path
) -> None:
    plot.draw(run.description, run.frames, tmp_path / "a.svg")
    seen = Seen(run.description, b"".join(run.frames))
    scales = {lane["name"]: lane["scale"] for lane in run.description["lanes"]}
    drawn = lines(figures[0])
    assert list(drawn) == ["x.desired", "x.real", "x.error", "x.velocity", "x.output"]
    for name, line in drawn.items():
        rows = seen.rows[name]
        scale = scales[name.partition(".")[2]]
        expected = [(when / MS, value * scale) for when, value in [*rows, (seen.now, rows[-1][1])]]
        assert line == expected
        assert len(line) > 10
    assert {line.get_drawstyle() for axes in figures[0].axes for line in axes.lines} == {
        "steps-post"
    }
    first = figures[0].axes[0]
    assert first.get_title("right") == "bench: x"
    assert [axes.get_ylabel() for axes in figures[0].axes] == [
        "counts", "counts", "counts/sample", "of full scale",
    ]  # fmt: skip
    assert figures[0].axes[-1].get_xlabel() == "time (ms)"
    assert first.get_xlim() == (0, seen.now / MS)


def test_lanes_span_and_units_are_those_asked_for(
    run: Recorded, figures: list[Figure], tmp_path: Path
) -> None:
    plot.draw(
        run.description, run.frames, tmp_path / "a.svg", ["x"], ["velocity", "profile"],
        begin=5 * MS, end=5 * MS + 900 * US, units="rev",
    )  # fmt: skip
    (axes,) = figures[0].axes
    assert axes.get_ylabel() == "rev/s"
    assert axes.get_xlabel() == "time (us)"
    seen = Seen(run.description, b"".join(run.frames))
    rows = [row for row in seen.rows["x.profile"] if row[0] <= 5 * MS + 900 * US]
    held = [value for when, value in rows if when <= 5 * MS][-1]
    inside = [(when / US, value) for when, value in rows if when > 5 * MS]
    expected = [(5000.0, held), *inside, (5900.0, rows[-1][1])]
    factor = SECOND / (256 * US) / 2000 / 65536
    assert lines(figures[0])["x.profile"] == [
        (when, pytest.approx(value * factor, rel=1e-12)) for when, value in expected
    ]
    assert len(inside) == 4


@pytest.mark.parametrize("ending", ["svg", "png", "pdf"])
def test_the_same_run_gives_the_same_bytes(run: Recorded, tmp_path: Path, ending: str) -> None:
    for name in ("a", "b"):
        plot.draw(run.description, run.frames, tmp_path / f"{name}.{ending}", lanes=["real"])
    drawn = (tmp_path / f"a.{ending}").read_bytes()
    assert drawn == (tmp_path / f"b.{ending}").read_bytes()
    assert drawn[:4] in (b"<?xm", b"\x89PNG", b"%PDF")
    assert b"date" not in drawn
    assert b"CreationDate" not in drawn


def test_an_svg_has_its_words_as_words_and_its_lines_by_name(run: Recorded, tmp_path: Path) -> None:
    plot.draw(run.description, run.frames, tmp_path / "a.svg")
    tree = ElementTree.parse(tmp_path / "a.svg")
    words = {text.text for text in tree.iter(f"{SVG}text")}
    assert {"bench: x", "desired position", "position error", "motor output"} <= words
    assert {f"x.{name}" for name in plot.LANES} <= {e.get("id") for e in tree.iter(f"{SVG}g")}


def test_what_cannot_be_told_apart_is_thinned_and_no_peak_is_lost() -> None:
    rows = [(n, float(n % 7)) for n in range(1_000_000)]
    rows[123_456] = (123_456, 99.0)
    rows[654_321] = (654_321, -99.0)
    kept = plot._thinned(rows, 0, 999_999)
    assert len(kept) <= 4 * (plot.SLOTS + 1)
    assert {(123_456, 99.0), (654_321, -99.0), rows[0], rows[-1]} <= set(kept)
    assert kept == sorted(set(kept))
    assert plot._thinned(rows[:8000], 0, 8000) == rows[:8000]


@pytest.mark.parametrize(
    ("options", "told"),
    [
        ({"axes": ["y"]}, "no axis is called y; there are x"),
        ({"lanes": ["speed"]}, "no lane is called speed; there are desired, real, error, velocity,"
         " profile, output, current, load"),
        ({"begin": 50 * SECOND}, "nothing to draw from 50000000us on: the run ends at "),
        ({"output": "a.bmp"}, "a.bmp: a picture's name ends in .svg, .png, .pdf"),
    ],
)  # fmt: skip
def test_what_makes_no_sense_is_refused(
    run: Recorded, tmp_path: Path, options: dict[str, Any], told: str
) -> None:
    file = tmp_path / options.pop("output", "a.svg")
    with pytest.raises(VbusError, match=re.escape(told)):
        plot.draw(run.description, run.frames, file, **options)
    assert not file.exists()


def test_without_matplotlib_it_says_how_to_get_it(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, "matplotlib", None)
    with (
        pytest.raises(PluginError, match="install it with: pip install matplotlib"),
        picture(tmp_path / "a.svg", 1, 1),
    ):
        pass
