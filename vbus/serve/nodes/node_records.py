"""What is recorded of nodes: a file for each, named after its node."""

from collections.abc import Callable
from contextlib import ExitStack
from pathlib import Path

import msgspec

from vbus.boardfile.sections import BoardFile
from vbus.core.errors import VbusError, write_errors
from vbus.nodes.node import Node
from vbus.serve.output_file import output
from vbus.serve.recording import Recording
from vbus.views.wave.merge import merge_waves
from vbus.views.wave.signals import FULL


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


def recording_of(
    file: BoardFile, node: Node, report: Callable[[str], None], opened: ExitStack
) -> Recording:
    """Record a node to which nothing has happened, in files of its own.

    Args:
        file: the board file, with what is to be recorded.
        node: the node.
        report: takes sentences about recordings that had to end.
        opened: closes the recording.

    Raises:
        VbusError: a file cannot be written, or what is wanted makes no sense.
    """
    recording = Recording(node.board, node.board.text, file.path, report)
    opened.callback(recording.close)
    files = {
        key: of_node(getattr(file.record, key), node.name)
        for key in ("journal", "report", "coverage")
    }
    waves = [
        msgspec.structs.replace(wave, file=of_node(wave.file, node.name)) for wave in file.waves
    ]
    recording.open(msgspec.structs.replace(file.record, **files), waves)
    return recording
