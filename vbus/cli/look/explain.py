"""``vbus explain``: bytes, status words, rules and journal entries in the manual's words."""

import re
import sys
from collections.abc import Iterable, Iterator, Sequence
from errno import ENOENT
from os import strerror
from pathlib import Path
from typing import Final

import click

from vbus.chips.packets import Cycle, Decoder, Packet
from vbus.cli.output import Line, json_line, no_progress
from vbus.core.errors import ConfigError, value_errors
from vbus.core.file_kinds import unreadable

_HEX: Final = re.compile(r"(?:0x)?([0-9A-Fa-f]{1,2})[hH]?")
_WORD: Final = re.compile(r"([a-z]+)=(?:0x)?([0-9A-Fa-f]{1,8})[hH]?")
_LINE: Final = re.compile(r"\b([rw]) ([0-9A-Fa-f]{1,2}) ([0-9A-Fa-f]{2})(?: x(\d{1,6}))?\b")
_ENTRY: Final = re.compile(r"(.+?)(?::(\d+)(?:-(\d+))?)?")


@click.command("explain")
@click.argument("what")
@click.argument("items", metavar="[BYTE]...", nargs=-1)
@click.option("--json", "as_json", is_flag=True, help="Print JSON, an object for each line.")
@no_progress
def command(what: str, items: tuple[str, ...], as_json: bool, no_progress: bool) -> None:
    """Explain bytes on a bus, a status value, a rule, or entries of a journal.

    WHAT is a chip family or part, and BYTEs are what its host writes (or reads, where the command
    says so), in hexadecimal: "vbus explain lm628 1F 00 2A". A BYTE may also be a bus cycle as
    transcripts have it, "w 0 1F" or "r 0 84", or a word by name, "status=84" or "signals=8544".

    WHAT may be a rule ("lm628.T14", or "T14" for that of every chip), a clause ("LM-BUS-7"), or a
    journal: "run.vbj" is all of it, "run.vbj:17" its entry 17, "run.vbj:17-40" several.
    """
    lines = _lines(what, items, no_progress, as_json)
    # Not echo, which flushes each line, and that costs more than making it: a terminal is given
    # every line at once anyway.
    try:
        sys.stdout.writelines(f"{line}\n" for line in (map(json_line, lines) if as_json else lines))
    finally:
        sys.stdout.flush()


def _lines(what: str, items: Sequence[str], quiet: bool, as_json: bool) -> Iterable[str]:
    """Return the lines that explain ``what``, or say what it could be."""
    from vbus.cli.look.explain_clauses import explained, unknown_clause

    lines = explained(what, as_json)
    if not lines:
        _refuse_unknown_rule(what)
        decoder = _decoder(what)
        if decoder is not None:
            if not items:
                raise click.UsageError(f"{what}: say what to explain: bytes, or status=HEX")
            return _chip(decoder, items)
    if items:
        raise click.UsageError(
            f'"{what}" is no chip; {_meant(what)}bytes and words belong to {_families()}'
        )
    if lines:
        return lines
    # Last of all: a journal may have any name, also one that looks like a rule.
    match = _ENTRY.fullmatch(what)
    if match is not None and Path(match[1]).is_dir():
        raise click.UsageError(f"{match[1]} is a directory; name a journal in it{_in(match[1])}")
    if match is None or not Path(match[1]).is_file():
        if match is not None and Path(match[1]).suffix:
            absent = unreadable(match[1], FileNotFoundError(ENOENT, strerror(ENOENT)))
            raise click.UsageError(f"{match[1]}: {absent}")
        raise click.UsageError(
            unknown_clause(what)
            or f'"{what}" is neither a chip ({_families()}), nor a rule ("vbus check --rules"'
            f" lists them), nor a clause, nor a journal; {_meant(what)}a command is told by its"
            ' bytes: "vbus explain CHIP BYTE..."'
        )
    from vbus.cli.journal_lines import decoded

    first = int(match[2]) if match[2] else 0
    last = int(match[3]) if match[3] else first if match[2] else None
    if last is not None and last < first:
        raise click.UsageError(f"{what}: entries go from the lower number to the higher")
    return decoded(Path(match[1]), first, last, quiet)


def _in(folder: str) -> str:
    """Return the first journal of a folder, as an example."""
    found = sorted(Path(folder).glob("*.vbj"))
    return f", such as {found[0]}" if found else ""


def _refuse_unknown_rule(what: str) -> None:
    """Say so if this looks like a rule of a chip, and there is none of that name."""
    from vbus import plugins
    from vbus.board.check.checks import all_rules
    from vbus.core.values.settings import suggestion

    family, dot, symbol = what.partition(".")
    known = {one.name for one in plugins.families()}
    if dot and symbol and family in known and not Path(what).exists():
        rules = [rule.name for rule in all_rules() if rule.name.startswith(f"{family}.")]
        raise click.UsageError(
            f'there is no rule "{what}"; {suggestion(what, rules)}"vbus check --rules" lists them'
        )


def _meant(what: str) -> str:
    """Return the chip family or part whose name is near, as a question; "" if none is."""
    from vbus import plugins
    from vbus.core.values.settings import suggestion

    parts = [part for chip in plugins.chip_classes() for part in chip.PARTS]
    return suggestion(what, [*(one.name for one in plugins.families()), *parts])


def _families() -> str:
    from vbus import plugins

    return ", ".join(sorted(one.name for one in plugins.families() if one.packets))


def _decoder(name: str) -> Decoder | None:
    """Return the decoder for a family or part, if ``name`` is one."""
    from vbus import plugins

    family = plugins.family(name.lower())
    if not family.chip:
        try:
            family = plugins.family_of(name.upper())
        except ConfigError:
            return None
    made = family.load("packets", Decoder)
    if made is None:
        raise click.UsageError(f"{name}: nothing is registered that reads its bus in words")
    return made()


def _chip(decoder: Decoder, items: Sequence[str]) -> Iterator[str]:
    text = " ".join(items)
    # A line of a transcript may stand among the words, with its count: "r 0 84 x14".
    cycles = [
        Cycle(0, match[1] == "w", int(match[2], 16), int(match[3], 16))
        for match in _LINE.finditer(text)
        for _ in range(int(match[4] or 1))
    ]
    rest = _LINE.sub(" ", text).split() if cycles else text.replace(",", " ").split()
    data: list[int] = []
    for item in rest:
        word = _WORD.fullmatch(item)
        byte = _HEX.fullmatch(item)
        if word:
            with value_errors(click.UsageError):
                value = decoder.word(word[1], int(word[2], 16))
            yield Line(f"{word[1]} {value}", word=word[1], text=value)
        # Bytes beside whole cycles would have no address.
        elif byte and not cycles:
            data.append(int(byte[1], 16))
        elif "=" in item:
            name, _, value = item.partition("=")
            raise click.UsageError(f'{name}: "{value}" is no hexadecimal number, such as {name}=84')
        elif not cycles:
            hint = f"; for a {item} value write {item}=HEX" if item in decoder.WORDS else ""
            raise click.UsageError(f'"{item}" is no byte; write two hexadecimal digits{hint}')
    with value_errors(click.UsageError):
        cycles = cycles or decoder.typed(data)
    for cycle in cycles:
        for packet in decoder.feed(cycle):
            yield from _packet(packet)
    for packet in decoder.finish():
        yield from _packet(packet)


def _packet(packet: Packet) -> Iterator[str]:
    data = [cycle.data for cycle in packet.cycles]
    yield Line(
        f"{' '.join(f'{byte:02X}' for byte in data)}: {packet.cited}",
        bytes=data, kind=packet.kind, text=packet.text, clause=packet.clause,
    )  # fmt: skip
