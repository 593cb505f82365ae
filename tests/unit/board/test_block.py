"""A board as a block of another simulator: its variables, its steps, and the hash of its run."""

import pytest

from tests.boards import AXIS
from vbus.board.block import READ, WRITE, BlockVariable, BoardBlock
from vbus.board.build import load_board_text
from vbus.core.kernel import US

LFIL = [(0, 0x1E), *((1, byte) for byte in (0x00, 0x0A, 0x01, 0x2C, 0x07, 0xD0)), (0, 0x04)]
MOVE = [
    (0, 0x1F), *((1, byte) for byte in (0, 0x2A, 0, 0, 1, 0x90, 0, 4, 0, 0, 0, 0, 1, 0xF4)),
    (0, 0x01),
]  # fmt: skip
STEP = 100 * US


def made(model: str = "dc_motor") -> tuple[BoardBlock, dict[str, BlockVariable]]:
    block = BoardBlock(AXIS.format(time="slaved", model=model), "board.toml", US)
    return block, {one.name: one for one in block.variables}


def put(variables: dict[str, BlockVariable], **values: int) -> None:
    for name, value in values.items():
        setter = variables[f"x.{name}"].put
        assert setter is not None
        setter(value)


def test_a_run_of_a_block_is_the_native_run() -> None:
    block, variables = made()
    native = load_board_text(AXIS.format(time="slaved", model="dc_motor"))
    native.start_trace()
    port = native.open_port("h")
    now = 0
    for address, byte in [*LFIL, *MOVE]:
        put(variables, strobe=WRITE, address=address, data=byte)
        block.step(now / 1e12, STEP / 1e12)
        now += STEP
        port.at(now)
        port.write(address, byte)
    put(variables, strobe=READ, address=0)
    for _ in range(300):
        block.step(now / 1e12, 10 * STEP / 1e12)
        now += 10 * STEP
        port.at(now)
        assert variables["x.answer"].get() == port.read(0)
    native.run_until(now)
    assert variables["trace_hash"].get() == native.trace_hash()
    assert variables["x.1.counts"].get() == native.axes["x.1"].count
    assert 490 < native.axes["x.1"].count < 510


def test_pins_are_driven_until_they_are_let_go() -> None:
    block, variables = made()
    assert variables["x.HI"].put is None
    put(variables, **{"/RST": 0})
    block.step(0.0, 1e-3)
    put(variables, **{"/RST": 2, "strobe": READ})
    for begin, status in ((1e-3, 0), (1.5e-3, 0x84)):  # the reset takes 1 ms from its edge
        block.step(begin, 0.5e-3)
        assert variables["x.answer"].get() == status


def test_a_motor_may_be_in_the_simulator_around_the_board() -> None:
    block, variables = made("outside")
    now = 0
    for address, byte in [*LFIL, *MOVE]:
        put(variables, strobe=WRITE, address=address, data=byte)
        block.step(now / 1e12, STEP / 1e12)
        now += STEP
    put(variables, strobe=0)
    count = 0.0
    for _ in range(600):
        block.step(now / 1e12, 5 * STEP / 1e12)
        now += 5 * STEP
        count += 20 * float(variables["x.1.drive"].get())
        put(variables, **{"1.counts": round(count)})
    assert 480 < count < 520


@pytest.mark.parametrize(
    ("begin", "span", "says"),
    [
        (0.0, 1e-3, "the step begins at 0 s, and the board is at 0.001 s: .* neither back"),
        (2e-3, 1e-3, "over time"),
        (1e-3, 1.5e-6, "1.5e-06 s is no multiple of 1e-06 s"),
        (1e-3, 0.0, "no multiple"),
    ],
)
def test_a_step_that_would_not_be_exact_is_refused(begin: float, span: float, says: str) -> None:
    block, variables = made()
    block.step(0.0, 1e-3)
    before = variables["trace_hash"].get()
    with pytest.raises(ValueError, match=says):
        block.step(begin, span)
    assert variables["trace_hash"].get() == before
    block.step(1e-3, 1e-3)


@pytest.mark.parametrize(
    ("given", "says"),
    [
        ({"strobe": 3}, "x.strobe = 3: it is from 0 to 2"),
        ({"strobe": 1, "address": -1}, "the inputs at 0 s: x.address = -1: it is from 0 to"),
        ({"strobe": 2, "data": 300}, "the inputs at 0 s: x.data = 300"),
        ({"/RST": 7}, "the inputs at 0 s: x./RST = 7"),
    ],
)
def test_an_input_that_is_none_is_refused(given: dict[str, int], says: str) -> None:
    block, variables = made()
    put(variables, **given)
    with pytest.raises(ValueError, match=says):
        block.step(0.0, 1e-3)
