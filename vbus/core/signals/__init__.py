"""Wires, pins, the seam to the mechanics, and those who look on."""

from vbus.core.signals.axis import Plant, Switch
from vbus.core.signals.net import HIGH, LOW, Guard, Net, Pin, Watcher, Z
from vbus.core.signals.observer import EdgeTaker, Observer
from vbus.core.signals.trace_hash import TraceHash
from vbus.core.signals.values import Reading, Value, ValueTable
from vbus.core.signals.violation import OFF, STRICT, WARN, Policy, Rule, Violation

__all__ = [
    "HIGH", "LOW", "OFF", "STRICT", "WARN", "EdgeTaker", "Guard", "Net", "Observer", "Pin", "Plant",
    "Policy", "Reading", "Rule", "Switch", "TraceHash", "Value", "ValueTable", "Violation",
    "Watcher", "Z",
]  # fmt: skip
