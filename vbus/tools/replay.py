"""``vbus replay``: a recorded run again, on the code as it is now."""

from dataclasses import asdict
from pathlib import Path

import click

from vbus.tools import exit_codes
from vbus.tools.journal_lines import instant, opened, progress
from vbus.tools.output import no_progress, show
from vbus.trace.journal.replay import Outcome
from vbus.version import __version__


@click.command("replay")
@click.argument("journal", type=click.Path(path_type=Path))
@click.option(
    "--board", "board_file", type=click.Path(), help="Play on this board file instead of its own."
)
@click.option("--json", "as_json", is_flag=True, help="Print JSON; instants in ps.")
@no_progress
def command(journal: Path, board_file: str | None, as_json: bool, no_progress: bool) -> int:
    """Make every call of a journal again and stop at the first difference.

    Compares replies, instants, violations and the state at the end. The exit code is 1 if
    something differs, or if the journal is damaged elsewhere than at its end.
    """
    from vbus.board.build import load_board, load_board_text
    from vbus.errors import ConfigError
    from vbus.trace.journal.replay import Replay

    with opened(journal) as reader:
        header = reader.header
        if board_file is not None:
            board = load_board(board_file)
        elif header.text:
            board = load_board_text(header.text, f"{journal}: {header.file}")
        else:
            raise ConfigError(
                f"{journal}: it was recorded on a board made in Python; name a board file with"
                " --board, or replay it in Python with vbus.trace.journal.replay"
            )
        with progress(journal, reader, "replaying", no_progress) as entries:
            outcome = Replay(board, entries, header.families).run()
        damage = reader.damage
    value = {**asdict(outcome), "damage": damage, "recorded_with": header.vbus}
    show(as_json, value, _lines(outcome, damage, header.vbus))
    return exit_codes.OK if outcome.divergence is None else exit_codes.FAILURE


def _lines(outcome: Outcome, damage: str, version: str) -> list[str]:
    found = outcome.divergence
    if found is None:
        lines = [f"no difference in {outcome.entries} entries, {outcome.cycles} bus cycles"]
        if not outcome.ended:
            lines.append(f"note: the journal was not closed{f' ({damage})' if damage else ''}")
        return lines
    clause = f"  [{found.clause}]" if found.clause else ""
    place = f"entry {found.entry} at {instant(found.when)}"
    lines = [
        f"{place}: {found.what} differs: {found.where}{clause}",
        f"  recorded: {found.recorded}",
        f"  now:      {found.now}",
    ]
    if version != __version__:
        lines.append(f"  recorded with vbus {version}, played with vbus {__version__}")
    return lines
