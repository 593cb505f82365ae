"""``vbus wave``: waveforms of running boards and of recorded runs."""

import io
import sys
from collections.abc import Iterator
from contextlib import ExitStack, closing, contextmanager, nullcontext, suppress
from pathlib import Path
from tempfile import TemporaryFile
from typing import Any, TextIO

import click

from vbus.cli.output import (
    complain,
    no_progress,
    positive,
    refuse_given,
    show,
    time_option,
    vcd_named,
)  # fmt: skip
from vbus.cli.sources import Feed, opened, replay_code
from vbus.core import exit_codes
from vbus.core.errors import VbusError, write_errors


@click.command("wave")
@click.argument("sources", metavar="SOURCE...", nargs=-1, required=True)
@click.option("-o", "--output", required=True, metavar="FILE", callback=vcd_named,
              help='The VCD file; "-": print.')  # fmt: skip
@click.option("--profile", type=click.Choice(["full", "sigrok"]), default="full", show_default=True,
              help="Everything, or single wires for sigrok's decoders.")  # fmt: skip
@click.option("--signals", multiple=True, metavar="PATTERN", help='These, such as "x.*"; else all.')
@click.option("--trigger", default="", metavar="CONDITION",
              help='What to wait for, such as "violation", "x.HI rises".')  # fmt: skip
@time_option("--before", default="0us", text="Show so much from before the trigger.")
@time_option("--duration", "length", default="0us", text="End so long after the start or trigger.")
@click.option("--sample", default="1ms", callback=positive, metavar="TIME",
              help="How often the chips' values are read.")  # fmt: skip
@click.option("--json", "as_json", is_flag=True, help="Print JSON: what was written where.")
@no_progress
def command(
    sources: tuple[str, ...], output: str, profile: str, signals: tuple[str, ...], trigger: str,
    before: int, length: int, sample: int, as_json: bool, no_progress: bool,
) -> int:  # fmt: skip
    """Write a waveform.

    SOURCE is a journal, which is played again for it, or the name of a running board. Times are
    chip time. Of a running board it is written until the duration is over, or Ctrl-C. Journals of
    several nodes of a machine give one file, with a scope for each node.
    """
    from vbus.boardfile.sections import WaveSection

    if as_json and output == "-":
        raise click.UsageError('"-o -" prints the waveform: with --json name a file')
    if before and not trigger:
        raise click.UsageError("--before counts from a trigger; give one with --trigger")
    if profile == "sigrok":
        refuse_given(("sample",), "is of the chips' values, which --profile sigrok leaves out")
    section = WaveSection(
        name="", file=output, profile=profile, signals=signals, trigger=trigger, before=before,
        duration=length, sample=sample,
    )  # fmt: skip
    source = sources[0]
    if len(sources) > 1:
        code = _of_machine([Path(name) for name in sources], section, no_progress)
    elif Path(source).is_file():
        code = _played(Path(source), section, None, no_progress)
    else:
        code = _of_board(source, section)
    if as_json and code == exit_codes.OK:
        name = source if len(sources) == 1 else list(sources)
        show(True, {"source": name, "file": output, "bytes": Path(output).stat().st_size}, ())
    return code


@contextmanager
def _output(name: str, whole: bool) -> Iterator[TextIO]:
    """Open the file to write; only once it is clear that there is something to write.

    Args:
        name: of the file; "-" prints.
        whole: whether it takes its name at the end; not where an error leaves the block.

    Raises:
        VbusError: the file cannot be written.
    """
    from vbus.serve.output_file import output

    if name == "-":
        yield sys.stdout
        return
    with output(name, whole) as file:
        yield file.begin_text()


def _of_machine(paths: list[Path], section: Any, quiet: bool) -> int:
    """Write one file of the journals of several nodes, in the order of the nodes."""
    from vbus.nodes.machine import board_of
    from vbus.nodes.node import Node
    from vbus.views.wave.merge import merge_waves
    from vbus.views.wave.signals import FULL

    if section.trigger or section.before or section.duration or section.profile != FULL:
        raise click.UsageError(
            "--trigger, --before, --duration and --profile sigrok are for one journal: each node"
            " has signals of its own; name the journal of the node that is meant"
        )
    nodes: dict[int, tuple[str, Path]] = {}
    plans: set[str] = set()
    for path in paths:
        if not path.is_file():
            raise VbusError(f"{path}: no such journal; a running board is recorded alone")
        with opened(path) as reader:
            node = board_of(reader.header, str(path)).beyond
        if not isinstance(node, Node):
            raise VbusError(f"{path}: it is of a board without nodes; record it alone")
        # Two journals of one node are two runs, or one named twice.
        if node.rank in nodes:
            raise VbusError(f"{path}: it is of node {node.name}, as {nodes[node.rank][1]} is")
        nodes[node.rank] = node.name, path
        plans.add(node.plan.digest)
    if len(plans) > 1:
        raise VbusError("these journals are of different machines; name those of one run")
    with ExitStack() as stack:
        waves: list[tuple[str, TextIO]] = []
        for _, (name, path) in sorted(nodes.items()):
            part = stack.enter_context(TemporaryFile("w+", encoding="ascii"))
            code = _played(path, section, part, quiet or section.file == "-")
            if code != exit_codes.OK:
                return code
            part.seek(0)
            waves.append((name, part))
        with write_errors(section.file), _output(section.file, whole=True) as file:
            merge_waves(waves, file)
    return exit_codes.OK


def _played(path: Path, section: Any, into: TextIO | None, quiet: bool) -> int:
    """Play a journal and write its waveform into an open file, or into that of the section."""
    from vbus.nodes.machine import board_of
    from vbus.record.replay import Replay
    from vbus.serve.recording import wave_of

    quiet = quiet or (section.file == "-" and sys.stdout.isatty())
    with opened(path, "replaying", quiet) as reader:
        board = board_of(reader.header, str(path))
        wave_of(board, section, io.StringIO(), complain)  # complains before a file is overwritten
        with _output(section.file, True) if into is None else nullcontext(into) as file:
            wave = wave_of(board, section, file, lambda _: None)
            wave.start()
            outcome = Replay(board, reader, reader.header.families).run()
            wave.stop()
            # Said after the replay: the file's own end has the reason.
            if wave.error:
                raise VbusError(f"{_shown(section.file)}: {wave.error}")
        code = replay_code(path, outcome, reader.damage)
    return code or _code(bool(wave.changes), section)


def _of_board(name: str, section: Any) -> int:
    from msgspec import structs

    written = 0
    with closing(Feed(name)) as feed, suppress(KeyboardInterrupt):
        keys = {k: v for k, v in structs.asdict(section).items() if k not in ("name", "file")}
        feed.ask("wave", **keys)
        where = _shown(section.file)
        with write_errors(where), _output(section.file, whole=False) as file:
            for data in feed.messages():
                file.write(data.decode("ascii"))
                file.flush()
                # A trigger that never came leaves a file without a byte.
                written += len(data)
    return _code(bool(written), section)


def _shown(name: str) -> str:
    return "standard output" if name == "-" else name


def _code(written: bool, section: Any) -> int:
    """Return the exit code; say so if the trigger has not come."""
    if written or not section.trigger:
        return exit_codes.OK
    complain(f'the trigger "{section.trigger}" has not come')
    return exit_codes.FAILURE
