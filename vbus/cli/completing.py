"""What a shell completes after ``vbus``; loaded only while one asks."""

from collections.abc import Callable, Iterable
from copy import copy
from pathlib import Path
from typing import Final

import click
from click.shell_completion import CompletionItem


def _boards() -> Iterable[str]:
    from vbus.serve.registry import boards_directory

    return sorted(path.stem for path in boards_directory().glob("*.sock"))


def _parts() -> Iterable[str]:
    from vbus import plugins

    return [part for chip in plugins.chip_classes() for part in chip.PARTS]


def _faults() -> Iterable[str]:
    from vbus.faults.table import faults

    return faults()


def _demos() -> Iterable[str]:
    from vbus.client.demo import demos

    return demos()


class Completed(click.ParamType):  # type: ignore[type-arg]
    """What a parameter is completed to.

    Args:
        items: returns what begins as its argument does.
    """

    name = "completed"

    def __init__(self, items: Callable[[str], list[CompletionItem]]) -> None:
        self._items = items

    def shell_complete(
        self, ctx: click.Context, param: click.Parameter, incomplete: str
    ) -> list[CompletionItem]:
        """Return what begins so."""
        return self._items(incomplete)


def _among(known: Callable[[], Iterable[str]]) -> Completed:
    """Complete to one of several names, which are looked up when asked for."""
    return Completed(lambda begun: [CompletionItem(n) for n in known() if n.startswith(begun)])


def _file(suffix: str) -> Completed:
    """Complete to a file, by what its name ends with; to any file where there is none of them."""

    def items(incomplete: str) -> list[CompletionItem]:
        # The shell shows whole paths: what stands before the last slash stays as it was typed.
        folder, slash, begun = incomplete.rpartition("/")
        here = Path(folder or ("/" if slash else "."))
        names = sorted(path.name for path in here.glob(f"*{suffix}"))
        found = [f"{folder}{slash}{name}" for name in names if name.startswith(begun)]
        return [CompletionItem(path) for path in found] or [CompletionItem(incomplete, type="file")]

    return Completed(items)


_BOARD: Final = _among(_boards)
_BOARD_FILE: Final = _file(".toml")
_JOURNAL: Final = _file(".vbj")
_FILE: Final = click.Path()

_TYPES: Final[dict[str, Completed | click.Path]] = {
    "board": _BOARD, "names": _BOARD, "boards": _BOARD_FILE, "machine": _BOARD_FILE,
    "journal": _JOURNAL, "journals": _JOURNAL, "first": _JOURNAL, "second": _JOURNAL,
    "sources": _JOURNAL, "what": _JOURNAL, "program": _FILE, "name": _among(_demos),
    "chip": _among(_parts), "fault": _among(_faults),
    "conform board": _BOARD_FILE, "exec board": _BOARD_FILE, "router file": _BOARD_FILE,
    "run board": _BOARD_FILE,
}  # fmt: skip
"""By argument, or by command and parameter; what is not here click completes by its type."""


def prepared(command: click.Command, path: str) -> click.Command:
    """Return a command, with those below it, whose parameters know what they complete to."""
    # The command itself stays as it is: tests and the page of the command line read it.
    command = copy(command)
    if isinstance(command, click.Group):
        below = command.commands.items()
        command.commands = {name: prepared(one, f"{path} {name}") for name, one in below}
    command.params = [_prepared(parameter, path) for parameter in command.params]
    return command


def _prepared(parameter: click.Parameter, path: str) -> click.Parameter:
    known = _TYPES.get(f"{path} {parameter.name}")
    if known is None and isinstance(parameter, click.Argument):
        known = _TYPES.get(parameter.name or "")
    if known is None and parameter.metavar == "FILE":
        known = _FILE
    if known is not None:
        parameter = copy(parameter)
        parameter.type = known
    return parameter
