"""``python -m contrib.generate [--check] [GROUP ...]``, in the source tree."""

import click

from contrib.generate.targets import GROUPS
from vbus.cli.generate.layout import make


@click.command(context_settings={"help_option_names": ["-h", "--help"]})
@click.option("--check", is_flag=True, help="Only say what is out of date; exit 1 if something is.")
@click.argument("groups", nargs=-1, type=click.Choice(sorted(GROUPS)))
def main(check: bool, groups: tuple[str, ...]) -> None:
    """Make the files of the source tree that follow from tables; all groups unless some are named.

    The results are committed; tests make them again and compare.
    """
    make([targets for group in groups or GROUPS for targets in GROUPS[group]], check)


main()
