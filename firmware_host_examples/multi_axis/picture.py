"""The plot: a path to scale, and curves over time."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path

from vbus.cli.look.plot import picture

COLOURS = ("#1f6fb4", "#c8432b", "#2e8b57", "#8a5bb5")

Line = Sequence[tuple[float, float]]


@dataclass
class Picture:
    """A path on the left, to scale in both directions, and curves over time on the right.

    Attributes:
        title: stands above.
        across: what the path shows from left to right, with its unit.
        up: what it shows upward.
        curves: what the curves show, with its unit.
    """

    title: str
    across: str
    up: str
    curves: str
    programmed: list[tuple[str, Line]] = field(default_factory=list)
    real: list[tuple[str, Line]] = field(default_factory=list)
    over_time: list[tuple[str, Line]] = field(default_factory=list)

    def path(self, name: str, points: Line, programmed: bool = False) -> None:
        """Add a path; a programmed one is drawn wide and pale, below the real one."""
        (self.programmed if programmed else self.real).append((name, points))

    def curve(self, name: str, points: Line) -> None:
        """Add a curve; its points are (seconds, value)."""
        self.over_time.append((name, points))

    def write(self, file: Path) -> None:
        """Write the picture: .svg, .png or .pdf.

        Raises:
            VbusError: the file cannot be written, or its name ends otherwise.
            PluginError: matplotlib is not installed.
        """
        with picture(file, 11.5, 5.6) as figure:
            figure.suptitle(self.title)
            left, right = figure.subplots(1, 2)
            left.set_aspect("equal", adjustable="datalim")
            left.set(xlabel=self.across, ylabel=self.up)
            right.set(xlabel="time (s)", ylabel=self.curves)
            for _, points in self.programmed:
                left.plot(*zip(*points, strict=True), color="#b8b8b8", linewidth=5)
            for axes, lines in ((left, self.real), (right, self.over_time)):
                for (name, points), colour in zip(lines, COLOURS, strict=False):
                    axes.plot(*zip(*points, strict=True), color=colour, label=name, gid=name)
                axes.legend(loc="lower right", bbox_to_anchor=(1, 1), ncols=len(lines))
