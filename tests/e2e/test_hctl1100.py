"""A driver written for the HCTL-1100 on an MCP-1200: what of it runs, and what a report names."""

import json
import re
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from tests.e2e.command import running, vbus
from vbus import connect
from vbus.chips.mcp1200.compatible import Hctl1100Uses
from vbus.client.bus import Bus

Driven = Callable[..., tuple[int, list[dict[str, str]]]]
ROOT = Path(__file__).parents[2]
BOARD = """
[board]
time = "lockstep"
[chips.x]
part = "MCP-1200"
clock = "8 MHz"
plant = "motor"
[plants.motor]
model = "ideal"
[[hosts]]
transport = "unix:$VBUS_RUNTIME/x"
cycle = "4 us"
[record]
journal = "{folder}/run.vbj"
"""


class Hctl1100:
    """A driver as its data sheet has it: 64 registers, samples of 16 clocks, R12 before R14.

    Args:
        bus: the bus.
        careful: whether it has learnt what is different on an MCP-1200.
    """

    def __init__(self, bus: Bus, careful: bool) -> None:
        self.bus = bus
        self.careful = careful

    def start(self) -> None:
        self.bus.write(0x05, 0x00)  # reset
        self.bus.delay("1 ms")
        self.bus.write(0x05, 0x01)  # initialization/idle
        if self.careful:
            self.bus.write(0x10, 0x00)
            self.bus.write(0x11, 0x3F)  # at four times the clock the sample time is that of before
        else:
            self.commutator()
        self.bus.write(0x0F, 0x40)  # a sample of 16 (40h + 1) clocks
        for address, value in ((0x20, 0xE5), (0x21, 0x40), (0x22, 0x08)):
            self.bus.write(address, value)
        self.bus.write(0x13, 0x00)  # clear the position
        for address in (0x0C, 0x0D, 0x0E):
            self.bus.write(address, 0x00)
        self.bus.write(0x05, 0x03)  # control

    def commutator(self) -> None:
        for address, value in ((0x18, 0x20), (0x1A, 0x08), (0x1B, 0x00), (0x1C, 0x00)):
            self.bus.write(address, value)
        self.bus.write(0x05, 0x02)  # align

    def move(self, target: int) -> None:
        self.bus.write(0x26, 0x20)
        self.bus.write(0x27, 0x00)
        self.bus.write(0x28, 0x08)
        for address, shift in ((0x29, 0), (0x2A, 8), (0x2B, 16)):
            self.bus.write(address, target >> shift & 0xFF)
        self.bus.write(0x00, 0x08)  # F0: trapezoidal profile
        for _ in range(500):
            self.bus.delay("5 ms")
            if not self.bus.read(0x00) & 0x01:
                return
        raise AssertionError("the profile does not end")

    def position(self) -> int:
        order = (0x14, 0x13, 0x12) if self.careful else (0x12, 0x13, 0x14)
        read = {address: self.bus.read(address) for address in order}
        return read[0x12] << 16 | read[0x13] << 8 | read[0x14]


@pytest.fixture
def driven(tmp_path: Path, runtime: Path) -> Driven:
    """Runs the driver on a board; gives where it ended and what the report notes."""
    (tmp_path / "bench.toml").write_text(BOARD.format(folder=tmp_path))

    def drive(careful: bool) -> tuple[int, list[dict[str, str]]]:
        with running(tmp_path / "bench.toml"), connect(f"unix:{runtime}/x") as bus:
            driver = Hctl1100(bus, careful)
            driver.start()
            driver.move(2000)
            bus.delay("100 ms")
            end = driver.position()
            if not careful:
                bus.write(0x24, 0x01)  # proportional velocity
                bus.write(0x23, 0x00)
                bus.write(0x00, 0x0B)
        done = vbus(
            "report", tmp_path / "run.vbj", "--compatibility", "hctl-1100", "--format", "json"
        )
        assert done.returncode == 0, done.stderr
        return end, json.loads(done.stdout)["violations"]

    return drive


def test_a_driver_is_told_each_use_that_is_another_here(driven: Driven) -> None:
    end, notes = driven(careful=False)

    assert end & 0xFF == pytest.approx(2000 & 0xFF, abs=2), "only the low byte is of now"
    names = [note["rule"].removeprefix("mcp1200.hctl-1100.") for note in notes
             if "hctl-1100" in note["rule"]]  # fmt: skip
    assert names == [
        *["commutator"] * 4, "align", "prescaler", *["position-order"] * 2,
        *["velocity-order"] * 2, "proportional",
    ]  # fmt: skip
    (timer,) = [note for note in notes if note["rule"].endswith("prescaler")]
    assert "a sample of 4160 clocks, not of 1040" in timer["detail"]


def test_a_driver_that_minds_them_runs_without_a_note(driven: Driven) -> None:
    end, notes = driven(careful=True)

    assert end == pytest.approx(2000, abs=2)
    assert [note for note in notes if "hctl-1100" in note["rule"]] == []


@pytest.mark.parametrize(
    ("cycles", "found"),
    [
        ([(True, 0x00, 0x0A)], ["unipolar"]),
        ([(True, 0x00, 0x0C)], ["hold-commutator"]),
        ([(True, 0x00, 0x03), (True, 0x00, 0x02)], []),
        ([(True, 0x40, 0x0B)], ["proportional"]),
        ([(True, 0x10, 0), (True, 0x0F, 0x40)], []),
        ([(False, 0x14, 0), (False, 0x12, 0), (False, 0x13, 0)], []),
        ([(False, 0x14, 0), (False, 0x12, 0), (False, 0x12, 0)], ["position-order"]),
        ([(True, 0x12, 0), (False, 0x18, 0), (True, 0x05, 0x03)], []),
    ],
)
def test_what_is_another_use_and_what_is_not(
    cycles: list[tuple[bool, int, int]], found: list[str]
) -> None:
    uses = Hctl1100Uses()

    told = [rule.name.rpartition(".")[2] for cycle in cycles for rule, _ in uses.cycle(*cycle)]

    assert told == found


def test_a_part_that_no_chip_stands_in_for_is_refused(driven: Driven, tmp_path: Path) -> None:
    driven(careful=True)

    done = vbus("report", tmp_path / "run.vbj", "--compatibility", "hctl-2000")

    assert done.returncode == 2
    said = 'no chip of this run stands in for the part "hctl-2000"; they stand in for hctl-1100'
    assert done.stderr == f"vbus: {said}\n"


def rules_of_page() -> Iterator[str]:
    page = (ROOT / "docs" / "hctl-1100.md").read_text()
    yield from re.findall(r"^\| `([\w-]+)` \|", page, re.MULTILINE)


def test_the_page_has_every_difference() -> None:
    assert list(rules_of_page()) == [rule.name.rpartition(".")[2] for rule in Hctl1100Uses.RULES]
