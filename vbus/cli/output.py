"""What verbs have in common: what they print, the files they read and write, their options."""

import json
import sys
from collections.abc import Callable, Collection, Iterable, Iterator
from contextlib import contextmanager, suppress
from functools import wraps
from pathlib import Path
from pkgutil import resolve_name
from typing import Any, BinaryIO, ClassVar, Final

import click
from click.core import ParameterSource

from vbus.core.errors import VbusError, read_errors, value_errors

Decorator = Callable[[Callable[..., Any]], Callable[..., Any]]


class Verbs(click.Group):
    """A group whose message about an unknown command has the likely one, and all there are.

    Attributes:
        GONE: commands that there were, and what to use in their place.
    """

    GONE: ClassVar[dict[str, str]] = {}

    def resolve_command(
        self, ctx: click.Context, args: list[str]
    ) -> tuple[str | None, click.Command | None, list[str]]:
        """Return the command that the first word names, and the words behind it."""
        name, known = args[0], self.list_commands(ctx)
        if name not in known and not name.startswith("-"):
            from vbus.core.values.settings import among

            instead = f"{self.GONE[name]}; " if name in self.GONE else ""
            there = instead + among(name, known, "there are")
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
            for one in value if isinstance(value, tuple) else filter(None, [value]):
                resolve_name(function)(str(one), *more)
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


RECORDS: Final = [name[2:] for name, *_ in _RECORDS if name != "--metrics"]
"""Options that replace a key of a board file's ``[record]``."""


def record_options(verb: Callable[..., int]) -> Callable[..., int]:
    """Give a verb that has a board of its own the options for what is recorded of it.

    It gets ``record``, what is to replace keys of ``[record]``, and ``metrics``, which may be "".
    """

    @wraps(verb)
    def with_records(metrics: str | None, **given: Any) -> int:
        # Only what was given: the others stay as the board file has them.
        record = {key: given.pop(key) for key in RECORDS}
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


def serving_options(verb: Callable[..., int]) -> Callable[..., int]:
    """Give a verb that serves boards until Ctrl-C the options of all such verbs."""
    as_json = click.option(
        "--json", "as_json", is_flag=True, help="Print one line of JSON when ready."
    )
    for option in (detach_option, as_json, from_option, record_options, rate_option):
        verb = option(verb)
    return verb


def duration(ctx: click.Context, param: click.Parameter, value: Any) -> Any:
    """Return what an option gives as a duration in ps; None stays None."""
    from vbus.protocols.quantities import parse_duration

    with value_errors(click.BadParameter):
        return value if value is None else parse_duration(value)


def positive(ctx: click.Context, param: click.Parameter, value: Any) -> Any:
    """Return what an option gives as a duration in ps, which is not 0; None stays None."""
    length = duration(ctx, param, value)
    if length == 0:
        raise click.BadParameter("it is no time at all; write one above 0, such as 500us")
    return length


def refuse_given(names: Collection[str], why: str) -> None:
    """Refuse options that are on the command line and would be without effect.

    Args:
        names: of the verb's parameters.
        why: the rest of the sentence, after the option.

    Raises:
        click.UsageError: at least one is given.
    """
    context = click.get_current_context()
    for param in context.command.params:
        source = context.get_parameter_source(str(param.name))
        if param.name in names and source is ParameterSource.COMMANDLINE:
            raise click.UsageError(f"{param.opts[-1]} {why}")


def endpoint_option(*names: str, text: str, multiple: bool = False) -> Decorator:
    """Return an option that takes an endpoint of Zenoh; port 0 is any free one."""
    # Whether there are certificates is known later, when the file that names them is read.
    check = refusing("vbus.network.session:check_endpoint", True)
    return click.option(*names, callback=check, multiple=multiple, metavar="ENDPOINT", help=text)


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


def complain(sentence: str, who: str = "vbus: ") -> None:
    """Print a sentence on standard error.

    What is at work goes on where nobody reads it any more: a server says it in the midst of that.

    Args:
        sentence: the sentence.
        who: stands in front of it.
    """
    with suppress(OSError):
        click.echo(f"{who}{sentence}", err=True)


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
