"""One test over parts, clocks, seeds, time policies and specimens, whatever its host is."""

import json

import pytest

pytest_plugins = "pytester"

HASTY_C = """
#include "vbus.h"
#include <stdlib.h>
int main(void)
{
    struct vbus bus;
    if (vbus_open(&bus, getenv("VBUS_LINK")) < 0)
        return 2;
    vbus_delay(&bus, 2000 * VBUS_US);
    return vbus_read(&bus, 0) != 0x84;
}
"""
HASTY_PYTHON = """
import os, sys, vbus

with vbus.connect(os.environ["VBUS_LINK"]) as bus:
    bus.delay(2 * 10**9)
    sys.exit(bus.read(0) != 0x84)
"""
HASTY = """
import pytest

def count():
    with open("runs", "a") as file:
        file.write("x")

@pytest.mark.vbus_matrix(hostile=40)
def test_hasty(vbus_lm629):
    {log}assert vbus_lm629.bus.read(0) == {status}
"""
C4 = "specimen:+0us:x.reset_status=C4"


def kept(suite: pytest.Pytester) -> list[object]:
    """Return what the cache keeps for the next run."""
    files = (suite.path / ".pytest_cache" / "v" / "vbus" / "hostile").glob("*")
    return [json.loads(file.read_text()) for file in files]


# -- variants -------------------------------------------------------------------------------------


def test_variants_are_the_product_of_the_lists(suite: pytest.Pytester) -> None:
    suite.makepyfile(
        """
        import pytest

        @pytest.mark.vbus_matrix(part=["LM629N-8", "LM628N-6 @ 6 MHz"], seed=range(2, 4))
        def test_parts(vbus_lm629, request):
            part, clock = {"L": ("LM629N-8", 8_000_000), "@": ("LM628N-6", 6_000_000)}[
                "@" if "@" in request.node.name else "L"
            ]
            assert (vbus_lm629.chip.part, vbus_lm629.chip.clock.hz) == (part, clock)
            assert f"seed{vbus_lm629.board.seed}" in request.node.name

        @pytest.mark.vbus_matrix(time=["lockstep", "slaved"], clock=["6 MHz"])
        @pytest.mark.vbus(board="board.toml")
        def test_time(vbus_board, request):
            assert vbus_board.policy in request.node.name
            assert vbus_board.chips[0].clock.hz == 6_000_000
        """
    )
    result = suite.runpytest("-v")
    result.assert_outcomes(passed=6)
    result.stdout.fnmatch_lines(
        [
            "*::test_parts[[]LM629N-8-seed2] PASSED*",
            "*::test_parts[[]LM629N-8-seed3] PASSED*",
            "*::test_parts[[]LM628N-6@6MHz-seed2] PASSED*",
            "*::test_parts[[]LM628N-6@6MHz-seed3] PASSED*",
            "*::test_time[[]6MHz-lockstep] PASSED*",
            "*::test_time[[]6MHz-slaved] PASSED*",
        ]
    )


def test_the_marker_of_the_test_stands_above_that_of_its_module(suite: pytest.Pytester) -> None:
    suite.makepyfile(
        "import pytest\npytestmark = pytest.mark.vbus_matrix(seed=[1, 2], clock=['8 MHz'])\n"
        "@pytest.mark.vbus_matrix(seed=[7])\ndef test_it(vbus_board): assert vbus_board.seed == 7\n"
    )
    suite.runpytest("-q").assert_outcomes(passed=1)


@pytest.mark.parametrize(
    ("said", "sentence"),
    [
        (
            "part=['LM629N-8 @ 6 MHz'], clock=['4 MHz']",
            'a part has its clock ("PART @ 6 MHz") or the list of clocks, not both',
        ),
        ("['LM629N-8']", "write lists by name, such as seed=[1, 2]"),
        ("parts=['LM629N-8']", "unknown keyword 'parts'; allowed are part, clock, time, seed, ho*"),
        ("part='LM629N-8'", "part = 'LM629N-8': write a list of texts"),
        ("seed=['1']", "seed = ['1']: write a list of numbers"),
        ("seed=[]", "seed = []: write a list of numbers"),
        ("time=['realtime']", "time = 'realtime': allowed are lockstep and slaved"),
        ("hostile=True", "hostile = True: write a number of specimens, such as 30"),
        ("hostile='30'", "hostile = '30': write a number of specimens, such as 30"),
        ("hostile=-1", "hostile = -1: write a number of specimens, such as 30"),
    ],
)
def test_a_marker_that_makes_no_sense_is_refused(
    suite: pytest.Pytester, said: str, sentence: str
) -> None:
    suite.makepyfile(
        f"import pytest\n@pytest.mark.vbus_matrix({said})\ndef test_it(vbus_board): pass\n"
    )
    result = suite.runpytest("-q")
    result.assert_outcomes(errors=1)
    found = sentence.replace("[", "[[]")
    result.stdout.fnmatch_lines([f"*::test_it: @pytest.mark.vbus_matrix: {found}"])


def test_a_test_without_a_board_has_no_variants(suite: pytest.Pytester) -> None:
    suite.makepyfile("import pytest\n@pytest.mark.vbus_matrix(seed=[1])\ndef test_it(): pass\n")
    suite.runpytest("-q").stdout.fnmatch_lines(["*the test takes no fixture of vbus that has a*"])


# -- specimens ------------------------------------------------------------------------------------


def test_a_driver_that_lives_with_every_specimen_passes(suite: pytest.Pytester) -> None:
    log = "count(); "
    status = "vbus_lm629.bus.read(0)"
    suite.makepyfile(HASTY.format(log=log, status=status).replace("hostile=40", "hostile=6"))
    suite.runpytest("-q").assert_outcomes(passed=1)
    assert 3 <= len((suite.path / "runs").read_text()) <= 8
    assert kept(suite) == []


def test_the_fewest_extremes_are_told_kept_and_tried_first_next_time(
    suite: pytest.Pytester,
) -> None:
    log = "count(); "
    suite.makepyfile(HASTY.format(log=log, status="0x84"))
    result = suite.runpytest("-q")
    result.assert_outcomes(failed=1)
    result.stdout.fnmatch_lines(['under:   x.reset_status = "C4"', 'board "lm629n-8" at *'])
    assert kept(suite) == [C4]
    runs = suite.path / "runs"
    runs.unlink()
    suite.runpytest("-q").assert_outcomes(failed=1)
    assert len(runs.read_text()) == 3  # a typical chip, the one that was kept, and for the report
    suite.makepyfile(HASTY.format(log=log, status="vbus_lm629.bus.read(0)"))
    suite.runpytest("-q").assert_outcomes(passed=1)
    assert kept(suite) == [None]


def test_what_is_kept_for_another_board_is_not_tried(suite: pytest.Pytester) -> None:
    suite.makepyfile(HASTY.format(log="", status="0x84"))
    suite.runpytest("-q").assert_outcomes(failed=1)
    (file,) = (suite.path / ".pytest_cache" / "v" / "vbus" / "hostile").glob("*")
    file.write_text(json.dumps(C4.replace("x.", "y.")))
    suite.runpytest("-q").assert_outcomes(failed=1)
    assert kept(suite) == [C4]


def test_a_driver_that_fails_on_a_typical_chip_is_not_searched(suite: pytest.Pytester) -> None:
    suite.makepyfile(HASTY.format(log="count(); ", status="0x99"))
    result = suite.runpytest("-q", "-p", "no:cacheprovider")
    result.assert_outcomes(failed=1)
    assert (suite.path / "runs").read_text() == "xx"
    assert "under:" not in result.stdout.str()


@pytest.mark.parametrize("host", ["C", "terminal", "python", "coroutine"])
def test_hosts_of_every_kind_meet_a_hostile_chip(suite: pytest.Pytester, host: str) -> None:
    suite.makefile(".c", hasty=HASTY_C)
    suite.makepyfile(hasty=HASTY_PYTHON)
    bodies = {
        "C": "def test_it(vbus_exec):\n    assert vbus_exec('hasty.c').code == 0",
        "python": "def test_it(vbus_exec):\n    assert vbus_exec('hasty.py').code == 0",
        "terminal": "def test_it(vbus_pty):\n    import vbus\n"
                    "    with vbus.connect(f'pty:{vbus_pty}') as bus:\n"
                    "        bus.delay(2 * 10**9)\n        assert bus.read(0) == 0x84",
        "coroutine": "@pytest.mark.asyncio\nasync def test_it(vbus_pty):\n"
                     "    from vbus.client.aio import connect\n"
                     "    async with await connect(f'pty:{vbus_pty}') as bus:\n"
                     "        await bus.delay(2 * 10**9)\n"
                     "        assert await bus.read(0) == 0x84",
    }  # fmt: skip
    suite.makepyfile(
        test_it=f"import pytest\npytestmark = pytest.mark.vbus_matrix(hostile=10)\n{bodies[host]}\n"
    )
    result = suite.runpytest_subprocess("-q", "test_it.py")
    result.assert_outcomes(failed=1)
    result.stdout.fnmatch_lines(['under:   x.reset_status = "C4"'])


def test_where_in_a_sample_a_host_begins_is_part_of_it(suite: pytest.Pytester) -> None:
    suite.makepyfile(
        """
        import pytest

        @pytest.mark.vbus_matrix(hostile=60)
        def test_it(vbus_lm629):
            assert not 34 * 10**6 <= vbus_lm629.clock.now < 10**9
        """
    )
    result = suite.runpytest("-q")
    result.assert_outcomes(failed=1)
    result.stdout.fnmatch_lines(["under:*the chips *us ahead"])


def test_a_board_in_real_time_is_refused(suite: pytest.Pytester) -> None:
    suite.makepyfile(
        "import pytest\n@pytest.mark.vbus(rate=1)\n@pytest.mark.vbus_matrix(hostile=3)\n"
        "def test_it(vbus_board): pass\n"
    )
    result = suite.runpytest("-q")
    result.stdout.fnmatch_lines(["*hostile: a board in real time never repeats a run;*"])


def test_an_acceptance_and_a_golden_are_judged_once(suite: pytest.Pytester) -> None:
    suite.makepyfile(
        test_it="""
        import pytest

        @pytest.mark.vbus(accept={"lm628.busy-write": "it waits for no more than 30 us"})
        @pytest.mark.vbus_matrix(hostile=60)
        def test_it(vbus_lm629, vbus_golden):
            vbus_lm629.bus.write(0, 0x02)
            vbus_lm629.bus.delay(30_000_000)
            vbus_lm629.bus.write(0, 0x02)
        """
    )
    suite.runpytest("-q", "--vbus-golden=update").assert_outcomes(passed=1)
    assert len(list(suite.path.rglob("*.golden"))) == 1
    suite.runpytest("-q").assert_outcomes(passed=1)


def test_fixtures_of_the_module_are_made_once(suite: pytest.Pytester) -> None:
    suite.makepyfile(
        """
        import pytest

        made = []

        @pytest.fixture(scope="module")
        def slow():
            made.append(1)
            yield
            assert made == [1]

        @pytest.mark.vbus_matrix(hostile=4)
        def test_it(slow, vbus_board):
            assert made == [1]
        """
    )
    suite.runpytest("-q").assert_outcomes(passed=1)
