"""``vbus fmu``: a board as a block for simulators that know FMI."""

import re
import sys
import tempfile
import uuid
from pathlib import Path
from typing import Final

import click

from vbus.cli.output import duration
from vbus.core.errors import ConfigError, import_errors, read_errors, write_errors
from vbus.serve.output_file import write_file

_SCRIPT: Final = '''\
"""A vbus board as a unit of FMI; made by "vbus fmu"."""

import atexit
import ctypes
import pathlib
import platform
import sys

sys.path += [path for path in {paths!r} if path not in sys.path]

from pythonfmu3 import (
    Fmi3Causality, Fmi3Slave, Fmi3Status, Fmi3StepResult, Fmi3Variability, Float64,
    Int32, Int64, String,
)
from vbus.board.block import BoardBlock

TYPES = {{float: Float64, str: String}}

# pythonfmu3 0.3.4 lets go of Python twice at the end of a process in which the unit's library stays
# loaded, which can corrupt the heap. It lets go once, and in time, unless the unit started Python.
HERE = pathlib.Path(__file__).parent
if sys.orig_argv and HERE.name == "resources":
    for library in HERE.parent.glob(f"binaries/{{platform.machine()}}-linux/*.so"):
        atexit.register(ctypes.CDLL(str(library)).finalizePythonInterpreter)


class Board(Fmi3Slave):
    def __init__(self, **keywords):
        super().__init__(**keywords)
        self.block = BoardBlock({text!r}, {file!r}, {base})
        self.guid, self.modelName, self.description = {guid!r}, {name!r}, {title!r}
        self.register_variable(Float64(
            "time", causality=Fmi3Causality.independent, variability=Fmi3Variability.continuous,
            getter=lambda: self.block.seconds,
        ), nested=False)
        for one in self.block.variables:
            causality = Fmi3Causality.input if one.put else Fmi3Causality.output
            kind = TYPES.get(type(one.get()), Int64 if one.name.endswith("counts") else Int32)
            self.register_variable(kind(
                one.name, causality=causality, variability=Fmi3Variability.discrete,
                description=one.title, getter=one.get, setter=one.put,
            ), nested=False)

    def to_xml(self, *arguments):
        root = super().to_xml(*arguments)
        root.set("variableNamingConvention", "flat")  # of pins such as x./RST
        return root

    def do_step(self, begin, span):
        try:
            self.block.step(begin, span)
        except Exception as error:
            self.log(f"{{type(error).__name__}}: {{error}}", Fmi3Status.error)
            return Fmi3StepResult(status=Fmi3Status.error)
        return Fmi3StepResult(status=Fmi3Status.ok)
'''


@click.command("fmu")
@click.argument("board", metavar="BOARD.toml", type=click.Path(path_type=Path))
@click.option("-o", "--output", required=True, type=click.Path(path_type=Path),
              help="The unit: a file that ends in .fmu.")  # fmt: skip
@click.option("--step", callback=duration, default="1 us", show_default=True, metavar="TIME",
              help="Steps are multiples of this; others are refused.")  # fmt: skip
def command(board: Path, output: Path, step: int) -> int:
    """Make a board a co-simulation unit of FMI 3.0.

    The unit has the pins of the chips, a bus cycle for each of them, encoder counts and drives as
    variables. It uses the Python and the vbus that are installed here, wherever it is loaded.
    """
    from vbus.board.block import BoardBlock

    if output.suffix != ".fmu":
        raise click.UsageError(f"-o {output}: a unit's name ends in .fmu")
    if step < 1:
        raise click.UsageError("--step: steps are 1 ps long at least")
    with import_errors("units of FMI need pythonfmu3", "'vbus[fmi]'"):
        from pythonfmu3 import FmuBuilder
    with read_errors(board, ConfigError):
        text = board.read_text()
    block = BoardBlock(text, str(board), step)
    guid = uuid.uuid5(uuid.NAMESPACE_URL, f"{step} {text}")
    script = _SCRIPT.format(
        paths=[path for path in sys.path if path], text=text, file=str(board), base=step,
        guid=str(guid), name=re.sub(r"\W", "_", block.name), title=f"vbus board {block.name}",
    )  # fmt: skip
    with write_errors(output), tempfile.TemporaryDirectory() as folder:
        # Python imports a name once: two units in one process have two names.
        source = Path(folder) / f"board_{guid.hex}.py"
        source.write_text(script)
        made = FmuBuilder.build_FMU(source, Path(folder) / "made")
        write_file(output, made.read_bytes())
    click.echo(
        f"{output}: {len(block.variables)} variables; steps are multiples of {step / 10**12:g} s"
    )
    return 0
