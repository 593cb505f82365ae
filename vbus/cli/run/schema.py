"""``vbus schema``: the JSON Schema of board files."""

import json

import click


@click.command("schema")
def command() -> None:
    """Print the JSON Schema of board files, for editors.

    It has the settings of every chip, plant and fault installed here. An editor that knows TOML
    completes and checks a board file whose first line names the schema:

    \b
        vbus schema > board.schema.json
        #:schema ./board.schema.json
    """
    from vbus.boardfile.schema import schema

    click.echo(json.dumps(schema(), indent=2, ensure_ascii=False))
