"""What is recorded of the nodes of one process: a file for each, named after its node."""

import asyncio
from collections.abc import Callable
from contextlib import ExitStack
from pathlib import Path

import msgspec

from vbus.boardfile.sections import BoardFile
from vbus.boardfile.source import Source
from vbus.errors import ConfigError, VbusError, write_errors
from vbus.nodes.node import Node
from vbus.server.output_file import output
from vbus.server.recording import ALONE, Recording
from vbus.trace.wave.merge import merge_waves
from vbus.trace.wave.signals import FULL


def of_node(path: str, node: str) -> str:
    """Return the file of one node: ``run.left.vbj`` where ``run.vbj`` is asked for; "" stays."""
    return str(Path(path).with_suffix(f".{node}{Path(path).suffix}")) if path else ""


def join_waves(file: BoardFile, report: Callable[[str], None]) -> list[str]:
    """Put one file, with a scope for each node, in the place of waveforms that have ended.

    Those with a trigger or for sigrok stay apart, because each node has signals of its own.

    Args:
        file: the board file.
        report: takes a sentence about each that stays apart because it cannot be written.

    Returns:
        These sentences.
    """
    lost = []
    for wave in file.waves:
        parts = {node.name: Path(of_node(wave.file, node.name)) for node in file.nodes}
        if (
            wave.trigger
            or wave.profile != FULL
            or not all(part.is_file() for part in parts.values())
        ):
            continue
        try:
            with write_errors(wave.file), ExitStack() as opened:
                texts = [
                    (name, opened.enter_context(part.open(encoding="ascii")))
                    for name, part in parts.items()
                ]
                merge_waves(texts, opened.enter_context(output(wave.file)).begin_text())
        except VbusError as error:
            files = ", ".join(map(str, parts.values()))
            lost.append(f"{error}; the waveform of each node is in a file of its own: {files}")
            report(lost[-1])
            continue
        for part in parts.values():
            part.unlink()
    return lost


class NodeRecords:
    """Journals, reports, coverage and waveforms of the nodes of one process.

    Args:
        file: the board file, with what is to be recorded.
        source: its text.
        report: takes sentences about recordings that had to end.
    """

    def __init__(self, file: BoardFile, source: Source, report: Callable[[str], None]) -> None:
        self._file: BoardFile = file
        self._source: Source = source
        self._report: Callable[[str], None] = report
        self._opened: ExitStack = ExitStack()
        self.of: dict[int, Recording] = {}
        """By rank of the node; empty if nothing is recorded."""
        self.lost: list[str] = []
        """Why files have not all they should have, once they are closed."""

    @property
    def wanted(self) -> bool:
        """Whether anything is to be recorded."""
        record = self._file.record
        return bool(record.journal or record.report or record.coverage or self._file.waves)

    def begin(self, node: Node) -> None:
        """Record a node to which nothing has happened.

        Raises:
            VbusError: a file cannot be written, or what is wanted makes no sense.
        """
        record = self._file.record
        if record.durable != "no" and not record.journal:
            raise ConfigError(ALONE)
        if not self.wanted:
            return
        recording = Recording(node.board, self._source.text, self._file.path, self._report)
        self._opened.callback(recording.close)
        files = {
            key: of_node(getattr(record, key), node.name)
            for key in ("journal", "report", "coverage")
        }
        waves = [
            msgspec.structs.replace(wave, file=of_node(wave.file, node.name))
            for wave in self._file.waves
        ]
        recording.open(msgspec.structs.replace(record, **files), waves)
        self.of[node.rank] = recording

    def start(self, loop: asyncio.AbstractEventLoop) -> None:
        """Begin to write journals at times."""
        for recording in self.of.values():
            recording.start(loop)

    def end(self) -> None:
        """End every recording; may be repeated."""
        self._opened.close()

    def close(self) -> None:
        """The nodes have stopped: end every recording; of all nodes, join their waveforms."""
        self.end()
        if len(self.of) == len(self._file.nodes):
            self.lost += join_waves(self._file, self._report)
        self.lost += [sentence for one in self.of.values() for sentence in one.failures]
