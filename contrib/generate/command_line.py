"""Makes the page of the command line from the commands themselves."""

import re
from collections.abc import Iterator
from inspect import cleandoc
from typing import Final

import click

from vbus.cli.cli import cli
from vbus.cli.generate.layout import table
from vbus.core import exit_codes

_HEAD: Final = """\
# The command line

<!-- Made from the commands by contrib.generate; change those. -->

`vbus --help` lists the commands, `vbus COMMAND --help` says what each takes. Every command takes
`-h` and `--help`.

A shell completes commands, options, names of running boards, part numbers, faults, demonstrations,
board files and journals, with one line in `~/.bashrc`, `~/.zshrc` or
`~/.config/fish/completions/vbus.fish`:

```bash
eval "$(_VBUS_COMPLETE=bash_source vbus)"    # bash
eval "$(_VBUS_COMPLETE=zsh_source vbus)"     # zsh
_VBUS_COMPLETE=fish_source vbus | source     # fish
```
"""


def command_line() -> str:
    """Return the page: every command with its arguments and options, and the exit codes."""
    codes = ((str(code), meaning) for code, meaning in exit_codes.MEANINGS.items())
    lines = [_HEAD, *_command(cli, "vbus"), "## Exit codes", "", *table(("code", "meaning"), codes)]
    return "\n".join(lines) + "\n"


def _command(command: click.Command, path: str) -> Iterator[str]:
    """Give the lines of a command, and of those below it."""
    context = click.Context(command, info_name=path)
    # The head of the page says what "vbus --help" does.
    if command is not cli:
        usage = " ".join([path, *command.collect_usage_pieces(context)])
        yield from (f"{'#' * len(path.split())} {path[len('vbus ') :]}", "")
        yield from ("```text", usage, "```", "", *_paragraphs(cleandoc(command.help or "")))
        yield from _options(command, context)
    if isinstance(command, click.Group):
        for name in command.list_commands(context):
            below = command.get_command(context, name)
            if below is not None and not below.hidden:
                yield from _command(below, f"{path} {name}")


def _paragraphs(text: str) -> Iterator[str]:
    """Give the help text; blocks that click does not wrap stay as they are."""
    for paragraph in text.split("\n\n"):
        # click's mark for "do not wrap": examples and tables.
        if paragraph.startswith("\b\n"):
            yield from ("```text", paragraph.removeprefix("\b\n"), "```", "")
        elif paragraph:
            yield from (_escaped(paragraph), "")


def _options(command: click.Command, context: click.Context) -> Iterator[str]:
    records = (
        parameter.get_help_record(context) or ("", "")
        for parameter in command.get_params(context)
        # Every command has it: the head of the page says so once.
        if "--help" not in parameter.opts
    )
    rows = [(f"`{names}`", _escaped(text)) for names, text in records if text]
    if rows:
        yield from (*table(("option", "meaning"), rows), "")


def _escaped(text: str) -> str:
    """Return text in which nothing is a mark of Markdown by accident."""
    # Names such as until_ready, and <file>, would become emphasis and tags.
    return re.sub(r"([*_<>])", r"\\\1", text)
