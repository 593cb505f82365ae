"""Reports of violations: what is in them, in four formats, and what is accepted."""

import json
from xml.etree import ElementTree

import pytest

from tests.unit.views.conftest import LM629, lm629_move, read, record
from vbus import plugins
from vbus.board.build import load_board_text
from vbus.board.check.checks import all_rules
from vbus.board.host_bus import HostBus
from vbus.core.errors import OptionError, VbusError
from vbus.core.kernel import MS
from vbus.core.signals import Violation
from vbus.record.view import play
from vbus.views.clauses import ac_tables
from vbus.views.findings import formats
from vbus.views.findings.report import CONTEXT, DETAILED, Compatibility, Report
from vbus.views.findings.suppress import Suppression, read_suppressions


def careless(port: HostBus) -> None:
    """Thirty polls, a byte written while busy, thirty polls."""
    for _ in range(30):
        port.read(0)
    port.write(0, 0x02)
    port.write(0, 0x01)
    for _ in range(30):
        port.read(0)
    port.write(0, 0x3F)
    port.delay(MS)
    port.read(0)


def report_of(*hosts: object, accepted: list[Suppression] | None = None) -> Report:
    header, entries = read(record(LM629, *hosts))  # type: ignore[arg-type]
    report = Report(header.board, header.families, all_rules(), accepted, header.file)
    play(header, entries, report)
    return report


@pytest.fixture
def report() -> Report:
    return report_of(careless)


def test_a_violation_has_its_figures_and_twenty_cycles_on_either_side(report: Report) -> None:
    busy, undefined = report.findings
    assert (busy.violation.rule, busy.violation.clause) == ("lm628.busy-write", "LM-BUS-10")
    assert busy.violation.chip == "x"
    assert len(busy.before) == CONTEXT
    assert busy.before[-1].text == "host0 x w 0 02"
    assert busy.before[-1].packets == ["x DFH  [LM-CMD-3]"]
    assert busy.after[0].text == "host0 x w 0 01"
    assert busy.after[0].when == busy.violation.when
    assert busy.after[0].packets == ["x write of 01H at address 0H not taken: lm628.busy-write"]
    assert len(busy.after) == CONTEXT + 1
    assert undefined.violation.rule == "lm628.undefined-command"


def test_a_live_board_and_its_journal_give_the_same_report(report: Report) -> None:
    board = load_board_text(LM629)
    live = Report("bench", {"x": "lm628"}, all_rules(), file="board.toml")
    board.observe(live)
    port = board.open_port("host0")
    careless(port)
    port.close()
    assert formats.text(live) == formats.text(report)


def test_only_so_many_of_one_rule_are_kept_whole_and_all_are_counted() -> None:
    def worse(port: HostBus) -> None:
        for _ in range(DETAILED):
            careless(port)

    report = report_of(worse, careless)
    assert report.counts[("x", "lm628.busy-write")] == DETAILED + 1
    assert len([f for f in report.findings if f.violation.rule == "lm628.busy-write"]) == DETAILED
    assert report.left_out() == 2


def test_the_text_marks_the_cycle_and_names_the_clause(report: Report) -> None:
    text = formats.text(report)
    assert text.startswith("error: lm628.busy-write [LM-BUS-10]: x at 32us: command 01H written")
    assert "  > 32us host0 x w 0 01\n" in text
    assert "    31us host0 x w 0 02\n        x DFH  [LM-CMD-3]\n" in text
    assert text.endswith(
        "bench: 2 violations in 64 bus cycles, 0 accepted\n"
        "without effect: 1 write not taken, 1 write of nothing\n"
    )


def test_json_has_instants_in_ps_and_both_transcripts(report: Report) -> None:
    text = formats.as_json(report)
    assert text.startswith('{\n "')
    value = json.loads(text)
    assert value["cycles"] == 64
    first = value["violations"][0]
    assert (first["when_ps"], first["chip"], first["rule"]) == (32_000_000, "x", "lm628.busy-write")
    assert (first["severity"], first["accepted"]) == ("error", None)
    assert len(first["before"]) == 20
    assert first["after"][0]["cycle"] == "host0 x w 0 01"
    assert value["counts"][0] == {"chip": "x", "rule": "lm628.busy-write", "count": 1}
    assert value["no_effect"] == {"write not taken": 1, "write of nothing": 1}


def test_junit_has_a_case_for_every_rule_and_fails_those_with_errors(report: Report) -> None:
    (suite,) = ElementTree.fromstring(formats.junit(report))
    rules = [rule for rule in all_rules() if rule.name.startswith("lm628.")]
    assert suite.get("tests") == str(len(rules)) == str(len(suite))
    assert (suite.get("failures"), suite.get("skipped")) == ("1", "0")
    assert suite.get("errors") == "0"
    (failure,) = suite.iter("failure")
    assert failure.get("type") == "lm628.busy-write"
    assert "> 32us host0 x w 0 01" in (failure.text or "")
    (warning,) = suite.iter("system-out")
    assert "warning: 1 x Only command codes" in (warning.text or "")


def test_junit_has_rules_of_the_board_too() -> None:
    report = Report("b", {"x": "lm628"}, all_rules())
    report.violation(Violation(1, "bus<1>", "board.contention", "decision 9", "error", 0, 0, "a\0"))
    (suite,) = ElementTree.fromstring(formats.junit(report))
    assert suite.get("failures") == "1"
    assert [c.get("classname") for c in suite if len(c)] == ["b.bus<1>"]


def test_sarif_has_rules_results_levels_and_places(report: Report) -> None:
    value = json.loads(formats.sarif(report))
    assert value["version"] == "2.1.0"
    (run,) = value["runs"]
    rules = run["tool"]["driver"]["rules"]
    assert [rule["id"] for rule in rules] == ["lm628.busy-write", "lm628.undefined-command"]
    first, second = run["results"]
    assert (first["ruleId"], first["level"], second["level"]) == (
        "lm628.busy-write", "error", "warning",
    )  # fmt: skip
    assert rules[first["ruleIndex"]]["id"] == first["ruleId"]
    place = first["locations"][0]
    assert place["physicalLocation"]["artifactLocation"]["uri"] == "board.toml"
    assert place["logicalLocations"][0]["fullyQualifiedName"] == "bench.x"
    assert first["properties"]["when_ps"] == 32_000_000


def test_sarif_of_a_rule_nobody_has_points_at_none() -> None:
    report = Report("b", {"x": "lm628"}, [])
    report.violation(Violation(1, "x", "acme.slow", "p. 3", "error", 0, 0, "a"))
    (run,) = json.loads(formats.sarif(report))["runs"]
    assert run["results"][0]["ruleIndex"] == -1


def test_intervals_are_shown_in_nanoseconds_and_other_figures_as_they_are() -> None:
    report = Report("b", {"x": "lm628"}, all_rules())
    report.violation(
        Violation(0, "x", "lm628.T14", "LM-TIM-14", "error", 20_000, 30_500, "too short")
    )
    report.violation(Violation(0, "x", "lm628.range", "LM-TRJ-2", "warning", 9, 8, "too far"))
    text = formats.text(report)
    assert "too short (measured 20 ns, limit 30.5 ns)" in text
    assert "too far (measured 9, limit 8)" in text
    assert json.loads(formats.as_json(report))["violations"][0]["unit"] == "ps"


def test_a_run_is_seen_with_the_eyes_of_a_driver_for_another_part() -> None:
    families = {"x": plugins.family("lm628"), "y": plugins.family("mcp1200")}
    report = Report("b", {"x": "lm628", "y": "mcp1200"}, all_rules())
    watch = Compatibility("hctl-1100", families, report)
    for chip in families:
        watch.bus_cycle(MS, "h", chip, True, 0x18, 0)
    found = [(it.violation.chip, it.violation.rule) for it in report.findings]
    assert found == [("y", "mcp1200.hctl-1100.commutator")]
    with pytest.raises(OptionError) as caught:
        Compatibility("z80", families, report)
    assert (
        str(caught.value)
        == 'no chip of this run stands in for the part "z80"; they stand in for hctl-1100'
    )


def test_an_accepted_violation_is_shown_with_its_reason_in_every_format() -> None:
    accepted = [
        Suppression("lm628.busy-write", "x", "the boot code does so once"),
        Suppression("lm628", "y", "another chip"),
    ]
    report = report_of(careless, accepted=accepted)
    assert report.unaccepted("error") == 0
    assert report.unaccepted("warning") == 1
    text = formats.text(report)
    assert "  accepted: the boot code does so once\n" in text
    assert "1 accepted\n" in text
    assert 'suppression of "lm628" has covered nothing' in text
    (suite,) = ElementTree.fromstring(formats.junit(report))
    assert (suite.get("failures"), suite.get("skipped")) == ("0", "1")
    assert next(suite.iter("skipped")).get("message") == "the boot code does so once"
    (result, _) = json.loads(formats.sarif(report))["runs"][0]["results"]
    assert result["suppressions"] == [
        {"kind": "external", "justification": "the boot code does so once"}
    ]
    assert json.loads(formats.as_json(report))["unused_suppressions"] == ["lm628"]


def test_a_suppression_names_a_rule_or_a_family_and_perhaps_a_chip() -> None:
    violation = Violation(0, "x", "lm628.T14", "LM-TIM-14", "error", 0, 0, "")
    assert Suppression("lm628.T14", "", "r").covers(violation)
    assert Suppression("lm628", "x", "r").covers(violation)
    assert not Suppression("lm628.T15", "", "r").covers(violation)
    assert not Suppression("lm628.T14", "y", "r").covers(violation)


GOOD = '[[suppress]]\nrule = "lm628.T14"\nchip = "x"\nreason = "slow cable"\n'


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("[[suppress", "s.toml:1: no TOML"),
        (GOOD.replace("reason", "why"), "s.toml:4: suppress[1].why: unknown key; allowed are chip"),
        (GOOD.replace('"slow cable"', '" "'), "s.toml:4: suppress[1].reason: say in words why"),
        (GOOD.replace('"slow cable"', "3"), "s.toml:4: suppress[1].reason: found 3; write a text"),
        (
            '[[suppress]]\nrule = "lm628.T14"\n',
            's.toml:1: suppress[1]: key "reason" is missing: why it is accepted',
        ),
        ('[[suppress]]\nreason = "r"\n', 's.toml:1: suppress[1]: key "rule" is missing'),
        (GOOD.replace("T14", "busy-wirte"), 'unknown rule; did you mean "lm628.busy-write"?'),
        ('[ignore]\nrule = "x"\n', "s.toml:1: ignore: unknown section; allowed are suppress"),
        ('[supress]\nrule = "x"\n', 'did you mean "suppress"?'),
        ("suppress = 3\n", "s.toml:1: suppress: found 3; this is a list of tables: [[suppress]]"),
    ],
)
def test_a_wrong_suppression_file_is_refused_with_what_is_allowed(text: str, message: str) -> None:
    with pytest.raises(VbusError) as caught:
        read_suppressions(text, "s.toml", [rule.name for rule in all_rules()])
    assert message in str(caught.value)


def test_a_good_suppression_file_is_read() -> None:
    (one,) = read_suppressions(GOOD, "s.toml", [rule.name for rule in all_rules()])
    assert (one.rule, one.chip, one.reason) == ("lm628.T14", "x", "slow cable")


def test_the_format_follows_from_the_name() -> None:
    assert formats.format_of("a.sarif") == "sarif"
    with pytest.raises(ValueError, match=r"a\.pdf: a report's name ends in \.txt, \.json"):
        formats.format_of("a.pdf")


def test_every_row_of_the_ac_tables_has_a_rule() -> None:
    rules = {rule.name for rule in all_rules()}
    for family, _, table in ac_tables():
        assert {f"{family}.{row.symbol}" for row in table} <= rules


def test_a_run_without_violations_says_so() -> None:
    report = report_of(lambda port: port.read(0))
    assert formats.text(report) == "bench: 0 violations in 1 bus cycles, 0 accepted\n"
    assert report_of(lm629_move).cycles > 300
