"""pytest-embedded at the machine's console.

pip install pytest-embedded-serial
pytest --embedded-services serial recipes/pytest_embedded
"""

import pytest

pytestmark = pytest.mark.vbus(board="../console.toml")


@pytest.fixture
def port(vbus_pty):
    """Give the serial service of pytest-embedded the terminal on which the board is served."""
    return vbus_pty


def test_the_chip_comes_out_of_its_reset(dut):
    dut.write("wait 2ms\r")
    dut.expect_exact("ready")
    dut.write("r 0\r")
    dut.expect_exact("84")
