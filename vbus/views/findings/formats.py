"""A report as text, JSON, JUnit XML and SARIF."""

import json
from collections.abc import Callable, Iterator
from typing import Any, Final
from xml.etree import ElementTree

import msgspec

from vbus.protocols.quantities import format_instant
from vbus.version import __version__
from vbus.views.clauses import ac_rules
from vbus.views.findings.report import CycleLine, Finding, Report

_INFORMATION: Final = "https://pypi.org/project/vbus/"


def figures(finding: Finding) -> str:
    """Return measured and limit in units a person reads; "" where both are nothing."""
    v = finding.violation
    # Rules of AC tables measure picoseconds; others count what their rule says.
    if v.rule in ac_rules():
        return f"measured {v.measured / 1000:g} ns, limit {v.limit / 1000:g} ns"
    if v.measured or v.limit:
        return f"measured {v.measured}, limit {v.limit}"
    return ""


def _sentence(finding: Finding) -> str:
    v = finding.violation
    shown = figures(finding)
    more = f" ({shown})" if shown else ""
    return f"{v.chip} at {format_instant(max(v.when, 0))}: {v.detail}{more}"


def _transcript(finding: Finding) -> Iterator[str]:
    """Give the cycles around a violation; the one it was found in is marked."""
    for line in finding.before:
        yield from _line(" ", line)
    for place, line in enumerate(finding.after):
        yield from _line(">" if place == 0 else " ", line)


def _line(mark: str, line: CycleLine) -> Iterator[str]:
    yield f"  {mark} {format_instant(line.when)} {line.text}"
    for packet in line.packets:
        yield f"  {mark}     {packet}"


def text(report: Report) -> str:
    """Return the report for people."""
    lines = []
    for finding in report.findings:
        v = finding.violation
        lines.append(f"{v.severity}: {v.rule} [{v.clause}]: {_sentence(finding)}")
        if finding.reason:
            lines.append(f"  accepted: {finding.reason}")
        else:
            lines.extend(_transcript(finding))
        lines.append("")
    for when, name, target, what, changed in report.faults:
        more = f"; {changed}" if changed else ""
        lines.append(f"fault: {name} {target} at {format_instant(when)}: {what}{more}")
    total = sum(report.counts.values())
    accepted = sum(1 for finding in report.findings if finding.reason)
    lines.append(
        f"{report.board}: {total} violations in {report.cycles} bus cycles, {accepted} accepted"
    )
    if report.no_effect.counts:
        lines.append(f"without effect: {report.no_effect.text()}")
    if report.left_out():
        lines.append(f"{report.left_out()} more of the same are not shown")
    for suppression in report.unused():
        lines.append(f'suppression of "{suppression.rule}" has covered nothing')
    return "\n".join(lines) + "\n"


def as_json(report: Report) -> str:
    """Return the report for programs; instants in ps."""
    findings = []
    for finding in report.findings:
        v = finding.violation
        findings.append(
            {
                "when_ps": v.when, "chip": v.chip, "rule": v.rule, "clause": v.clause,
                "severity": v.severity, "measured": v.measured, "limit": v.limit,
                "unit": "ps" if v.rule in ac_rules() else "", "detail": v.detail,
                "accepted": finding.reason or None, "before": msgspec.to_builtins(finding.before),
                "after": msgspec.to_builtins(finding.after),
            }
        )  # fmt: skip
    counts = [
        {"chip": chip, "rule": rule, "count": count}
        for (chip, rule), count in report.counts.items()
    ]
    value = {
        "board": report.board,
        "vbus": __version__,
        "cycles": report.cycles,
        "no_effect": dict(sorted(report.no_effect.counts.items())),
        "violations": findings,
        "counts": counts,
        "faults": [
            dict(zip(("when_ps", "name", "target", "what", "text"), evidence, strict=True))
            for evidence in report.faults
        ],
        "unused_suppressions": [suppression.rule for suppression in report.unused()],
    }
    return json.dumps(value, indent=1) + "\n"


def junit(report: Report) -> str:
    """Return a test case for each rule of each chip; errors that are not accepted fail it."""
    suite = ElementTree.Element("testsuite", {"name": _xml(report.board)})
    failures = skipped = 0
    # Rules that were not broken are test cases too: a suite without failures says what it covers.
    pairs = [
        (chip, rule)
        for chip, family in report.families.items()
        for rule in report.rules
        if rule.name.startswith(f"{family}.")
    ]
    # Those of the board itself belong to no family.
    # dict.fromkeys below drops those that a family has named already.
    pairs += [(chip, rule) for chip, name in report.counts for rule in report.rules
              if rule.name == name]  # fmt: skip
    for chip, rule in dict.fromkeys(pairs):
        mine = [
            f for f in report.findings if (f.violation.chip, f.violation.rule) == (chip, rule.name)
        ]
        where, name = _xml(f"{report.board}.{chip}"), _xml(f"{rule.name} [{rule.clause}]")
        case = ElementTree.SubElement(suite, "testcase", {"classname": where, "name": name})
        # A case without a body is one that passed.
        if not mine:
            continue
        open_ones = [finding for finding in mine if not finding.reason]
        body = "\n".join(
            line for f in open_ones or mine for line in (_sentence(f), *_transcript(f))
        )
        count = report.counts[(chip, rule.name)]
        if not open_ones:
            skipped += 1
            ElementTree.SubElement(case, "skipped", {"message": _xml(mine[0].reason)})
        elif rule.severity == "error":
            failures += 1
            attributes = {"type": rule.name, "message": _xml(f"{count} x {rule.title}")}
            ElementTree.SubElement(case, "failure", attributes).text = _xml(body)
        else:
            text = f"{rule.severity}: {count} x {rule.title}\n{body}"
            ElementTree.SubElement(case, "system-out").text = _xml(text)
    numbers = {"tests": len(suite), "failures": failures, "skipped": skipped, "errors": 0}
    suite.attrib |= {name: str(number) for name, number in numbers.items()}
    suites = ElementTree.Element("testsuites")
    suites.append(suite)
    ElementTree.indent(suites, " ")
    written = ElementTree.tostring(suites, encoding="unicode")
    return f'<?xml version="1.0" encoding="UTF-8"?>\n{written}\n'


def _xml(value: str) -> str:
    """Return a text without characters that no XML may have."""
    # XML 1.0 has no way to write other control characters, not even escaped.
    return "".join(c if c >= " " or c in "\n\t" else "?" for c in value)


def sarif(report: Report) -> str:
    """Return the report as SARIF 2.1.0."""
    used = {finding.violation.rule for finding in report.findings}
    rules = [rule for rule in report.rules if rule.name in used]
    places = {rule.name: place for place, rule in enumerate(rules)}
    results = []
    for finding in report.findings:
        v = finding.violation
        result: dict[str, Any] = {
            "ruleId": v.rule,
            "ruleIndex": places.get(v.rule, -1),
            "level": v.severity,
            "message": {"text": f"{_sentence(finding)} [{v.clause}]"},
            "locations": [
                {
                    "physicalLocation": {
                        # A place is required of each result: GitHub shows none without a file and a
                        # line.
                        "artifactLocation": {"uri": report.file or f"{report.board}.toml"},
                        "region": {"startLine": 1},
                    },
                    "logicalLocations": [
                        {"name": v.chip, "fullyQualifiedName": f"{report.board}.{v.chip}",
                         "kind": "resource"}
                    ],
                }
            ],
            "properties": {
                "when_ps": v.when, "clause": v.clause, "measured": v.measured, "limit": v.limit,
                "cycles": list(_transcript(finding)),
            },
        }  # fmt: skip
        if finding.reason:
            result["suppressions"] = [{"kind": "external", "justification": finding.reason}]
        results.append(result)
    driver = {
        "name": "vbus",
        "version": __version__,
        "informationUri": _INFORMATION,
        "rules": [
            {
                "id": rule.name,
                "shortDescription": {"text": rule.title},
                "defaultConfiguration": {"level": rule.severity},
                "properties": {"clause": rule.clause},
            }
            for rule in rules
        ],
    }
    value = {
        "$schema": "https://json.schemastore.org/sarif-2.1.0.json",
        "version": "2.1.0",
        "runs": [{"tool": {"driver": driver}, "results": results}],
    }
    return json.dumps(value, indent=1) + "\n"


FORMATS: Final[dict[str, Callable[[Report], str]]] = {
    "text": text, "json": as_json, "junit": junit, "sarif": sarif,
}  # fmt: skip
"""What writes each format."""
ENDINGS: Final = {".txt": "text", ".json": "json", ".xml": "junit", ".sarif": "sarif"}
"""Format by the end of a file's name."""


def format_of(path: str) -> str:
    """Return the format a file's name asks for.

    Raises:
        ValueError: its end is none of :data:`ENDINGS`.
    """
    for ending, name in ENDINGS.items():
        if path.endswith(ending):
            return name
    raise ValueError(f"{path}: a report's name ends in {', '.join(ENDINGS)}")
