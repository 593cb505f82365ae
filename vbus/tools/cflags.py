"""``vbus cflags``: what a C compiler must be told to build a host against the C client."""

import json
from dataclasses import dataclass
from pathlib import Path
from typing import Final

import click

from vbus.errors import VbusError
from vbus.native import include_dir


@dataclass(frozen=True, slots=True)
class Shim:
    """A set of headers with which driver sources compile for the PC as they are.

    Attributes:
        folders: include folders in ``shims``, searched in this order.
        sources: what is compiled with the driver, below the C client's folder.
        options: further options of the compiler.
    """

    folders: tuple[str, ...]
    sources: tuple[str, ...]
    options: tuple[str, ...] = ()


_CARD: Final = ("vbus.c", "link_text.c", "card_link.c")
_PINS: Final = ("vbus.c", "link_text.c", "pin_decoder.c", "pin_link.c", "shims/ports.cpp")
_AVR: Final = (*_PINS, "shims/avr/avr_shim.cpp")

SHIMS: Final = {
    "arduino": Shim(("arduino", "avr"), (*_AVR, "shims/arduino/arduino_shim.cpp")),
    "avr": Shim(("avr",), _AVR),
    "pic": Shim(("pic",), (*_PINS, "shims/pic/pic_shim.cpp"), ("-Wno-unknown-pragmas",)),
    "linux-io": Shim(("linux-io",), _CARD),
    "mmio": Shim(("mmio",), _CARD, ("-D_DEFAULT_SOURCE", "-include", "vbus_mmio.h")),
}
"""The shims by name. The ports of microcontrollers are C++ objects: those want g++."""


@click.command("cflags")
@click.option(
    "--shim",
    type=click.Choice(list(SHIMS)),
    help="Headers with which sources written for other machines compile as they are.",
)
@click.option("--json", "as_json", is_flag=True, help="Print JSON.")
def command(shim: str | None, as_json: bool) -> None:
    """Print the compiler options of the C client: include path and source file.

    \b
    cc $(vbus cflags) -o host host.c
    g++ $(vbus cflags --shim avr) -DF_CPU=16000000UL -o host host.c
    """
    folder = Path(include_dir())
    chosen = Shim((), ("vbus.c",)) if shim is None else SHIMS[shim]
    sources = [str(folder / source) for source in chosen.sources]
    includes = [str(folder / "shims" / name) for name in chosen.folders] + [str(folder)]
    headers = [str(folder / "vbus.h")]
    if not all(Path(file).exists() for file in [*sources, *headers, *includes]):
        raise VbusError(f"the C client is missing from {folder}; install vbus again")
    if as_json:
        told = {"include": str(folder), "sources": sources, "headers": headers}
        if shim is not None:
            told |= {"includes": includes, "options": list(chosen.options)}
        click.echo(json.dumps(told))
    else:
        flags = [*(f"-I{include}" for include in includes), *chosen.options, *sources]
        click.echo(" ".join(flags))
