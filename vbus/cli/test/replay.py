"""``vbus replay``: a recorded run again, on the code as it is now."""

from dataclasses import asdict
from pathlib import Path
from typing import Any

import click

from vbus.board.board import Board
from vbus.chips.packets import cited
from vbus.cli.journal_lines import instant
from vbus.cli.output import no_progress, show
from vbus.cli.sources import opened
from vbus.core import exit_codes
from vbus.nodes.machine import board_of, trace_hash
from vbus.nodes.node import Node
from vbus.record.replay import Outcome, Replay
from vbus.version import __version__


@click.command("replay")
@click.argument("journals", nargs=-1, required=True, type=click.Path(path_type=Path))
@click.option(
    "--board", "board_file", type=click.Path(), help="Play on this board file instead of its own."
)
@click.option("--json", "as_json", is_flag=True, help="Print JSON; instants in ps.")
@no_progress
def command(
    journals: tuple[Path, ...], board_file: str | None, as_json: bool, no_progress: bool
) -> int:
    """Make every call of a journal again and stop at the first difference.

    Compares replies, instants, violations and the state at the end. The exit code is 1 if
    something differs, or if the journal is damaged elsewhere than at its end. JOURNALS of all nodes
    of a machine are played one after the other, and give the trace hash of the machine.
    """
    values: list[dict[str, Any]] = []
    lines: list[str] = []
    played: list[Board] = []
    for journal in journals:
        with opened(journal, "replaying", no_progress) as reader:
            header = reader.header
            board = board_of(header, str(journal), board_file or "")
            # A trace looks at nets: only where the machine's hash comes of it.
            if isinstance(board.beyond, Node) and len(journals) > 1:
                board.beyond.start_trace()
            outcome = Replay(board, reader, header.families).run()
            damage = reader.damage
        played.append(board)
        values.append({**asdict(outcome), "damage": damage, "recorded_with": header.vbus})
        text = _lines(outcome, damage, header.vbus)
        lines += text if len(journals) == 1 else [f"{journal}: {line}" for line in text]
    value: dict[str, Any] = values[0] if len(journals) == 1 else {"journals": values}
    found = machine_hash(played)
    if found:
        value["trace_hash"] = found
        lines.append(f"trace hash {found}")
    show(as_json, value, lines)
    same = all(one["divergence"] is None for one in values)
    return exit_codes.OK if same else exit_codes.FAILURE


def machine_hash(played: list[Board]) -> str:
    """Return the trace hash of a machine all of whose nodes were played, once each; else ""."""
    found = [board.beyond for board in played if isinstance(board.beyond, Node)]
    nodes = sorted(found, key=lambda node: node.rank)
    plans = {node.plan.digest for node in nodes}
    whole = [node.rank for node in nodes] == list(range(len(nodes[0].names))) if nodes else False
    return trace_hash(nodes) if whole and len(plans) == 1 and len(nodes) == len(played) else ""


def _lines(outcome: Outcome, damage: str, version: str) -> list[str]:
    found = outcome.divergence
    if found is None:
        lines = [f"no difference in {outcome.entries} entries, {outcome.cycles} bus cycles"]
        if not outcome.ended:
            lines.append(f"note: the journal was not closed{f' ({damage})' if damage else ''}")
        return lines
    place = f"entry {found.entry} at {instant(found.when)}"
    lines = [
        f"{place}: {found.what} differs: {found.where}{cited(found.clause)}",
        f"  recorded: {found.recorded}",
        f"  now:      {found.now}",
    ]
    if version != __version__:
        lines.append(f"  recorded with vbus {version}, played with vbus {__version__}")
    return lines
