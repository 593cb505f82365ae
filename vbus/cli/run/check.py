"""``vbus check`` and ``vbus schema``: board files, and the rules that hosts are held to."""

import json
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import asdict
from typing import Any

import click
from msgspec import structs

from vbus.board.board import Board
from vbus.boardfile.sections import BoardFile
from vbus.boardfile.source import Source
from vbus.cli.output import show
from vbus.core import exit_codes
from vbus.core.errors import VbusError
from vbus.serve.recording import ALONE, UNREPORTED
from vbus.views.findings.suppress import suppressions_of


@click.command("check")
@click.argument("boards", metavar="[BOARD]...", nargs=-1)
@click.option("--rules", is_flag=True, help="List every violation rule: clause, severity, AC row.")
@click.option("--map", "mapped", is_flag=True, help="Show what answers at each address of a card.")
@click.option("--json", "as_json", is_flag=True, help="Print JSON.")
def check(boards: tuple[str, ...], rules: bool, mapped: bool, as_json: bool) -> int:
    """Check board files; list the rules hosts are held to.

    Names every mistake with file, line and key, and what is allowed instead. What only shows
    between the parts (a plant that a chip cannot drive, a fault, a waveform) is checked when the
    rest is right. With --rules, lists what a host can break, by the names that [violations] uses,
    with the row of the manual's AC table where a rule is one. With --map, tries every address of
    every card: who answers a read and a write there, where two answer, and which chip is never
    selected.
    """
    if mapped and not boards:
        raise click.UsageError("--map is of board files: name one")
    if not boards and not rules:
        raise click.UsageError("name a board file, or ask for --rules")
    report: dict[str, Any] = {}
    code = exit_codes.OK
    if boards:
        report["boards"] = [_check(board, mapped) for board in boards]
        if not all(board["ok"] for board in report["boards"]):
            code = exit_codes.BAD_BOARD
    if rules:
        report["rules"] = _rules()
    show(as_json, report, _lines(report))
    return code


def _check(path: str, mapped: bool) -> dict[str, Any]:
    from vbus.board.build import build
    from vbus.board.card.card_map import CardAnswer, address_map, remarks
    from vbus.board.config import read_board_file
    from vbus.boardfile.source import BoardFileError
    from vbus.network.security import rights_in_words

    try:
        file, source = read_board_file(path)
        if file.nodes:
            from vbus.nodes.machine import build_nodes

            boards = [node.board for node in build_nodes(file, source)]
        else:
            boards = [build(file, source)]
            # Nodes have signals of their own: their waves are checked when each of them is run.
            check_records(file, boards[0], source)
    except BoardFileError as error:
        problems = [structs.asdict(problem) for problem in error.problems]
        return {"file": path, "ok": False, "problems": problems}
    used = {plant for chip in file.chips for plant in chip.axes}
    notes = [
        f"chips.{broken.chip}: {broken.rule} ({broken.clause}): {broken.detail}:"
        f" {broken.measured / 1000:g} ns, the limit is {broken.limit / 1000:g} ns"
        for board in boards
        for broken in board.violations
    ]
    notes += [
        f"[plants.{p.name}] is not used by any chip" for p in file.plants if p.name not in used
    ]
    # No mistake: a test or a demonstration opens its ports itself.
    if not file.hosts:
        notes.append("there is no [[hosts]]: nothing can attach to this board from outside")
    answers: list[CardAnswer] = []
    if mapped:
        # A card reaches the chips of its own node alone; there is no map across nodes.
        answers = [] if file.nodes else address_map(file, boards[0])
        notes += remarks(file, boards[0], answers)
        if not answers:
            notes.append("--map shows cards; there is none on one board, without nodes")
    return {
        "file": path,
        "ok": True,
        "name": file.board.name,
        "time": file.board.time,
        "nodes": {
            node.name: [chip.name for chip in file.chips if chip.node == node.name]
            for node in file.nodes
        },
        "chips": {chip.name: chip.part for chip in file.chips},
        "hosts": [host.transport for host in file.hosts],
        "rights": rights_in_words(file.zenoh.allow or {}),
        "map": [asdict(answer) for answer in answers],
        "notes": notes,
    }


def _rules() -> list[dict[str, Any]]:
    from vbus.board.check.checks import all_rules
    from vbus.views.clauses import ac_limits

    return [{**rule._asdict(), "rows": ac_limits(rule.name)} for rule in all_rules()]


def _lines(report: dict[str, Any]) -> Iterator[str]:
    for board in report.get("boards", []):
        if not board["ok"]:
            from vbus.boardfile.source import Problem

            for problem in board["problems"]:
                click.echo(str(Problem(**problem)), err=True)
            continue
        chips = ", ".join(f"{name} ({part})" for name, part in board["chips"].items())
        hosts = ", ".join(board["hosts"]) or "no hosts"
        yield f"{board['file']}: ok: {chips}; {hosts}; {board['time']}"
        for node, members in board["nodes"].items():
            yield f"{board['file']}: node {node}: {', '.join(members)}"
        for right in board["rights"]:
            yield f"{board['file']}: zenoh: {right}"
        if board["map"]:
            from vbus.board.card.card_map import CardAnswer, lines

            for line in lines([CardAnswer(**row) for row in board["map"]]):
                yield f"{board['file']}: {line}"
        for note in board["notes"]:
            yield f"{board['file']}: note: {note}"
    rules = report.get("rules", [])
    width = max((len(rule["name"]) for rule in rules), default=0)
    for rule in rules:
        row = f"  [row {'; '.join(rule['rows'])}]" if rule["rows"] else ""
        yield (
            f"{rule['name']:<{width}}  {rule['clause']:<11}  {rule['severity']:<7}"
            f"  {rule['title']}{row}"
        )


def check_records(file: BoardFile, board: Board, source: Source) -> None:
    """Find recordings that could not begin when the board is run.

    Raises:
        BoardFileError: there is at least one.
    """
    record = file.record

    @contextmanager
    def checked(*place: str) -> Iterator[None]:
        try:
            yield
        except (ValueError, VbusError) as error:
            source.fail(place, str(error))

    # What cannot be honoured is refused, not ignored.
    if record.durable != "no" and not record.journal:
        source.fail(("record", "durable"), ALONE)
    if record.suppress and not record.report:
        source.fail(("record", "suppress"), UNREPORTED)
    if record.report:
        from vbus.views.findings.formats import format_of

        with checked("record", "report"):
            format_of(record.report)
    if record.coverage:
        from vbus.views.coverage.formats import coverage_format

        with checked("record", "coverage"):
            coverage_format(record.coverage)
    if record.suppress:
        with checked("record", "suppress"):
            suppressions_of(record.suppress)
    for wave in file.waves:
        from vbus.events.condition import Condition
        from vbus.views.wave.signals import nets_of, vcd_name

        with checked("waves", wave.name, "file"):
            vcd_name(wave.file)
        with checked("waves", wave.name, "signals"):
            nets_of(board, wave.signals)
        if wave.trigger:
            with checked("waves", wave.name, "trigger"):
                Condition(wave.trigger, board, "trigger")
    source.finish()


@click.command("schema")
def schema() -> None:
    """Print the JSON Schema of board files, for editors.

    It has the settings of every chip, plant and fault installed here. An editor that knows TOML
    completes and checks a board file whose first line names the schema:

    \b
        vbus schema > board.schema.json
        #:schema ./board.schema.json
    """
    from vbus.boardfile.schema import schema as made

    click.echo(json.dumps(made(), indent=2, ensure_ascii=False))
