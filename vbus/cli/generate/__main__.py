"""``python -m vbus.cli.generate [--check] [GROUP ...]``, ``--family NAME``, ``--sigrok DIR``."""

import sys
from functools import partial
from pathlib import Path

import click

from vbus import plugins
from vbus.cli.generate.sigrok import decoder_targets
from vbus.cli.generate.targets import GROUPS, family_targets, stale, write


@click.command(context_settings={"help_option_names": ["-h", "--help"]})
@click.option("--check", is_flag=True, help="Only say what is out of date; exit 1 if something is.")
@click.option("--family", metavar="NAME", help="Make all files of one installed chip family.")
@click.option(
    "--sigrok", metavar="DIR", help="Make sigrok's decoders of all installed families in DIR."
)
@click.argument("groups", nargs=-1, type=click.Choice(sorted(GROUPS)))
def main(check: bool, family: str | None, sigrok: str | None, groups: tuple[str, ...]) -> None:
    """Make the files that follow from tables; all groups unless some are named."""
    makers = [targets for group in groups or tuple(GROUPS) for targets in GROUPS[group]]
    if family is not None:
        one = plugins.family(family)
        if not one.home:
            known = ", ".join(known.name for known in plugins.families() if known.home)
            raise click.BadParameter(f'there is no family "{family}"; there are {known}')
        makers = [lambda: family_targets(one)]
    if sigrok is not None:
        folder = str(Path(sigrok).resolve())
        makers = [partial(decoder_targets, one, folder) for one in plugins.families()]
    found = []
    for targets in makers:
        found += stale(targets()) if check else write(targets())
    for path in found:
        click.echo(f"{'out of date' if check else 'written'}: {path}")
    if check and found:
        sys.exit(1)


main()
