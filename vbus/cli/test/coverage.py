"""``vbus coverage``: what a driver has exercised of the chips it drives."""

from pathlib import Path
from typing import TYPE_CHECKING, Final

import click

from vbus.cli.output import complain, no_progress, reading
from vbus.cli.sources import opened, tell_damage
from vbus.core import exit_codes
from vbus.serve.output_file import write_file

if TYPE_CHECKING:
    from vbus.views.coverage.coverage import Coverage

_FORMATS: Final = {"text": ".txt", "json": ".json", "html": ".html", "cobertura": ".xml"}


@click.command("coverage")
@click.argument("files", nargs=-1, required=True, type=click.Path(path_type=Path))
@click.option("--format", "style", type=click.Choice(list(_FORMATS)),
              help="What is written; else as --output ends, or text.")  # fmt: skip
@click.option("--json", "style", flag_value="json", help="The same as --format json.")
@click.option("--output", metavar="FILE", type=click.Path(path_type=Path), help="Write to FILE.")
@click.option("--all", "every", is_flag=True, help="As text: list also what was exercised.")
@click.option("--diff", is_flag=True, help="Show what only the first or only the second has.")
@click.option(
    "--fail-under", type=click.FloatRange(0, 100), default=0.0, metavar="PERCENT",
    help="Exit with 1 if less than this was exercised.",
)  # fmt: skip
@click.option("--covers", metavar="NAME", help="Which tests use a command, register, flag.")
@click.option("--test", metavar="TEST", help="What a test uses, and which rules it breaks.")
@no_progress
def command(
    files: tuple[Path, ...], style: str | None, output: Path | None, every: bool, diff: bool,
    fail_under: float, covers: str | None, test: str | None, no_progress: bool,
) -> int:  # fmt: skip
    """Show which commands, registers, flags and modes a driver has used, and which never.

    FILES are journals (vbus run --journal) or coverage files (--format json, pytest
    --vbus-coverage=FILE.json, which know their tests); several are merged.
    """
    from vbus.views.coverage.coverage import merged
    from vbus.views.coverage.formats import (
        COVERAGE_FORMATS,
        as_text,
        covered_by_test,
        difference,
        tests_covering,
    )

    if sum((diff, covers is not None, test is not None)) > 1:
        raise click.UsageError("--diff, --covers and --test each show something else; take one")
    if diff and len(files) != 2:
        raise click.UsageError(f"--diff compares two files; {len(files)} are given")
    plain = diff or covers is not None or test is not None
    if style is None:
        ending = output.suffix if output and not plain else ".txt"
        style = next((name for name, end in _FORMATS.items() if end == ending), "text")
    if style != "text" and plain:
        raise click.UsageError("--diff, --covers and --test are shown as text only")
    parts = [read(path, no_progress) for path in files]
    whole = merged(parts)
    if diff:
        text = difference(parts[0], parts[1])
    elif covers is not None:
        text = tests_covering(whole, covers)
    elif test is not None:
        text = covered_by_test(whole, test)
    elif style == "text":
        text = as_text(whole, every)
    else:
        text = COVERAGE_FORMATS[_FORMATS[style]](whole)
    if output is None:
        click.echo(text, nl=False)
    else:
        write_file(output, text.encode())
    measured = parts[1] if diff else whole
    if measured.percent() < fail_under:
        complain(f"{measured.shown()} exercised, {fail_under:g}% wanted")
        return exit_codes.FAILURE
    return exit_codes.OK


def read(path: Path, quiet: bool = True) -> "Coverage":
    """Return the coverage of a journal, or the one a coverage file holds.

    Raises:
        VbusError: it is neither, or cannot be read.
    """
    from vbus.record.view import play
    from vbus.views.coverage.coverage import CoverageObserver, from_json

    with reading(path) as file:
        start = file.read(1)
        text = start + file.read() if start == b"{" else b""
    if text:
        return from_json(text, str(path))
    with opened(path, "reading", quiet) as reader:
        observer = CoverageObserver(reader.header.families, str(path))
        play(reader.header, reader, observer)
        tell_damage(path, reader.damage)
    return observer.coverage
