"""Failing tests as annotations of GitHub, and a run as a summary of its job."""

import os
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Final

import pytest

SUMMARY: Final = "GITHUB_STEP_SUMMARY"
"""Variable that names the file of a job's summary."""
WORKSPACE: Final = "GITHUB_WORKSPACE"
"""Variable that names the folder of the repository."""
SECTION: Final = "vbus"
"""The part of a test's report that tells of its boards."""


def said_of(report: pytest.TestReport) -> str:
    """Return what the report of a test says of its boards; "" if it has none."""
    return next((text for name, text in report.sections if name == SECTION), "")


def first_line(report: pytest.TestReport) -> str:
    """Return what went wrong, in one line."""
    crash = getattr(report.longrepr, "reprcrash", None)
    text = str(crash.message if crash is not None else report.longrepr)
    return text.splitlines()[0] if text else "failed"


def annotation(report: pytest.TestReport, root: Path) -> str:
    """Return a failing test as GitHub's runner reads it: shown in the changes, at its line."""
    path, line, name = report.location
    line = (line or 0) + 1
    crash = getattr(report.longrepr, "reprcrash", None)
    if crash is not None and (root / crash.path).resolve() == (root / path).resolve():
        line = crash.lineno
    home = Path(os.environ.get(WORKSPACE) or Path.cwd()).resolve()
    place = (root / path).resolve()
    if place.is_relative_to(home):
        path = place.relative_to(home).as_posix()
    where = f"file={_property(path)},line={line},title={_property(name)}"
    message = f"{first_line(report)}\n{said_of(report)}"
    return f"::error {where}::{_message(message)}"


def _message(text: str) -> str:
    return text.replace("%", "%25").replace("\r", "%0D").replace("\n", "%0A")


def _property(text: str) -> str:
    return _message(text).replace(":", "%3A").replace(",", "%2C")


def summary(failed: Iterable[pytest.TestReport], passed: int, more: Sequence[str]) -> str:
    """Return a summary of a job in Markdown.

    Args:
        failed: reports of the tests with a board that failed.
        passed: how many tests passed.
        more: lines to add, such as those of the coverage.
    """
    reports = list(failed)
    lines = [f"### vbus: {len(reports)} failed, {passed} passed", ""]
    for report in reports:
        heading = first_line(report).replace("&", "&amp;").replace("<", "&lt;")
        lines += [
            f"<details><summary><code>{report.nodeid}</code>: {heading}</summary>",
            "",
            *(f"    {line}" for line in said_of(report).splitlines()),
            "",
            "</details>",
            "",
        ]
    return "\n".join([*lines, *(f"    {line}" for line in more), ""])


def write(terminal: pytest.TerminalReporter, root: Path, more: Sequence[str]) -> None:
    """Print annotations, and write the summary where GitHub wants it.

    Args:
        terminal: knows the reports, and is written to.
        root: the folder that the places of tests are relative to.
        more: what the summary says besides.
    """
    failed = [
        report
        for outcome in ("failed", "error")
        for report in terminal.getreports(outcome)
        if isinstance(report, pytest.TestReport) and said_of(report)
    ]
    for report in failed:
        terminal.line(annotation(report, root))
    file = os.environ.get(SUMMARY)
    if file:
        passed = len(terminal.getreports("passed"))
        with Path(file).open("a", encoding="utf-8") as text:
            text.write(summary(failed, passed, more))
