"""Mechanics from elsewhere: a co-simulation unit of FMI 2.0 or 3.0, called through FMPy."""

import logging
import shutil
import weakref
from collections.abc import Iterable
from functools import partial
from typing import Any, ClassVar, Final

from mypy_extensions import i64

from vbus.core.errors import PluginError
from vbus.core.kernel import SECOND
from vbus.core.options import Option, Settings
from vbus.core.signals import Plant, Value, ValueTable
from vbus.core.state import Names
from vbus.plant.encoder import ENCODER_OPTIONS, MOST_TURNED, Encoder, floor

log: Final = logging.getLogger("vbus.plant.fmu")
_NUMBERS: Final = ("Real", "Integer", "Float64", "Float32", "Int64", "Int32")
"""Types of variables that a drive or a position may have."""
_STATE: Final = ("canGetAndSetFMUstate", "canSerializeFMUstate")
_FINEST: Final = 2.220446049250313e-16


class FmuPlant(Plant):
    """A unit whose one input takes the drive and whose one output is the place of the shaft.

    The unit is stepped by one length from its beginning to its end: ``step``, or the first period
    of its chip. In a period of the chip as many steps are made as end in it; the drive holds for
    them, and between them the shaft goes straight. A unit whose step fails stands from then on.
    """

    TAKES: ClassVar[tuple[str, ...]] = ("drive",)
    OPTIONS: ClassVar[tuple[Option, ...]] = (
        *ENCODER_OPTIONS,
        Option("file", "text", "", 'the unit; model = "fmu:FILE.fmu" says the same'),
        Option("drive", "text", "drive", "its input that takes the drive"),
        Option("full_drive", "ratio", 1.0, "what that input is given at full command"),
        Option("position", "text", "position", "its output that is the place of the shaft"),
        Option("counts_per_unit", "ratio", 1.0, "counts for each unit of that output"),
        Option("start", "text", "", 'values of other variables, such as "mass=2.5, load=0.1"'),
        Option("step", "s", 0, "its communication step; 0 s: the first period of the chip", low=0),
    )
    VALUES: ClassVar[ValueTable] = ValueTable(
        Value("position of the unit", "_place", key="unit", lane="unit", step=1e-6)
    )
    STATE: ClassVar[Names] = (
        "count", "_steps", "_now", "_step", "_from: float", "_to: float", "_place: float",
        "_failed: bool", "_unit: bytes[...]",
    )  # fmt: skip
    WIRING: ClassVar[Names] = ("encoder", "_name", "_fmu", "_in", "_out", "_loads", "_origin")
    DERIVED: ClassVar[Names] = ("_period",)

    def __init__(self, settings: Settings | None = None) -> None:
        super().__init__(settings)
        self.encoder: Encoder = Encoder(
            int(self.settings["encoder_lines"]), bool(self.settings["index"]),
            int(self.settings["index_offset"]),
        )  # fmt: skip
        self._name: str = str(self.settings["file"])
        if not self._name:
            raise ValueError('a unit is missing: write model = "fmu:FILE.fmu"')
        self._period: int = 0
        self._step: int = int(self.settings["step"])
        self._steps: int = 0
        """Steps since power-on."""
        self._now: int = 0
        """Chip time since power-on (ps)."""
        self._failed: bool = False
        self._unit: bytes = b""
        try:
            self._open()
        except (ValueError, PluginError):
            raise
        except Exception as error:  # of FMPy, of zipfile, of the loader of libraries
            raise ValueError(f"{self._name}: this unit cannot be used: {error}") from error
        self._place: float = self._read()
        self._origin: float = self._place
        self._from: float = 0.5
        self._to: float = 0.5

    # -- the unit -----------------------------------------------------------------------------

    def _open(self) -> None:
        """Unpack the unit, load its library and initialise it."""
        try:
            import fmpy
        except ImportError:
            raise PluginError(
                f"{self._name}: units of FMI need FMPy; install it with: pip install 'vbus[fmi]'"
            ) from None
        about = fmpy.read_model_description(self._name)
        if about.coSimulation is None or not about.fmiVersion.startswith(("2.", "3.")):
            raise ValueError(
                f"{self._name}: a unit of FMI {about.fmiVersion} without co-simulation; export it"
                " as a co-simulation unit of FMI 2.0 or 3.0"
            )
        variables = {one.name: one for one in about.modelVariables}
        self._in: Any = self._variable(variables, "drive", "input")
        self._out: Any = self._variable(variables, "position", "output")
        folder = fmpy.extract(self._name)
        weakref.finalize(self, shutil.rmtree, folder, ignore_errors=True)
        self._fmu: Any = fmpy.instantiate_fmu(
            folder,
            about,
            "CoSimulation",
            logger=partial(_pass_on, self._name),
            require_functions=False,
        )
        weakref.finalize(self, _free, self._fmu)
        self._loads: bool = all(getattr(about.coSimulation, key) for key in _STATE)
        start = [pair.partition("=") for pair in str(self.settings["start"]).split(",") if pair]
        if about.fmiVersion.startswith("2."):
            self._fmu.setupExperiment(startTime=0.0)
        for name, _, value in start:
            one = variables.get(name.strip())
            try:
                number = float(value)
            except ValueError:
                number = float("nan")
            if one is None or one.type not in _NUMBERS or number != number:
                raise ValueError(
                    f'start: "{name.strip()}={value.strip()}" is no number of a variable of'
                    f" {self._name}; there are {_names(variables.values())}"
                )
            self._set(one, number)
        self._fmu.enterInitializationMode()
        self._fmu.exitInitializationMode()

    def _variable(self, variables: dict[str, Any], key: str, causality: str) -> Any:
        """Return the variable that a setting names."""
        one = variables.get(str(self.settings[key]))
        if one is None or one.causality != causality or one.type not in _NUMBERS:
            there = _names(v for v in variables.values() if v.causality == causality)
            raise ValueError(
                f'{key}: {self._name} has no {causality} "{self.settings[key]}" that is a number;'
                f" there are {there}"
            )
        return one

    def _set(self, one: Any, value: float) -> None:
        number: float | int = round(value) if one.type.startswith("Int") else value
        getattr(self._fmu, f"set{one.type}")([one.valueReference], [number])

    def _read(self) -> float:
        (value,) = getattr(self._fmu, f"get{self._out.type}")([self._out.valueReference])
        return float(value)

    def _make_step(self) -> None:
        """Step the unit, and take its place down; a unit that fails is left alone afterwards."""
        try:
            self._fmu.doStep(self._steps * self._step / SECOND, self._step / SECOND)
            place = self._read()
            counts = (place - self._origin) * float(self.settings["counts_per_unit"])
            if not abs(counts - self._to) <= MOST_TURNED:
                raise ValueError(f"it has gone to {place:g}")
        except Exception as error:  # of FMPy: the unit returned an error
            self._failed = True
            log.error(
                "%s: the step from %g s on failed: %s; the shaft stands from now on: look at the"
                " unit's own messages, or choose a smaller step",
                self._name, self._steps * self._step / SECOND, error,
            )  # fmt: skip
            return
        self._place = place
        self._to = 0.5 + counts
        self._steps += 1

    # -- periods ------------------------------------------------------------------------------

    def prepare(self, period: float) -> None:
        """Set the length of a period in seconds."""
        self._period = round(period * SECOND)
        self._step = self._step or self._period
        self._from = self._to

    def drive(self, command: float, error: i64) -> i64:
        """Run the steps that end in this period with ``command`` of full scale."""
        self._from = self._to
        self._now += self._period
        if not self._failed:
            self._set(self._in, command * float(self.settings["full_drive"]))
        while not self._failed and (self._steps + 1) * self._step <= self._now:
            self._make_step()
        self.count = floor(self._to)
        return self.count

    def count_at(self, fraction: float) -> i64:
        """Return the count at ``fraction`` (0.0 to 1.0) of the last period."""
        if fraction >= 1.0:
            return self.count
        return floor(self._from + (self._to - self._from) * max(fraction, 0.0))

    def fraction_at(self, count: i64) -> float:
        """Return when, as a fraction of the last period, the encoder first reached ``count``."""
        start = floor(self._from)
        if count == start or self._to == self._from:
            return 0.0 if count == start else 1.0
        rising = count > start
        # Going down, a count is reached when the shaft leaves the one above it.
        border = float(count) if rising else float(count) + 1.0
        fraction = (border - self._from) / (self._to - self._from)
        step = _FINEST  # the border itself may be missed by a rounding error
        while 0.0 <= fraction < 1.0:
            here = self.count_at(fraction)
            if (here >= count) if rising else (here <= count):
                return fraction
            fraction += step
            step *= 2.0
        return 1.0

    def index_between(self, start: i64, end: i64) -> tuple[bool, i64]:
        """Tell whether moving from ``start`` to ``end`` enters an index position, and which."""
        return self.encoder.index_between(start, end)

    # -- state --------------------------------------------------------------------------------

    def unsaved(self) -> str:
        """Return why no snapshot can hold the unit; "" if one can."""
        if self._loads:
            return ""
        return (
            f"{self._name} cannot be saved or go back: the unit lacks {' or '.join(_STATE)};"
            " run the board from the beginning, or export the unit with states"
        )

    def before_save(self) -> None:
        """Ask the unit for its state, if it has one to give."""
        if self._loads:
            state = self._fmu.getFMUState()
            self._unit = self._fmu.serializeFMUState(state)
            self._fmu.freeFMUState(state)

    def after_load(self) -> None:
        """Give the unit its state back."""
        if not self._loads:
            raise ValueError(self.unsaved())
        state = self._fmu.deserializeFMUState(self._unit)
        self._fmu.setFMUState(state)
        self._fmu.freeFMUState(state)


def _pass_on(name: str, *about: Any) -> None:
    """Pass on what a unit says: the last argument, in both versions of FMI."""
    log.warning("%s: %s", name, bytes(about[-1]).decode(errors="replace"))


def _names(variables: Iterable[Any]) -> str:
    return ", ".join(one.name for one in variables if one.type in _NUMBERS) or "none"


def _free(unit: Any) -> None:
    unit.terminate()
    unit.freeInstance()
