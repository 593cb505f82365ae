"""labgrid at the machine's console.

pip install labgrid
pytest recipes/labgrid
"""

import pytest
from labgrid import Target
from labgrid.driver import SerialDriver
from labgrid.resource import RawSerialPort

pytestmark = pytest.mark.vbus(board="../console.toml")


@pytest.fixture
def console(vbus_pty):
    """Make a target of labgrid whose serial port is the terminal on which the board is served."""
    target = Target("machine")
    RawSerialPort(target, name=None, port=vbus_pty)
    driver = SerialDriver(target, name=None)
    target.activate(driver)
    yield driver
    target.cleanup()


def test_the_chip_comes_out_of_its_reset(console):
    console.sendline("wait 2ms")
    console.expect("ready")
    console.sendline("r 0")
    console.expect("84")
