"""Freezes runs, and writes down what a ruling has changed.

    python -m tests.frozen.generate                      freeze the runs that are not there yet
    python -m tests.frozen.generate --update NAME ... --ruling CLAUSE --why TEXT
    python -m tests.frozen.generate --update NAME ... --state --why TEXT
    python -m tests.frozen.generate --snapshots          take all snapshots anew
    python -m tests.frozen.generate --views              write the hashes of all views anew

A journal and its frozen hashes are never written again. ``--update`` plays runs and writes
beside their frozen hashes what they come to now, and which ruling changes them; with ``--state``,
that their states hold something else while they do the same. A NAME may be a pattern (``'lm62*'``):
runs that come to what is written are passed over; one that comes to its frozen hashes again loses
what was written beside them.
"""

import argparse
import io
import json
import sys
from fnmatch import fnmatch
from random import Random

from tests.differential.drive import Host as RandomHost
from tests.frozen import board_runs, lm628_runs, mc1241a_runs, mcp1200_runs, views  # noqa: F401
from tests.frozen.frozen import (
    BEGIN,
    END,
    HASHES,
    README,
    RUNS,
    STATES,
    Run,
    board_of,
    hashes_of,
    play,
    read_journal,
    read_rulings,
    read_runs,
    table,
)
from tests.frozen.hosts import ALL, Frozen
from tests.nodes import four_chips
from vbus.board import snapshot
from vbus.board.board import Board
from vbus.board.build import load_board_text
from vbus.record.journal import Journal
from vbus.record.player import Player
from vbus.record.replay import Replay

RANDOM = 700
"""Operations of a random host."""


def record(frozen: Frozen) -> bytes:
    """Return the journal of a run."""
    name = f"{frozen.name}.toml"
    board = load_board_text(frozen.text, name)
    file = io.BytesIO()
    journal = Journal(board, file, frozen.text, name)
    frozen.play(board)
    journal.close()
    return file.getvalue()


def keep(data: bytes, at: int) -> bytes:
    """Return the snapshot after ``at`` entries of a journal."""
    header, entries = read_journal(data)
    player = Player(board_of(header))
    for entry in entries[:at]:
        player.play(entry)
    return snapshot.write(snapshot.take(player.board))


def random_hosts() -> list[Frozen]:
    """Return hosts that do anything: with whole cycles, some with strobes too."""
    made = []
    for family in ("lm628", "mcp1200", "mc1241a"):
        wanted = {False: 2, True: 1}
        for seed in range(100, 400, 2):
            host = RandomHost(family, seed)
            if host.traced or not wanted[host.strobes > 0]:
                continue
            wanted[host.strobes > 0] -= 1
            kind = "strobed" if host.strobes else "cycles"

            def run(board: Board, host: RandomHost = host) -> None:
                host.board = board
                host.port = board.open_port("h")
                for _ in range(RANDOM):
                    host.operation()
                host.port.close()

            made.append(
                Frozen(
                    f"{family}-random-{kind}-{seed}", host.board.text,
                    f"a random host with {kind}, {host.board.policy}", run,
                )
            )  # fmt: skip
    return made


def freeze(frozen: Frozen) -> Run:
    """Write the files of a run; return its row."""
    data = record(frozen)
    header, entries = read_journal(data)
    outcome = Replay(board_of(header), entries, header.families).run()
    if outcome.divergence is not None or not outcome.ended:
        raise SystemExit(f"{frozen.name} does not replay: {outcome.divergence}")
    at = len(entries) * Random(frozen.name).randrange(40, 60) // 100
    while entries[at - 1].op in ("violation", "cycle", "fault"):
        at += 1
    operations = min(frozen.going_on, len(entries) - 1 - at)
    (RUNS / f"{frozen.name}.vbj").write_bytes(data)
    (RUNS / f"{frozen.name}.snap").write_bytes(keep(data, at))
    run = Run(frozen.name, frozen.covers, frozen.watch, at, operations, {}, {}, {})
    run.hashes.update(play(run))
    return run


def freeze_nodes() -> Run:
    """Write the files of the board with nodes; return its row."""
    name = "board-four-nodes"
    (RUNS / f"{name}.toml").write_text(four_chips.BOARD)
    (RUNS / f"{name}.txt").write_text(four_chips.scenario())
    covers = "four chips on four nodes in one process, wires with delays between them"
    run = Run(name, covers, (), 0, 0, {}, {}, {})
    run.hashes.update(play(run))
    return run


def text_of(runs: list[Run]) -> str:
    """Return ``hashes.toml``."""
    lines: list[str] = []
    for run in runs:
        lines += [f"[{run.name}]", f"covers = {json.dumps(run.covers)}"]
        if run.watch:
            lines.append(f"watch = {json.dumps(run.watch)}")
        if run.at:
            lines += [f"at = {run.at}", f"operations = {run.operations}"]
        for part in ("frozen", "changed", "state_changed"):
            rows = run.hashes if part == "frozen" else getattr(run, part)
            if rows:
                lines.append(f"[{run.name}.{part}]")
                lines += [f"{key} = {json.dumps(value)}" for key, value in rows.items()]
        lines.append("")
    return "\n".join(lines)


def write(runs: list[Run]) -> None:
    """Write ``hashes.toml``, and the table of the page."""
    HASHES.write_text(text_of(runs))
    page = README.read_text()
    before, _, rest = page.partition(BEGIN)
    _, _, after = rest.partition(END)
    README.write_text(f"{before}{BEGIN}\n{table(runs)}\n{END}{after}")


def update(run: Run, ruling: str, why: str, state: bool) -> str:
    """Note that a run comes to something else, by a ruling or in its state only; or why not."""
    now = play(run)
    if now == run.expected():
        return ""
    if state:
        expected = {**run.hashes, **hashes_of(run.changed)}
        new = {key: value for key, value in now.items() if value != expected[key]}
        if not new or not set(new) <= STATES:
            return f"{run.name} differs in {', '.join(new) or 'nothing'}: name a ruling"
        run.state_changed.clear()
        run.state_changed.update({"why": why}, **new)
        return ""
    new = {key: value for key, value in now.items() if value != run.hashes[key]}
    if not new:
        run.changed.clear()
        run.state_changed.clear()
        return ""
    rulings = list(dict.fromkeys([*run.rulings, ruling]))
    reasons = run.changed.get("why", [])
    reasons = [reasons] if isinstance(reasons, str) else list(reasons)
    reasons = list(dict.fromkeys([*reasons, why]))
    one = len(rulings) == len(reasons) == 1
    run.changed.clear()
    run.changed.update(ruling=ruling if one else rulings, why=why if one else reasons, **new)
    run.state_changed.clear()
    return ""


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--update", nargs="+", metavar="NAME", default=[])
    parser.add_argument("--ruling", default="")
    parser.add_argument("--why", default="")
    parser.add_argument("--state", action="store_true")
    parser.add_argument("--snapshots", action="store_true")
    parser.add_argument("--views", action="store_true")
    options = parser.parse_args()
    if options.views:
        views.VIEWS.write_text(views.text_of({name: views.hashes(name) for name in views.names()}))
        return
    runs = read_runs(HASHES.read_text()) if HASHES.exists() else []
    if options.snapshots:
        for run in runs:
            if run.at:
                data = (RUNS / f"{run.name}.vbj").read_bytes()
                (RUNS / f"{run.name}.snap").write_bytes(keep(data, run.at))
        return
    names = {run.name for run in runs}
    if options.update:
        if not options.why or bool(options.ruling) == options.state:
            raise SystemExit("give --why, and either --ruling or --state")
        if options.ruling and options.ruling not in read_rulings():
            raise SystemExit(f"no ruling {options.ruling!r} in rulings.toml")
        refused = []
        for name in options.update:
            matching = [run for run in runs if fnmatch(run.name, name)]
            if not matching:
                raise SystemExit(f"no run is called {name}")
            refused += [update(run, options.ruling, options.why, options.state) for run in matching]
        write(runs)
        sys.exit("\n".join(filter(None, refused)) or None)
    else:
        RUNS.mkdir(exist_ok=True)
        for frozen in (*ALL, *random_hosts()):
            if frozen.name not in names:
                print(frozen.name, file=sys.stderr)
                runs.append(freeze(frozen))
        if "board-four-nodes" not in names:
            runs.append(freeze_nodes())
    write(runs)


if __name__ == "__main__":
    main()
