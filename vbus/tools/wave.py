"""``vbus wave``: waveforms of running boards and of recorded runs."""

import io
import json
import sys
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any, TextIO

import click

from vbus.errors import TransportError, VbusError
from vbus.tools import exit_codes


def _duration(ctx: click.Context, param: click.Parameter, value: str) -> int:
    from vbus.protocols.quantities import parse_duration

    try:
        return parse_duration(value)
    except ValueError as error:
        raise click.BadParameter(str(error)) from None


@click.command("wave")
@click.argument("source")
@click.option("-o", "--output", required=True, metavar="FILE", help='The VCD file; "-": print.')
@click.option("--profile", type=click.Choice(["full", "sigrok"]), default="full", show_default=True)
@click.option("--signals", multiple=True, metavar="PATTERN", help='Signals, such as "x.*".')
@click.option("--trigger", default="", help='What to wait for, such as "violation", "x.HI rises".')
@click.option("--before", default="0us", callback=_duration, help="Show this from before it.")
@click.option("--duration", default="0us", callback=_duration, help="Record so long.")
@click.option("--sample", default="1ms", callback=_duration, help="Look at values so often.")
@click.option("--no-progress", is_flag=True, help="Show no progress bar.")
def command(
    source: str, output: str, profile: str, signals: tuple[str, ...], trigger: str, before: int,
    duration: int, sample: int, no_progress: bool,
) -> int:  # fmt: skip
    """Write a waveform.

    SOURCE is a journal, which is played again for it, or the name of a running board. Times are
    chip time. Of a running board it is written until the duration is over, or Ctrl-C.
    """
    from vbus.board.sections import WaveSection

    wish = WaveSection(
        name="", file=output, profile=profile, signals=signals, trigger=trigger, before=before,
        duration=duration, sample=max(sample, 1),
    )  # fmt: skip
    if Path(source).is_file():
        return _of_journal(Path(source), wish, no_progress)
    return _of_board(source, wish)


@contextmanager
def _output(name: str) -> Iterator[TextIO]:
    """Open the file to write; only once it is clear that there is something to write."""
    from vbus.server.recording import open_text

    file: TextIO = sys.stdout if name == "-" else open_text(name)
    try:
        yield file
    finally:
        if name != "-":
            with suppress(OSError):  # what it could not take has been reported
                file.close()


def _of_journal(path: Path, wish: Any, quiet: bool) -> int:
    from vbus.board.build import load_board_text
    from vbus.server.recording import wave_of
    from vbus.tools.journal_lines import moving, opened, progress
    from vbus.trace.journal.replay import Replay

    with opened(path) as (reader, _):
        if not reader.header.text:
            raise VbusError(f"{path}: it was recorded on a board made in Python")
        board = load_board_text(reader.header.text, reader.header.file)
        wave_of(board, wish, io.StringIO(), _complain)  # complains before a file is overwritten
        with _output(wish.file) as file:
            wave = wave_of(board, wish, file, _complain)
            wave.start()
            with progress(path, reader, "replaying", quiet or file.isatty()) as move:
                outcome = Replay(board, moving(iter(reader), move), reader.header.families).run()
            wave.stop()
    if wave.error:
        return exit_codes.FAILURE
    if outcome.divergence is not None:
        _complain(f"{path}: the run differs from its journal at entry {outcome.divergence.entry};"
                  ' "vbus replay" shows how')  # fmt: skip
        return exit_codes.FAILURE
    if not wave.changes and wish.trigger:
        _complain(f'the trigger "{wish.trigger}" has not come')
        return exit_codes.FAILURE
    return exit_codes.OK


def _of_board(name: str, wish: Any) -> int:
    from msgspec import structs

    from vbus.tools.monitor import Feed

    feed = Feed(name)
    written = 0
    try:
        keys = {k: v for k, v in structs.asdict(wish).items() if k not in ("name", "file")}
        feed.send(json.dumps({"wave": keys}).encode() + b"\n")
        for item in feed:
            if item[0] == "refused":
                raise VbusError(item[1])
            if item[0] == "wave":
                break
        else:
            raise TransportError(f'board "{name}" has stopped')
        with _output(wish.file) as file:
            for data in feed.raw():
                file.write(data.decode("ascii"))
                file.flush()
                written += len(data)
    except KeyboardInterrupt:
        pass
    except OSError as error:
        if isinstance(error, VbusError):
            raise
        where = "standard output" if wish.file == "-" else wish.file
        raise VbusError(f"{where}: cannot be written: {error.strerror}") from error
    finally:
        feed.close()
    if not written and wish.trigger:
        _complain(f'the trigger "{wish.trigger}" has not come')
        return exit_codes.FAILURE
    return exit_codes.OK


def _complain(sentence: str) -> None:
    click.echo(f"vbus: {sentence}", err=True)
