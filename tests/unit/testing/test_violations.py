"""A breach of a datasheet fails its test, unless it is accepted with a reason and happens."""

import pytest

pytest_plugins = "pytester"

TOO_EARLY = """
import pytest
from vbus.serve.in_process import connect_in_process

def too_early(board, times=1):
    bus = connect_in_process(board)
    for _ in range(times):
        bus.write(0, 0x1E)

def too_late(board):
    bus = connect_in_process(board)
    board.run_until(5 * 10**9)
    bus.write(0, 0x1E)
    bus.write(0, 0x1E)
"""


def test_violations_fail_their_test_in_a_line_for_each_rule(suite: pytest.Pytester) -> None:
    suite.makepyfile(
        TOO_EARLY
        + """
def test_once(vbus_board):
    too_early(vbus_board)

def test_often(vbus_board):
    too_early(vbus_board, 24)
    too_late(vbus_board)
"""
    )
    result = suite.runpytest("-q", "-rf")
    result.assert_outcomes(failed=2)
    result.stdout.fnmatch_lines(
        [
            "x broke lm628.reset-write at 1us: Nothing is written during reset*LM-*",
            "without effect: 1 write not taken",
            "x broke lm628.reset-write 24 times, first at 1us: Nothing is written*",
            "x broke lm628.busy-write at 5002us: *",
            "*1us x write of 1EH at address 0H not taken: lm628.reset-write x24",
            "violations: 25",
            "*x broke lm628.reset-write 24 times, first at 1us: Nothing is written*",
            "without effect: 25 writes not taken",
        ]
    )


@pytest.mark.spec("LM-TIM-5")
def test_a_clock_that_the_part_does_not_take_fails_its_tests(suite: pytest.Pytester) -> None:
    suite.makepyfile(
        """
import pytest

@pytest.mark.vbus_matrix(part=["LM629N-6"], clock=["6 MHz", "8 MHz"])
def test_it(vbus_lm629):
    vbus_lm629.host.check_reset()
"""
    )
    result = suite.runpytest("-q", "-rf")
    result.assert_outcomes(passed=1, failed=1)
    result.stdout.fnmatch_lines(
        [
            "x broke lm628.T4 at 0us: CLK high or low for 62500 ps only*",
            "x broke lm628.T5 at 0us: 8000000 Hz is above the grade of a LM629N-6*",
        ]
    )


@pytest.mark.parametrize("how", ["option", "project", "marker"])
def test_one_line_has_violations_reported_only(suite: pytest.Pytester, how: str) -> None:
    mark = '@pytest.mark.vbus(violations="report")\n' if how == "marker" else ""
    suite.makepyfile(
        f"{TOO_EARLY}\n{mark}def test_it(vbus_board):\n    too_early(vbus_board)\n"
        f"\n{mark}def test_fails(vbus_board):\n    too_early(vbus_board)\n    assert False\n"
    )
    if how == "project":
        suite.makepyprojecttoml('[tool.vbus]\nviolations = "report"\n')
    result = suite.runpytest("-q", *(["--vbus-violations=report"] if how == "option" else []))
    result.assert_outcomes(passed=1, failed=1)
    result.stdout.fnmatch_lines(
        ["violations: 1", "*x broke lm628.reset-write at 1us: Nothing is written*"]
    )


def test_what_is_accepted_does_not_fail_and_is_shown_with_its_reason(
    suite: pytest.Pytester,
) -> None:
    suite.makepyfile(
        TOO_EARLY
        + """
@pytest.mark.vbus(accept={"lm628.reset-write": "the bootloader cannot wait"})
class TestBoot:
    def test_it(self, vbus_board):
        too_early(vbus_board, 3)

    @pytest.mark.vbus(accept={"lm628.busy-write": "a fault of revision A"})
    def test_both(self, vbus_board):
        too_early(vbus_board)
        too_late(vbus_board)

    def test_another_rule(self, vbus_board):
        too_early(vbus_board, 2)
        too_late(vbus_board)
"""
    )
    result = suite.runpytest("-q")
    result.assert_outcomes(passed=2, failed=1)
    result.stdout.fnmatch_lines(
        [
            "x broke lm628.busy-write at *",
            "violations: 1",
            "accepted:  x broke lm628.reset-write 2 times: the bootloader cannot wait",
        ]
    )


@pytest.mark.parametrize("options", [[], ["-n2"]], ids=["alone", "workers"])
def test_an_acceptance_that_is_never_needed_fails(
    suite: pytest.Pytester, options: list[str]
) -> None:
    suite.makepyprojecttoml('[tool.vbus.accept]\n"lm628.busy-write" = "old firmware"\n')
    suite.makepyfile(
        TOO_EARLY
        + """
pytestmark = pytest.mark.vbus(accept={"lm628.busy-read": "polls too fast"})

@pytest.mark.vbus(accept={"lm628.reset-write": "the bootloader cannot wait"})
def test_alone(vbus_board):
    pass

@pytest.mark.parametrize("part", ["LM628N-6", "LM629N-8"])
@pytest.mark.vbus(accept={"lm628.reset-write": "some cannot wait"})
def test_one_of_two_needs_it(vbus_make_board, part):
    if part == "LM629N-8":
        too_early(vbus_make_board(part))
"""
    )
    of_test = "test_an_acceptance_that_is_never_needed_fails.py"
    result = suite.runpytest_subprocess("-q", *options)
    result.assert_outcomes(passed=3, errors=1)
    result.stdout.fnmatch_lines(
        [f"{of_test}::test_alone accepts lm628.reset-write (the bootloader cannot wait), which*"]
    )
    assert "polls too fast" not in result.stdout.str(), "not all tests of the module have passed"

    result = suite.runpytest_subprocess("-q", "-k", "needs", *options)
    result.assert_outcomes(passed=2, deselected=0 if options else 1)
    assert result.ret == pytest.ExitCode.OK

    result = suite.runpytest_subprocess("-q", f"{of_test}::test_one_of_two_needs_it", *options)
    result.assert_outcomes(passed=2)
    assert result.ret == pytest.ExitCode.OK


@pytest.mark.parametrize("options", [[], ["-n2"]], ids=["alone", "workers"])
def test_what_a_module_and_the_project_accept_is_judged_after_a_complete_run(
    suite: pytest.Pytester, options: list[str]
) -> None:
    suite.makepyprojecttoml('[tool.vbus.accept]\n"lm628.busy-write" = "old firmware"\n')
    suite.makepyfile(
        test_early=TOO_EARLY
        + """
pytestmark = pytest.mark.vbus(accept={"lm628.busy-read": "polls too fast"})

@pytest.mark.parametrize("number", range(4))
def test_it(vbus_lm629, number):
    pass
""",
        test_none="def test_it(): pass\n",
    )
    result = suite.runpytest_subprocess("-q", *options)
    result.assert_outcomes(passed=5)
    assert result.ret == pytest.ExitCode.TESTS_FAILED
    result.stdout.fnmatch_lines_random(
        [
            "test_early.py accepts lm628.busy-read (polls too fast), which never happened; *",
            "the project accepts lm628.busy-write (old firmware), which never happened; *",
        ]
    )
    result = suite.runpytest_subprocess("-q", "test_early.py", *options)
    assert "the project" not in result.stdout.str()
    assert "test_early.py accepts lm628.busy-read" in result.stdout.str()
    assert (
        suite.runpytest_subprocess("-q", "test_early.py::test_it[2]", *options).ret
        == pytest.ExitCode.OK
    )


@pytest.mark.parametrize("options", [[], ["-n2"]], ids=["alone", "workers"])
def test_a_need_in_one_worker_is_a_need_of_all(suite: pytest.Pytester, options: list[str]) -> None:
    suite.makefile(
        ".toml", old='[[suppress]]\nrule = "lm628.reset-write"\nchip = "x"\nreason = "old"\n'
    )
    suite.makepyprojecttoml('[tool.vbus]\nsuppress = "old.toml"\n')
    suite.makepyfile(
        TOO_EARLY
        + """
@pytest.mark.parametrize("number", range(6))
def test_it(vbus_board, number):
    if number == 4:
        too_early(vbus_board)
"""
    )
    result = suite.runpytest_subprocess("-q", *options)
    result.assert_outcomes(passed=6)
    assert result.ret == pytest.ExitCode.OK


def test_what_follows_a_fault_on_its_chip_is_shown_apart_and_fails_on_request(
    suite: pytest.Pytester,
) -> None:
    suite.makepyfile(
        TOO_EARLY
        + """
def faulted(board, instant):
    board.faults.arm("jam", when=f"at {instant}")
    too_early(board, 2)
    board.run_until(10 * 10**9)

def test_before(vbus_board):
    faulted(vbus_board, "3 ms")

def test_after(vbus_board):
    faulted(vbus_board, "1 ns")

@pytest.mark.vbus(after_fault="fail")
def test_asked_for(vbus_board):
    faulted(vbus_board, "1 ns")
"""
    )
    result = suite.runpytest("-q")
    result.assert_outcomes(passed=1, failed=2)
    result.stdout.fnmatch_lines(
        [
            "x broke lm628.reset-write 2 times, first at 1us: *",
            "x broke lm628.reset-write 2 times, first at 1us, after a fault: *",
            "violations: none",
            "violations after a fault: 2",
        ]
    )


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("[tool.vbus\n", "*pyproject.toml: *"),
        ("[tool.vbus]\nviolation = 1\n", "*unknown key 'violation'; allowed are violations*"),
        ('[tool.vbus]\nviolations = "no"\n', '*violations = \'no\': write "fail" or "report"*'),
        ('[tool.vbus]\naccept = "all"\n', "*accept = 'all': write rules with reasons*"),
        ('[tool.vbus]\nsuppress = "gone.toml"\n', "*gone.toml: cannot be read: No such file*"),
    ],
)
def test_a_project_that_makes_no_sense_is_refused(
    suite: pytest.Pytester, text: str, message: str
) -> None:
    suite.makepyfile("def test_it(vbus_board): pass\n")
    suite.makepyprojecttoml(text)
    result = suite.runpytest("-q", "-c", "tox.ini", "--rootdir", ".")
    result.assert_outcomes(errors=1)
    result.stdout.fnmatch_lines([message])


CLOSES = """
import pytest
from vbus.serve.in_process import connect_in_process

@pytest.fixture
def driver(vbus_board):
    bus = connect_in_process(vbus_board)
    yield bus
    bus.write(0, 0x1E)
    bus.close()
"""


def test_violations_of_a_drivers_end_fail_its_test(suite: pytest.Pytester) -> None:
    suite.makepyfile(
        CLOSES
        + """
def test_it(driver):
    pass

def test_fails_anyway(driver):
    driver.write(0, 0x1E)
    driver.delay("5 ms")
    assert False

@pytest.mark.vbus(accept={"lm628.reset-write": "it ends when it likes"})
def test_accepted(driver):
    pass

@pytest.mark.vbus(violations="report")
def test_reported(driver):
    pass
"""
    )
    result = suite.runpytest("-q", "-rE")
    result.assert_outcomes(passed=3, failed=1, errors=1)
    result.stdout.fnmatch_lines(
        [
            "*ERROR at teardown of test_it*",
            "x broke lm628.reset-write at 1us: Nothing is written during reset*",
            "violations: 1",
            "ERROR *::test_it *",
        ]
    )


def test_what_no_right_driver_leaves_fails_a_test_that_has_passed(suite: pytest.Pytester) -> None:
    suite.makepyfile(
        """
import pytest

@pytest.fixture
def axis(vbus_lm629):
    axis = vbus_lm629.host
    axis.check_reset()
    axis.load_filter(kp=300, kd=2000)
    axis.move(50, acc=400, vel=4 << 16)
    axis.ltrj(0x0100)
    return axis

@pytest.fixture
def ended(axis):
    yield
    axis.stt()

def test_leaves(axis):
    pass

def test_its_fixture_ends_it(ended):
    pass

def test_fails_anyway(axis):
    assert False

@pytest.mark.vbus(accept={"lm628.off-waits": "the load alone is tested"})
def test_accepted(axis):
    pass
"""
    )
    result = suite.runpytest("-q", "-rE")
    result.assert_outcomes(passed=3, failed=1, errors=1)
    result.stdout.fnmatch_lines(
        [
            "*ERROR at teardown of test_leaves*",
            "x broke lm628.off-waits at *: LTRJ has loaded a stop that no STT has taken*",
            "violations: 1",
            "ERROR *::test_leaves*",
        ]
    )


@pytest.mark.parametrize("options", [[], ["-n2"]], ids=["alone", "workers"])
@pytest.mark.parametrize("board", [True, False], ids=["a board", "no board"])
def test_an_acceptance_is_found_needless_whatever_runs_first(
    suite: pytest.Pytester, options: list[str], board: bool
) -> None:
    suite.makepyprojecttoml('[tool.vbus.accept]\n"lm628.busy-write" = "old firmware"\n')
    suite.makepyfile(
        f"""
import pytest
pytestmark = pytest.mark.vbus(accept={{"lm628.busy-read": "polls too fast"}})

def test_a_without_a_board():
    pass

def test_b({"vbus_board" if board else ""}):
    pass

def test_c_without_a_board():
    pass
"""
    )
    result = suite.runpytest_subprocess("-q", *options)
    result.assert_outcomes(passed=3)
    assert result.ret == pytest.ExitCode.TESTS_FAILED
    result.stdout.fnmatch_lines(
        ["the project accepts lm628.busy-write (old firmware), which never happened; take it out"]
    )
    result.stdout.fnmatch_lines(["*.py accepts lm628.busy-read (polls too fast), which never*"])


@pytest.mark.parametrize("options", [[], ["-n", "2"]])
def test_notes_of_tests_that_pass_stand_in_the_summary(
    suite: pytest.Pytester, options: list[str]
) -> None:
    suite.makepyfile(
        """
        import pytest

        @pytest.mark.parametrize("n", range(2))
        def test_left(vbus_lm629, n):
            vbus_lm629.host.load_filter(kp=300, update=False)

        def test_clean(vbus_lm629):
            vbus_lm629.host.load_filter(kp=300)
        """
    )
    done = suite.runpytest("-q", *options)
    done.assert_outcomes(passed=3)
    done.stdout.fnmatch_lines(
        [
            "*vbus notes of tests that passed*",
            "lm628.left-loaded in 2 tests, first *test_left*: x: LFIL has loaded a filter that no*",
        ]
    )
    assert "test_clean" not in done.stdout.str()


def test_a_write_into_the_reset_at_power_on_is_told_what_helps(suite: pytest.Pytester) -> None:
    suite.makepyfile(
        """
        from vbus.serve.in_process import connect_in_process

        def test_busy_alone_is_polled(vbus_board):
            bus = connect_in_process(vbus_board)
            while bus.read(0) & 1:
                pass
            bus.write(0, 0x1E)
        """
    )
    done = suite.runpytest("-q")
    done.assert_outcomes(failed=1)
    done.stdout.fnmatch_lines(['*hint: x is in the reset that follows power-on*power_on = "done"*'])
