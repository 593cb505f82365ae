"""The clauses of a board's chips, as ``vbus explain`` tells them, for its page."""

from collections.abc import Iterable

from vbus import plugins
from vbus.chips.base import Chip
from vbus.chips.clauses import clauses_of
from vbus.views.clauses import all_carriers
from vbus.views.scope.frames import ALL, CLAUSES, frame, texts


def clause_frame(families: Iterable[str]) -> bytes:
    """Return a frame with the clauses of chip families: id, title, kind, section, text, citing.

    Args:
        families: names of the families; each may come more than once.
    """
    rows = []
    citing = all_carriers()
    for name in dict.fromkeys(families):
        chip = plugins.family(name).load("chip", Chip)
        package = chip.__module__.rpartition(".")[0] if chip is not None else ""
        for clause in clauses_of(package).values() if package else ():
            rows.append(
                {
                    "name": clause.name, "title": clause.title, "kind": clause.kind,
                    "section": clause.section, "text": clause.text,
                    "named_by": citing.get(clause.name, []),
                }
            )  # fmt: skip
    return frame(CLAUSES, ALL, len(rows), 0, texts(rows))
