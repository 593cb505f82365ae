"""The DC-8's tables: pins, registers, rules."""

from vbus.chips.bus_watch import strobed_bus
from vbus.chips.tables import PinRow, Register, RegisterMap
from vbus.core.signals import HIGH, LOW, Rule, ValueTable

COUNT_CLK = 16
"""Cycles of CLK for one count (DC-CNT-1)."""

PINS = (
    PinRow("/CS", "in", strobe=True, select=True, title="select"),
    PinRow("A0", "in", rest=LOW, strobe=True, title="which register"),
    PinRow("/RD", "in", strobe=True, title="read strobe"),
    PinRow("/WR", "in", strobe=True, title="write strobe"),
    PinRow("D0-D7", "io", width=8, title="data"),
    PinRow("DONE", "out", rest=HIGH, title="the count is 0"),
)
BUS = strobed_bus(
    ("/CS", "A0", "/RD", "/WR"), setup=20_000, read_low=100_000, write_low=100_000, hold=20_000,
    data_setup=80_000, data_hold=20_000, cycle_ps=200_000,
)  # fmt: skip
REGISTERS = RegisterMap(
    2,
    Register("LOAD", (0,), clause="DC-REG-1", title="what is counted down from"),
    Register("COUNT", (1,), access="r", clause="DC-REG-2", title="what is left"),
)
VALUES = ValueTable(registers=REGISTERS)
RUNNING = Rule("dc8.running", "DC-REG-1", "LOAD is written only while the count is 0.")
RULES = (RUNNING,)
