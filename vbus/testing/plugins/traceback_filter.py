"""A failure as the lines of the test alone, where vbus has put a mistake in a sentence."""

from pathlib import Path
from traceback import walk_tb
from types import TracebackType
from typing import Final

import pytest

from vbus.core.errors import VbusError
from vbus.testing.limits import HostStuck

PACKAGE: Final = Path(__file__).parents[2]


def cut_short(found: pytest.ExceptionInfo[BaseException]) -> pytest.ExceptionInfo[BaseException]:
    """Leave only the test's own lines of a mistake that vbus has put in a sentence."""
    own = None
    for frame, line in reversed(list(walk_tb(found.tb))):
        if not Path(frame.f_code.co_filename).is_relative_to(PACKAGE):
            own = TracebackType(own, frame, frame.f_lasti, line)
    if own is None or not isinstance(found.value, VbusError | ValueError | HostStuck):
        return found
    return pytest.ExceptionInfo.from_exception(found.value.with_traceback(own))
