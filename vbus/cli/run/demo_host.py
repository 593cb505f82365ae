"""The host's side of ``vbus demo``: a separate process that knows nothing but its link.

``python -m vbus.cli.run.demo_host NAME LINK``. The exit code is 0 if all went through, whether or
not the results are right.
"""

import os
import sys
from typing import Final

from vbus import plugins
from vbus.client import connect
from vbus.client.demo import Demo, tell
from vbus.core.errors import VbusError

_FAMILIES: Final = {one.demo_name: one for one in plugins.families() if one.demo}
NAMES: Final = tuple(_FAMILIES)
"""Demonstrations by name; the first is the default."""


def demo_of(name: str) -> Demo:
    """Return the demonstration called ``name``."""
    row: Demo = _FAMILIES[name].object("demo")
    return row


def main(name: str, link: str) -> int:
    """Do it; return the exit code."""
    try:
        with connect(link) as bus:
            chips = [f"{chip.name} ({chip.part})" for chip in bus.info.chips]
            tell(hello=link, pid=os.getpid(), chips=chips)
            demo_of(name).host(bus)
    except VbusError as error:
        tell(failed=str(error))
        return 1
    tell(end=True)
    return 0


if __name__ == "__main__":
    sys.exit(main(*sys.argv[1:3]))
