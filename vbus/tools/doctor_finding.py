"""One thing ``vbus doctor`` has looked at."""

from dataclasses import dataclass
from typing import Final

OK: Final = "ok"
WARN: Final = "warn"
FAIL: Final = "fail"


@dataclass(frozen=True, slots=True)
class Diagnosis:
    """One thing looked at.

    Attributes:
        state: ``"ok"``, ``"warn"`` (something cannot be used) or ``"fail"`` (nothing will work).
        what: the thing.
        detail: what was found.
        advice: what to do; empty if it is in order.
    """

    state: str
    what: str
    detail: str
    advice: str = ""

    def __str__(self) -> str:
        text = f"{self.state:<5} {self.what}: {self.detail}"
        return f"{text}\n      {self.advice}" if self.advice else text
