"""Firmware on a board, as ``vbus exec`` runs it."""

from vbus.cli.hosted.program import run_at_link, run_on_board
from vbus.cli.run.exec import program_of
from vbus.cli.run.firmware import avr_command, parse


def run_avr(
    spec: str, elf: str, board: str = "", *, link: str = "", transcript: str | None = None
) -> int:
    """Run AVR firmware on a board of its own, or at a link; return the exit code."""
    if link:
        return run_at_link(avr_command(parse(spec), elf)(link))
    return run_on_board(program_of(board, [elf], avr=spec), transcript)


def run_cpu(
    spec: str, image: str, board: str, transcript: str | None = None, summary: bool = True
) -> int:
    """Run a firmware image on a board of its own; return the exit code."""
    return run_on_board(program_of(board, [image], cpu=spec), transcript, summary)
