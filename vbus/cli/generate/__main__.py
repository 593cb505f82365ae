"""``python -m vbus.cli.generate [--check] --family NAME``, or ``--sigrok DIR``."""

from functools import partial
from pathlib import Path

import click

from vbus import plugins
from vbus.cli.generate.layout import make
from vbus.cli.generate.sigrok import decoder_targets
from vbus.cli.generate.targets import family_targets


@click.command(context_settings={"help_option_names": ["-h", "--help"]})
@click.option("--check", is_flag=True, help="Only say what is out of date; exit 1 if something is.")
@click.option("--family", metavar="NAME", help="Make all files of one installed chip family.")
@click.option(
    "--sigrok", metavar="DIR", help="Make sigrok's decoders of all installed families in DIR."
)
def main(check: bool, family: str | None, sigrok: str | None) -> None:
    """Make the files that follow from the tables of installed chips."""
    # Nothing is made by accident: the files of the source tree have a command of their own.
    if family is None and sigrok is None:
        raise click.UsageError(
            "name a chip family with --family, or a folder with --sigrok; files of the source tree"
            " of vbus are made there by: python -m contrib.generate"
        )
    if family is not None:
        one = plugins.family(family)
        if not one.home:
            known = ", ".join(known.name for known in plugins.families() if known.home)
            raise click.BadParameter(f'there is no family "{family}"; there are {known}')
        make([partial(family_targets, one)], check)
    if sigrok is not None:
        folder = str(Path(sigrok).resolve())
        make([partial(decoder_targets, one, folder) for one in plugins.families()], check)


main()
