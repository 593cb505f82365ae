"""Whether a file is what a program of others reads, by the schemas that check-jsonschema brings."""

from pathlib import Path


def mistakes(schema: str, *files: Path) -> str:
    """Return what is wrong with files; nothing if they are as the schema says.

    The command is called here: as a process it takes ten times as long to start as to look.
    """
    # Each worker collects all tests, and what this imports would be a tenth of that.
    from check_jsonschema.cli.main_command import main
    from click.testing import CliRunner

    done = CliRunner().invoke(main, ["--builtin-schema", schema, *map(str, files)])
    return done.output + repr(done.exception) if done.exit_code else ""
