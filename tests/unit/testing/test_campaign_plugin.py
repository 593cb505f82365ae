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
    words = ("-q", "-p", "no:cacheprovider", "--vbus-campaign=40", "--vbus-campaign-only=cycle")
    result = suite.runpytest(*words)
    result.assert_outcomes(passed=1)
    text = result.stdout.str()
    (line,) = re.findall(r"^vbus: 1 test in 41 worlds: .*$", text, re.MULTILINE)
    assert re.search(r": \d+ detected, \d+ no effect, \d+ hang, .*; \d+ not tried$", line)
    assert re.search(r"silent: \S+::test_kp: x LFIL", text)
    again = suite.runpytest(*words)
    assert line in again.stdout.str()
    (world,) = set(re.findall(r"--vbus-world=(cycle:x\.\d+:flip\d)$", text, re.MULTILINE)[:1])
    replay = suite.runpytest("-q", f"--vbus-world={world}")
    replay.assert_outcomes(passed=1)
    replay.stdout.fnmatch_lines(["vbus: *::test_kp: cycle * of x: D* is inverted: silent*: x *"])


def test_of_specimens_that_are_told_each_is_the_least_that_does_it(suite: pytest.Pytester) -> None:
    suite.makepyfile(
        "def test_kp(vbus_lm629):\n"
        "    axis = vbus_lm629.host\n"
        "    axis.load_filter(kp=44 if axis.bus.read(0) == 0xC4 else 300)\n"
    )
    words = ("--vbus-campaign=300", "--vbus-campaign-only=specimen", "-p", "no:cacheprovider")
    text = suite.runpytest("-q", *words).stdout.str()
    assert len(re.findall("silent: ", text)) > 1
    assert set(re.findall(r"--vbus-world=(\S+)", text)) == {"specimen:+0us:x.reset_status=C4"}


def test_a_campaign_of_a_time_is_shared_by_the_tests_that_have_a_board(
    suite: pytest.Pytester,
) -> None:
    suite.makepyfile(LOADS.format(look=""))
    words = ("--vbus-campaign=1h", "--vbus-campaign-only=floating", "-p", "no:cacheprovider")
    result = suite.runpytest("-q", *words)
    result.assert_outcomes(passed=1)
    assert re.search(r"^vbus: 1 test in \d+ worlds: .*$", result.stdout.str(), re.MULTILINE)


def test_a_campaign_that_has_tried_nothing_fails(suite: pytest.Pytester) -> None:
    suite.makepyfile(LOADS.format(look=""))
    result = suite.runpytest("-q", "-p", "no:cacheprovider", "--vbus-campaign=0.001s")
    assert result.ret == pytest.ExitCode.TESTS_FAILED
    why = "its time was over after the reference runs"
    result.stdout.fnmatch_lines(
        [f"  *::test_kp: no campaign: {why}", "  no world was tried at all*"]
    )


def test_a_world_that_does_not_come_about_is_told(suite: pytest.Pytester) -> None:
    suite.makepyfile(LOADS.format(look=""))
    result = suite.runpytest("-q", "--vbus-world=cycle:x.9999:lost")
    result.assert_outcomes(passed=1)
    result.stdout.fnmatch_lines(["*: no effect: nothing was broken: * before cycle 9999"])
    other = suite.runpytest("-q", "--vbus-world=cycle:y.1:lost")
    other.assert_outcomes(errors=1)
    other.stdout.fnmatch_lines(["*cycle:y.1:lost: no chip called 'y'; this board has: x"])


def test_a_campaign_leaves_the_files_of_the_verb(
    suite: pytest.Pytester, monkeypatch: pytest.MonkeyPatch
) -> None:
    suite.makepyfile(test_a=LOADS.format(look=""), test_b=LOADS.format(look=""))
    files = ("--vbus-campaign-json=c.json", "--vbus-campaign-junit=c.xml",
             "--vbus-campaign-page=c.html")  # fmt: skip
    only = "--vbus-campaign-only=cycle,fault"
    result = suite.runpytest("-q", "-p", "no:cacheprovider", "--vbus-campaign=24", only, *files)
    result.assert_outcomes(passed=2)
    one, other = read_baseline("c.json"), json.loads(Path("c.json").read_text())
    assert {"test_a.py::test_kp", "test_b.py::test_kp"} == {
        group.partition(": ")[0] for _, group, _ in one
    }
    assert len(other["results"]) == 48
    assert sum(total["left"] for total in other["totals"]) > 100
    cases = ElementTree.parse("c.xml").getroot()
    assert (cases.get("tests"), cases.get("failures")) == ("48", str(len(one)))
    line = "pytest test_a.py::test_kp --vbus-world=cycle:x."
    assert line in "".join(case.findtext("failure", "") for case in cases)
    page = Path("c.html").read_text()
    assert html.escape(line) in page
    assert re.search(r"not tried: answers_late[^:]*: a test has no link that could break", page)
    before = Path("c.json").read_bytes()
    monkeypatch.setenv("PYTHONPATH", os.pathsep.join(sys.path))
    verb = ("-m", "vbus", "campaign", "--worlds=24", "--only=cycle,fault", "--json=c.json", "--",
            "pytest", "-q", "-n", "2", "-p", "no:cacheprovider")  # fmt: skip
    assert suite.run(sys.executable, *verb).ret == 0
    assert Path("c.json").read_bytes() == before


def test_a_campaign_goes_on_and_has_a_baseline(suite: pytest.Pytester) -> None:
    count = "with open('runs', 'a') as runs: runs.write('.')"
    path = suite.makepyfile(LOADS.format(look=count))
    words = ("-q", "-p", "no:cacheprovider", "--vbus-campaign-only=cycle",
             "--vbus-campaign-json=c.json")  # fmt: skip
    summary = r"^vbus: 1 test in (.*)$"
    runs, lines = [], []

    def run(*more: str) -> pytest.RunResult:
        result = suite.runpytest(*words, *more)
        result.assert_outcomes(passed=1)
        lines.extend(re.findall(summary, result.stdout.str(), re.MULTILINE))
        runs.append(len(Path("runs").read_text()) - 3)  # it runs twice before, and once at the end
        Path("runs").unlink()
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
        "def test_c(vbus_board): pytest.skip('no')\n"
        "def test_d(): pass\n"
    )
    result = suite.runpytest("-q", "--vbus-campaign=5")
    result.assert_outcomes(passed=2, failed=1, skipped=1)
    result.stdout.fnmatch_lines(
        ["  *::test_a: no campaign: in real time no two runs are alike",
         "  *::test_b: no campaign: it fails with nothing broken",
         "  *::test_c: no campaign: it is skipped"]
    )  # fmt: skip
    alone = suite.runpytest("-q", "--vbus-campaign=5", "-k", "test_d")
    alone.stdout.fnmatch_lines(["vbus: no campaign: no test here has a board"])


@pytest.mark.parametrize(
    ("option", "message"),
    [
        ("--vbus-campaign=soon", "write a number of worlds"),
        ("--vbus-campaign=0", "write a number of worlds"),
        ("--vbus-world=cycle:x", "DIMENSION:WHERE:HOW"),
        (
            "--vbus-world=cycle:x.1:lost --vbus-campaign",
            "is one world, and --vbus-campaign is many",
        ),
        ("--vbus-campaign-json=x.json", "goes with --vbus-campaign"),
        ("--vbus-campaign-all", "goes with --vbus-campaign"),
        ("--vbus-campaign=5 --vbus-campaign-only=cycles", 'did you mean "cycle"'),
        ("--vbus-campaign=5 --vbus-campaign-only=threads", "only threads of a program"),
        ("--vbus-campaign=5 --vbus-campaign-phases=1", "is 2 to 4096"),
        ("--vbus-campaign=5 --vbus-campaign-baseline=no.json", "no.json"),
        (
            "--vbus-campaign=5 --vbus-campaign-only=cycle --vbus-campaign-phases=4",
            "dimension phase",
        ),
        ("--vbus-campaign=5 --vbus-campaign-baseline=c --vbus-campaign-json=c", "another file"),
        ("--vbus-campaign=5 --vbus-campaign-page=t.py t.py::test_a", "this campaign reads it"),
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
