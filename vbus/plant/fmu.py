"""Mechanics from elsewhere: a co-simulation unit of FMI 2.0 or 3.0, called through FMPy."""

import logging
import shutil
import weakref
from collections.abc import Callable, Iterable
from functools import partial
from typing import Any, ClassVar, Final

from mypy_extensions import i64

from vbus.core.errors import PluginError, import_errors
from vbus.core.kernel import SECOND
from vbus.core.options import Option, Settings
from vbus.core.signals import Value, ValueTable
from vbus.core.signals.axis import DRIVES
from vbus.core.state import Names
from vbus.plant.encoder import ENCODER_OPTIONS, MOST_TURNED, EncodedPlant

log: Final = logging.getLogger("vbus.plant.fmu")
_NUMBERS: Final = ("Real", "Integer", "Float64", "Float32", "Int64", "Int32")
"""Types of variables that a drive or a position may have."""
_STATE: Final = ("canGetAndSetFMUstate", "canSerializeFMUstate")
"""What a unit must be able to do before a snapshot can hold it (FMI 2.0, 4.3.1)."""
_INPUTS: Final = {"drive": (1,), "pulses": (1,), "phases": (2, 3)}
"""How many inputs each kind of drive has."""


class FmuPlant(EncodedPlant):
    """A unit whose inputs take what a chip drives, and whose one output is the place of the shaft.

    The unit is stepped by one length from its beginning to its end: ``step``, or the first period
    of its chip. In a period of the chip as many steps are made as end in it; the drive holds for
    them, and between them the shaft goes straight. A unit whose step fails stands from then on.
    """

    TAKES: ClassVar[tuple[str, ...]] = tuple(_INPUTS)
    OPTIONS: ClassVar[tuple[Option, ...]] = (
        *ENCODER_OPTIONS,
        Option("file", "text", "", 'the unit; model = "fmu:FILE.fmu" says the same'),
        Option("takes", "choice", "drive", "what drives it: a servo command, the place to which"
               " step pulses have led, or phase commands", choices=tuple(_INPUTS)),
        Option("drive", "text", "drive", 'its input for that; of phases two or three, as "ia, ib"'),
        Option("full_drive", "ratio", 1.0, "what that input is given at full command, or for each"
               " step pulse"),
        Option("position", "text", "position", "its output that is the place of the shaft"),
        Option("counts_per_unit", "ratio", 1.0, "counts for each unit of that output"),
        Option("start", "text", "", 'values of other variables, such as "mass=2.5, load=0.1"'),
        Option("step", "s", 0, "its communication step; 0 s: the first period of the chip", low=0),
    )  # fmt: skip
    VALUES: ClassVar[ValueTable] = ValueTable(
        Value("position of the unit", "_place", key="unit", lane="unit", step=1e-6)
    )
    STATE: ClassVar[Names] = (
        "_steps", "_now", "_step", "_pulsed", "_place: float", "_failed: bool", "_unit: bytes[...]",
        *EncodedPlant.STATE,
    )  # fmt: skip
    WIRING: ClassVar[Names] = ("TAKES", "_name", "_fmu", "_in", "_out", "_loads", "_origin")
    DERIVED: ClassVar[Names] = ("_period",)

    def __init__(self, settings: Settings | None = None) -> None:
        super().__init__(settings)
        # A class takes all three; a unit what its input is for, so that a chip refuses another.
        vars(self)["TAKES"] = (str(self.settings["takes"]),)
        self._name: str = str(self.settings["file"])
        if not self._name:
            raise ValueError('a unit is missing: write model = "fmu:FILE.fmu"')
        self._period: int = 0
        self._step: int = int(self.settings["step"])
        self._steps: int = 0
        """Steps since power-on."""
        self._now: int = 0
        """Chip time since power-on (ps)."""
        self._pulsed: int = 0
        """Step pulses since power-on."""
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

    # -- the unit -----------------------------------------------------------------------------

    def _open(self) -> None:
        """Unpack the unit, load its library and initialise it."""
        with import_errors(f"{self._name}: units of FMI need FMPy", "'vbus[fmi]'"):
            import fmpy
        about = fmpy.read_model_description(self._name)
        if about.coSimulation is None or not about.fmiVersion.startswith(("2.", "3.")):
            raise ValueError(
                f"{self._name}: a unit of FMI {about.fmiVersion} without co-simulation; export it"
                " as a co-simulation unit of FMI 2.0 or 3.0"
            )
        variables = {one.name: one for one in about.modelVariables}
        (takes,) = self.TAKES
        names = [name.strip() for name in str(self.settings["drive"]).split(",")]
        if len(names) not in _INPUTS[takes]:
            many = " or ".join(map(str, _INPUTS[takes]))
            raise ValueError(
                f'drive = "{", ".join(names)}": {DRIVES[takes]} go to {many} inputs of a unit;'
                " write their names with commas between them"
            )
        self._in: list[Any] = [self._variable(variables, "drive", "input", one) for one in names]
        out = str(self.settings["position"])
        self._out: Any = self._variable(variables, "position", "output", out)
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

    def _variable(self, variables: dict[str, Any], key: str, causality: str, name: str) -> Any:
        """Return the variable that a setting names."""
        one = variables.get(name)
        if one is None or one.causality != causality or one.type not in _NUMBERS:
            there = _names(v for v in variables.values() if v.causality == causality)
            raise ValueError(
                f'{key}: {self._name} has no {causality} "{name}" that is a number;'
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
            # The shaft begins in the middle of count 0, as that of any plant.
            counts = (place - self._origin) * float(self.settings["counts_per_unit"]) + 0.5
            if not abs(counts - float(self.base)) <= MOST_TURNED:
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
        self.points[1] = counts - float(self.base)
        self._steps += 1

    # -- periods ------------------------------------------------------------------------------

    def prepare(self, period: float) -> None:
        """Set the length of a period in seconds."""
        self.forget_course()
        self._period = round(period * SECOND)
        self._step = self._step or self._period

    def drive(self, command: float, error: i64) -> i64:
        """Run the steps that end in this period with ``command`` of full scale."""
        return self._run("drive", lambda _: (command,))

    def pulses(self, steps: i64) -> i64:
        """Run them with the place that the pulses so far have led to at the end of each."""
        many, way, before = abs(int(steps)), 1 if steps >= 0 else -1, self._pulsed
        self._pulsed += int(steps)
        # Pulse j of n comes at j/n of the period, as a stepper motor has it.
        return self._run("pulses", lambda past: (before + way * (many * past // self._period),))

    def phases(self, a: float, b: float, c: float) -> i64:
        """Run them with phase commands; without a third input ``c`` is not connected."""
        return self._run("phases", lambda _: (a, b, c))

    def _run(self, kind: str, given: Callable[[int], tuple[float, ...]]) -> i64:
        """Run the steps that end in this period; ``given`` is what drives each, by its end."""
        if kind not in self.TAKES:
            raise TypeError(f"{self._name} takes {self.TAKES}, not {kind}")
        self.begin(1)
        self.points[1] = self.first
        begun = self._now
        self._now += self._period
        while not self._failed and (end := (self._steps + 1) * self._step) <= self._now:
            for one, value in zip(self._in, given(end - begun), strict=False):
                self._set(one, value * float(self.settings["full_drive"]))
            self._make_step()
        return self.end()

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
        super().before_save()
        if self._loads:
            state = self._fmu.getFMUState()
            self._unit = self._fmu.serializeFMUState(state)
            self._fmu.freeFMUState(state)

    def after_load(self) -> None:
        """Give the unit its state back."""
        super().after_load()
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
