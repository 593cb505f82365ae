"""LM628 and LM629 precision motion controllers."""

from vbus.chips.lm628.chip import LM628

__all__ = ["LM628"]
