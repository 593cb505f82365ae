"""The pytest plug-in, seen from the suites that use it."""

import re
import shlex
import subprocess
import sys
from pathlib import Path
from xml.etree import ElementTree

import pytest

from tests.unit.views.scope.decoded import of_page

pytest_plugins = "pytester"


def vbus(line: str) -> subprocess.CompletedProcess[str]:
    program, *arguments = shlex.split(line)
    assert program == "vbus"
    return subprocess.run(
        [sys.executable, "-m", "vbus", *arguments], capture_output=True, text=True, timeout=60
    )


def test_each_chip_is_ready_to_use(suite: pytest.Pytester) -> None:
    suite.makepyfile(
        """
        import pytest

        @pytest.mark.parametrize("part", ["vbus_lm628", "vbus_lm629"])
        def test_servo(part, request):
            axis = request.getfixturevalue(part)
            assert axis.chip.part[:5] == part[5:].upper()
            axis.host.check_reset()
            axis.host.load_filter(kp=300, kd=2000)
            assert abs(axis.host.move(2000, acc=20, vel=3 << 16) - 2000) < 10
            assert abs(axis.plant.count - 2000) < 10

        def test_mcp1200(vbus_mcp1200):
            vbus_mcp1200.host.write_kp(5)
            assert vbus_mcp1200.host.read_kp() == 5
            assert not vbus_mcp1200.board.violations, "it is out of its reset"
            assert vbus_mcp1200.board.chips[0].part == "MCP-1200"

        def test_mc1241a(vbus_mc1241a):
            assert len(vbus_mc1241a.plants) == 2
            assert vbus_mc1241a.host.select(2) >= 0
        """
    )
    suite.runpytest("-q").assert_outcomes(passed=4)


def test_the_marker_names_the_board_and_what_is_special_about_it(suite: pytest.Pytester) -> None:
    suite.makepyfile(
        """
        import pytest

        @pytest.mark.vbus(board="board.toml", seed=7)
        def test_file(vbus_board):
            assert (vbus_board.name, vbus_board.seed) == ("bench", 7)
            assert vbus_board.policy == "lockstep"

        @pytest.mark.vbus("MC1141A", plant="ideal", clock="20 MHz")
        def test_keywords(vbus_board, vbus_make_board):
            assert type(vbus_board.plants[0]).__name__ == "IdealPlant"
            assert vbus_make_board("MCP-1200", plant="dc_motor", seed=3).seed == 3

        @pytest.mark.vbus(board="[board]\\nname='t'\\n[chips.q]\\npart='LM628N-6'\\n"
                                "clock='6 MHz'\\nplant='none'\\n", rate=50, strict=True)
        def test_text(vbus_board):
            assert (vbus_board.policy, vbus_board.rate) == ("realtime", 50.0)
            assert vbus_board.violation_policy.default == 2

        def test_default(vbus_board):
            assert vbus_board.chips[0].part == "LM629N-8"
        """
    )
    suite.runpytest("-q").assert_outcomes(passed=4)


@pytest.mark.parametrize(
    ("mark", "message"),
    [
        ('board="nowhere.toml"', "*nowhere.toml: there is no such board file*"),
        ("bord=1", "*unknown keyword 'bord'; did you mean \"board\"? allowed are board, plant*"),
        ("rate=-1", "*rate=-1: it is chip seconds per second*"),
        ('board="LM999"', "*LM999*"),
        ('accept={"lm628.reset-wrte": "why"}', "*unknown rule 'lm628.reset-wrte'; did you mean*"),
        ('accept={"lm628.reset-write": " "}', "*say in words why lm628.reset-write is accepted*"),
        ('accept=["lm628.reset-write"]', '*write rules with reasons, {"RULE": "why"}*'),
        ('violations="ignore"', '*violations = \'ignore\': write "fail" or "report"*'),
        ("after_fault=True", '*after_fault = True: write "report" or "fail"*'),
    ],
)
def test_a_mark_that_makes_no_sense_is_said_in_one_sentence(
    suite: pytest.Pytester, mark: str, message: str
) -> None:
    suite.makepyfile(f"import pytest\n@pytest.mark.vbus({mark})\ndef test_it(vbus_board): pass\n")
    result = suite.runpytest("-q")
    result.assert_outcomes(errors=1)
    result.stdout.fnmatch_lines([message])
    # No line of pytest's or of vbus's: the mistake is the user's.
    for line in ("*def vbus_*", "*pluggy*", "*During handling*", "*plugin.py:*"):
        result.stdout.no_fnmatch_line(line)


def test_the_clock_moves_time_exactly_and_refuses_what_cannot_be(suite: pytest.Pytester) -> None:
    suite.makepyfile(
        """
        import pytest
        from vbus import VbusError

        def test_lockstep(vbus_clock, vbus_board):
            vbus_clock.advance("10ms")
            vbus_clock.advance(5)
            vbus_clock.run_until("20ms")
            assert vbus_clock.now == vbus_board.now == 20_000_000_000
            with pytest.raises(VbusError, match="already"):
                vbus_clock.run_until("1ms")
            with pytest.raises(VbusError, match="backwards"):
                vbus_clock.advance(-1)
            with pytest.raises(VbusError):
                vbus_clock.advance("soon")

        def test_freeze(vbus_lm629):
            bus, clock = vbus_lm629.bus, vbus_lm629.clock
            before = clock.now
            with clock.freeze():
                bus.write(0, 0x1E)
                assert set(bus.reads(0, 50)) == {bus.read(0)}
                assert bus.read(0) & 1
                assert clock.now == before
                with pytest.raises(VbusError, match="frozen"):
                    clock.advance("1us")
            clock.advance("1ms")
            assert not bus.read(0) & 1
            assert clock.now == before + 1_000_000_000 + 1_000_000

        @pytest.mark.vbus(rate=1)
        def test_real_time_is_the_wall_clocks(vbus_clock):
            with pytest.raises(VbusError, match="wall clock"):
                vbus_clock.advance(1)
        """
    )
    suite.runpytest("-q").assert_outcomes(passed=3)


FAILING = """
    def test_stall(vbus_lm629):
        vbus_lm629.host.check_reset()
        vbus_lm629.bus.write(0, 0x1E)
        vbus_lm629.bus.write(0, 0x1E)
        vbus_lm629.clock.advance("3ms")
        assert vbus_lm629.bus.read(0) == 0x55
"""


def test_a_failing_test_tells_what_was_on_the_bus_and_its_line_replays_it(
    suite: pytest.Pytester,
) -> None:
    suite.makepyfile(test_it=FAILING)
    result = suite.runpytest("-q", "--junitxml=out.xml", "--vbus-seed=9", "--vbus-wave=on-failure")
    result.assert_outcomes(failed=1)
    result.stdout.fnmatch_lines(
        [
            "*- vbus -*",
            'board "lm629n-8" at *us, seed 9, lockstep; * bus cycles',
            "*x RSTI resets *",
            "*x RDSTAT 80H MOTOR_OFF",
            "violations: 1",
            "*x broke lm628.busy-write at *",
            "journal: *",
            "replay:  vbus replay *",
            "wave:    *.vcd",
            "again:   pytest *test_it.py::test_stall --vbus-seed=9",
        ]
    )
    text = result.stdout.str()
    replay = re.search(r"^replay:  (.*)$", text, re.MULTILINE)
    again = re.search(r"^again:   pytest (.*)$", text, re.MULTILINE)
    assert replay is not None
    assert again is not None
    done = vbus(replay[1])
    assert done.returncode == 0, done.stdout
    assert re.fullmatch(r"no difference in \d+ entries, \d+ bus cycles\n", done.stdout)
    case = ElementTree.parse(suite.path / "out.xml").find(".//testcase")
    assert case is not None
    told = {p.get("name"): p.get("value") for p in case.iterfind(".//property")}
    assert told["vbus.seed"] == "9"
    assert told["vbus.replay"] == replay[1]
    assert "RSTI" in str(told["vbus.transcript"])
    assert "lm628.busy-write" in str(told["vbus.violations"])
    assert Path(str(told["vbus.journal"])).stat().st_size > 0
    page = Path(str(told["vbus.scope"]))
    assert page.suffix == ".html"
    assert of_page(page.read_bytes()).packets("x bus")[-1][2] == "RDSTAT 80H MOTOR_OFF  [LM-CMD-23]"
    assert "$enddefinitions" in Path(str(told["vbus.wave"])).read_text()

    repeated = suite.runpytest("-q", *shlex.split(again[1]))
    repeated.assert_outcomes(failed=1)
    transcript = re.findall(r"^    [\d.]+us .*$", text, re.MULTILINE)
    assert transcript == re.findall(r"^    [\d.]+us .*$", repeated.stdout.str(), re.MULTILINE)


def test_files_are_kept_of_failing_tests_only_unless_asked_for(suite: pytest.Pytester) -> None:
    suite.makepyfile("def test_it(vbus_lm629): vbus_lm629.bus.read(0)")
    suite.runpytest("-q", "--vbus-dir=kept", "--vbus-wave=on-failure").assert_outcomes(passed=1)
    assert not (suite.path / "kept").exists()
    suite.runpytest("-q", "--vbus-dir=kept", "--vbus-wave=always").assert_outcomes(passed=1)
    assert [path.suffix for path in (suite.path / "kept").iterdir()] == [".vcd"]


def test_a_waveform_that_cannot_be_written_is_refused_before_the_first_test(
    suite: pytest.Pytester, monkeypatch: pytest.MonkeyPatch
) -> None:
    suite.makepyfile("def test_it(vbus_lm629): vbus_lm629.bus.read(0)")
    monkeypatch.setitem(sys.modules, "vcd", None)
    result = suite.runpytest_inprocess("-q", "--vbus-wave=always")
    assert result.ret == pytest.ExitCode.USAGE_ERROR
    result.stderr.fnmatch_lines(["*--vbus-wave needs pyvcd; install it with: pip install*"])


def test_a_fault_that_never_fired_fails_its_test(suite: pytest.Pytester) -> None:
    suite.makepyfile(
        """
        def test_never(vbus_board):
            vbus_board.faults.arm("jam", when="at 10 s")

        def test_fires(vbus_board, vbus_clock):
            vbus_board.faults.arm("jam", when="at 10 ms")
            vbus_clock.advance("11ms")

        def test_called_off(vbus_board):
            vbus_board.faults.arm("jam", when="at 10 s")
            vbus_board.faults.clear()
        """
    )
    result = suite.runpytest("-q")
    result.assert_outcomes(failed=1, passed=2)
    result.stdout.fnmatch_lines(
        ['fault #1 jam*of board "lm629n-8" never fired*', "faults:", "*#1 jam*", "replay: *"]
    )


def test_a_mistake_in_words_is_shown_with_the_lines_of_the_test_alone(
    suite: pytest.Pytester,
) -> None:
    suite.makepyfile(
        """
        def arm(board):
            board.faults.arm("jam", when="at ten o'clock")

        def test_it(vbus_board):
            arm(vbus_board)
        """
    )
    result = suite.runpytest("-q")
    result.assert_outcomes(failed=1)
    result.stdout.fnmatch_lines(
        [
            ">       arm(vbus_board)",
            ">       board.faults.arm(*",
            "E*o'clock*",
            "*.py:2: ValueError",
        ]
    )
    assert "vbus/faults" not in result.stdout.str()
    assert "vbus/faults" in suite.runpytest("-q", "--full-trace").stdout.str()


def test_a_failing_test_with_a_fault_replays_with_the_fault(suite: pytest.Pytester) -> None:
    suite.makepyfile(
        """
        def test_it(vbus_lm629):
            axis = vbus_lm629.host
            axis.check_reset()
            axis.load_filter(kp=300, kd=2000)
            vbus_lm629.board.faults.arm("jam", when="at 20 ms")
            axis.load_trajectory(acc=400, vel=4 << 16, pos=5000, start=True)
            vbus_lm629.clock.advance("1 s")
            assert axis.rdrp() == 5000
        """
    )
    result = suite.runpytest("-q")
    result.assert_outcomes(failed=1)
    replay = re.search(r"^replay:  (.*)$", result.stdout.str(), re.MULTILINE)
    assert replay is not None
    done = vbus(replay[1])
    assert done.returncode == 0, done.stdout
    assert "no difference in" in done.stdout


def test_a_terminal_serves_the_board_while_the_test_holds_its_clock(suite: pytest.Pytester) -> None:
    suite.makepyfile(
        """
        import serial
        from vbus import connect

        def test_bytes(vbus_pty, vbus_clock):
            vbus_clock.advance("5ms")
            with serial.Serial(vbus_pty, timeout=60) as port:
                port.write(bytes([0x10]))
                assert port.read(2) == bytes([0x44, 0x84])
            assert vbus_clock.now == 5_001_000_000

        def test_client(vbus_pty, vbus_board, vbus_clock):
            vbus_clock.advance("5ms")
            with connect(f"pty:{vbus_pty}") as bus:
                assert bus.read(0) == 0x84
            assert bus.info.board == vbus_board.name
        """
    )
    suite.runpytest("-q").assert_outcomes(passed=2)


def test_it_works_beside_asyncio_and_with_workers(suite: pytest.Pytester) -> None:
    suite.makepyfile(
        """
        import pytest

        @pytest.mark.asyncio
        @pytest.mark.parametrize("turn", range(3))
        async def test_coroutine(turn, vbus_pty):
            from vbus.client.aio import connect
            async with await connect(f"pty:{vbus_pty}") as bus:
                assert await bus.read(0) in (0x00, 0x84)

        @pytest.mark.parametrize("turn", range(3))
        def test_plain(turn, vbus_pty):
            assert turn != 1, "on purpose"
        """
    )
    result = suite.runpytest_subprocess("-q", "-n2")
    result.assert_outcomes(passed=5, failed=1)
    result.stdout.fnmatch_lines(["replay:  vbus replay *"])


def test_workers_share_a_folder_and_nothing_else(suite: pytest.Pytester) -> None:
    suite.makepyfile(
        test_one="""
        import pytest

        HOST = "import os, vbus\\nwith vbus.connect(os.environ['VBUS_LINK']) as bus: bus.read(0)"

        @pytest.mark.parametrize("turn", range(4))
        @pytest.mark.vbus(board="board.toml")
        def test_it(turn, vbus_board, vbus_clock, vbus_exec, tmp_path):
            host = tmp_path / "host.py"
            host.write_text(HOST)
            assert vbus_exec(str(host)).code == 0
            vbus_board.faults.arm("jam")
            vbus_clock.advance(f"{turn + 1} ms")
            assert turn % 2, "on purpose"
        """,
        test_two="""
        import pytest

        @pytest.mark.asyncio
        @pytest.mark.vbus(board="board.toml", seed=3)
        async def test_it(vbus_board, vbus_pty):
            from vbus.client.aio import connect
            vbus_board.faults.arm("jam")
            async with await connect(f"pty:{vbus_pty}") as bus:
                await bus.read(0)
            assert False, "on purpose"
        """,
    )
    alone = suite.runpytest_subprocess("-q", "--vbus-dir=alone", "-p", "no:xdist")
    alone.assert_outcomes(passed=2, failed=3)
    shared = suite.runpytest_subprocess("-q", "-n2", "--vbus-dir=kept", "--vbus-wave=on-failure")
    shared.assert_outcomes(passed=2, failed=3)
    lines = [line for line in shared.outlines if line.startswith("replay:")]
    journals = {re.findall(r"\S+\.vbj", line)[0] for line in lines}
    assert len(journals) == 3
    assert len(list((suite.path / "kept").glob("*.vcd"))) == 3
    for journal in journals:
        # What a worker saw is what one process sees.
        here = vbus(f"vbus replay {journal}")
        there = vbus(f"vbus replay {suite.path / 'alone' / Path(journal).name}")
        assert here.returncode == there.returncode == 0, here.stdout + here.stderr
        assert here.stdout == there.stdout


def test_a_run_that_does_not_use_it_does_not_pay_for_it(suite: pytest.Pytester) -> None:
    suite.makepyfile(
        """
        import sys

        def test_nothing():
            loaded = {name for name in sys.modules if name.startswith("vbus.")}
            mine = {"vbus.compiled", "vbus.core", "vbus.core.entry_points",
                    "vbus.testing", "vbus.testing.plugins",
                    "vbus.testing.plugins.plugin", "vbus.version",
                    "vbus.testing.plugins.acceptance_plugin",
                    "vbus.testing.plugins.golden_plugin", "vbus.testing.plugins.workers",
                    "vbus.testing.plugins.worlds_plugin"}
            assert loaded <= mine
        """
    )
    suite.runpytest_subprocess("-q").assert_outcomes(passed=1)


def test_fixtures_of_two_chips_share_one_board_and_one_time(suite: pytest.Pytester) -> None:
    suite.makepyfile(
        """
        import pytest

        def test_families(vbus_mcp1200, vbus_mc1241a, vbus_clock, vbus_board):
            assert vbus_mcp1200.board is vbus_mc1241a.board is vbus_board
            assert list(vbus_board.axes) == ["x.1", "y.1", "y.2"]
            vbus_mcp1200.host.reset()
            assert vbus_mc1241a.host.select(2) >= 0
            assert vbus_mcp1200.bus.read(7) == vbus_mcp1200.chip.telemetry()["status"]
            vbus_clock.advance("1 ms")
            assert vbus_mcp1200.bus.now() == vbus_mc1241a.bus.now() == vbus_clock.now

        def test_kin(vbus_lm629, vbus_lm628):
            for name, one in {"LM629": vbus_lm629, "LM628": vbus_lm628}.items():
                assert one.chip.part.startswith(name)
                one.host.check_reset()

        def test_asked_for_too_late(request, vbus_mcp1200):
            with pytest.raises(Exception, match="the chips of all fixtures among its arguments"):
                request.getfixturevalue("vbus_lm629")
        """
    )
    suite.runpytest("-q").assert_outcomes(passed=3)
