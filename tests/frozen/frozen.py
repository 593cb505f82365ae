"""Frozen runs: where their files are, and how one is played again.

A run is a journal with a snapshot taken in it, or a board file with nodes and its scenario, in the
folder ``runs``.
"""

import hashlib
import io
import tomllib
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from vbus.board import snapshot
from vbus.board.board import Board
from vbus.board.build import load_board_text
from vbus.board.config import read_board_text
from vbus.core.kernel import US
from vbus.core.signals import Observer, TraceHash, Violation
from vbus.nodes.machine import Machine
from vbus.nodes.plan import pins_of
from vbus.nodes.scenario import read_scenario
from vbus.record.format import Entry, Header, JournalReader
from vbus.record.player import FINDINGS, Player
from vbus.record.replay import Replay

FOLDER = Path(__file__).parent
RUNS = FOLDER / "runs"
HASHES = FOLDER / "hashes.toml"
RULINGS = FOLDER / "rulings.toml"
README = FOLDER / "README.md"
BEGIN = "<!-- begin rulings: made by tests/frozen/generate.py -->"
END = "<!-- end rulings -->"

STATES = frozenset(("state", "then_state"))
"""Hashes that also change when a chip only keeps something more."""


@dataclass(frozen=True)
class Run:
    """One entry of ``hashes.toml``.

    Attributes:
        name: of the run, and of its files.
        covers: what it shows.
        watch: pins whose edges stand in its trace, beside the nets that join pins.
        at: entries of the journal before the snapshot; 0 if there is none.
        operations: entries played on from the snapshot.
        hashes: what the run gave when it was recorded; those of ``then_...`` from the snapshot on.
        changed: what a ruling has changed on purpose: ``ruling``, ``why``, and the new hashes.
        state_changed: why a state holds something else though all it does is the same: ``why``,
            and the new hashes.
    """

    name: str
    covers: str
    watch: tuple[str, ...]
    at: int
    operations: int
    hashes: dict[str, str]
    changed: dict[str, Any]
    state_changed: dict[str, Any]

    @property
    def rulings(self) -> list[str]:
        """The rulings that change it."""
        ruling = self.changed.get("ruling", [])
        return [ruling] if isinstance(ruling, str) else list(ruling)

    def expected(self) -> dict[str, str]:
        """Return what it comes to now."""
        new = {**hashes_of(self.changed), **hashes_of(self.state_changed)}
        return {**self.hashes, **new}


def hashes_of(entry: dict[str, Any]) -> dict[str, str]:
    """Return the hashes of a ``changed`` or ``state_changed`` entry, without its reason."""
    return {key: value for key, value in entry.items() if key not in ("ruling", "why")}


def read_runs(text: str) -> list[Run]:
    """Return the runs of ``hashes.toml``."""
    return [
        Run(
            name,
            row["covers"],
            tuple(row.get("watch", ())),
            row.get("at", 0),
            row.get("operations", 0),
            row["frozen"],
            row.get("changed", {}),
            row.get("state_changed", {}),
        )
        for name, row in tomllib.loads(text).items()
    ]


def read_rulings() -> dict[str, dict[str, str]]:
    """Return the rulings by the clause they are called by."""
    return tomllib.loads(RULINGS.read_text())


def table(runs: Iterable[Run]) -> str:
    """Return the page's table of rulings, with the runs that each changes."""
    changes: dict[str, list[str]] = {name: [] for name in read_rulings()}
    for run in runs:
        for ruling in run.rulings:
            changes[ruling].append(run.name)
    rows = ["| ruling | amends | changes what a run does | runs changed |", "|---|---|---|---|"]
    for name, row in read_rulings().items():
        names = ", ".join(f"`{run}`" for run in changes[name]) or "none"
        rows.append(f"| {name}: {row['says']} | {row['amends']} | {row['run']} | {names} |")
    return "\n".join(rows)


# -- playing ------------------------------------------------------------------------------------


class _Findings(Observer):
    def __init__(self) -> None:
        self.found: list[Violation] = []

    def violation(self, violation: Violation) -> None:
        """Note a violation; a lazy chip may find it later than another chip's."""
        self.found.append(violation)

    def digest(self) -> str:
        """Return how many there are, and a hash over all."""
        lines = sorted(
            f"{v.when:020} {v.chip} {v.rule} {v.clause} {v.severity} {v.measured} {v.limit}"
            f" {v.detail}"
            for v in self.found
        )
        digest = sha("\n".join(lines))
        return f"{len(lines)}:{digest}"


class Stretch:
    """A stretch of a run: what its calls answer, and what is seen meanwhile.

    Args:
        player: stands where the stretch begins.
        watch: pins whose edges are seen.
    """

    def __init__(self, player: Player, watch: Iterable[str]) -> None:
        self.player: Player = player
        self.board: Board = player.board
        self._trace: TraceHash = TraceHash([chip.name for chip in self.board.chips])
        self._findings: _Findings = _Findings()
        self._replies = hashlib.sha256()
        self.board.observe(self._trace)
        for net in self.board.nets.values():
            net.observe(self._trace)
        for pin in watch:
            self.board.watch(pin, self._trace)
        self.board.listen(self._findings)

    def play(self, entries: Iterable[Entry]) -> None:
        """Make the calls of some entries."""
        for entry in entries:
            if entry.op == "end":
                self.player.run_to(entry)
            if entry.op in FINDINGS:
                continue
            self.player.run_to(entry)
            reply, error = self.player.call(entry)
            self._replies.update(f"{entry.op} {reply!r} {error} {self.board.now}\n".encode())

    def hashes(self) -> dict[str, str]:
        """Return the hashes of the stretch and of the state it ends in."""
        self.board.catch_up()
        return {
            "trace": self._trace.digest(),
            "replies": self._replies.hexdigest(),
            "violations": self._findings.digest(),
            "state": self.board.state_hash(),
        }


def sha(text: str) -> str:
    """Return the SHA-256 (hex) of a text."""
    return hashlib.sha256(text.encode()).hexdigest()


def read_journal(data: bytes) -> tuple[Header, list[Entry]]:
    """Return a journal's header and entries."""
    reader = JournalReader(io.BytesIO(data))
    return reader.header, list(reader)


def board_of(header: Header) -> Board:
    """Return the board a journal was recorded on, at instant 0."""
    return load_board_text(header.text, header.file)


def play_journal(run: Run) -> dict[str, str]:
    """Play a journal from its beginning to its end."""
    header, entries = read_journal((RUNS / f"{run.name}.vbj").read_bytes())
    stretch = Stretch(Player(board_of(header)), run.watch)
    stretch.play(entries)
    return stretch.hashes()


def play_snapshot(run: Run) -> dict[str, str]:
    """Go on from a snapshot with the calls that follow it in the journal."""
    _, entries = read_journal((RUNS / f"{run.name}.vbj").read_bytes())
    kept = snapshot.read((RUNS / f"{run.name}.snap").read_bytes(), run.name)
    player = Player(snapshot.rebuild(kept))
    player.resume(kept, open_sessions(entries[: run.at]))
    stretch = Stretch(player, run.watch)
    stretch.play(entries[run.at : run.at + run.operations])
    return {f"then_{name}": value for name, value in stretch.hashes().items()}


def open_sessions(entries: Iterable[Entry]) -> list[int]:
    """Return the sessions that are open after these entries, in the order of their opening."""
    sessions: list[int] = []
    for entry in entries:
        if entry.op == "open":
            sessions.append(entry.port)
        elif entry.op == "close":
            sessions.remove(entry.port)
    return sessions


def play_nodes(run: Run) -> dict[str, str]:
    """Run a board with nodes, all in this process, with the scenario of its hosts."""
    file, source = read_board_text((RUNS / f"{run.name}.toml").read_text(), f"{run.name}.toml")
    text = (RUNS / f"{run.name}.txt").read_text()
    machine = Machine(file, source, read_scenario(text, f"{run.name}.txt", pins_of(file), US))
    machine.run()
    states = "\n".join(node.board.state_hash() for node in machine.nodes)
    return {"trace": machine.trace_hash(), "state": sha(states)}


def play(run: Run) -> dict[str, str]:
    """Play a run again; return its hashes."""
    if (RUNS / f"{run.name}.toml").exists():
        return play_nodes(run)
    hashes = play_journal(run)
    if run.at:
        hashes |= play_snapshot(run)
    return hashes


def first_difference(name: str) -> str:
    """Say where a journal's replay differs from it first, for the message of a failing test."""
    path = RUNS / f"{name}.vbj"
    if not path.exists():
        return ""
    header, entries = read_journal(path.read_bytes())
    found = Replay(board_of(header), entries, header.families).run().divergence
    return str(found) if found is not None else "the journal itself plays as it was recorded"
