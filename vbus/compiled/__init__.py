"""Which core runs: the compiled one, or the same files interpreted.

A wheel built where a C compiler is holds both: ``kernel.py`` and, made from it, an extension
module beside it, which Python prefers. ``VBUS_PURE=1`` in the environment turns that round.
"""

import os
import sys
from importlib.machinery import (
    BYTECODE_SUFFIXES,
    EXTENSION_SUFFIXES,
    SOURCE_SUFFIXES,
    FileFinder,
    SourceFileLoader,
    SourcelessFileLoader,
)

from vbus.version import __version__

REASON = "reason.txt"
"""Beside this file in a wheel without the compiled core: one line saying why."""

_PACKAGE = os.path.dirname(os.path.dirname(os.path.abspath(__file__)))


def pure_wanted() -> bool:
    """Whether the environment asks for the interpreted core."""
    return os.environ.get("VBUS_PURE", "") not in ("", "0")


def interpret() -> None:
    """From now on load the package's modules from their source, whatever stands beside them."""

    def finder(path: str) -> FileFinder:
        if path != _PACKAGE and not path.startswith(_PACKAGE + os.sep):
            raise ImportError("not a folder of this package", path=path)
        return FileFinder(
            path,
            (SourceFileLoader, SOURCE_SUFFIXES),
            (SourcelessFileLoader, BYTECODE_SUFFIXES),
        )

    # Before Python's own hook, which prefers extension modules.
    sys.path_hooks.insert(0, finder)
    # Finders that were made before this hook would go on preferring them.
    for path in list(sys.path_importer_cache):
        if path == _PACKAGE or path.startswith(_PACKAGE + os.sep):
            del sys.path_importer_cache[path]


def is_compiled() -> bool:
    """Whether the core that runs, or would be imported, is the compiled one."""
    loaded = sys.modules.get("vbus.core.kernel.kernel")
    # What has been loaded decides; else what an import would find.
    if loaded is not None:
        return not str(loaded.__file__).endswith(tuple(SOURCE_SUFFIXES + BYTECODE_SUFFIXES))
    return not pure_wanted() and _extension_there()


def core() -> str:
    """Return ``"compiled"`` or ``"interpreted"``."""
    return "compiled" if is_compiled() else "interpreted"


def why() -> str:
    """Return why the core is interpreted; empty if it is compiled."""
    if is_compiled():
        return ""
    if _extension_there():
        return "VBUS_PURE asks for it"
    return _noted() or "it runs from its source tree"


def lacks_compiler() -> bool:
    """Whether the core would be compiled, had a compiler been there when vbus was installed."""
    return not is_compiled() and not _extension_there() and bool(_noted())


def _noted() -> str:
    try:
        with open(os.path.join(_PACKAGE, "compiled", REASON), encoding="utf-8") as file:
            return file.read().strip()
    except FileNotFoundError:
        return ""


def _extension_there() -> bool:
    path = os.path.join(_PACKAGE, "core", "kernel", "kernel")
    return any(os.path.exists(path + suffix) for suffix in EXTENSION_SUFFIXES)


def version_line() -> str:
    """Return version and core in a line for people."""
    return f"vbus {__version__} ({core()} core)"
