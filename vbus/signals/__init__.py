"""Wires, pins, the seam to the mechanics, and those who look on."""

from vbus.signals.axis import Plant, Switch
from vbus.signals.lane import nearest
from vbus.signals.net import HIGH, LOW, Guard, Net, Pin, Watcher, Z
from vbus.signals.observer import EdgeTaker, Observer
from vbus.signals.tables import Rule, Violation
from vbus.signals.trace_hash import TraceHash
from vbus.signals.values import Reading, Value, ValueTable
from vbus.signals.violation import OFF, STRICT, WARN, Policy

__all__ = [
    "HIGH",
    "LOW",
    "OFF",
    "STRICT",
    "WARN",
    "EdgeTaker",
    "Guard",
    "Net",
    "Observer",
    "Pin",
    "Plant",
    "Policy",
    "Reading",
    "Rule",
    "Switch",
    "TraceHash",
    "Value",
    "ValueTable",
    "Violation",
    "Watcher",
    "Z",
    "nearest",
]
