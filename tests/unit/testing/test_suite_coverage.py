"""What a suite exercises of its chips: merged over tests, programs and workers."""

import json
from xml.etree import ElementTree

import pytest

from tests.unit.testing.test_plugin import vbus

pytest_plugins = "pytester"

TESTS = """
import pytest

def test_home(vbus_lm629):
    vbus_lm629.bus.write(0, 0x02)

@pytest.mark.parametrize("number", range(2))
def test_status(vbus_board, vbus_exec, number):
    assert vbus_exec("host.py").ok

def test_registers(vbus_mcp1200):
    vbus_mcp1200.bus.read(7)

@pytest.mark.vbus(violations="report")
def test_early(vbus_board):
    from vbus.serve.in_process import connect_in_process
    connect_in_process(vbus_board).write(0, 0x1E)

def test_of_nothing():
    pass
"""
HOST = "import os, vbus\nwith vbus.connect(os.environ['VBUS_LINK']) as bus: bus.read(0)\n"


@pytest.mark.parametrize("options", [[], ["-n2"]], ids=["alone", "workers"])
def test_a_suite_is_covered_as_one(suite: pytest.Pytester, options: list[str]) -> None:
    suite.makepyfile(test_it=TESTS, host=HOST)
    files = [f"--vbus-coverage=out/c.{end}" for end in ("json", "txt", "html", "xml")]
    result = suite.runpytest_subprocess("-q", "test_it.py", *files, *options)
    result.assert_outcomes(passed=6)
    result.stdout.fnmatch_lines(
        [
            "*= vbus coverage =*",
            "lm628: 2 of *",
            "  commands: 2 of *",
            "mcp1200: * of *",
            "together: * of *",
            "written: out/c.json",
            "written: out/c.xml",
        ]
    )
    assert "never" not in result.stdout.str()
    found = json.loads((suite.path / "out" / "c.json").read_text())
    assert found["families"]["lm628"]["groups"]["commands"]["RDSTAT"] == 2
    assert found["runs"] == ["5 tests"]
    assert found["tests"]["test_it.py::test_home"] == {"lm628": {"commands": ["DFH"]}}
    assert "test_it.py::test_of_nothing" not in found["tests"]
    assert "never" in (suite.path / "out" / "c.txt").read_text()
    page = (suite.path / "out" / "c.html").read_text()
    assert "<summary>2 tests</summary>test_it.py::test_status[0]<br>test_it.py::test_stat" in page
    root = ElementTree.parse(suite.path / "out" / "c.xml").getroot()
    done, total = int(root.get("lines-covered", "")), int(root.get("lines-valid", ""))
    assert root.get("line-rate") == f"{done / total:.4f}"
    assert [package.get("name") for package in root.iterfind("packages/package")] == [
        "lm628", "mcp1200",
    ]  # fmt: skip
    lines = root.findall(".//class/lines/line")
    assert len(lines) == total
    assert sum(line.get("hits") != "0" for line in lines) == done
    method = root.find(".//method[@name='RDSTAT']/lines/line")
    assert method is not None
    assert method.get("hits") == "2"

    which = vbus(f"vbus coverage {suite.path}/out/c.json --covers RDSTAT").stdout.splitlines()
    assert which[0].startswith("lm628 commands: RDSTAT")
    assert which[1:3] == ["    test_it.py::test_status[0]", "    test_it.py::test_status[1]"]
    rule = vbus(f"vbus coverage {suite.path}/out/c.json --covers lm628.reset-write").stdout
    assert "\n    test_it.py::test_early\n" in rule
    assert "no test" in vbus(f"vbus coverage {suite.path}/out/c.json --covers LTRJ").stdout
    of_test = vbus(f"vbus coverage {suite.path}/out/c.json --test test_it.py::test_registers")
    assert of_test.stdout.startswith("mcp1200 registers read: STATUS")
    wrong = vbus(f"vbus coverage {suite.path}/out/c.json --covers RDSTAX")
    assert "nothing is called 'RDSTAX' on the chips of this coverage; did you mean \"RDSTAT\"?" in (
        wrong.stderr
    )
    wrong = vbus(f"vbus coverage {suite.path}/out/c.json --test test_it.py::test_hme")
    assert 'did you mean "test_it.py::test_home"?' in wrong.stderr


def test_a_run_can_be_held_to_a_limit_and_compared_with_a_base(suite: pytest.Pytester) -> None:
    suite.makepyfile(
        """
        def test_status(vbus_lm629):
            vbus_lm629.bus.read(0)

        def test_stop(vbus_lm629):
            vbus_lm629.bus.write(0, 0x01)
        """
    )
    first = suite.runpytest("-q", "--vbus-coverage=base.json", "-k", "status")
    assert first.ret == pytest.ExitCode.OK
    second = suite.runpytest("-q", "--vbus-coverage-base=base.json", "-k", "stop")
    second.stdout.fnmatch_lines(
        [
            "*never DFH*",
            "+ lm628 commands: STT*",
            "- lm628 commands: RDSTAT*",
            "*% before, *% now",
        ]
    )
    assert second.ret == pytest.ExitCode.OK
    short = suite.runpytest("-q", "--vbus-coverage-fail-under=50")
    assert short.ret == pytest.ExitCode.TESTS_FAILED
    short.stdout.fnmatch_lines(["*% exercised, 50% wanted"])
    nothing = suite.runpytest("-q", "--vbus-coverage-fail-under=1", "-k", "nothing")
    nothing.stdout.fnmatch_lines(["nothing was exercised*", "0.0% exercised, 1% wanted"])


@pytest.mark.parametrize(
    ("option", "message"),
    [
        (
            "--vbus-coverage=c.pdf",
            "*=c.pdf: a coverage file's name ends in one of .txt, .json*",
        ),
        ("--vbus-coverage-base=none.json", "*none.json: *No such file*"),
        ("--vbus-coverage-fail-under=130", "*=130: percent go from 0 to 100"),
        ("--vbus-coverage-fail-under=-1", "*=-1: percent go from 0 to 100"),
        ("--vbus-coverage-fail-under=nan", "*=nan: percent go from 0 to 100"),
    ],
)
def test_a_coverage_that_cannot_be_had_is_refused_at_once(
    suite: pytest.Pytester, option: str, message: str
) -> None:
    suite.makepyfile("def test_it(vbus_board): pass\n")
    result = suite.runpytest("-q", option)
    assert result.ret == pytest.ExitCode.USAGE_ERROR
    result.stderr.fnmatch_lines([message])
