"""``vbus fault``: break a running board, on schedule, and look at the evidence."""

from collections.abc import Iterable, Iterator
from typing import TYPE_CHECKING, Any

import click

from vbus.cli.output import Verbs, show
from vbus.serve.registry import order

if TYPE_CHECKING:
    from vbus.faults.row import Fault


@click.group("fault", cls=Verbs)
def command() -> None:
    """Arm and clear faults of a running board; show what they did.

    BOARD is the name "vbus ls" shows.
    """


@command.command("list")
@click.argument("board", required=False)
@click.option("--json", "as_json", is_flag=True, help="Print JSON; times in ps.")
def listing(board: str | None, as_json: bool) -> None:
    """List the faults there are, or those that were armed on BOARD."""
    if board is None:
        from vbus.faults.table import faults

        show(as_json, [_row(fault) for fault in faults().values()], _table(faults().values()))
        return
    armed = order(board, "fault.list")
    show(as_json, armed, [one["text"] for one in armed] or ["no fault was armed"])


def _row(fault: "Fault") -> dict[str, Any]:
    return {
        "name": fault.name,
        "family": fault.family,
        "title": fault.title,
        "target": fault.target,
        "parameters": {row.name: row.default for row in fault.parameters},
    }


def _table(faults: "Iterable[Fault]") -> Iterator[str]:
    family = ""
    for fault in faults:
        if fault.family != family:
            family = fault.family
            yield f"{family}:"
        keys = "".join(f" {row.name}" for row in fault.parameters)
        yield f"  {fault.name + keys:34} {fault.title}"


@command.command("arm")
@click.argument("board")
@click.argument("fault")
@click.argument("parameters", nargs=-1, metavar="[NAME=VALUE]...")
@click.option("--target", default="", help='Chip "x", axis "x.2", link "host0" or a wire.')
@click.option("--when", help='"at 5 ms", "cycle 12", "position 1000", "command LTRJ", '
              '"edge x./RST low" or "rate 10 Hz"; now if not given.')  # fmt: skip
@click.option("--until", help='"once", "for 5 ms" or "cleared".')
@click.option("--json", "as_json", is_flag=True, help="Print JSON; times in ps.")
def arm(
    board: str, fault: str, parameters: tuple[str, ...], target: str, when: str | None,
    until: str | None, as_json: bool,
) -> None:  # fmt: skip
    """Arm a FAULT on a running BOARD; "vbus fault list" shows which there are."""
    given: dict[str, str] = {}
    for parameter in parameters:
        key, equals, value = parameter.partition("=")
        if not equals:
            raise click.UsageError(f'found "{parameter}"; write a parameter as NAME=VALUE')
        given[key] = value
    armed = order(
        board, "fault.arm", name=fault, target=target, when=when, until=until, parameters=given
    )
    show(as_json, armed, [armed["text"]])


@command.command("clear")
@click.argument("board")
@click.argument("which", default="all")
@click.option("--json", "as_json", is_flag=True, help="Print JSON; times in ps.")
def clear(board: str, which: str, as_json: bool) -> None:
    """End faults of a running BOARD, or call them off: a number, a name, or all."""
    cleared = order(board, "fault.clear", which=which)
    show(as_json, cleared, [one["text"] for one in cleared] or ["nothing waited or acted"])


@command.command("log")
@click.argument("board")
@click.option("--json", "as_json", is_flag=True, help="Print JSON; instants in ps.")
def log(board: str, as_json: bool) -> None:
    """Show when faults of a running BOARD began and ended, and what they changed."""
    evidence = order(board, "fault.log")
    lines = [
        f"{one['when_ps'] / 1e9:.6f} ms #{one['number']} {one['name']} {one['target']}:"
        f" {one['what']}" + (f"; {one['text']}" if one["text"] else "")
        for one in evidence
    ]
    show(as_json, evidence, lines or ["nothing has happened"])
