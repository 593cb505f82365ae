"""``vbus cflags``: what a C compiler must be told to build a host against the C client."""

import json
from pathlib import Path

import click

from vbus.errors import VbusError
from vbus.native import include_dir


@click.command("cflags")
@click.option("--json", "as_json", is_flag=True, help="Print JSON.")
def command(as_json: bool) -> None:
    """Print the compiler options of the C client: include path and source file.

    \b
    cc $(vbus cflags) -o host host.c
    """
    folder = Path(include_dir())
    sources = [str(folder / "vbus.c")]
    headers = [str(folder / "vbus.h")]
    if not all(Path(file).exists() for file in [*sources, *headers]):
        raise VbusError(f"the C client is missing from {folder}; install vbus again")
    if as_json:
        click.echo(json.dumps({"include": str(folder), "sources": sources, "headers": headers}))
    else:
        click.echo(" ".join([f"-I{folder}", *sources]))
