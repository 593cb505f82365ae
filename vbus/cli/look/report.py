"""``vbus report``: the violations of a recorded run."""

from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Final

import click

from vbus.cli.output import no_progress
from vbus.cli.sources import opened, tell_damage
from vbus.core import exit_codes

if TYPE_CHECKING:
    from vbus.circuit.stream import PacketReader
    from vbus.views.findings.report import Report

_FORMATS: Final = ("text", "json", "junit", "sarif")
_FAIL_ON: Final = ("note", "warning", "error", "never")
"""Severities from the least up; there is no violation of the last."""


@click.command("report")
@click.argument("journal", type=click.Path(path_type=Path))
@click.option("--format", "style", type=click.Choice(_FORMATS), default="text", show_default=True,
              help="What is printed.")  # fmt: skip
@click.option("--json", "style", flag_value="json", help="The same as --format json.")
@click.option("--compatibility", metavar="PART", help="Note where PART (hctl-1100) differs.")
@click.option("--suppress", metavar="FILE", help="TOML file of accepted violations.")
@click.option(
    "--fail-on", type=click.Choice(_FAIL_ON), default="error", show_default=True,
    help="Exit with 1 if a violation of this severity or above is not accepted.",
)  # fmt: skip
@no_progress
def command(
    journal: Path, style: str, compatibility: str | None, suppress: str | None, fail_on: str,
    no_progress: bool,
) -> int:  # fmt: skip
    """Show every violation of a journal with the 20 bus cycles before and after it."""
    from vbus.board.check.checks import all_rules
    from vbus.record.view import play
    from vbus.views.findings.formats import FORMATS
    from vbus.views.findings.report import Report
    from vbus.views.findings.suppress import suppressions_of

    with opened(journal, "reading", no_progress) as reader:
        header = reader.header
        report = Report(
            header.board, header.families, all_rules(), suppressions_of(suppress or ""), header.file
        )
        readers = [report, *_other_part(report, compatibility)]
        play(header, reader, *readers)
        tell_damage(journal, reader.damage)
    click.echo(FORMATS[style](report), nl=False)
    if style == "text":
        for line in _motion(journal, report.cycles):
            click.echo(line)
    counted = _FAIL_ON[_FAIL_ON.index(fail_on) :]
    failed = any(report.unaccepted(severity) for severity in counted)
    return exit_codes.FAILURE if failed else exit_codes.OK


def _motion(journal: Path, cycles: int) -> "Iterator[str]":
    """Give what became of each axis, and what the run has left, if it is not too long a run."""
    from vbus.cli.outcome import MOST_PLAYED, axes_played
    from vbus.core.errors import VbusError

    # Violations are in the journal; where the axes went is only known after playing it again.
    if cycles > MOST_PLAYED:
        yield f"axes: not played again, after more than {MOST_PLAYED} bus cycles"
        return
    try:
        with opened(journal) as reader:
            axes, board = axes_played(reader, str(journal))
    # The report itself is complete: a board that cannot be built again only costs these lines.
    except VbusError as error:
        yield f"axes: not known: {error}"
        return
    yield from (f"axis {line}" for line in axes)
    for one in board.left_over():
        yield f"{one.severity}: {one.chip}: {one.rule} ({one.clause}): {one.detail}"
    yield from board.hints(board.violations)


def _other_part(report: "Report", part: str | None) -> "Iterator[PacketReader]":
    """Give what reads the journal beside the report, and knows of another part, if asked for."""
    if part is None:
        return
    from vbus import plugins
    from vbus.views.findings.report import Compatibility

    families = {chip: plugins.family(name) for chip, name in report.families.items()}
    yield Compatibility(part, families, report)
