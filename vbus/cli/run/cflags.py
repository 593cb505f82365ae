"""``vbus cflags``: the options with which a C compiler builds a host against the C client."""

import sys
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Final

import click

from vbus.cli.output import show
from vbus.core.errors import VbusError
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

    def includes(self) -> list[str]:
        """Return the folders in which the compiler looks for headers."""
        client = Path(include_dir())
        return [str(client / "shims" / name) for name in self.folders] + [str(client)]

    def files(self) -> list[str]:
        """Return what is compiled with the driver."""
        return [str(Path(include_dir()) / source) for source in self.sources]

    def flags(self) -> list[str]:
        """Return all options of the compiler."""
        return [*(f"-I{folder}" for folder in self.includes()), *self.options, *self.files()]


_CARD: Final = ("vbus.c", "link_text.c", "run_end.c", "card_table.c", "card_link.c", "card_time.c")
_CLOCKS: Final = tuple(
    f"-Wl,--wrap={name}"
    for name in ("clock_gettime", "clock_nanosleep", "gettimeofday", "nanosleep", "sleep", "time",
                 "usleep")
)  # fmt: skip
_PINS: Final = (
    "vbus.c", "link_text.c", "run_end.c", "pin_decoder.c", "card_table.c", "pin_link.c",
    "shims/ports.cpp",
)  # fmt: skip
_AVR: Final = (*_PINS, "shims/avr/avr_shim.cpp")

_PIC: Final = Shim(("pic",), (*_PINS, "shims/pic/pic_shim.cpp"), ("-Wno-unknown-pragmas",))


def _dialect(name: str) -> Shim:
    """Return the shim of another compiler for PICs: its sources are translated on the way."""
    # gcc splits -wrapper at commas; paths with a comma cannot be given.
    wrapper = f"{sys.executable},{Path(include_dir()) / 'pic_dialect.py'},{name}"
    return replace(_PIC, options=(*_PIC.options, "-wrapper", wrapper))


SHIMS: Final = {
    "arduino": Shim(
        ("arduino", "avr"),
        (*_AVR, "shims/arduino/arduino_shim.cpp", "shims/arduino/wire_shim.cpp"),
    ),
    "avr": Shim(("avr",), _AVR),
    "pic": _PIC,
    "c18": _dialect("c18"),
    "ccs": _dialect("ccs"),
    "stm32": Shim(
        ("stm32",),
        (*_PINS, "shims/stm32/stm32_shim.cpp"),
        (
            "-DVBUS_PORT_BITS=16",
            # An STM32 has ints of 32 bits too: the note about them would be wrong.
            "-DVBUS_INT_IS_32_BITS",
            # The compiler calls the shim at each branch: so loops without an access take chip time.
            "-fsanitize-coverage=trace-pc",
            "-Wno-missing-field-initializers",
        ),
    ),
    "linux-io": Shim(("linux-io",), _CARD, _CLOCKS),
    "mmio": Shim(("mmio",), _CARD, ("-D_DEFAULT_SOURCE", "-include", "vbus_mmio.h", *_CLOCKS)),
}
"""The shims by name."""

MICROCONTROLLERS: Final = frozenset(
    name for name, shim in SHIMS.items() if _PINS[-1] in shim.sources
)
"""The shims with ports. Those are C++ objects, for which sources are compiled with g++."""

PLAIN: Final = Shim((), ("vbus.c",))
"""For sources that call the C client themselves."""


@click.command("cflags")
@click.option(
    "--shim", type=click.Choice(list(SHIMS)),
    help="Headers with which sources written for other machines compile as they are.",
)  # fmt: skip
@click.option("--json", "as_json", is_flag=True, help="Print JSON.")
def command(shim: str | None, as_json: bool) -> None:
    """Print the compiler options of the C client: include path and source file.

    \b
    cc $(vbus cflags) -o host host.c
    g++ $(vbus cflags --shim avr) -DF_CPU=16000000UL -o host host.c
    """
    folder = Path(include_dir())
    chosen = PLAIN if shim is None else SHIMS[shim]
    sources, includes = chosen.files(), chosen.includes()
    headers = [str(folder / "vbus.h")]
    # A compiler would name the first missing file, and not why.
    if not all(Path(file).exists() for file in [*sources, *headers, *includes]):
        raise VbusError(f"the C client is missing from {folder}; install vbus again")
    value: dict[str, Any] = {"include": str(folder), "sources": sources, "headers": headers}
    if shim is not None:
        value |= {"includes": includes, "options": list(chosen.options)}
    show(as_json, value, [" ".join(chosen.flags())])
