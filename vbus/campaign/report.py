"""What a campaign has found: as lines, as JSON, as JUnit does, and as one page."""

from collections.abc import Callable, Collection, Iterable, Iterator, Mapping
from html import escape
from pathlib import Path
from typing import Final
from xml.etree import ElementTree

import msgspec

from vbus.campaign.plan import PlannedWorld
from vbus.campaign.verdict import (
    DETECTED,
    FOUND,
    HANG,
    NO_EFFECT,
    SILENT,
    SLOW,
    VERDICTS,
    Campaign,
    Result,
    Tried,
    WayTotal,
    early,
)
from vbus.campaign.world import read_world
from vbus.core.errors import VbusError, content

QUIET: Final = (SILENT, FOUND)
_HEADS: Final = {DETECTED: "detected", NO_EFFECT: "no effect", HANG: "hang", FOUND: "finding",
                 SILENT: "silent"}  # fmt: skip
FILES: Final = ("json", "junit", "page")
"""Files that a campaign may write, by the options that name them."""
_STORED: Final = 100
"""Runs after which results are stored: a second or so of a function, some ten of a program."""
Line = Callable[[PlannedWorld], str]
"""Gives the line that runs a world again."""


class Saved(msgspec.Struct):
    """A file of ``--json``.

    Attributes:
        digests: by test, or "" of a program: of board and program; others have other results.
        results: by :attr:`PlannedWorld.name`.
        keys: dimension, group and way of each silent outcome: what a baseline is asked for.
        totals: what came of each way in the campaign that wrote it last.
    """

    digests: dict[str, str] = {}
    results: dict[str, Result] = {}
    keys: list[tuple[str, str, str]] = []
    totals: list[WayTotal] = []

    def of(self, digest: str, test: str = "") -> dict[str, Result]:
        """Return the results of a test or program; forget those of another state of it."""
        # The text of a world has no blank behind its colons.
        mine = {name: one for name, one in self.results.items() if name.rpartition(": ")[0] == test}
        if self.digests.get(test) != digest:
            self.results = {name: one for name, one in self.results.items() if name not in mine}
            mine = {}
        self.digests[test] = digest
        return mine

    def take(
        self, one: PlannedWorld, result: Result, put: Callable[[bytes], object] | None
    ) -> None:
        """Take a result; store all of them now and then, for a campaign that is stopped."""
        if result.verdict == SLOW:  # the next campaign tries it again
            return
        self.results[one.name] = msgspec.structs.replace(result, group=one.group)
        if put is not None and len(self.results) % _STORED == 0:
            put(as_json(self))

    def silent(self) -> list[tuple[str, str, str]]:
        """Return dimension, group and way of each silent outcome, of earlier campaigns too."""
        found = set()
        for name, result in self.results.items():
            if result.verdict in QUIET:
                test, colon, text = name.rpartition(": ")
                world = read_world(text)
                found.add((world.dimension, f"{test}{colon}{result.group}", world.way))
        return sorted(found)


def as_json(saved: Saved) -> bytes:
    """Return a file of ``--json``."""
    # Processes end in any order.
    digests, results = dict(sorted(saved.digests.items())), dict(sorted(saved.results.items()))
    whole = Saved(digests, results, saved.silent(), saved.totals)
    return msgspec.json.format(msgspec.json.encode(whole), indent=1) + b"\n"


def write(
    campaign: Campaign,
    saved: Saved,
    new: Collection[Tried],
    subject: str,
    line: Line,
    files: Mapping[str, Callable[[bytes], object]],
) -> None:
    """Write what came of a campaign.

    Args:
        campaign: the campaign.
        saved: its results, which take its outcomes and totals.
        new: outcomes that fail it.
        subject: what was run.
        line: gives the line that runs a world again.
        files: by what they are, of :data:`FILES`, what writes them.
    """
    saved.totals = campaign.totals()
    makers = {
        "json": lambda: as_json(saved),
        "junit": lambda: as_junit(campaign, new, line),
        "page": lambda: as_page(campaign, subject, line),
    }
    for kind, put in files.items():
        put(makers[kind]())


def _read(path: str) -> Saved:
    data = content(path)
    try:
        saved = msgspec.json.decode(data, type=Saved)
        saved.silent()  # its names are worlds
        return saved
    except (msgspec.DecodeError, ValueError) as error:
        raise VbusError(f"{path}: this is no file of vbus campaign --json: {error}") from None


def read_saved(path: str) -> Saved:
    """Return what a file has of an earlier campaign, if it is there.

    Raises:
        VbusError: the file is there and is none, or cannot be read.
    """
    return _read(path) if Path(path).exists() else Saved()


def check_files(written: Iterable[str | None], read: Iterable[str | Path | None]) -> None:
    """Refuse to write over what a campaign reads: its baseline, the driver, the tests.

    Raises:
        ValueError: a file is both.
    """
    taken = {Path(name).resolve() for name in read if name}
    for name in filter(None, written):
        if Path(name).resolve() in taken:
            raise ValueError(f"{name}: this campaign reads it; give what is written another file")


def read_baseline(path: str) -> Collection[tuple[str, str, str]]:
    """Return the silent outcomes that a file names.

    Raises:
        VbusError: it is no file of ``--json``, or cannot be read.
    """
    return _read(path).keys


# -- lines ----------------------------------------------------------------------------------------


def shown(coverage: float | None) -> str:
    """Return a diagnostic coverage as people read it."""
    return "-" if coverage is None else f"{100 * coverage:.0f} %"


def _cells(total: WayTotal) -> list[object]:
    """Return what the table has of a way, under its heads."""
    counts = (total.counts.get(one, 0) for one in VERDICTS)
    return [*counts, total.tried, total.left, shown(total.coverage)]


def _untried(campaign: Campaign) -> Iterator[str]:
    """Say of what nothing was tried, each reason once."""
    reasons: dict[str, list[str]] = {}
    for what, why in campaign.plan.refused.items():
        reasons.setdefault(why, []).append(what)
    if untouched := [total.name for total in campaign.totals() if not total.tried and total.left]:
        reasons["the campaign ended before"] = untouched
    for why, whats in reasons.items():
        yield f"not tried: {', '.join(whats)}: {why}"


def lines(
    campaign: Campaign,
    known: Collection[tuple[str, str, str]] | None,
    line: Line,
    most: int | None,
) -> Iterator[str]:
    """Give the table, and what was silent, hung, or failed with nothing broken, with its replay.

    Args:
        campaign: the campaign.
        known: outcomes of the baseline; None: there is none.
        line: gives that line.
        most: outcomes to tell; None: all.
    """
    heads = (*_HEADS.values(), "tried", "not tried", "coverage")
    yield f"{'':24}" + "".join(f"{head:>10}" for head in heads)
    for total in campaign.totals():
        yield f"{total.name:24}" + "".join(f"{cell:>10}" for cell in _cells(total))
    yield from _untried(campaign)
    yield from outcomes(campaign, known, line, most)


def outcomes(
    campaign: Campaign,
    known: Collection[tuple[str, str, str]] | None,
    line: Line,
    most: int | None,
    everything: str = "--all tells them, --json and --page have them",
) -> Iterator[str]:
    """Give what is to be looked at, as :func:`lines` does; ``everything`` says where all is."""
    listed = campaign.listed()
    for number, one in enumerate(listed):
        if most is not None and number >= most:
            yield f"{len(listed) - most} more; {everything}"
            break
        new = " (new)" if known is not None and one.quiet and one.key not in known else ""
        verdict = "fails, and nothing is broken" if one.fails else one.result.verdict
        yield f"{verdict}{new}: {one.planned.group}, {one.replay.world.sentence()}"
        yield f"    {one.result.reason}"
        for finding in one.result.findings:
            yield f"    finding: {finding}"
        yield f"    {line(one.replay)}"
    for (_, finding), worlds in campaign.unsafe().items():
        first = worlds[0]
        many = f"{len(worlds)} worlds, first " if len(worlds) > 1 else ""
        where = f"{first.planned.group}, {first.planned.world.sentence()}"
        yield f"detected, and yet {finding}: {many}{where}"
        yield f"    {line(first.planned)}"


# -- JUnit ----------------------------------------------------------------------------------------


def as_junit(campaign: Campaign, new: Collection[Tried], line: Line) -> bytes:
    """Return a JUnit file: a test case for each group and way; a new silent outcome fails it."""
    failing = {one.key: one for one in new}
    cases = sorted({one.key for one in campaign.tried})
    suite = ElementTree.Element(
        "testsuite", name="vbus campaign", tests=str(len(cases)), failures=str(len(failing))
    )
    for dimension, group, way in cases:
        case = ElementTree.SubElement(
            suite, "testcase", classname=f"campaign.{dimension}", name=f"{group}: {way}"
        )
        one = failing.get((dimension, group, way))
        if one is not None:
            failure = ElementTree.SubElement(case, "failure", message=one.result.verdict)
            world = one.replay.world
            failure.text = f"{world.sentence()}: {one.result.reason}\n{line(one.replay)}"
    ElementTree.indent(suite)
    text: bytes = ElementTree.tostring(suite, encoding="utf-8", xml_declaration=True)
    return text + b"\n"


# -- page -----------------------------------------------------------------------------------------

_STYLE: Final = """
body{font:14px system-ui,sans-serif;margin:2em;color:#222;background:#fff}
table{border-collapse:collapse;margin:1em 0}td,th{border:1px solid #ccc;padding:.2em .6em}
th{text-align:left;background:#f4f4f4}td{text-align:center}td.l{text-align:left}
.detected{background:#cfe8cf}.noeffect{background:#f2f2f2}.hang{background:#f6d9a8}
.silent{background:#f2b8b8}.finding{background:#f8dada}
.left{color:#888}details{display:inline}pre{white-space:pre-wrap;text-align:left;max-width:60em}
"""
_WORST: Final = (SILENT, FOUND, HANG, DETECTED, NO_EFFECT)


def as_page(campaign: Campaign, subject: str, line: Line) -> bytes:
    """Return one page: a matrix of groups and ways, each cell with the line that runs it again.

    Args:
        campaign: the campaign.
        subject: what was run, for its head.
        line: gives that line.
    """
    out = [f"<!doctype html><meta charset=utf-8><title>vbus campaign</title><style>{_STYLE}</style>"
           f"<h1>vbus campaign</h1><p><code>{escape(subject)}</code></p>"]  # fmt: skip
    heads = (*_HEADS.values(), "tried", "not tried", "diagnostic coverage")
    out.append("<table><tr><th>way" + "".join(f"<th>{head}" for head in heads))
    for total in campaign.totals():
        out.append(f"<tr><th>{escape(total.name)}"
                   + "".join(f"<td>{cell}" for cell in _cells(total)))  # fmt: skip
    out.append("</table>")
    out += [f"<p>{escape(sentence)}" for sentence in _untried(campaign)]
    for dimension in dict.fromkeys(total.dimension for total in campaign.totals()):
        out.append(_matrix(campaign, dimension, line))
    return "\n".join(out).encode() + b"\n"


def _matrix(campaign: Campaign, dimension: str, line: Line) -> str:
    cells: dict[tuple[str, str], list[Tried]] = {}
    planned = [one for one in campaign.plan.worlds if one.world.dimension == dimension]
    for one in campaign.tried:
        if one.dimension == dimension:
            cells.setdefault((one.planned.group, one.planned.world.way), []).append(one)
    left = {(one.group, one.world.way) for one in planned}
    ways = [total.way for total in campaign.totals() if total.dimension == dimension]
    out = [f"<h2>{escape(dimension)}</h2><table><tr><th>what"]
    out += [f"<th>{escape(way)}" for way in ways]
    for group in dict.fromkeys(one.group for one in sorted(planned, key=early)):
        out.append(f"<tr><td class=l>{escape(group)}")
        out += [_cell(cells.get((group, way), []), line, (group, way) in left) for way in ways]
    out.append("</table>")
    return "".join(out)


def _cell(tried: list[Tried], line: Line, there: bool) -> str:
    if not tried:
        return "<td class=left>not tried" if there else "<td>"
    # A cell shows the worst of its worlds: one silent outcome is what its reader looks for.
    one = min(tried, key=lambda one: _WORST.index(one.result.verdict))
    verdict = one.result.verdict
    same = sum(other.result.verdict == verdict for other in tried)
    findings = "".join(f"\nfinding: {finding}" for finding in one.result.findings)
    world = one.replay.world
    text = f"{world.sentence()}\n{one.result.reason}{findings}\n{line(one.replay)}"
    return (
        f"<td class={_HEADS[verdict].replace(' ', '')}><details><summary>{_HEADS[verdict]}"
        f" {same}/{len(tried)}</summary><pre>{escape(text)}</pre></details>"
    )
