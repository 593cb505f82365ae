"""``vbus conform``: a logic analyser's capture of real silicon beside the model."""

import json
import tomllib
from collections import Counter
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import asdict
from pathlib import Path
from typing import Any, BinaryIO, Final

import click

from vbus.cli.output import bar, duration, no_progress, reading, refuse_given, show
from vbus.core import exit_codes
from vbus.core.errors import ConfigError, VbusError

_QUANTITY: Final = "PIN=CHANNEL"


def _start(ctx: click.Context, param: click.Parameter, value: str) -> str | int:
    if value in ("auto", "reset", "start"):
        return value
    instant: int = duration(ctx, param, value)
    return instant


@click.command("conform")
@click.argument("chip")
@click.argument("capture", type=click.Path(path_type=Path))
@click.option("--clock", metavar="FREQUENCY", help='The chip\'s clock, such as "8 MHz".')
@click.option("--option", "options", multiple=True, metavar="KEY=VALUE", help="A chip's setting.")
@click.option("--plant", "plants", multiple=True, metavar="MODEL[,KEY=VALUE]...",
              help="Mechanics of an axis; may be given for each. Default: none.")  # fmt: skip
@click.option(
    "--board", metavar="FILE", help="A board file instead; CHIP is a chip or a card on it."
)
@click.option("--map", "maps", multiple=True, metavar=f"{_QUANTITY}[,...]|FILE",
              help="Which channel is which pin; also PIN=low, PIN=high.")  # fmt: skip
@click.option("--from", "start", default="auto", show_default=True, callback=_start,
              metavar="auto|reset|start|INSTANT",
              help="Where to begin: both are in the same state there.")  # fmt: skip
@click.option("--slack", callback=duration, metavar="DURATION",
              help="How far apart in time. Default: a sample and a clock period.")  # fmt: skip
@click.option("--ignore", multiple=True, metavar="NAME|ADDRESS:MASK",
              help="Leave out this packet, register or output; or bits of an address.")  # fmt: skip
@click.option("--samplerate", metavar="FREQUENCY", help="Of a table without a column of time.")
@click.option("--violations", is_flag=True, help="Judge AC limits too; list what the host broke.")
@click.option("--json", "as_json", is_flag=True, help="Print a JSON object.")
@no_progress
def command(
    chip: str, capture: Path, clock: str | None, options: tuple[str, ...],
    plants: tuple[str, ...], board: str | None, maps: tuple[str, ...], start: str | int,
    slack: int | None, ignore: tuple[str, ...], samplerate: str | None, violations: bool,
    as_json: bool, no_progress: bool,
) -> int:  # fmt: skip
    """Compare silicon with the model.

    CAPTURE is what a logic analyser saw on the host bus of a real chip: a VCD file, a sigrok
    session (.sr) or a table (.csv). What the host did is driven into a model of CHIP (a part
    number), edge by edge, and what the chip answered is compared. Ends with 0 if all agrees, 1 at
    the first difference, 6 if the capture cannot be used.
    """
    from vbus.board.build import load_board
    from vbus.board.card.card_bus import CardBus
    from vbus.views.silicon.card_watch import tie_others
    from vbus.views.silicon.channel_map import wiring_of
    from vbus.views.silicon.conform import CaptureTolerance, Conform
    from vbus.views.silicon.start import find_start, watch_of

    if board is not None:
        refuse_given(("clock", "options", "plants"), "is for a chip alone; --board says it")
    if capture.suffix.lower() not in (".csv", ".txt"):
        refuse_given(("samplerate",), f"is of tables (.csv); {capture} has times of its own")
    made = _board(chip, clock, options, plants) if board is None else load_board(board)
    part = _chip_of(made, chip)
    watch = watch_of(part)
    names, masks = _ignored(ignore, made, part)
    hertz = hertz_of(samplerate)
    wanted = _map(maps)
    with opened_capture(capture, hertz) as (read, _, _):
        wanted = {**_by_nets(part, watch.table.data, read.channels), **wanted} if board else wanted
        wiring = wiring_of(read.channels, part.name, part.pin_rows, watch, wanted)
        if isinstance(part, CardBus):
            tie_others(part, wiring)
        found = find_start(read.samples, wiring, part, start)
    period = read.period
    slack = period + -(-(10**12) // part.clock.hz) if slack is None else slack
    with (
        opened_capture(capture, hertz) as (read, file, size),
        bar("comparing", size, file.tell, no_progress or as_json) as move,
    ):
        run = Conform(made, part, wiring, CaptureTolerance(slack, names, masks), violations, move)
        verdict = run.run(read.samples, found)
    value = _value_of(verdict, found.why, slack, violations)
    show(as_json, value, _lines(capture, verdict, found, violations), 2)
    return exit_codes.OK if verdict.mismatch is None else exit_codes.FAILURE


# -- what is compared ---------------------------------------------------------------------------


def _value(text: str) -> str:
    """Return a setting as TOML: numbers and truth values as they are, all else as text."""
    try:
        tomllib.loads(f"x = {text}")
    except tomllib.TOMLDecodeError:
        return json.dumps(text)
    return text


def _settings(pairs: list[str], option: str) -> str:
    lines = ""
    for pair in pairs:
        key, equals, value = pair.partition("=")
        if not equals or not key.strip().isidentifier():
            raise click.UsageError(f'{option}: found "{pair}"; write KEY=VALUE')
        lines += f"{key.strip()} = {_value(value.strip())}\n"
    return lines


def _board(part: str, clock: str | None, options: tuple[str, ...], plants: tuple[str, ...]) -> Any:
    """Return a board of one chip."""
    from vbus import plugins
    from vbus.board.build import load_board_text
    from vbus.boardfile.source import BoardFileError

    part = part.upper()
    try:
        axes = plugins.chip_class(part).AXES
    except ConfigError as error:
        raise click.UsageError(str(error)) from None
    if clock is None:
        raise click.UsageError('say at which clock the chip runs: --clock "8 MHz"')
    models = ""
    names = []
    for number, plant in enumerate(plants):
        model, *settings = plant.split(",")
        names.append(f"p{number}")
        models += f"[plants.p{number}]\nmodel = {json.dumps(model)}\n"
        models += _settings(settings, "--plant")
    if axes < 2 and len(names) > axes:
        has = "one axis" if axes else "no axis"
        times = "once" if len(names) == 1 else f"{len(names)} times"
        raise click.UsageError(f"{part} has {has}; --plant is given {times}")
    names = names or ["none"]
    key = f"plants = {json.dumps(names)}" if axes > 1 else f"plant = {json.dumps(names[0])}" * axes
    text = (
        '[board]\nname = "conform"\ntime = "slaved"\npower_on = "done"\n'
        f"[chips.x]\npart = {json.dumps(part)}\nclock = {json.dumps(clock)}\n{key}\n"
        f"{_settings(list(options), '--option')}{models}"
    )
    try:
        return load_board_text(text)
    except BoardFileError as error:
        wrong = [f"{_option_of(problem.key)}: {problem.message}" for problem in error.problems]
        raise click.UsageError("\n".join(wrong)) from None


def _option_of(key: str) -> str:
    """Return what on the command line a key of the board came from."""
    if key.startswith("chips.x.plant"):
        return "--plant"
    where, _, name = key.rpartition(".")
    if where != "chips.x":
        return f"--plant {name}"
    return {"part": "CHIP", "clock": "--clock"}.get(name, f"--option {name}")


def _chip_of(board: Any, name: str) -> Any:
    found = [
        chip for chip in board.chips
        if name in (chip.name, chip.part, chip.part.lower(), chip.FAMILY)
    ]  # fmt: skip
    if len(board.chips) == 1 and len(found) == 0 and board.name == "conform":
        return board.chips[0]
    if len(found) != 1:
        known = ", ".join(f"{chip.name} ({chip.part})" for chip in board.chips)
        raise VbusError(f'"{name}" is not one chip of the board; it has {known}')
    return found[0]


def _by_nets(chip: Any, data: str, channels: Sequence[str]) -> dict[str, str]:
    """Return channels by pin where they have the name of its wire, as in waves of a board."""
    from vbus.views.wave.signals import bit_names, plain

    by_name = {plain(channel): channel for channel in channels}
    found = {}
    for name, pin in chip.pins.items():
        pairs = [(name, pin.net.name)]
        if name == data:
            pairs = list(zip(bit_names(name, 8), bit_names(pin.net.name, 8), strict=True))
        for own, net in pairs:
            if plain(net) in by_name:
                found[own] = by_name[plain(net)]
    return found


def _map(maps: tuple[str, ...]) -> dict[str, str]:
    """Return channels by pin."""
    wanted: dict[str, str] = {}
    for item in maps:
        if "=" not in item:
            wanted |= _map_file(item)
            continue
        for pair in item.split(","):
            pin, equals, channel = pair.partition("=")
            if not equals or not channel.strip():
                raise click.UsageError(f'--map: found "{pair}"; write {_QUANTITY}, or a file')
            wanted[pin.strip()] = channel.strip()
    return wanted


def _map_file(path: str) -> dict[str, str]:
    try:
        with reading(Path(path)) as file:
            table = tomllib.load(file)
    except (tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
        raise VbusError(f"{path}: {error}") from None
    table = table.get("channels", table)
    for pin, channel in table.items() if isinstance(table, dict) else ():
        if not isinstance(channel, str):
            raise VbusError(f"{path}: {pin}: found {channel}; write the channel's name as text")
    return dict(table)


def _ignored(
    items: tuple[str, ...], board: Any, part: Any
) -> tuple[frozenset[str], dict[int, int]]:
    """Return names, and masks by address; a name that nothing has would leave nothing out."""
    from vbus import plugins
    from vbus.events.names import Names, unknown_packet

    known = [] if part.CONNECTOR else Names(board).packets(part.name)
    if known:
        known += plugins.family(part.FAMILY).outputs
    names = set()
    masks: dict[int, int] = {}
    for item in items:
        address, colon, mask = item.partition(":")
        if not colon:
            if (known or part.CONNECTOR) and (unknown := unknown_packet(item, known)):
                raise click.UsageError(f"--ignore: no packet, register or output {unknown}")
            names.add(item)
            continue
        try:
            where = int(address, 16)
            masks[where] = masks.get(where, 0) | int(mask, 16)
        except ValueError:
            raise click.UsageError(
                f'--ignore: found "{item}"; write a name, or ADDRESS:MASK in hexadecimal'
            ) from None
    return frozenset(names), masks


# -- the file -----------------------------------------------------------------------------------


def hertz_of(text: str | None) -> int:
    """Return hertz of what ``--samplerate`` says; 0 if nothing."""
    from vbus.views.silicon.capture import frequency

    hertz = frequency(text, "--samplerate") if text else 0
    if text and not hertz:
        raise click.UsageError(f'--samplerate: "{text}" is no frequency such as "24 MHz"')
    return hertz


@contextmanager
def opened_capture(path: Path, hertz: int) -> Iterator[tuple[Any, BinaryIO, int]]:
    """Open a capture; the end of its name says its format."""
    from vbus.core.errors import CaptureError
    from vbus.core.file_kinds import HEAD, is_none
    from vbus.views.silicon.capture_csv import read_csv
    from vbus.views.silicon.capture_sr import read_sr
    from vbus.views.silicon.capture_vcd import read_vcd

    kind = path.suffix.lower()
    if kind not in (".vcd", ".sr", ".csv"):
        with reading(path, CaptureError) as file:
            head = file.read(HEAD)
        made = "captures end in .vcd, .sr or .csv"
        raise CaptureError(is_none(path, head, "capture", made))
    with reading(path, CaptureError) as file:
        if kind == ".csv":
            capture = read_csv(file, str(path), hertz)
        else:
            capture = (read_vcd if kind == ".vcd" else read_sr)(file, str(path))
        yield capture, file, path.stat().st_size


# -- what came of it ----------------------------------------------------------------------------


def _value_of(verdict: Any, why: str, slack: int, violations: bool) -> dict[str, Any]:
    value = asdict(verdict)
    value |= {"conforms": verdict.mismatch is None, "started": why, "slack": slack}
    if not violations:
        del value["violations"]
    return value


def _indented(mark: str, text: str) -> Iterator[str]:
    """Give a cycle with the packets that end in it below it."""
    cycle, *packets = text.split("\n")
    yield f"{mark}{cycle}"
    for packet in packets:
        yield f"      {packet}"


def _lines(path: Path, verdict: Any, found: Any, violations: bool) -> Iterator[str]:
    from vbus.chips.packets import cited
    from vbus.protocols.quantities import format_instant

    skipped = (
        f"; {found.skipped} cycles before that are not compared (--from)" if found.skipped else ""
    )
    yield f"{path}: compared {found.why}{skipped}"
    outputs = f", and {', '.join(verdict.outputs)}" if verdict.outputs else ""
    ignored = f"; {verdict.ignored} differences ignored" if verdict.ignored else ""
    mismatch = verdict.mismatch
    if mismatch is None:
        yield (
            f"no difference in {verdict.cycles} bus cycles, {verdict.reads} of them reads{outputs},"
            f" up to {format_instant(verdict.end)}{ignored}"
        )
    else:
        yield (
            f"first difference at {format_instant(mismatch.when)}, after {verdict.cycles} bus"
            f" cycles that match: {mismatch.where}{cited(mismatch.clause)}{ignored}"
        )
        yield f"  silicon: {mismatch.silicon}"
        yield f"  model:   {mismatch.model}"
        for text in mismatch.before:
            yield from _indented("      ", text)
        for number, text in enumerate(mismatch.after):
            yield from _indented("      " if number else "  >   ", text)
    if violations:
        rules = Counter(violation.rule for violation in verdict.violations)
        counts = ", ".join(f"{rule} x{times}" for rule, times in rules.most_common())
        plural = "" if verdict.broken == 1 else "s"
        yield f"{verdict.broken} violation{plural} by the host{': ' * bool(rules)}{counts}"
        for v in verdict.violations:
            yield f"  {format_instant(v.when)} {v.rule}  [{v.clause}]: {v.detail}" + (
                f" ({v.measured} ps, limit {v.limit} ps)" if v.limit else ""
            )
