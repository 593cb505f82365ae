"""``vbus trace``: the traces of nodes made one, and its hash."""

import click

from vbus.cli.output import show


@click.command("trace")
@click.argument("files", metavar="FILE...", nargs=-1, required=True)
@click.option("--json", "as_json", is_flag=True, help="Print JSON.")
def command(files: tuple[str, ...], as_json: bool) -> None:
    """Merge the traces of all nodes of a run and print the SHA-256 of what happened.

    FILEs are what "vbus run --trace" has written, one for each process. The hash is the same
    however many processes ran the nodes.
    """
    from vbus.serve.nodes.nodes import read_traces

    lines, digest = read_traces(files)
    show(as_json, {"hash": digest, "events": len(lines)}, [f"{digest}  {len(lines)} events"])
