"""What a failing test leaves behind: polls folded, annotations, a summary of the job."""

import pytest

from vbus.board.build import build
from vbus.core.kernel import MS
from vbus.serve.host_limits import LAST_LINES
from vbus.serve.in_process import connect_in_process
from vbus.testing.boards import for_test, of_part
from vbus.testing.limits import HostWatch, Limits

pytest_plugins = "pytester"


def test_several_polls_in_turn_are_folded_and_hide_nothing() -> None:
    board = build(*for_test(of_part("MCP-1200"), "board.toml"))
    watch = HostWatch(board, Limits())
    board.run_until(5 * MS)
    bus = connect_in_process(board)
    bus.write(0x05, 0x03)
    for _ in range(LAST_LINES):
        bus.read(0x07)
        bus.read(0x07)
        bus.read(0x00)
    bus.write(0x05, 0x03)
    lines = watch.lines
    assert lines[0] == lines[-1]
    assert lines[0].startswith("x write ")
    assert lines[1].startswith("x read STATUS FCH")
    assert lines[1].endswith(" x2")
    assert lines[2].startswith("x read FLAG ")
    assert lines[3] == f"the same polls again x{3 * LAST_LINES - 3}"
    assert len(lines) == 5


def test_github_is_told_where_and_why(
    suite: pytest.Pytester, monkeypatch: pytest.MonkeyPatch
) -> None:
    summary = suite.path / "summary.md"
    monkeypatch.setenv("GITHUB_STEP_SUMMARY", str(summary))
    monkeypatch.setenv("GITHUB_WORKSPACE", str(suite.path.parent))
    suite.makepyfile(
        test_it="""
        import pytest

        @pytest.mark.parametrize("share", ["50%, or so"])
        def test_arrives(vbus_lm629, share):
            vbus_lm629.bus.read(0)
            assert vbus_lm629.plant.count == 5, "100%\\nmore"

        def test_without_a_board():
            assert False

        def test_passes(vbus_board):
            pass
        """
    )
    result = suite.runpytest("-q", "--tb=no", "--vbus-github", "--vbus-coverage")
    result.assert_outcomes(failed=2, passed=1)
    lines = [line for line in result.outlines if line.startswith("::")]
    (line,) = lines
    where, _, message = line.removeprefix("::error ").partition("::")
    assert where == (f"file={suite.path.name}/test_it.py,line=6,title=test_arrives[50%25%2C or so]")
    assert message.startswith('AssertionError: 100%25%0Aboard "lm629n-8" at ')
    assert "%0Areplay:  vbus replay " in message
    text = summary.read_text()
    assert text.startswith("### vbus: 1 failed, 1 passed\n")
    assert "<code>test_it.py::test_arrives[50%, or so]</code>: AssertionError: 100%<" in text
    assert "\n    violations: none\n" in text
    assert "\n    lm628: 3 of " in text
    assert "never" not in text
    assert "::error" not in suite.runpytest("-q").stdout.str()


MOVES = """
def drive(chip, run, update):
    chip.check_reset()
    chip.load_filter(kp=300, kd=2000, update=update)
    chip.load_trajectory(acc=400, vel=4 << 16, pos=2000, start=True)
    for _ in range(300):
        run("2 ms")
        chip.rdrp()

def test_updated(vbus_lm629):
    drive(vbus_lm629.host, vbus_lm629.clock.advance, True)
    assert False

def test_waits(vbus_lm629):
    drive(vbus_lm629.host, vbus_lm629.clock.advance, False)
"""


@pytest.mark.spec("LM-CMD-5")
def test_a_failing_test_says_what_became_of_the_axis(suite: pytest.Pytester) -> None:
    suite.makepyfile(MOVES)
    suite.runpytest("-q").stdout.fnmatch_lines(
        [
            "violations: none",
            "axis x: ended at 2000 counts, was 8 counts off at most, moved from 0 between 0 and"
            " 2000, at up to 4 (commanded 3.*) cnt/sample",
            "violations: 1",
            "*x broke lm628.filter-waits at *: STT: *UDF has not followed LFIL*",
            "notes: 1",
            "*x notes lm628.left-loaded at *: LFIL has loaded a filter that no UDF has taken*",
            "axis x: ended at 0 counts, was 2000 counts off at most, did not move, its profile ran"
            " in vain: *UDF has not followed LFIL",
        ]
    )
