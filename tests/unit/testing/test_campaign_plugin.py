"""``pytest --vbus-campaign``: tests in many worlds, told in one line of the summary."""

import html
import json
import os
import re
import sys
from pathlib import Path
from xml.etree import ElementTree

import pytest

from vbus.campaign.report import read_baseline

pytest_plugins = "pytester"

LOADS = """
def test_kp(vbus_lm629):
    axis = vbus_lm629.host
    axis.load_filter(kp=300)
    {look}
"""


def test_the_default_summary_says_how_many_worlds_there_were(suite: pytest.Pytester) -> None:
    suite.makepyfile(
        "import pytest\n@pytest.mark.vbus_matrix(seed=[1, 2])\ndef test_a(vbus_board): pass\n"
        "def test_b(vbus_board): pass\ndef test_c(): pass\n"
    )
    result = suite.runpytest("-q")
    result.assert_outcomes(passed=4)
    result.stdout.fnmatch_lines(["vbus: 3 tests in 3 worlds"])
    quiet = suite.runpytest("-q", "-k", "test_c")
    assert "vbus:" not in quiet.stdout.str()


def test_a_campaign_tells_what_a_test_passes_over(suite: pytest.Pytester) -> None:
    suite.makepyfile(LOADS.format(look=""))
    words = ("-q", "-p", "no:cacheprovider", "--vbus-campaign=40")
    result = suite.runpytest(*words)
    result.assert_outcomes(passed=1)
    text = result.stdout.str()
    (line,) = re.findall(r"^vbus: 1 test in 43 worlds: .*$", text, re.MULTILINE)
    assert re.search(r": \d+ detected, \d+ no effect, \d+ hang, .*; \d+ not tried$", line)
    assert re.search(r"silent: \S+::test_kp: x LFIL", text)
    again = suite.runpytest(*words)
    assert line in again.stdout.str()
    (world,) = set(re.findall(r"--vbus-world='(cycle:x\.\d+:flip\d)'", text)[:1])
    suite.runpytest("-q", f"--vbus-world={world}").assert_outcomes(passed=1)


def test_a_campaign_leaves_the_files_of_the_verb(
    suite: pytest.Pytester, monkeypatch: pytest.MonkeyPatch
) -> None:
    suite.makepyfile(test_a=LOADS.format(look=""), test_b=LOADS.format(look=""))
    files = ("--vbus-campaign-json=c.json", "--vbus-campaign-junit=c.xml",
             "--vbus-campaign-page=c.html")  # fmt: skip
    result = suite.runpytest("-q", "-p", "no:cacheprovider", "--vbus-campaign=12", *files)
    result.assert_outcomes(passed=2)
    one, other = read_baseline("c.json"), json.loads(Path("c.json").read_text())
    assert {"test_a.py::test_kp", "test_b.py::test_kp"} == {
        group.partition(": ")[0] for _, group, _ in one
    }
    assert len(other["results"]) == 24
    assert sum(total["left"] for total in other["totals"]) > 100
    cases = ElementTree.parse("c.xml").getroot()
    assert (cases.get("tests"), cases.get("failures")) == ("24", str(len(one)))
    line = "pytest 'test_a.py::test_kp' --vbus-world='cycle:x."
    assert line in "".join(case.findtext("failure", "") for case in cases)
    page = Path("c.html").read_text()
    assert html.escape(line) in page
    assert "only threads of a program with a card" in page
    before = Path("c.json").read_bytes()
    monkeypatch.setenv("PYTHONPATH", os.pathsep.join(sys.path))
    verb = ("-m", "vbus", "campaign", "--worlds=12", "--json=c.json", "--",
            "pytest", "-q", "-n", "2", "-p", "no:cacheprovider")  # fmt: skip
    assert suite.run(sys.executable, *verb).ret == 0
    assert Path("c.json").read_bytes() == before


def test_a_campaign_goes_on_and_has_a_baseline(suite: pytest.Pytester) -> None:
    path = suite.makepyfile(LOADS.format(look=""))
    words = ("-q", "-p", "no:cacheprovider", "--vbus-campaign-only=cycle",
             "--vbus-campaign-json=c.json")  # fmt: skip
    summary = r"^vbus: 1 test in (\d+) worlds: (.*)$"
    runs, lines = [], []

    def run(*more: str) -> pytest.RunResult:
        result = suite.runpytest(*words, *more)
        result.assert_outcomes(passed=1)
        ((worlds, line),) = re.findall(summary, result.stdout.str(), re.MULTILINE)
        runs.append(int(worlds) - 3)  # it runs twice before, and once at the end
        lines.append(line)
        return result

    run("--vbus-campaign=3")
    assert run("--vbus-campaign=8").ret == 0
    before = Path("c.json").read_bytes()
    Path("base.json").write_bytes(before)
    assert run("--vbus-campaign=8", "--vbus-campaign-baseline=base.json").ret == 0
    assert (runs, lines[1]) == ([3, 5, 0], lines[2])
    assert Path("c.json").read_bytes() == before
    saved = json.loads(before)
    saved["keys"] = saved["keys"][1:]
    Path("base.json").write_text(json.dumps(saved))
    new = run("--vbus-campaign=8", "--vbus-campaign-baseline=base.json")
    assert (new.ret, runs[-1]) == (pytest.ExitCode.TESTS_FAILED, 0)
    assert new.stdout.str().count(" (new): test_a_campaign") == 1
    path.write_text(path.read_text() + "# another driver\n")
    run("--vbus-campaign=2", "--vbus-campaign-seed=5")
    assert runs[-1] == 2


def test_a_test_that_looks_fails_in_the_world_in_which_another_passes(
    suite: pytest.Pytester,
) -> None:
    look = "assert not axis.status() & 2"
    suite.makepyfile(LOADS.format(look=look))
    suite.runpytest("-q", "--vbus-world=cycle:x.1:lost").assert_outcomes(passed=1)
    result = suite.runpytest("-q", "--vbus-world=cycle:x.2:flip7")
    result.assert_outcomes(failed=1)
    result.stdout.fnmatch_lines(["under:   cycle 2 of x: D7 is inverted"])


def test_what_makes_no_campaign_is_told(suite: pytest.Pytester) -> None:
    suite.makepyfile(
        "import pytest\n@pytest.mark.vbus(rate=1)\ndef test_a(vbus_board): pass\n"
        "def test_b(vbus_board): assert 0\n"
    )
    result = suite.runpytest("-q", "--vbus-campaign=5")
    result.assert_outcomes(passed=1, failed=1)
    result.stdout.fnmatch_lines(
        ["  *::test_a: no campaign: in real time no two runs are alike",
         "  *::test_b: no campaign: it fails with nothing broken"]
    )  # fmt: skip


@pytest.mark.parametrize(
    ("option", "message"),
    [
        ("--vbus-campaign=soon", "write a number of worlds"),
        ("--vbus-campaign=0", "write a number of worlds"),
        ("--vbus-world=cycle:x", "DIMENSION:WHERE:HOW"),
        ("--vbus-campaign-json=x.json", "goes with --vbus-campaign"),
        ("--vbus-campaign-all", "goes with --vbus-campaign"),
        ("--vbus-campaign=5 --vbus-campaign-only=cycles", 'did you mean "cycle"'),
        ("--vbus-campaign=5 --vbus-campaign-only=threads", "only threads of a program"),
        ("--vbus-campaign=5 --vbus-campaign-phases=1", "is 2 to 4096"),
        ("--vbus-campaign=5 --vbus-campaign-baseline=no.json", "no.json"),
    ],
)
def test_an_option_that_cannot_be_is_refused(
    suite: pytest.Pytester, option: str, message: str
) -> None:
    suite.makepyfile("def test_a(vbus_board): pass\n")
    result = suite.runpytest("-q", *option.split())
    assert result.ret == pytest.ExitCode.USAGE_ERROR
    assert message in result.stderr.str()


def test_workers_hand_over_what_they_have_seen(suite: pytest.Pytester) -> None:
    pytest.importorskip("xdist")
    suite.makepyfile("def test_a(vbus_board): pass\ndef test_b(vbus_board): pass\n")
    result = suite.runpytest_subprocess("-q", "-n", "2")
    result.stdout.fnmatch_lines(["vbus: 2 tests in 2 worlds"])
