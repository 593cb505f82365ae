"""AVR firmware on the specimens that the manual allows."""

import shutil

import pytest

from tests.avr.conftest import EXAMPLES, Compile, compile_avr, early_bus
from tests.avr.test_wiring import BEHIND

pytest_plugins = "pytester"

HASTY = """int main(void)
{
    lm629_bus_init();
    _delay_ms(3);
    return lm629_bus_read_status() != 0x84;
}"""
SUITE = """
import pytest

@pytest.mark.vbus(board="board.toml")
@pytest.mark.vbus_matrix(hostile=10)
def test_firmware(vbus_exec):
    assert vbus_exec("main.elf", avr="mmcu=atmega328p,f=16000000").code == 0
"""


def test_firmware_that_knows_one_status_after_a_reset_is_found_out(
    pytester: pytest.Pytester, firmware: Compile
) -> None:
    elf = firmware(HASTY)
    shutil.copy(elf, pytester.path / "main.elf")
    shutil.copy(EXAMPLES / "lm629_avr_bitbang" / "board.toml", pytester.path)
    pytester.makepyfile(SUITE)
    result = pytester.runpytest_subprocess("-q")
    result.assert_outcomes(failed=1)
    result.stdout.fnmatch_lines(['under:   x.reset_status = "C4"'])


@pytest.mark.parametrize("behind", [False, True], ids=["wired", "behind glue"])
def test_a_byte_that_is_taken_before_its_strobe_is_in_the_report_of_a_failing_test(
    pytester: pytest.Pytester, firmware: Compile, behind: bool
) -> None:
    folder = EXAMPLES / "lm629_avr_bitbang"
    board = BEHIND if behind else (folder / "board.toml").read_text()
    (pytester.path / "board.toml").write_text(board)
    source = early_bus(pytester.path / "lm629_bus.c")
    main = pytester.path / "main.c"
    main.write_text(f'#include "firmware.h"\n{HASTY}\n')
    driver = EXAMPLES / "lm629_c" / "lm629_driver.c"
    compile_avr(pytester.path / "main.elf", main, source, driver)
    pytester.makepyfile(SUITE.replace("@pytest.mark.vbus_matrix(hostile=10)\n", ""))
    result = pytester.runpytest_subprocess("-q")
    result.assert_outcomes(failed=1)
    result.stdout.fnmatch_lines(["missed: x: the host took ??h where the chip gave 84h at *"])


def test_firmware_that_spins_is_ended_by_the_budget_of_its_test(
    pytester: pytest.Pytester, firmware: Compile
) -> None:
    elf = firmware(
        """#include <avr/interrupt.h>
        int main(void)
        {
            lm629_bus_init();
            sei();
            for (;;)
                ;
        }"""
    )
    shutil.copy(elf, pytester.path / "main.elf")
    shutil.copy(EXAMPLES / "lm629_avr_bitbang" / "board.toml", pytester.path)
    pytester.makepyfile(
        """
        import pytest

        @pytest.mark.vbus(board="board.toml", budget={"chip_time": "200 ms"})
        def test_firmware(vbus_exec):
            vbus_exec("main.elf", avr="mmcu=atmega328p,f=16000000")
        """
    )
    result = pytester.runpytest_subprocess("-q")
    result.assert_outcomes(failed=1)
    result.stdout.fnmatch_lines(["*HostStuck: *it was not done after 0.2 s of chip time"])
