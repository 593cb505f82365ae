"""Virtual time: an integer number of picoseconds, and what is due when."""

from vbus.core.instants import END, FAR, MS, NEVER, NS, SECOND, US
from vbus.core.kernel.clock import HELD, Clock
from vbus.core.kernel.kernel import Kernel, Timer

__all__ = ["END", "FAR", "HELD", "MS", "NEVER", "NS", "SECOND", "US", "Clock", "Kernel", "Timer"]
