"""Faults on schedule: what breaks, when, for how long, and the evidence of it."""
