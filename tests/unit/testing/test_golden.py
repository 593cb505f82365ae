"""Goldens: a run is compared with one that was right, and the file says what is in it."""

import tomllib
from dataclasses import replace
from pathlib import Path

import pytest

from vbus.core.errors import ConfigError, VbusError
from vbus.plant.dc_motor import DcMotor
from vbus.testing.limits import NEAR, tolerance_of
from vbus.testing.plugins.golden import complaints, read_golden, text_of
from vbus.views.runs.difference import Tolerance
from vbus.views.runs.motion import AxisCourse, Move
from vbus.views.runs.run import Run, Said

pytest_plugins = "pytester"

RUN = Run(
    [Said(0, text, text) for text in ("x RDSTAT", 'x "quoted"', "x STT")],
    {"x.1": AxisCourse((Move(2_500_000_000, tuple(range(0, 90, 3))),), 88, 4)},
    225,
    300_256_000_001,
    models={"x.1": "dc_motor 1"},
    vbus="0.1.0",
)
TEXT = """\
# What the host does in test_it.py::test_a, and what comes of it.
# pytest --vbus-golden=update writes this file anew.
format = 1
vbus = "0.1.0"
cycles = 225
chip_time = "300256.000001us"
host = [
  "x RDSTAT",
  "x \\"quoted\\"",
  "x STT",
]

[axes."x.1"]
model = "dc_motor 1"
final = 88
peak_error = 4

[[axes."x.1".moves]]
begin = "2500us"
path = [  # counts, once in a millisecond
  0, 3, 6, 9, 12, 15, 18, 21, 24, 27, 30, 33, 36, 39, 42, 45, 48, 51, 54, 57,
  60, 63, 66, 69, 72, 75, 78, 81, 84, 87,
]
"""
MOVE = """
import pytest

@pytest.mark.parametrize("kp", [300])
def test_a(vbus_lm629, vbus_golden, kp):
    axis = vbus_lm629.host
    axis.check_reset()
    axis.load_filter(kp=kp, kd=2000)
    axis.load_trajectory(acc=400, vel=4 << 16, pos=50, start=True)
    vbus_lm629.clock.advance("80 ms")

def test_b():
    pass
"""
FILE = "test_it/test_a[300].golden"


# -- the file -------------------------------------------------------------------------------------


def test_a_golden_is_text_and_is_read_as_it_was(tmp_path: Path) -> None:
    assert text_of(RUN, "test_it.py::test_a") == TEXT
    path = tmp_path / "a.golden"
    path.write_text(TEXT)
    assert read_golden(path) == RUN


@pytest.mark.parametrize(
    ("right", "wrong", "sentence"),
    [
        ("format = 1", "format = 2", "this is no golden: it is of format 2; this vbus reads 1"),
        ("cycles = 225\n", "", "this is no golden: it has no 'cycles'"),
        ('"2500us"', '"soon"', "this is no golden: 'soon' is no duration"),
        ("[axes", "[[axes", "this is no golden: "),
        ('"x STT",', '"x STT', "this is no golden: "),
        ("0, 3, 6", '"a"', "this is no golden: invalid literal for int"),
    ],
)
def test_a_file_that_is_none_is_refused(
    tmp_path: Path, right: str, wrong: str, sentence: str
) -> None:
    path = tmp_path / "a.golden"
    path.write_text(TEXT.replace(right, wrong))
    with pytest.raises(VbusError, match=f"a.golden: {sentence}"):
        read_golden(path)


# -- the verdict ----------------------------------------------------------------------------------


def test_what_is_as_it_was_has_no_complaints_whatever_the_model() -> None:
    assert complaints(RUN, replace(RUN, models={"x.1": "dc_motor 2"}, vbus="9"), NEAR) == []


def test_time_and_cycles_are_limits() -> None:
    faster = replace(RUN, cycles=20, duration=10**9)
    assert complaints(RUN, faster, NEAR) == []
    assert complaints(faster, RUN, NEAR) == [
        "cost: bus cycles",
        "  golden: 20",
        "  now:    225",
        "cost: chip time",
        "  golden: 1 ms",
        "  now:    300.256 ms",
    ]
    assert complaints(RUN, replace(RUN, cycles=236), NEAR) == []
    assert len(complaints(RUN, replace(RUN, cycles=237), NEAR)) == 3


def test_what_the_host_does_is_shown_as_a_difference_of_lines() -> None:
    now = replace(RUN, host=[RUN.host[0], Said(0, "x DFH", "x DFH"), *RUN.host[1:]])
    assert complaints(RUN, now, NEAR) == [
        "the host does something else:",
        "  --- golden",
        "  +++ now",
        "  @@ -1,3 +1,4 @@",
        "   x RDSTAT",
        "  +x DFH",
        '   x "quoted"',
        "   x STT",
    ]
    many = replace(RUN, host=[Said(0, str(n), str(n)) for n in range(99)])
    assert complaints(RUN, many, NEAR)[-1] == "... and 65 lines more"


def test_a_motor_of_another_model_is_said_to_be_one() -> None:
    course = replace(RUN.axes["x.1"], final=80)
    now = replace(RUN, axes={"x.1": course}, models={"x.1": "dc_motor 2"}, vbus="0.2.0")
    assert complaints(RUN, now, NEAR) == [
        "x.1 was recorded with dc_motor 1, this is dc_motor 2: another model of the motor moves"
        " otherwise, which is no fault of the driver; look at what differs, and update",
        "recorded with vbus 0.1.0, this is 0.2.0",
        "motor: x.1: final position",
        "  golden: 88 counts",
        "  now:    80 counts",
    ]


def test_other_axes_are_told_by_their_names() -> None:
    assert complaints(RUN, replace(RUN, axes={}, models={}), NEAR) == [
        "the axes of the board are others: x.1 and none"
    ]


# -- how near -------------------------------------------------------------------------------------


def test_a_table_says_how_near_is_near_enough() -> None:
    given = {"counts": 0, "time": "2.5 %", "cycles": "100%"}
    assert tolerance_of("here", given) == Tolerance(0, 0.025, 1.0, limit=True)
    assert tolerance_of("here", {}) == Tolerance(4, 0.05, 0.05, limit=True)


@pytest.mark.parametrize(
    ("given", "sentence"),
    [
        (5, r'here: golden = 5: write a table, \{"counts": 4, "time": "5 %"\}'),
        ({"count": 5}, "golden: unknown key 'count'; did you mean .counts.. allowed are counts"),
        ({"counts": -1}, "golden: counts = -1: write a number of counts"),
        ({"counts": True}, "golden: counts = True: write a number of counts"),
        ({"counts": "5 %"}, "golden: counts = '5 %': write a number of counts"),
        ({"time": 5}, 'golden: time = 5: write a share, such as "5 %"'),
        ({"cycles": "-5 %"}, "golden: cycles = '-5 %': write a share"),
    ],
)
def test_a_table_that_makes_no_sense_is_refused(given: object, sentence: str) -> None:
    with pytest.raises(ConfigError, match=sentence):
        tolerance_of("here", given)


# -- the fixture ----------------------------------------------------------------------------------


def test_a_test_without_its_golden_fails_and_says_how_to_record_it(suite: pytest.Pytester) -> None:
    suite.makepyfile(test_it=MOVE)
    result = suite.runpytest("-q")
    result.assert_outcomes(failed=1, passed=1)
    result.stdout.fnmatch_lines(
        [
            "there is no golden *.golden: look at what the test does, and record it: pytest"
            " 'test_it.py::test_a[[]300]' --vbus-golden=update"
        ]
    )
    assert not (suite.path / FILE).exists()


def test_a_golden_is_recorded_by_the_option_and_compared_from_then_on(
    suite: pytest.Pytester,
) -> None:
    suite.makepyfile(test_it=MOVE)
    recorded = suite.runpytest("-q", "--vbus-golden=update")
    recorded.assert_outcomes(passed=2)
    named = str(suite.path / FILE).replace("[", "[[]")
    recorded.stdout.fnmatch_lines(["*= vbus: goldens written =*", named])
    table = tomllib.loads((suite.path / FILE).read_text())
    assert table["host"][3] == "x LFIL kp=300 kd=2000 ds=1 samples"
    assert table["axes"]["x.1"]["model"] == "dc_motor 1"
    assert abs(table["axes"]["x.1"]["final"] - 50) < 3
    again = suite.runpytest("-q")
    again.assert_outcomes(passed=2)
    assert "goldens written" not in again.stdout.str()
    suite.makepyfile(test_it=MOVE.replace("kp=kp", "kp=50"))
    result = suite.runpytest("-q")
    result.assert_outcomes(failed=1, passed=1)
    result.stdout.fnmatch_lines(
        [
            "it is not as in *",
            "  the host does something else:",
            "    -x LFIL kp=300 kd=2000 ds=1 samples",
            "    +x LFIL kp=50 kd=2000 ds=1 samples",
            "  motor: x.1: peak error",
            "    golden: *",
            "if this is right: pytest 'test_it.py::test_a[[]300]' --vbus-golden=update",
            'board "lm629n-8" at *',
        ]
    )


def test_a_better_motor_model_is_told_as_such(
    suite: pytest.Pytester, monkeypatch: pytest.MonkeyPatch
) -> None:
    suite.makepyfile(test_it=MOVE)
    suite.runpytest("-q", "--vbus-golden=update").assert_outcomes(passed=2)
    golden = suite.path / FILE
    golden.write_text(golden.read_text().replace("final = ", "final = 1"))
    monkeypatch.setattr(DcMotor, "MODEL", 2)
    result = suite.runpytest("-q")
    result.assert_outcomes(failed=1, passed=1)
    result.stdout.fnmatch_lines(["*was recorded with dc_motor 1, this is dc_motor 2: *"])


@pytest.mark.parametrize("how", ["marker", "project"])
def test_marker_and_project_say_how_near_is_near_enough(suite: pytest.Pytester, how: str) -> None:
    suite.makepyfile(test_it=MOVE)
    suite.runpytest("-q", "--vbus-golden=update").assert_outcomes(passed=2)
    golden = suite.path / FILE
    golden.write_text(golden.read_text().replace("cycles = ", "cycles = 1 # "))
    suite.runpytest("-q").assert_outcomes(failed=1, passed=1)
    if how == "project":
        suite.makepyprojecttoml('[tool.vbus.golden]\ncycles = "99999 %"\n')
    else:
        mark = 'pytestmark = pytest.mark.vbus(golden={"cycles": "99999 %"})\n'
        suite.makepyfile(test_it=MOVE.replace("import pytest\n", f"import pytest\n{mark}"))
    suite.runpytest("-q").assert_outcomes(passed=2)


def test_a_mark_of_a_golden_without_its_fixture_fails(suite: pytest.Pytester) -> None:
    mark = 'import pytest\n\n@pytest.mark.vbus(golden={"cycles": "5 %"})\n'
    suite.makepyfile(test_it=mark + "def test_it(vbus_lm629): pass\n")
    result = suite.runpytest("-q")
    result.assert_outcomes(failed=1)
    result.stdout.fnmatch_lines(
        ["*its mark says golden=..., and the test takes no vbus_golden: nothing is compared"]
    )


@pytest.mark.parametrize(
    ("body", "sentence"),
    [
        ("vbus_golden", "vbus_golden: the test has no board; take a chip's fixture, or vbus_board"),
        ("vbus_golden, vbus_board: vbus_board.axes['x.1'].__setattr__('_next', 7)",
         "vbus_golden: what the test did to its board past hosts, clock and faults is in no*"),
    ],
)  # fmt: skip
def test_what_cannot_be_compared_fails_in_words(
    suite: pytest.Pytester, body: str, sentence: str
) -> None:
    arguments, _, work = body.partition(": ")
    advance = "; vbus_board.run_for(10**10)" if work else ""
    suite.makepyfile(test_it=f"def test_it({arguments}): {work or 'pass'}{advance}\n")
    result = suite.runpytest("-q")
    result.assert_outcomes(failed=1)
    result.stdout.fnmatch_lines([sentence])


def test_a_board_in_real_time_has_no_golden(suite: pytest.Pytester) -> None:
    suite.makepyfile(
        "import pytest\n@pytest.mark.vbus(rate=1)\ndef test_it(vbus_board, vbus_golden): pass\n"
    )
    result = suite.runpytest("-q")
    result.stdout.fnmatch_lines(["vbus_golden: a board in real time is at another instant in ev*"])


def test_a_test_that_fails_or_breaks_the_datasheet_is_not_compared(suite: pytest.Pytester) -> None:
    suite.makepyfile(
        "def test_fails(vbus_board, vbus_golden): assert False\n"
        "def test_breaks(vbus_lm629, vbus_golden):\n"
        "    vbus_lm629.bus.write(0, 2); vbus_lm629.bus.write(0, 2)\n"
    )
    result = suite.runpytest("-q", "--vbus-golden=update")
    result.assert_outcomes(failed=2)
    assert not list(suite.path.rglob("*.golden"))


# -- goldens of no test ---------------------------------------------------------------------------


@pytest.mark.parametrize("options", [[], ["-n2"]], ids=["alone", "workers"])
def test_a_golden_of_no_test_fails_a_run_of_the_whole_module(
    suite: pytest.Pytester, options: list[str]
) -> None:
    suite.makepyfile(test_it=MOVE)
    run = suite.runpytest_subprocess
    recorded = run("-q", "--vbus-golden=update", *options)
    recorded.assert_outcomes(passed=2)
    recorded.stdout.fnmatch_lines(["*= vbus: goldens written =*", "*/test_it/test_a*.golden"])
    left = [suite.path / "test_it" / "test_old.golden", suite.path / "test_gone" / "test_a.golden"]
    left[1].parent.mkdir()
    for file in left:
        file.write_text("")
    result = run("-q", *options)
    result.assert_outcomes(passed=2)
    assert result.ret == 1
    result.stdout.fnmatch_lines(
        [
            "*= vbus: goldens that no test uses =*",
            "*test_gone/test_a.golden: --vbus-golden=update removes it",
            "*test_it/test_old.golden: --vbus-golden=update removes it",
        ]
    )
    if not options:
        for narrow in (["test_it.py::test_b"], ["--lf"]):
            assert run("-q", *narrow).ret == 0
    result = run("-q", "--vbus-golden=update", *options)
    result.stdout.fnmatch_lines(["*test_it/test_old.golden: removed"])
    assert result.ret == 0
    assert [file.name for file in suite.path.rglob("*.golden")] == ["test_a[300].golden"]


def test_tests_that_are_left_out_keep_their_goldens(suite: pytest.Pytester) -> None:
    suite.makepyfile(test_it=MOVE)
    suite.runpytest("-q", "--vbus-golden=update").assert_outcomes(passed=2)
    assert suite.runpytest("-q", "-k", "test_b").ret == 0
    assert (suite.path / FILE).exists()


def test_names_that_are_no_file_names_stay_apart(suite: pytest.Pytester) -> None:
    suite.makepyfile(
        test_it="import pytest\nclass TestIt:\n"
        "    @pytest.mark.parametrize('what', ['a/b', 'a b', 'ab'])\n"
        "    def test_a(self, vbus_board, vbus_golden, what): pass\n"
    )
    suite.runpytest("-q", "--vbus-golden=update").assert_outcomes(passed=3)
    names = sorted(file.name for file in suite.path.rglob("*.golden"))
    assert names[-1] == "TestIt.test_a[ab].golden"
    assert [name[:19] for name in names[:2]] == ["TestIt.test_a[a_b]-"] * 2
    suite.runpytest("-q").assert_outcomes(passed=3)
