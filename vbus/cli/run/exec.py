"""``vbus exec``: a program and a board that live as long as each other."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

import click

from vbus.cli.look.scope_page import PageRequest, scope_options
from vbus.cli.output import RECORDS, record_options, refuse_given, time_option
from vbus.core.errors import TransportError, value_errors

if TYPE_CHECKING:
    from vbus.cli.hosted.program import HostedProgram

_ORDER: Final = ("unix", "tcp", "pty")
"""Kinds of links, best first: sockets take several programs at once, a terminal takes one."""


def link_of(name: str, firmware: bool = False) -> str:
    """Return the link of a running board by which a program joins; it speaks the byte protocol.

    The first of :data:`_ORDER` whose host has a card, or for firmware a pin map; else the first.

    Args:
        name: the board, as ``vbus ls`` shows it.
        firmware: whether the program moves port bits.

    Raises:
        TransportError: no board of that name answers, or it has no such link.
    """
    from vbus.serve.registry import not_there, running

    found = next((board for board in running() if board["board"] == name), None)
    if found is None:
        raise TransportError(not_there(name, "runs on this machine"))
    if "error" in found:
        raise TransportError(f"{name}: {found['error']}")
    # Text links are for people: a program would have to parse prompts.
    every = found.get("links", [])  # a router has none
    links = [link for link in every if link["protocol"] == "byte" and _kind(link) in _ORDER]
    if not links:
        there = ", ".join(f"{link['url']} ({link['protocol']})" for link in every)
        raise TransportError(
            f"{name} has no link a program could join by (byte protocol on a Unix socket, TCP or a"
            f" PTY); it has: {there or 'none'}; add a [[hosts]] entry to its board file"
        )
    links.sort(key=lambda link: _ORDER.index(_kind(link)))
    # A link that describes a card or pin map lets the library do without the board file.
    for link in links:
        if _kind(link) != "pty" and _described(str(link["url"]), firmware):
            return str(link["url"])
    return str(links[0]["url"])


def _kind(link: dict[str, Any]) -> str:
    return str(link["url"]).partition(":")[0]


def _described(url: str, firmware: bool) -> bool:
    from vbus.client import connect

    try:
        with connect(url) as bus:
            return bool(bus.info.wiring if firmware else bus.info.card)
    except TransportError:
        return False


_RECORDED: Final = (
    "a running board keeps its records if it was started with such options of vbus run"
)
_WITHOUT: Final = {
    "transcript": _RECORDED,
    "metrics": _RECORDED,
    "scope": "a running board is shown by: vbus scope NAME",
    "scope_control": "a running board is taken in hand by: vbus scope NAME --control",
    "open_page": "a running board is shown by: vbus scope NAME",
    **dict.fromkeys(RECORDS, _RECORDED),
    "limit": "only a board that ends with the program can end it",
    "cpu": "its [cpu] section says what the image runs on",
    "pinmap": "a link of a running board has the pin map of its host",
}
"""Why options are for boards that the program has of its own."""


@click.command("exec", context_settings={"ignore_unknown_options": True})
@click.option("--board", metavar="FILE", help="The board file; served while the program runs.")
@click.option("--link", metavar="WHERE", help="In place of --board: a link of a running board.")
@click.option(
    "--join", metavar="NAME", help="In place of --board: a running board, as vbus ls has it."
)
@click.option("--avr", metavar="SPEC", help="PROGRAM is AVR firmware; mmcu=atmega328p,f=16000000.")
@click.option("--cpu", metavar="SPEC", help="PROGRAM is a firmware image; cortex-m3.")
@click.option("--pinmap", metavar="NAME", help="Which pin map of the board file.")
@click.option("--transcript", metavar="FILE", help="Write every bus cycle to this file.")
@record_options
@scope_options
@time_option(
    "--limit", text="End a program that hangs: after so much, or when it polls or waits in vain."
)
@click.option(
    "--summary/--no-summary", default=True,
    help="List at the end the rules that were broken (with --board).",
)  # fmt: skip
@click.argument("program", nargs=-1, required=True, type=click.UNPROCESSED)
def command(
    board: str | None, link: str | None, join: str | None, avr: str | None, cpu: str | None,
    pinmap: str | None, transcript: str | None, record: dict[str, str], metrics: str,
    page: PageRequest, limit: int | None, summary: bool, program: tuple[str, ...],
) -> int:  # fmt: skip
    """Run a program on a board of its own; the exit code is the program's.

    \b
    vbus exec --board board.toml -- ./host          finds the board's link in $VBUS_LINK
    vbus exec --join bench -- ./host                on the board that vbus ls calls bench
    vbus exec --board board.toml --avr mmcu=atmega328p,f=16000000 firmware.elf
    vbus exec --board board.toml --cpu cortex-m3 firmware.elf
    vbus exec --board board.toml --limit "10 s" -- ./host   of chip time; or polls in vain

    SPEC is a list of mmcu=, f= (clock in Hz), cycles= (end after so many), until= (end when the
    firmware has sent this text), pin= (end when it drives a pin, PB5=1), uart=, pty= (a terminal
    in place of stdout), pace (no faster than real time), gdb= (port for avr-gdb), stats. With --cpu
    it is a processor, and of these cycles=, until= and stats.
    """
    if sum(way is not None for way in (board, link, join)) != 1:
        raise click.UsageError(
            "name either a board file with --board or a link with --link, or a running board with"
            " --join"
        )
    if board is None:
        for option, why in _WITHOUT.items():
            refuse_given((option,), f"goes with --board; {why}")
        refuse_given(("summary",), "goes with --board; of a running board see: vbus report")
    if board is not None:
        from vbus.cli.hosted.program import run_on_board

        made = program_of(board, program, pinmap, avr, cpu, record, metrics)
        return run_on_board(made, transcript, summary, limit, page)
    link = link or link_of(join or "", firmware=avr is not None)
    if avr is None:
        return _join(link, list(program))
    from vbus.cli.hosted.program import run_at_link
    from vbus.cli.run.firmware import avr_command

    return run_at_link(avr_command(_specified("--avr", avr, program), program[0])(link))


def program_of(
    board: str,
    program: Sequence[str],
    pinmap: str | None = None,
    avr: str | None = None,
    cpu: str | None = None,
    record: Mapping[str, object] | None = None,
    metrics: str = "",
) -> "HostedProgram":
    """Return a program, or firmware, on the board of a file.

    Args:
        board: the board file.
        program: program and arguments; firmware: its file alone.
        pinmap: which pin map of the board file; else its only one.
        avr: of AVR firmware the settings of the simulator.
        cpu: of a firmware image its processor, and when it ends.
        record: replaces keys of the file's ``[record]``.
        metrics: replaces ``listen`` of its ``[metrics]``.

    Raises:
        click.UsageError: ``avr`` or ``cpu`` is wrong, or does not go with the program.
        ConfigError: the board file is wrong.
        OptionError: it has no such pin map.
        ProgramError: the firmware is none, or for another processor.
        VbusError: there is no simulator or emulator.
    """
    from vbus.board.config import read_board_file
    from vbus.cli.hosted.program import HostedProgram, host_of
    from vbus.core.errors import OptionError
    from vbus.serve.serving import recorded

    if avr is not None and cpu is not None:
        raise click.UsageError("write --avr or --cpu, not both")
    options: Any = None if avr is None else _specified("--avr", avr, program)
    settings: Any = None if cpu is None else _specified("--cpu", cpu, program)
    file, source = read_board_file(board)
    file = recorded(file, record or {}, metrics)
    if options is not None or settings is not None:
        from vbus.cli.run import firmware

        what = "AVR" if settings is None else settings.processor
        host = firmware.host_of_firmware(file, pinmap, what)
        if settings is None:
            command = firmware.avr_command(options, program[0])
        else:
            command = firmware.cpu_command(settings, program[0], file)
        return HostedProgram(file, source, host, command, simulated=True)
    if pinmap is not None and all(section.name != pinmap for section in file.pinmaps):
        raise OptionError(f"{board}: there is no [pinmaps.{pinmap}]")
    return HostedProgram(file, source, host_of(file, pinmap), lambda _: list(program))


def _specified(option: str, spec: str, program: Sequence[str]) -> Any:
    """Return what the specification of firmware asks for.

    Raises:
        click.UsageError: it is wrong, or the program is more than one file.
    """
    from vbus.cli.run.firmware import parse, settings_of

    if len(program) != 1:
        raise click.UsageError(f"{option} takes one firmware file and no arguments")
    with value_errors(click.BadParameter, param_hint=option):
        return parse(spec) if option == "--avr" else settings_of(spec)


def _join(link: str, program: list[str]) -> int:
    """Run a program on a board that runs already."""
    from tempfile import TemporaryDirectory

    from vbus.cli.hosted.preload import environment, warn_of
    from vbus.cli.hosted.program import run_at_link
    from vbus.client import connect
    from vbus.core.errors import OptionError

    # Asked once before the program begins: a link that is wrong is named, and no program runs.
    with value_errors(OptionError, "--link: "), connect(link) as bus:
        info = bus.info
    with TemporaryDirectory(prefix="vbus-") as folder:
        note = Path(folder) / "fault"
        variables = environment(info, link, note) if info.card else {"VBUS_LINK": link}
        if info.card:
            warn_of(program[0], info.policy)
        return run_at_link(program, variables, note)
