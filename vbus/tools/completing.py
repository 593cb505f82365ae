"""What a shell completes after ``vbus``; loaded only while one asks."""

from collections.abc import Callable, Iterable
from copy import copy
from pathlib import Path
from typing import Final

import click
from click.shell_completion import CompletionItem


def _boards() -> Iterable[str]:
    from vbus.server.registry import boards_directory

    return sorted(path.stem for path in boards_directory().glob("*.sock"))


def _parts() -> Iterable[str]:
    from vbus import plugins

    return [part for chip in plugins.chip_classes() for part in chip.PARTS]


def _faults() -> Iterable[str]:
    from vbus.faults.table import faults

    return faults()


def _demos() -> Iterable[str]:
    from vbus.tools.demos import NAMES

    return NAMES


class NameChoice(click.ParamType):  # type: ignore[type-arg]
    """One of several names, which are looked up when asked for."""

    name = "name"

    def __init__(self, known: Callable[[], Iterable[str]]) -> None:
        self._known = known

    def shell_complete(
        self, ctx: click.Context, param: click.Parameter, incomplete: str
    ) -> list[CompletionItem]:
        """Return the names that begin so."""
        return [CompletionItem(name) for name in self._known() if name.startswith(incomplete)]


class Files(click.ParamType):  # type: ignore[type-arg]
    """A file, by what its name ends with; any file where there is none of them."""

    name = "file"

    def __init__(self, suffix: str) -> None:
        self._suffix = suffix

    def shell_complete(
        self, ctx: click.Context, param: click.Parameter, incomplete: str
    ) -> list[CompletionItem]:
        """Return the files that begin so."""
        folder, slash, begun = incomplete.rpartition("/")
        here = Path(folder or ("/" if slash else "."))
        names = sorted(path.name for path in here.glob(f"*{self._suffix}"))
        found = [f"{folder}{slash}{name}" for name in names if name.startswith(begun)]
        items = [CompletionItem(path) for path in found]
        return items or [CompletionItem(incomplete, type="file")]


_BOARD: Final = NameChoice(_boards)
_BOARD_FILE: Final = Files(".toml")
_JOURNAL: Final = Files(".vbj")
_FILE: Final = click.Path()

_TYPES: Final[dict[tuple[str, str], NameChoice | Files | click.Path]] = {
    ("check", "boards"): _BOARD_FILE,
    ("conform", "board"): _BOARD_FILE,
    ("conform", "chip"): NameChoice(_parts),
    ("coverage", "files"): _FILE,
    ("demo", "name"): NameChoice(_demos),
    ("diff", "first"): _JOURNAL,
    ("diff", "second"): _JOURNAL,
    ("exec", "board"): _BOARD_FILE,
    ("exec", "program"): _FILE,
    ("explain", "what"): _JOURNAL,
    ("fault arm", "board"): _BOARD,
    ("fault arm", "fault"): NameChoice(_faults),
    ("fault clear", "board"): _BOARD,
    ("fault list", "board"): _BOARD,
    ("fault log", "board"): _BOARD,
    ("logs", "board"): _BOARD,
    ("ls", "names"): _BOARD,
    ("monitor", "board"): _BOARD,
    ("plot", "journal"): _JOURNAL,
    ("replay", "journals"): _JOURNAL,
    ("report", "journal"): _JOURNAL,
    ("router", "file"): _BOARD_FILE,
    ("run", "board"): _BOARD_FILE,
    ("snap bisect", "journal"): _JOURNAL,
    ("snap load", "board"): _BOARD,
    ("snap save", "board"): _BOARD,
    ("stop", "names"): _BOARD,
    ("up", "machine"): _BOARD_FILE,
    ("wait", "names"): _BOARD,
    ("wave", "source"): _JOURNAL,
}
"""By command and parameter; what is not here click completes by its type."""


def prepared(command: click.Command, path: str) -> click.Command:
    """Return a command, with those below it, whose parameters know what they complete to."""
    command = copy(command)
    if isinstance(command, click.Group):
        below = command.commands.items()
        command.commands = {name: prepared(one, f"{path} {name}") for name, one in below}
    command.params = [_prepared(parameter, path) for parameter in command.params]
    return command


def _prepared(parameter: click.Parameter, path: str) -> click.Parameter:
    known = _TYPES.get((path, parameter.name or ""))
    if known is None and parameter.metavar == "FILE":
        known = _FILE
    if known is not None:
        parameter = copy(parameter)
        parameter.type = known
    return parameter
