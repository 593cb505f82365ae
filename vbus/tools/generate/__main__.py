"""``python -m vbus.tools.generate [--check] [clients] [documents]``."""

import sys

import click

from vbus.tools.generate.targets import GROUPS, stale, write


@click.command(context_settings={"help_option_names": ["-h", "--help"]})
@click.option("--check", is_flag=True, help="Only say what is out of date; exit 1 if something is.")
@click.argument("groups", nargs=-1, type=click.Choice(sorted(GROUPS)))
def main(check: bool, groups: tuple[str, ...]) -> None:
    """Make the files that follow from tables; all groups unless some are named."""
    found = []
    for group in groups or tuple(GROUPS):
        for targets in GROUPS[group]:
            found += stale(targets()) if check else write(targets())
    for path in found:
        click.echo(f"{'out of date' if check else 'written'}: {path}")
    if check and found:
        sys.exit(1)


main()
