"""Pages of the command line, the C client and the ledgers, made from what they are about."""

import inspect
import re
from collections.abc import Iterator

import click
import pytest
from click.testing import CliRunner

from contrib.generate.command_line import command_line
from contrib.generate.ledger import ledger
from contrib.generate.targets import HEADER, c_interface
from vbus import plugins
from vbus.chips.clauses import SILICON, clauses_of, proofs_of
from vbus.cli.cli import cli
from vbus.cli.generate.layout import ROOT


def test_every_command_is_on_the_page_with_every_option() -> None:
    page = command_line()
    context = click.Context(cli)

    for name in cli.list_commands(context):
        command = cli.get_command(context, name)
        assert command is not None
        section = page.partition(f"\n## {name}\n")[2].partition("\n## ")[0]
        assert f"vbus {name} " in section
        for option in command.params:
            if isinstance(option, click.Option):
                assert max(option.opts, key=len) in section, (name, option.name)
    assert "### fault arm\n" in page
    assert "\b" not in page
    assert "| 3 | the board file is wrong, or names" in page


def test_every_function_of_the_header_is_on_its_page() -> None:
    page = c_interface()
    functions = re.findall(r"\b(vbus_\w+)\(", (ROOT / HEADER).read_text())

    assert "vbus_wait_event" in functions
    for function in functions:
        assert f"{function}(" in page
    assert "extern" not in page


@pytest.mark.parametrize("name", ["lm628", "mcp1200", "mc1241a"])
def test_a_ledger_has_every_clause_with_its_kind_and_its_tests(name: str) -> None:
    family = plugins.family(name)
    page = ledger(family)

    for clause in clauses_of(family.home).values():
        link = f"[{clause.name}]({name}-clauses.md#{clause.name.lower()})"
        (row,) = (line for line in page.splitlines() if line.startswith(f"| {link} |"))
        assert f"| {clause.kind} | {clause.evidence}" in row
        for test in proofs_of(family.home).get(clause.name, []):
            assert f"`{test.removeprefix('tests/')}`" in row
        assert clause.tested == ("| open: " not in row)


@pytest.mark.parametrize("name", ["lm628", "mcp1200", "mc1241a"])
def test_what_silicon_decides_is_proved_by_more_than_a_model_written_from_rulings(
    name: str,
) -> None:
    home = plugins.family(name).home
    decided = [clause for clause in clauses_of(home).values() if clause.kind == SILICON]

    for clause in decided:
        assert clause.evidence
        assert "reference" not in clause.evidence
        tests = proofs_of(home).get(clause.name, [])
        assert not clause.tested or any("tests/reference/" not in test for test in tests)
    assert decided or name == "mcp1200"


def test_a_ledger_counts_the_mutants_that_tests_of_a_clause_kill() -> None:
    page = ledger(plugins.family("lm628"))
    touched = [line for line in page.splitlines() if re.search(r" \| [1-9]\d* \|$", line)]

    assert f"{len(touched)} clauses have one that their tests find" in page
    assert touched


def commands(group: click.Command, words: tuple[str, ...]) -> Iterator[tuple[str, ...]]:
    """Give the words of each command, groups included."""
    yield words
    if isinstance(group, click.Group):
        context = click.Context(group)
        for name in group.list_commands(context):
            found = group.get_command(context, name)
            assert found is not None
            yield from commands(found, (*words, name))


def test_help_prints_every_example_as_written() -> None:
    """None is wrapped: an example that is broken over lines cannot be copied."""
    examples = 0
    for words in commands(cli, ()):
        command: click.Command = cli
        for name in words:
            assert isinstance(command, click.Group)
            command = command.get_command(click.Context(command), name) or command
        paragraphs = inspect.cleandoc(command.help or "").split("\n\n")
        written = [
            line.strip()
            for paragraph in paragraphs
            if paragraph.startswith("\b") or "\nvbus " in paragraph
            for line in paragraph.removeprefix("\b").splitlines()
        ]
        shown = CliRunner().invoke(cli, [*words, "--help"], terminal_width=80).output.splitlines()
        for line in written:
            assert line in [other.strip() for other in shown], (words, line)
        examples += len(written)
    assert examples > 12
