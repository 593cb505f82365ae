"""Host programs on a test's board: vbus_exec, seen from the suites that use it."""

import pytest

from tests.left_out import require

pytest_plugins = "pytester"

HOST = """
#include "vbus.h"
#include <stdio.h>
#include <stdlib.h>
#ifndef EXTRA
#define EXTRA 0
#endif
int main(int argc, char **argv)
{
    struct vbus bus;
    int status;
    if (vbus_open(&bus, getenv("VBUS_LINK")) < 0)
        return 3;
    status = vbus_read(&bus, 0);
    printf("status %02X %d\\n", status, argc);
    vbus_close(&bus);
    return status == 0x84 ? EXTRA : 2;
}
"""


@pytest.fixture
def suite(pytester: pytest.Pytester) -> pytest.Pytester:
    pytester.makeini(
        "[pytest]\nfilterwarnings = error\nasyncio_default_fixture_loop_scope = function\n"
    )
    return pytester


def test_a_c_program_is_compiled_and_runs_on_the_board_of_the_test(suite: pytest.Pytester) -> None:
    require("cc")
    suite.path.joinpath("host.c").write_text(HOST)
    suite.path.joinpath("wrong.c").write_text("int main(void) { return nothing; }\n")
    suite.makepyfile(
        """
        import pytest
        from vbus import VbusError

        def test_it(vbus_exec, vbus_clock, vbus_lm629, vbus_board):
            vbus_clock.advance("5ms")
            done = vbus_exec("host.c", "-v")
            assert (done.code, done.output) == (0, "status 84 2\\n"), done
            assert done.transcript == ["x RDSTAT 84H MOTOR_OFF TRAJECTORY_COMPLETE"]
            assert done.cycles == 1
            assert vbus_clock.now == 6_001_000_000
            assert vbus_lm629.bus.read(0) == 0x84
            again = vbus_exec("host.c", flags="-DEXTRA=7")
            assert (again.code, again.ok) == (7, False)

        def test_compiler(vbus_exec):
            with pytest.raises(VbusError, match="(?s)wrong.c: the compiler refuses it.*nothing"):
                vbus_exec("wrong.c")
            with pytest.raises(VbusError, match="there is no shim 'arm'"):
                vbus_exec("host.c", shim="arm")

        def test_failing(vbus_exec):
            assert vbus_exec("host.c").code == 0
        """
    )
    result = suite.runpytest("-q", "-x")
    result.assert_outcomes(passed=2, failed=1)
    result.stdout.fnmatch_lines(["*x RDSTAT 00H*", "replay:  vbus replay *"])


def test_a_program_gets_its_name_when_it_is_whole(
    suite: pytest.Pytester, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Workers of one run share a folder; none starts what another is still writing."""
    compiler = suite.path / "compiler"
    compiler.write_text('#!/bin/sh\n[ "$1" = -E ] || { : > "$2"; ls "${2%/*}" > listing; }\n')
    compiler.chmod(0o755)
    monkeypatch.setenv("CC", str(compiler))
    suite.path.joinpath("host.c").write_text("")
    suite.makepyfile(
        """
        def test_it(vbus_exec):
            program = vbus_exec.compile("host.c")
            with open("listing") as file:
                while_compiling = file.read().split()
            assert program.name not in while_compiling
            assert [name for name in while_compiling if name.startswith(program.name)]
            assert program.exists()
        """
    )
    suite.runpytest("-q").assert_outcomes(passed=1)


def write_host(suite: pytest.Pytester, monkeypatch: pytest.MonkeyPatch) -> None:
    """Write a host whose exit code is in code.h; its compiler writes down what it is asked for."""
    compiler = suite.path / "compiler"
    compiler.write_text(f'#!/bin/sh\necho "$1" >> called\nexec {require("cc")} "$@"\n')
    compiler.chmod(0o755)
    monkeypatch.setenv("CC", str(compiler))
    suite.path.joinpath("host.c").write_text('#include "code.h"\nint main(void) { return CODE; }\n')


def test_a_program_is_compiled_again_when_what_it_includes_has_changed(
    suite: pytest.Pytester, monkeypatch: pytest.MonkeyPatch
) -> None:
    write_host(suite, monkeypatch)
    suite.makepyfile(
        """
        from pathlib import Path

        def test_it(vbus_exec):
            for code in 3, 3, 4:
                Path("code.h").write_text(f"#define CODE {code}\\n")
                assert vbus_exec("host.c").code == code
            assert Path("called").read_text().split() == ["-E", "-o", "-E", "-E", "-o"]
        """
    )
    suite.runpytest("-q").assert_outcomes(passed=1)


def test_worlds_of_a_campaign_run_what_its_reference_run_has_compiled(
    suite: pytest.Pytester, monkeypatch: pytest.MonkeyPatch
) -> None:
    write_host(suite, monkeypatch)
    suite.makepyfile(
        """
        def test_it(vbus_exec):
            assert vbus_exec("host.c").code == 7
        """
    )
    suite.path.joinpath("code.h").write_text("#define CODE 7\n")
    suite.runpytest("-q", "--vbus-campaign=3", "--vbus-campaign-only=phase").assert_outcomes(
        passed=1
    )
    assert suite.path.joinpath("called").read_text().split() == ["-E", "-o", "-E", "-E"]


def test_a_python_program_and_one_that_hangs(suite: pytest.Pytester) -> None:
    suite.makepyfile(
        driver="""
        import os, sys
        from vbus import connect

        with connect(os.environ["VBUS_LINK"]) as bus:
            while sys.argv[1] == "hang" or not bus.read(0) & 0x84 == 0x84:
                bus.read(0)
        print("done", sys.argv[1] == os.environ["VBUS_LINK"])
        """,
        test_it="""
        def test_python(vbus_exec, vbus_board):
            done = vbus_exec("driver.py", "{link}")
            assert done.output == "done True\\n", done.errors
            assert vbus_board.now == done.now > 1_000_000_000

        def test_hang(vbus_exec):
            done = vbus_exec("driver.py", "hang", longest=5_000_000_000)
            assert done.stuck == "it was not done after 0.005 s of chip time"
            assert not done.ok

        def test_served(vbus_pty, vbus_exec):
            import pytest
            with pytest.raises(Exception, match="served on .* already, by vbus_pty"):
                vbus_exec("driver.py", "")

        def test_no_program(vbus_exec):
            import pytest
            with pytest.raises(Exception, match="nothing: there is no such program; build it"):
                vbus_exec("nothing")

        def test_no_source(vbus_exec, request):
            import pytest
            at = rf"; looked for it in {request.path.parent}$"
            with pytest.raises(Exception, match="^main.c is not there" + at):
                vbus_exec("main.c")
            with pytest.raises(Exception, match="^axis.c is not there" + at):
                vbus_exec.compile("test_it.py", "axis.c")
            with pytest.raises(Exception, match="^driver2.py is not there" + at):
                vbus_exec("driver2.py")

        def test_avr(vbus_exec):
            import pytest
            with pytest.raises(Exception, match="chip time must follow the AVR"):
                vbus_exec("firmware.elf", avr="mmcu=atmega328p")
            with pytest.raises(Exception, match="chip time must follow the cortex-m3"):
                vbus_exec("firmware.elf", cpu="cortex-m3")
            with pytest.raises(Exception, match='^cpu=.z80.: unknown processor "z80"'):
                vbus_exec("firmware.elf", cpu="z80")
        """,
    )
    suite.runpytest("-q", "test_it.py").assert_outcomes(passed=6)


def test_a_library_stands_behind_what_needs_it(suite: pytest.Pytester) -> None:
    suite.makefile(".c", root="""
        #include <math.h>
        #include <stdlib.h>
        int main(int count, char **words) { return (int)sqrt(atof(words[count - 1])); }
    """)  # fmt: skip
    suite.makepyfile(
        """
        def test_root(vbus_exec):
            assert vbus_exec("root.c", "49", flags="-O0 -lm -Wall").code == 7
        """
    )
    suite.runpytest("-q").assert_outcomes(passed=1)
