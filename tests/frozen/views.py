"""What the verbs show of the frozen runs, as hashes.

A view is what a user sees of a run: its waveform, report, coverage, lines of ``vbus explain``, and
lanes of the scope. ``views.toml`` has a hash of every view by run;
``python -m tests.frozen.generate --views`` writes the file anew.
"""

import io
import json
import tomllib
from collections.abc import Callable
from hashlib import sha256
from pathlib import Path
from typing import Final
from zlib import crc32

from tests.frozen.frozen import FOLDER, RUNS, board_of, read_journal
from vbus.board.check.checks import all_rules
from vbus.boardfile.sections import WaveSection
from vbus.cli.journal_lines import decoded
from vbus.core.kernel import MS
from vbus.record.format import JournalReader
from vbus.record.replay import Replay
from vbus.record.view import play
from vbus.serve.recording import wave_of
from vbus.version import __version__
from vbus.views.coverage.coverage import CoverageObserver
from vbus.views.coverage.formats import COVERAGE_FORMATS, as_text
from vbus.views.findings.formats import FORMATS
from vbus.views.findings.report import Report
from vbus.views.findings.suppress import suppressions_of
from vbus.views.scope.recording import replayed
from vbus.views.scope.rows import Rows

VIEWS: Final = FOLDER / "views.toml"
DIGITS: Final = 16
"""Of a hash, in hexadecimal: enough to see a difference, and the file stays small."""


def wave(path: Path) -> str:
    """Return the VCD file that ``vbus wave`` writes."""
    reader = JournalReader(io.BytesIO(path.read_bytes()))
    board, file = board_of(reader.header), io.StringIO()
    section = WaveSection(name="", file="", sample=MS)
    waveform = wave_of(board, section, file, lambda _: None)
    waveform.start()
    Replay(board, reader, reader.header.families).run()
    waveform.stop()
    return file.getvalue()


def report(path: Path) -> str:
    """Return what ``vbus report`` prints, as text and as JSON."""
    header, entries = read_journal(path.read_bytes())
    found = Report(header.board, header.families, all_rules(), suppressions_of(""), header.file)
    play(header, entries, found)
    return FORMATS["text"](found) + FORMATS["json"](found)


def coverage(path: Path) -> str:
    """Return what ``vbus coverage`` prints, as text and as JSON."""
    header, entries = read_journal(path.read_bytes())
    observer = CoverageObserver(header.families, path.name)
    play(header, entries, observer)
    return as_text(observer.coverage, True) + COVERAGE_FORMATS[".json"](observer.coverage)


def explain(path: Path) -> str:
    """Return what ``vbus explain`` prints of all of it, and of each entry."""
    _, entries = read_journal(path.read_bytes())
    lines = [*decoded(path, 0, None, quiet=True), *decoded(path, 0, len(entries) - 1)]
    return "\n".join(lines).replace(str(path), path.name)


def scope(path: Path) -> str:
    """Return the frames that a page of the scope gets, and the rows made from them."""
    reader = JournalReader(io.BytesIO(path.read_bytes()))
    recorded = replayed(board_of(reader.header), reader, reader.header.families, strobes=True)
    frames = b"".join(recorded.frames)
    rows = [
        f"{when} {lane.full_name} {value}"
        for when, lane, value in Rows(recorded.description).take(frames)
    ]
    described = json.dumps(recorded.description)
    return "\n".join((described, frames.hex(), *rows, str(recorded.outcome)))


SHOWN: Final[dict[str, Callable[[Path], str]]] = {
    one.__name__: one for one in (wave, report, coverage, explain, scope)
}


def names() -> list[str]:
    """Return the frozen journals by name, in order."""
    return sorted(path.stem for path in RUNS.glob("*.vbj"))


def shown_of(name: str) -> dict[str, Callable[[Path], str]]:
    """Return the views that are made of a run.

    A waveform and the scope play a run again, which takes 80 s for all runs: both are made
    of every fifth run by a checksum of its name, and of those with several chips or with faults.
    """
    played = crc32(name.encode()) % 5 == 0 or name.startswith(("board", "faults"))
    return {view: show for view, show in SHOWN.items() if played or show not in (wave, scope)}


def hashes(name: str) -> dict[str, str]:
    """Return a hash of every view of a run; the version of vbus is no part of it."""
    path = RUNS / f"{name}.vbj"
    return {
        view: sha256(show(path).replace(__version__, "VERSION").encode()).hexdigest()[:DIGITS]
        for view, show in shown_of(name).items()
    }


def read_views() -> dict[str, dict[str, str]]:
    """Return the hashes that the views came to, by run and view."""
    return tomllib.loads(VIEWS.read_text())


def text_of(views: dict[str, dict[str, str]]) -> str:
    """Return ``views.toml``: a line for each run."""
    lines = ["# Written by: python -m tests.frozen.generate --views"]
    for name, row in sorted(views.items()):
        cells = ", ".join(f'{view} = "{value}"' for view, value in row.items())
        lines.append(f"{name} = {{ {cells} }}")
    return "\n".join(lines) + "\n"
