"""Entry points of installed packages, read where installers write them.

``importlib.metadata`` gives the same: a tenth of the time to a board's first answer went into
importing it, so it is asked only where packages may lie in something other than folders.
"""

import sys
from collections.abc import Iterator
from functools import cache, reduce
from importlib import import_module
from importlib.machinery import PathFinder
from pathlib import Path
from typing import Final, NamedTuple

FOLDERS: Final = (".dist-info", ".egg-info")
"""How the folders end in which a package tells of itself."""


class EntryPoint(NamedTuple):
    """What a package has registered.

    Attributes:
        name: by which it is asked for.
        value: where it is: ``"module:object"``, or a module.
        group: in which it is registered.
        package: that has registered it; "" if unknown.
    """

    name: str
    value: str
    group: str
    package: str = ""

    def load(self) -> object:
        """Return what is registered, imported now if need be."""
        module, _, path = self.value.partition("[")[0].partition(":")
        names = filter(None, path.strip().split("."))
        return reduce(getattr, names, import_module(module.strip()))


@cache
def installed() -> tuple[EntryPoint, ...]:
    """Return every entry point; of a package that is there twice, those found first count."""
    # A zip, or an editable installation by a finder: the slow way knows them.
    if not _only_folders():
        return tuple(_from_metadata())
    seen: dict[str, tuple[EntryPoint, ...]] = {}
    for place in sys.path:
        for folder in _folders(Path(place)):
            package = folder.stem.partition("-")[0].replace("_", "-")
            # As Python imports: the first place on the path wins.
            if package.lower() not in seen:
                seen[package.lower()] = tuple(_read(folder / "entry_points.txt", package))
    return tuple(entry for entries in seen.values() for entry in entries)


def _only_folders() -> bool:
    """Whether all packages are in folders: no zip file and no other package's finder has any."""
    finders = (finder for finder in sys.meta_path if hasattr(finder, "find_distributions"))
    return all(finder is PathFinder for finder in finders) and not any(
        Path(place).is_file() for place in sys.path
    )


def _from_metadata() -> Iterator[EntryPoint]:
    from importlib.metadata import entry_points

    found = entry_points()
    for group in found.groups:
        for entry in found.select(group=group):
            yield EntryPoint(entry.name, entry.value, group, entry.dist.name if entry.dist else "")


def _folders(place: Path) -> list[Path]:
    try:
        return sorted(folder for folder in place.iterdir() if folder.name.endswith(FOLDERS))
    except OSError:  # not there, or no folder
        return []


def _read(file: Path, package: str) -> Iterator[EntryPoint]:
    try:
        text = file.read_text(encoding="utf-8")
    except OSError:  # it registers nothing
        return
    group = ""
    for line in map(str.strip, text.splitlines()):
        if line.startswith("["):
            group = line.strip("[]")
        elif line and not line.startswith("#"):
            name, _, value = line.partition("=")
            yield EntryPoint(name.strip(), value.strip(), group, package)
