"""Chips, plants, protocols and transports by name: entry points, loaded when first asked for.

The parts that come with vbus are registered in its own ``pyproject.toml`` in the same way as
anybody else's. Nothing is scanned at import.
"""

from collections.abc import Iterable
from contextlib import suppress
from functools import cache
from typing import Final, TypeVar

from vbus.chips.base import Chip
from vbus.chips.family import Family
from vbus.core.entry_points import EntryPoint, installed
from vbus.core.errors import ConfigError, PluginError
from vbus.core.signals import Plant
from vbus.core.values.settings import among

CHIPS: Final = "vbus.chips"
PLANTS: Final = "vbus.plants"
PROTOCOLS: Final = "vbus.protocols"
TRANSPORTS: Final = "vbus.transports"

_LOADED: Final[dict[EntryPoint, Family]] = {}
"""Families by entry point, once they are loaded."""

_Part = TypeVar("_Part")
_KINDS: Final = {
    CHIPS: "part",
    PLANTS: "plant model",
    PROTOCOLS: "protocol",
    TRANSPORTS: "transport",
}


def entry_points(group: str) -> Iterable[EntryPoint]:
    """Return the entry points of a group, as they are installed."""
    return [entry for entry in installed() if entry.group == group]


@cache
def _entries(group: str) -> dict[str, EntryPoint]:
    """Return the entry points of a group by name.

    Raises:
        PluginError: two distributions claim one name, or none is registered at all.
    """
    found: dict[str, EntryPoint] = {}
    for entry in entry_points(group=group):
        other = found.get(entry.name)
        if other is not None and other.value != entry.value:
            raise PluginError(
                f'{_KINDS[group]} "{entry.name}" is claimed twice: by {_origin(other)} and by'
                f" {_origin(entry)}; uninstall one of them"
            )
        found[entry.name] = entry
    if not found:
        raise PluginError(
            f"no {group} entry points are registered: vbus runs from a source tree that is not"
            ' installed; run "pip install -e ." in it'
        )
    return found


def _origin(entry: EntryPoint) -> str:
    return f"{entry.package} ({entry.value})" if entry.package else entry.value


def names(group: str) -> list[str]:
    """Return every name registered in ``group``, sorted."""
    return sorted(_entries(group))


def load(group: str, name: str) -> object:
    """Return what is registered in ``group`` under ``name``, imported now if need be.

    Raises:
        ConfigError: nothing is.
        PluginError: it cannot be imported; names the distribution and the reason.
    """
    entry = _entries(group).get(name)
    if entry is None:
        raise ConfigError(f'unknown {_KINDS[group]} "{name}"; {known(group, name)}')
    return _import(entry, group)


def known(group: str, name: str) -> str:
    """Return the end of a message about an unknown ``name``: the likely one, and all there are."""
    return among(name, names(group), "known are")


def _parts() -> list[str]:
    """Return the part numbers of all chips, and what those of chips without any begin with."""
    parts: list[str] = []
    for name in names(CHIPS):
        with suppress(PluginError):
            parts += chip_of(_family(name)).PARTS or (name,)
    return list(dict.fromkeys(parts))


def _import(entry: EntryPoint, group: str) -> object:
    try:
        return entry.load()
    except Exception as error:
        raise PluginError(
            f'{_KINDS[group]} "{entry.name}" of {_origin(entry)} cannot be loaded:'
            f" {type(error).__name__}: {error}"
        ) from error


def family_of(part: str) -> Family:
    """Return the family behind a part number.

    Entry points of ``vbus.chips`` are named by the start of the part numbers they answer for; the
    longest name that fits wins, so ``LM629`` may be of another package than ``LM62``. An entry is a
    :class:`~vbus.chips.family.Family`, or a chip class: a family of which nothing else is known.

    Raises:
        ConfigError: no name fits.
        PluginError: the entry point is broken, or it is neither.
    """
    fitting = [name for name in _entries(CHIPS) if part.startswith(name)]
    if not fitting:
        raise ConfigError(f'unknown part "{part}"; {among(part, _parts(), "known are", most=3)}')
    return _family(max(fitting, key=len))


def _family(name: str) -> Family:
    entry = _entries(CHIPS)[name]
    if entry not in _LOADED:
        found = load(CHIPS, name)
        if not isinstance(found, Family):
            chip = _checked(CHIPS, name, found, Chip)
            found = Family(chip.FAMILY, chip)
        _LOADED[entry] = found
    return _LOADED[entry]


def families() -> list[Family]:
    """Return every family that is registered, each once, those that come with vbus first.

    Broken plug-ins are left out.

    Raises:
        PluginError: none is registered at all, or a name is claimed twice.
    """
    found: dict[tuple[str, object], Family] = {}
    for name in names(CHIPS):
        with suppress(PluginError):
            one = _family(name)
            found.setdefault((one.name, one.chip), one)
    return sorted(found.values(), key=lambda one: not one.home.startswith(f"{CHIPS}."))


def family(name: str) -> Family:
    """Return the family called ``name``; if no package has it, one of which nothing else is known.

    Where a board has chips of it, no other plug-in is loaded.
    """
    loaded = (_LOADED.get(entry) for entry in _entries(CHIPS).values())
    for one in loaded:
        if one is not None and one.name == name:
            return one
    return next((one for one in families() if one.name == name), Family(name))


def chip_class(part: str) -> type[Chip]:
    """Return the class behind a part number.

    Raises:
        ConfigError: no name fits.
        PluginError: as :func:`family_of`, or the class cannot be imported.
    """
    return chip_of(family_of(part))


def chip_of(one: Family) -> type[Chip]:
    """Return the chip class of a family.

    Raises:
        PluginError: it cannot be imported, or there is none.
    """
    found = one.load("chip", Chip)
    if found is None:
        raise PluginError(f"family {one.name} names no chip class")
    return found


def chip_classes() -> list[type[Chip]]:
    """Return every chip that is registered, each once; those whose plug-in is broken are left out.

    Raises:
        PluginError: none is registered at all, or a name is claimed twice.
    """
    found: dict[type[Chip], None] = {}
    for one in families():
        with suppress(PluginError):
            found[chip_of(one)] = None
    return list(found)


def plant_class(model: str) -> type[Plant]:
    """Return the class behind a plant model, such as ``"dc_motor"`` or ``"fmu:gantry.fmu"``.

    Raises:
        ConfigError: the name is unknown, or a file is named and the model has none.
        PluginError: the entry point is broken, or it is not a plant.
    """
    name, colon, _ = model.partition(":")
    found = class_of(PLANTS, name, Plant)
    if colon and not has_file(found):
        raise ConfigError(f'plant model "{name}" has no file; write model = "{name}"')
    return found


def has_file(model: type[Plant]) -> bool:
    """Whether a plant model is written with a file, as in ``"fmu:gantry.fmu"``."""
    return any(option.name == "file" for option in model.OPTIONS)


def class_of(group: str, name: str, base: type[_Part]) -> type[_Part]:
    """Return the class that is registered in ``group`` under ``name``.

    Raises:
        ConfigError: nothing is.
        PluginError: it cannot be imported, or is no subclass of ``base``.
    """
    return _checked(group, name, load(group, name), base)


def _checked(group: str, name: str, found: object, base: type[_Part]) -> type[_Part]:
    if not isinstance(found, type) or not issubclass(found, base):
        raise PluginError(
            f'{_KINDS[group]} "{name}" of {_origin(_entries(group)[name])} is not a subclass of'
            f" {base.__name__}"
        )
    return found
