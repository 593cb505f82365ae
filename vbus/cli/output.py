"""What verbs have in common: what they print, the files they read and write, their options."""

import json
import sys
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from functools import wraps
from pathlib import Path
from pkgutil import resolve_name
from typing import Any, BinaryIO, Final

import click

from vbus.core.errors import VbusError, read_errors

Decorator = Callable[[Callable[..., Any]], Callable[..., Any]]


class Verbs(click.Group):
    """A group whose message about an unknown command has the likely one, and all there are."""

    def resolve_command(
        self, ctx: click.Context, args: list[str]
    ) -> tuple[str | None, click.Command | None, list[str]]:
        """Return the command that the first word names, and the words behind it."""
        name, known = args[0], self.list_commands(ctx)
        if name not in known and not name.startswith("-"):
            from vbus.core.values.settings import suggestion

            there = f"{suggestion(name, known)}there are {', '.join(known)}"
            raise click.UsageError(f'there is no command "{name}"; {there}', ctx)
        return super().resolve_command(ctx, args)


no_progress = click.option("--no-progress", is_flag=True, help="Show no progress bar.")


def refusing(function: str, *more: Any) -> Callable[..., Any]:
    """Return a callback that refuses an option's value with the error of a function.

    So a name or an address that no record can have is a wrong use, and nothing begins to run.

    Args:
        function: ``MODULE:NAME``; imported when the option is given.
        more: its arguments after the value.
    """

    def checked(ctx: click.Context, param: click.Parameter, value: Any) -> Any:
        try:
            if value:
                resolve_name(function)(str(value), *more)
        except (ValueError, VbusError) as error:
            raise click.BadParameter(str(error)) from None
        return value

    return checked


vcd_named: Final = refusing("vbus.views.wave.signals:vcd_name")

_RECORDS: Final = (
    ("--journal", "FILE", "Write every call of every host to FILE.", None),
    ("--report", "FILE", "Write violations: .txt, .json, .xml or .sarif.",
     refusing("vbus.views.findings.formats:format_of")),
    ("--suppress", "FILE", "TOML file of accepted violations.", None),
    ("--coverage", "FILE", "Write what is exercised: .txt, .json, .html, .xml.",
     refusing("vbus.views.coverage.formats:coverage_format")),
    ("--wave", "FILE", "Write a waveform of everything to FILE (VCD).", vcd_named),
    ("--metrics", "HOST:PORT", "Numbers for Prometheus; port 0: a free one.",
     refusing("vbus.board.check.network_checks:metrics_address", True)),
)  # fmt: skip


_KEYS: Final = [name[2:] for name, *_ in _RECORDS if name != "--metrics"]


def record_options(verb: Callable[..., int]) -> Callable[..., int]:
    """Give a verb that has a board of its own the options for what is recorded of it.

    It gets ``record``, what is to replace keys of ``[record]``, and ``metrics``, which may be "".
    """

    @wraps(verb)
    def with_records(metrics: str | None, **given: Any) -> int:
        # Only what was given: the others stay as the board file has them.
        record = {key: given.pop(key) for key in _KEYS}
        record = {key: value for key, value in record.items() if value is not None}
        return verb(record=record, metrics=metrics or "", **given)

    for name, metavar, text, check in reversed(_RECORDS):
        option = click.option(name, metavar=metavar, help=text, callback=check)
        with_records = option(with_records)
    return with_records


detach_option = click.option(
    "--detach", is_flag=True, help="Return when ready; vbus stop, logs and wait follow."
)


def _rate(ctx: click.Context, param: click.Parameter, value: str | None) -> float | None:
    """Return the rate as a number."""
    if value is None or value == "max":
        return None if value is None else float("inf")
    try:
        rate = float(value)
    except ValueError:
        rate = 0.0
    # At less than a thousandth an hour of wall time is 3.6 s of chip time: that is a mistake of
    # units.
    if not 0.001 <= rate < float("inf"):
        raise click.BadParameter(f'"{value}" is no rate; write a number from 0.001 up, or "max"')
    return rate


rate_option = click.option(
    "--rate", callback=_rate, metavar="RATE", help='Chip seconds per second of wall time, or "max".'
)
from_option = click.option(
    "--from", "start", metavar="FILE", help="Go on from a snapshot (vbus snap save)."
)


def duration(ctx: click.Context, param: click.Parameter, value: Any) -> Any:
    """Return what an option gives as a duration in ps; None stays None."""
    from vbus.protocols.quantities import parse_duration

    try:
        return value if value is None else parse_duration(value)
    except ValueError as error:
        raise click.BadParameter(str(error)) from None


def endpoint_option(*names: str, text: str, multiple: bool = False) -> Decorator:
    """Return an option that takes an endpoint of Zenoh; port 0 is any free one."""

    def checked(ctx: click.Context, param: click.Parameter, value: Any) -> Any:
        from vbus.network.session import check_endpoint

        try:
            for endpoint in value if multiple else filter(None, [value]):
                check_endpoint(endpoint.replace("tls/", "tcp/", 1))  # certificates come later
        except VbusError as error:
            raise click.BadParameter(str(error)) from None
        return value

    return click.option(*names, callback=checked, multiple=multiple, metavar="ENDPOINT", help=text)


def time_option(*names: str, text: str, default: str | None = None) -> Decorator:
    """Return an option that takes an instant or a span of chip time, in ps to the verb."""
    return click.option(*names, callback=duration, default=default, metavar="TIME", help=text)


def seconds_option(
    *names: str, text: str, default: float | None = None, least: float = 0.0
) -> Decorator:
    """Return an option that takes seconds of wall time, up to a day."""
    kind = click.FloatRange(least, 86_400)
    return click.option(*names, type=kind, default=default, metavar="SECONDS", help=text)


class Line(str):
    """A line for people, and what it says as data."""

    __slots__ = ("value",)

    def __new__(cls, text: str, /, **value: Any) -> "Line":
        """Make one of its text and the keys of its data."""
        line = super().__new__(cls, text)
        line.value = value
        return line

    value: dict[str, Any]


def seconds(ps: int) -> str:
    """Return an instant in seconds, with all its digits that tell."""
    whole, fraction = divmod(ps, 10**12)
    return f"{whole}.{fraction:012}".rstrip("0").rstrip(".") + " s"


def json_line(line: str) -> str:
    """Return what a line says as one line of JSON."""
    # A line without data is still an object, so that each line of the output has the same form.
    return json.dumps(line.value if isinstance(line, Line) else {"text": line})


def show(as_json: bool, value: Any, lines: Iterable[str], indent: int | None = None) -> None:
    """Print a value as JSON, or else the lines that say the same."""
    for line in [json.dumps(value, indent=indent)] if as_json else lines:
        click.echo(line)


def complain(sentence: str) -> None:
    """Print a sentence on standard error."""
    click.echo(f"vbus: {sentence}", err=True)


@contextmanager
def reading(path: Path, kind: type[VbusError] = VbusError) -> Iterator[BinaryIO]:
    """Open a file to read.

    Raises:
        VbusError: it cannot be opened; of this kind.
    """
    # Only the opening is guarded: errors within the block are those of its reader.
    with read_errors(path, kind):
        file = path.open("rb")
    with file:
        yield file


@contextmanager
def bar(
    what: str, size: int, place: Callable[[], int], quiet: bool
) -> Iterator[Callable[[], None]]:
    """Show a bar on standard error, if that is a terminal and ``quiet`` is not set.

    Gives what moves it to ``place()`` of ``size``.
    """
    # A bar in a log would be a line for each step, and the import of rich is slow.
    if quiet or not sys.stderr.isatty():
        yield lambda: None
        return
    from rich.console import Console
    from rich.progress import Progress

    with Progress(console=Console(stderr=True), transient=True) as shown:
        task = shown.add_task(what, total=size)
        yield lambda: shown.update(task, completed=place())
