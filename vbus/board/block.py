"""A board as a block in another simulator: variables in, variables out, and steps of time."""

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import Final

from msgspec.structs import replace

from vbus.board.build import build
from vbus.board.config import read_board_text
from vbus.chips.base import Chip
from vbus.core.kernel import SECOND
from vbus.core.signals import Plant
from vbus.glue.part import GluePart
from vbus.plant.outside import OutsidePlant
from vbus.protocols.port import PortError

IDLE, READ, WRITE = range(3)
"""Values of a strobe: no bus cycle in this step, or one."""
LET_GO: Final = 2
"""Value of a pin that the block's inputs do not drive."""

Number = int | float | str


@dataclass(frozen=True, slots=True)
class BlockVariable:
    """A variable of a block.

    Attributes:
        name: such as ``"x.data"`` or ``"x.HI"``.
        title: what it is.
        get: returns its value, of its type in every step.
        put: takes another one for the next step; None: it is an output.
    """

    name: str
    title: str
    get: Callable[[], Number]
    put: Callable[[int], None] | None = None


class BoardBlock:
    """A board in slaved time, whose host is the simulator around it.

    A step from t to t + h takes the inputs as they are: pins and counts count from t, and each chip
    whose strobe is set gets one bus cycle, latched at t + h. Outputs are those of t + h.

    Args:
        text: of the board file.
        file: its name, for messages.
        base: steps are multiples of this (ps).

    Raises:
        ConfigError: the board file has mistakes or nodes.
    """

    def __init__(self, text: str, file: str, base: int) -> None:
        read, source = read_board_text(text, file)
        self._board = build(replace(read, board=replace(read.board, time="slaved")), source)
        self._base: int = base
        self._board.start_trace()
        self._port = self._board.open_port("block")
        self._given: dict[str, int] = {}
        """Inputs, by their names."""
        self._most: dict[str, int] = {}
        """What they are at most; a count has no bound."""
        self._answers: dict[str, int] = {}
        self._driven: dict[str, int] = {}
        """Levels of pins that have been driven."""
        self.variables: list[BlockVariable] = []
        for chip in self._board.chips:
            for what, most, title in (
                ("strobe", WRITE, "a bus cycle at the end of the step: 0 none, 1 read, 2 write"),
                ("address", 0xFFFF, "its address"),
                ("data", 0xFF, "the byte it writes"),
            ):
                self._input(f"{chip.name}.{what}", title, 0, most)
            self._output(f"{chip.name}.answer", "the byte read last", self._answer_of(chip.name))
        self._add_pins()
        for axis, plant in self._board.axes.items():
            self._add_axis(axis, plant)
        self._output("trace_hash", "SHA-256 of all that has happened", self._board.trace_hash)

    @property
    def name(self) -> str:
        """Name of the board."""
        return self._board.name

    @property
    def seconds(self) -> float:
        """Where the board is in time (s)."""
        return self._board.now / SECOND

    # -- variables ----------------------------------------------------------------------------

    def _input(self, name: str, title: str, value: int, most: int = -1) -> None:
        given = self._given
        given[name] = value
        if most >= 0:
            self._most[name] = most
        self.variables.append(BlockVariable(
            name, title, lambda: given[name], lambda value: given.update({name: int(value)})
        ))  # fmt: skip

    def _output(self, name: str, title: str, get: Callable[[], Number]) -> None:
        self.variables.append(BlockVariable(name, title, get))

    def _answer_of(self, chip: str) -> Callable[[], int]:
        self._answers[chip] = 0
        return lambda: self._answers[chip]

    def _add_pins(self) -> None:
        board, pins = self._board, self._port.pins
        parts: list[Chip | GluePart] = [*board.chips, *board.glue.parts]
        rows = {f"{part.name}.{row.name}": row for part in parts for row in part.pin_rows}
        outputs = pins.output_names()
        for number, name in enumerate(pins.side_names()):
            if name in outputs:
                self._output(name, rows[name].title, partial(self._port.getpin, number))
            elif rows[name].direction == "in":
                self._input(name, f"{rows[name].title}; 2: not driven", LET_GO, LET_GO)

    def _add_axis(self, axis: str, plant: Plant) -> None:
        if isinstance(plant, OutsidePlant):
            self._input(f"{axis}.counts", "where the encoder is (counts)", 0)
            self._output(f"{axis}.drive", "drive, of full scale", lambda: plant.command)
            return
        self._output(f"{axis}.counts", "where the encoder is (counts)", lambda: int(plant.count))
        name, _, number = axis.rpartition(".")
        chip = self._board.chip(name)
        row = chip.VALUES.lane("output")
        if row is not None:
            key = row.key.format(number)
            self._output(
                f"{axis}.drive", "drive, of full scale", lambda: float(chip.telemetry()[key])
            )

    # -- time ---------------------------------------------------------------------------------

    def step(self, begin: float, span: float) -> None:
        """Let time pass.

        Args:
            begin: where the simulator says the step begins (s).
            span: how long it is (s).

        Raises:
            ValueError: the step goes back, leaves time out or is no multiple of the base; or an
                input is none that a chip can take. No time has passed.
        """
        board, base = self._board, self._base
        if abs(begin * SECOND - board.now) > base / 2:
            raise ValueError(
                f"the step begins at {begin:.12g} s, and the board is at {self.seconds:.12g}"
                " s: a board goes neither back nor over time; begin each step where the last ended"
            )
        times = span * SECOND / base
        if round(times) < 1 or abs(times - round(times)) > 1e-6:
            raise ValueError(
                f"a step of {span:.12g} s is no multiple of {base / SECOND:.12g} s, so instants"
                " would not be exact; choose one that is, or another base with: vbus fmu --step"
            )
        end = board.now + round(times) * base
        try:
            self._use_inputs(end)
        except PortError as error:
            raise ValueError(f"the inputs at {begin:.12g} s: {error}") from error
        board.run_until(end)
        board.catch_up()

    def _use_inputs(self, end: int) -> None:
        port, board, given = self._port, self._board, self._given
        for name, most in self._most.items():
            if not 0 <= given[name] <= most:
                raise PortError(0, f"{name} = {given[name]}: it is from 0 to {most}")
        for number, name in enumerate(port.pins.side_names()):
            level = given.get(name, LET_GO)
            if level != self._driven.get(name, LET_GO):
                port.pin(number, level)
                self._driven[name] = level
        for axis, plant in board.axes.items():
            if isinstance(plant, OutsidePlant):
                plant.given = given[f"{axis}.counts"]
        for number, chip in enumerate(board.chips):
            strobe = given[f"{chip.name}.strobe"]
            if strobe == IDLE:
                continue
            port.select(1 << number)
            port.at(end)
            address = given[f"{chip.name}.address"]
            if strobe == WRITE:
                port.write(address, given[f"{chip.name}.data"])
            else:
                self._answers[chip.name] = port.read(address)
