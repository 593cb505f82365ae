"""A host on the network."""

import pytest

from vbus.transports.zenoh_host import ZenohLink


def test_a_host_that_has_gone_does_not_go_again() -> None:
    """Timers that look for its liveliness token come due later."""
    link = ZenohLink.__new__(ZenohLink)
    link._open, link.reason = False, "closed by the host"
    link.on_end = lambda carry_out: pytest.fail("it has ended already")
    link.host_ended("its token was not seen")
    assert link.reason == "closed by the host"
