"""A journal as lanes: played again for them."""

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

from vbus.board.board import Board
from vbus.record.format import Entry
from vbus.record.replay import Outcome, Replay
from vbus.views.scope.clauses import clause_frame
from vbus.views.scope.recording import Recorder


@dataclass(frozen=True, slots=True)
class Recorded:
    """The lanes of a run that is over.

    Attributes:
        description: what a page gets first.
        frames: all that happened.
        outcome: what came of the replay.
    """

    description: dict[str, Any]
    frames: list[bytes]
    outcome: Outcome


def replayed(
    board: Board, entries: Iterable[Entry], families: dict[str, str], strobes: bool = False
) -> Recorded:
    """Play a journal up to its end, or the first difference; return its lanes.

    Args:
        board: built from the same file, at instant 0, with no ports open.
        entries: the journal's.
        families: chip families by name of chip.
        strobes: whether the lines of the host buses are lanes too.
    """
    recorder = Recorder(board, edges=True, strobes=strobes)
    recorder.start()
    outcome = Replay(board, entries, families).run()
    recorder.stop()
    frames = [clause_frame(families.values()), *recorder.take()]
    return Recorded(recorder.lanes.described(live=False), frames, outcome)
