"""Pages of the chips, made from their tables."""

import re

import pytest

from contrib.generate.targets import chip_pages
from vbus import plugins
from vbus.board.check.checks import all_rules
from vbus.chips.clauses import clauses_of
from vbus.cli.generate.chip_pages import clause_page, page
from vbus.cli.generate.layout import ROOT, stale

FAMILIES = ("lm628", "mcp1200", "mc1241a")


@pytest.mark.parametrize("family", FAMILIES)
def test_every_rule_of_a_chip_is_on_its_page(family: str) -> None:
    text = page(plugins.family(family))

    rules = [rule for rule in all_rules() if rule.name.startswith(f"{family}.")]
    assert rules
    for rule in rules:
        (row,) = re.findall(rf"^\| `{re.escape(rule.name)}` .*$", text, re.MULTILINE)
        assert rule.clause in row


@pytest.mark.parametrize("name", FAMILIES)
def test_a_page_begins_with_what_the_part_is_for_and_where_it_sits(name: str) -> None:
    family = plugins.family(name)
    begin, _, _ = page(family).partition("\n## ")

    assert family.about
    assert begin.index(family.about) < begin.index(f"](../pictures/{name}.svg)")
    assert (ROOT / "docs" / "pictures" / f"{name}.svg").exists()


def test_every_command_and_register_is_on_a_page_with_its_code() -> None:
    found = 0
    for name in FAMILIES:
        family = plugins.family(name)
        text = page(family)
        for command in family.commands:
            assert f"| `{command.name}` | {command.code:02X}H |" in text
        for register in family.registers:
            assert f"| `{register.name}` | {register.addresses[0]:02X}H" in text
        found += len([*family.commands, *family.registers])
    assert found > 100


def test_every_note_of_a_chip_is_named_on_its_page() -> None:
    for family in FAMILIES:
        notes = (ROOT / "vbus" / "chips" / family / "NOTES.md").read_text()
        numbers = re.findall(r"^(\d+)\. ", notes, re.MULTILINE)
        _, _, silent = page(plugins.family(family)).partition("## Where the manual is silent")

        assert re.findall(r"^(\d+)\. ", silent, re.MULTILINE) == numbers


def test_the_pages_are_up_to_date() -> None:
    assert stale(chip_pages()) == [], 'run "python -m contrib.generate documents"'


def test_links_of_the_pages_lead_to_files_and_headings() -> None:
    pages = {path: make() for path, make in chip_pages()}
    headings = {
        path: {line.strip("# ").lower() for line in text.splitlines() if line.startswith("##")}
        for path, text in pages.items()
    }
    for path, text in pages.items():
        for link in re.findall(r"\]\(([^)]+)\)", text):
            file, _, heading = link.partition("#")
            assert (ROOT / path).parent.joinpath(file).exists(), (path, link)
            assert not heading or heading in headings[f"docs/chips/{file}"], (path, link)


@pytest.mark.parametrize("family", FAMILIES)
def test_every_clause_of_a_chip_is_on_a_page_and_linked_from_its_rows(family: str) -> None:
    text = clause_page(plugins.family(family))

    for clause in clauses_of(f"vbus.chips.{family}").values():
        assert f"\n## {clause.name}\n\n**{clause.title}**\n" in text
    for rule in all_rules():
        if rule.name.startswith(f"{family}."):
            link = f"[{rule.clause}]({family}-clauses.md#{rule.clause.lower()})"
            assert link in page(plugins.family(family))


def test_every_rule_that_a_clause_names_is_one() -> None:
    rules = {rule.name for rule in all_rules()}
    for family in FAMILIES:
        for clause in clauses_of(f"vbus.chips.{family}").values():
            named = re.findall(rf"`({family}\.[\w-]+)`", clause.text)
            assert set(named) <= rules, clause.name


def test_a_clause_on_its_page_says_what_explain_says() -> None:
    text = (
        clause_page(plugins.family("lm628")).partition("\n## LM-BUS-14\n")[2].partition("\n## ")[0]
    )

    assert text.startswith("\n**Busy gates; the status read itself is not required**\n(manual: ")
    assert clauses_of("vbus.chips.lm628")["LM-BUS-14"].text in text
    assert "No test: The manual itself calls it untestable" in clause_page(plugins.family("lm628"))
    assert "Rules: `lm628.busy-write`, `lm628.busy-read`." in clause_page(plugins.family("lm628"))


def test_ac_limits_differ_by_supply_and_by_speed_grade() -> None:
    assert "| interval | limit, 5 V | limit, 3.3 V |" in page(plugins.family("mcp1200"))
    assert "| at least 50 ns, at most 500 ns | at least 70 ns, at most 500 ns |" in page(
        plugins.family("mcp1200")
    )
    assert "grade -6: T4 78 ns, T5 166 ns" in page(plugins.family("lm628"))
