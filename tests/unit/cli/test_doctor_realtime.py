"""What the system says of its clock, in words."""

import ctypes
from typing import Any

import pytest

from vbus.cli.run import doctor_realtime
from vbus.transports import linux


class System:
    """Stands in for the C library: says what adjtimex would."""

    def __init__(self, status: int, error: int, slew: int, result: int) -> None:
        self.told = status, error, slew, result

    def adjtimex(self, place: Any) -> int:
        timex = ctypes.cast(place, ctypes.POINTER(linux._Timex)).contents
        assert timex.modes == 0, "it is asked, not set"
        timex.status, timex.maxerror, timex.freq, result = self.told
        ctypes.set_errno(1)
        return result


@pytest.mark.parametrize(
    ("told", "state", "detail"),
    [
        ((0x2001, 120, -3 << 15, 0), "ok", "within 120 us of true time, slewed by -1.5 ppm"),
        (
            (0x40, 16_000_000, 0, 5), "ok",
            "nothing disciplines it; nodes on several computers follow each other's clocks better"
            " with chrony or ptp4l",
        ),
        ((0, 0, 0, -1), "warn", "the system does not tell: Operation not permitted"),
    ],
)  # fmt: skip
def test_a_clock_that_is_disciplined_is_told_from_one_that_is_not(
    monkeypatch: pytest.MonkeyPatch, told: tuple[int, int, int, int], state: str, detail: str
) -> None:
    monkeypatch.setattr(linux, "_libc", System(*told))
    found = doctor_realtime._clock()
    assert (found.state, found.what, found.detail) == (state, "clock", detail)


def test_the_kernel_itself_takes_the_question() -> None:
    kept = linux.clock_discipline()
    assert kept is None or kept[0] >= 0
