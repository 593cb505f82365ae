"""PMD MC1241A and MC1141A: microstepping motion processors."""

from vbus.chips.mc1241a.chip import MC1241A

__all__ = ["MC1241A"]
