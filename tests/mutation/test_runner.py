"""The runner itself, on a package of a few lines: it tells killed from survived."""

import json
import os
import re
import shutil
import subprocess
import sys
import textwrap
from collections import Counter
from collections.abc import Sequence
from pathlib import Path

import pytest

from tests.mutation import finder, trial
from tests.mutation.choose import choose
from tests.mutation.cover import Map, Measured
from tests.mutation.mutants import (
    QUOTAS,
    Mutant,
    first,
    folder,
    mutants,
    mutated,
    one_per_site,
    sample,
)
from tests.mutation.records import (
    Entry,
    Result,
    judge,
    over_budget,
    read_budget,
    read_kept,
    read_results,
    stale,
    without_verdict,
    write_budget,
)
from tests.mutation.unobservable import same_by_construction

RUN = Path(__file__).with_name("run.py")

ALL = ("--only", "toy", "--sample", "1000")

CODE = """\
import os



def half(value):
    return value // 2


UP = 5
FIRST = {3: half(14)}[3]


def double(value):
    return value * 2


def forgotten(value):
    return value * 3


def unseen(value):
    return value * 4


def wait():
    done = True
    while not done:
        pass


def stop():
    if False:
        os.abort()
"""

TESTS = """\
from toy.code import FIRST, UP, double, forgotten, stop, wait


def test_double():
    assert double(5) == 10


def test_forgotten():
    forgotten(5)


def test_values():
    assert (FIRST, UP) == (7, 5)


def test_wait():
    wait()


def test_stop():
    stop()


def test_broken():
    assert False
"""


@pytest.fixture(scope="module")
def toy(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A package, its tests, its coverage map and the results of all mutants."""
    root = tmp_path_factory.mktemp("toy")
    (root / "toy").mkdir()
    (root / "toy" / "__init__.py").touch()
    (root / "toy" / "code.py").write_text(CODE)
    (root / "checks").mkdir()
    (root / "checks" / "test_toy.py").write_text(TESTS)
    (root / "pytest.ini").touch()
    mapped = run(root, "map", "checks")
    assert "not used, it does not pass: checks/test_toy.py::test_broken" in mapped.stdout
    run(root, "run", *ALL, "--least", "1", "--jobs", "1")
    return root


def run(root: Path, *words: str) -> subprocess.CompletedProcess[str]:
    options = ("--root", str(root), "--package", "toy", "--lists", str(root))
    return subprocess.run(
        [sys.executable, RUN, *options, *words], capture_output=True, text=True, check=False
    )


def results(root: Path) -> dict[str, set[tuple[str, str]]]:
    """Return what became of the mutants of each scope."""
    by_id = {mutant.id: mutant for mutant in mutants(root, "toy/code.py", breaks=True)}
    found: dict[str, set[tuple[str, str]]] = {}
    for result in read_results(root / "build" / "mutation" / "results.jsonl").values():
        found.setdefault(by_id[result.id].scope, set()).add((result.verdict, result.by))
    return found


def test_killed_survived_hanging_crashed_and_not_importable_are_told_apart(toy: Path) -> None:
    tests = "checks/test_toy.py::test_"
    assert results(toy) == {
        "half": {("killed", f"{tests}values")},
        "UP": {("killed", f"{tests}values")},
        "FIRST": {("killed", f"{tests}values"), ("killed", "collection")},
        "double": {("killed", f"{tests}double")},
        "forgotten": {("survived", "")},
        "unseen": {("unreached", "")},
        "wait": {("timeout", "")},
        "stop": {("killed", "SIGABRT"), ("survived", "")},
    }


@pytest.mark.parametrize(
    ("program", "ends"), [("n = 0\nwhile n < 5_000_000: n += 1", True), ("input()", False)]
)
def test_a_child_that_waits_is_given_up_and_not_one_that_works(
    monkeypatch: pytest.MonkeyPatch, program: str, ends: bool
) -> None:
    monkeypatch.setattr(trial, "LOOK", 0.01)
    command = [sys.executable, "-c", program]
    with subprocess.Popen(command, stdin=subprocess.PIPE, start_new_session=True) as child:
        assert trial._ends(child.pid, 0.1) == ends


def test_only_tests_that_execute_the_line_are_chosen(toy: Path) -> None:
    by_id = {mutant.id: mutant for mutant in mutants(toy, "toy/code.py", breaks=True)}
    counts = {
        by_id[result.id].scope: result.tests
        for result in read_results(toy / "build" / "mutation" / "results.jsonl").values()
    }
    assert (counts["double"], counts["forgotten"], counts["unseen"]) == (1, 1, 0)


TABLES = """\
_SMALL = (
    Row("ONE", 1,
        title="first"),
    Row("TWO", 2,
        title="second"),
)
ROWS = _SMALL
"""
READERS = """\
@pytest.mark.parametrize("name", ["ONE", "TWO"])
def test_rows(name):
    assert toy.ROWS[name]


def test_other():
    pass
"""


def test_of_a_table_the_case_of_its_row_comes_first_and_what_is_made_of_it_is_looked_for(
    tmp_path: Path,
) -> None:
    (tmp_path / "toy").mkdir()
    (tmp_path / "toy" / "code.py").write_text(TABLES)
    (tmp_path / "test_toy.py").write_text(READERS)
    names = [f"test_toy.py::test_{name}" for name in ("rows[ONE]", "rows[TWO]", "other")]
    found = Map({name: Measured(0.01, False, {}) for name in names})
    rows = {it.line: it for it in mutants(tmp_path, "toy/code.py") if it.scope == "_SMALL"}
    assert choose(tmp_path, found, rows[2], 40.0) == [names[0], names[1]]
    assert choose(tmp_path, found, rows[4], 40.0) == [names[1], names[0]]


def test_no_file_is_touched_and_what_is_done_is_not_done_again(toy: Path) -> None:
    assert (toy / "toy" / "code.py").read_text() == CODE
    again = run(toy, "run", *ALL, "--jobs", "1")
    assert ", 0 to try" in again.stdout


def test_verdicts_that_are_kept_do_without_the_folder_until_their_function_changes(
    toy: Path, tmp_path: Path
) -> None:
    copy = tmp_path / "toy"
    shutil.copytree(toy, copy)
    kept = run(copy, "keep", *ALL)
    assert re.fullmatch(r"(\d+) verdicts in .*/results.txt\n", kept.stdout), kept.stderr
    results = copy / "build" / "mutation" / "results.jsonl"
    results.unlink()
    run(copy, "run", *ALL, "--jobs", "1")
    scopes = {mutant.id: mutant.scope for mutant in mutants(copy, "toy/code.py", breaks=True)}
    # That no test gets to a mutant is of the map, which each developer makes: it is not kept.
    assert {scopes[it] for it in read_results(results)} == {"unseen"}
    assert ", 0 to try" in run(copy, "run", *ALL, "--jobs", "1").stdout
    assert run(copy, "report", *ALL).stdout.startswith(run(toy, "report", *ALL).stdout[:200])
    code = copy / "toy" / "code.py"
    code.write_text(CODE.replace("return value * 2", "return value * (1 + 1)"))
    again = run(copy, "run", *ALL, "--jobs", "1")
    tried = {mutant.id: mutant.scope for mutant in mutants(copy, "toy/code.py", breaks=True)}
    assert ", 0 to try" not in again.stdout
    assert {tried[it] for it in read_results(results)} == {"double", "unseen"}


def git(root: Path, *words: str) -> None:
    subprocess.run(["git", "-c", "user.name=a", "-c", "user.email=a@b.c", *words], cwd=root,
                   check=True, capture_output=True)  # fmt: skip


def test_a_verdict_remembers_its_test_and_is_void_once_that_has_changed(
    toy: Path, tmp_path: Path
) -> None:
    root = tmp_path / "toy"
    shutil.copytree(toy, root)
    run(root, "keep", *ALL)
    git(root, "init", "-q")
    git(root, "add", ".")
    git(root, "commit", "-qm", "as it was")
    kept = root / "results.txt"
    by = {it.by for it in read_kept(kept).values() if it.scope == "double"}
    assert by == {"checks/test_toy.py::test_double"}
    assert stale(root, read_kept(kept).values()) == {}
    assert run(root, "stale", "--since", "HEAD").stdout.endswith(
        "0 verdicts are void; `run --since HEAD` tries them again\n"
    )
    shutil.rmtree(root / "build")  # no map, as on a developer's machine
    tests = root / "checks" / "test_toy.py"
    tests.write_text(TESTS.replace("double(5) == 10", "True"))
    void = run(root, "stale", "--since", "HEAD")
    assert void.returncode == 1
    assert "toy/code.py: double: the test has changed: checks/test_toy.py::test_double" in (
        void.stdout
    )
    tests.write_text(TESTS.replace("double(5) == 10", "double(5) == 5 + 5"))
    again = run(root, "run", *ALL, "--since", "HEAD", "--jobs", "1")
    assert "killed" in again.stdout, again.stdout + again.stderr
    assert "survived" not in again.stdout
    tests.write_text(TESTS.replace("double(5) == 10", "double"))
    weak = run(root, "run", *ALL, "--since", "HEAD", "--jobs", "1")
    assert "toy/code.py:14: run `map` first" in weak.stdout


def test_a_room_may_not_have_more_mutants_without_a_verdict_than_it_had(tmp_path: Path) -> None:
    budget = tmp_path / "stale.toml"
    write_budget(budget, {"vbus/plant": 40, "vbus/glue": 0})
    assert read_budget(budget) == {"vbus/plant": 40}
    write_budget(budget, {"vbus/plant": 50, "vbus/glue": 7})
    assert read_budget(budget) == {"vbus/plant": 40}, "it only falls"
    slack = {name: QUOTAS[name] // 10 for name in ("vbus/plant", "vbus/glue")}
    most = {"vbus/plant": 40 + slack["vbus/plant"], "vbus/glue": slack["vbus/glue"]}
    assert over_budget(most, read_budget(budget)) == []
    may, quota = most["vbus/glue"], QUOTAS["vbus/glue"]
    assert over_budget({"vbus/plant": 0, "vbus/glue": may + 1}, {}) == [
        f"vbus/glue: {may + 1} of {quota} mutants have no verdict of the code as it is, "
        f"{may} may be"
    ]
    kept = [Result(str(i), "d", "killed", "", 0, 0.0, "", "vbus/glue/a.py", "f") for i in range(9)]
    assert without_verdict(kept, ["3"])["vbus/glue"] == QUOTAS["vbus/glue"] - 8


def test_the_report_fails_as_long_as_a_survivor_is_not_listed(toy: Path) -> None:
    report = run(toy, "report", *ALL, "--entries")
    assert report.returncode == 1
    assert "- return value * 3" in report.stdout
    entries = report.stdout[report.stdout.index("[[mutant]]") : report.stdout.rindex('reason = ""')]
    text = entries + 'reason = ""\n'
    (toy / "survivors.toml").write_text(text)
    assert "is listed without a reason" in run(toy, "report", *ALL).stdout
    (toy / "survivors.toml").write_text(text.replace('reason = ""', 'reason = "a toy"'))
    *_, last, complaint = run(toy, "report", *ALL).stdout.splitlines()
    assert (last, complaint) == ("", "all elsewhere: less than 90% are killed")


def test_the_gate_fails_when_a_mutant_survives_or_is_gone(toy: Path) -> None:
    assert run(toy, "gate", "--renew").returncode == 0
    passed = run(toy, "gate", "--jobs", "1")
    assert passed.returncode == 0, passed.stdout + passed.stderr
    code, tests = toy / "toy" / "code.py", toy / "checks" / "test_toy.py"
    try:
        tests.write_text(TESTS.replace("assert double(5) == 10", "double(5)"))
        failed = run(toy, "gate", "--jobs", "1")
        assert failed.returncode == 1
        assert "survives: " in failed.stdout
        assert "- return value * 2" in failed.stdout
        tests.write_text(TESTS.replace("test_double", "test_twice"))
        assert "missing checks/test_toy.py::test_double" in run(toy, "gate").stderr
        tests.write_text(TESTS)
        code.write_text(CODE.replace("value * 2", "2 * value"))
        failed = run(toy, "gate", "--jobs", "1")
        assert failed.returncode == 1
        assert "no longer applies: " in failed.stdout
    finally:
        code.write_text(CODE)
        tests.write_text(TESTS)


def test_a_folder_that_is_measured_takes_nothing_from_one_with_a_longer_name(toy: Path) -> None:
    path = toy / "build" / "mutation" / "map.json"
    before = path.read_text()
    (toy / "check").mkdir()
    (toy / "check" / "test_one.py").write_text("def test_one(): pass\n")
    try:
        run(toy, "map", "check")
        there = {*json.loads(before)["tests"], "check/test_one.py::test_one"}
        assert Map.load(path).tests.keys() == there
    finally:
        path.write_text(before)
        shutil.rmtree(toy / "check")


def test_a_killer_that_fails_without_a_mutant_makes_its_verdicts_void(
    toy: Path, tmp_path: Path
) -> None:
    killer = "checks/test_toy.py::test_double"
    tests = toy / "checks" / "test_toy.py"
    own = tmp_path / "results.jsonl"
    known = (toy / "build" / "mutation" / "results.jsonl").read_text().splitlines(keepends=True)
    own.write_text("".join(line for line in known if killer not in line))
    try:
        tests.write_text(TESTS.replace("double(5) == 10", "double(5) == 110"))
        done = run(toy, "--results", str(own), "run", *ALL)
    finally:
        tests.write_text(TESTS)
    assert done.returncode == 1
    assert killer in done.stdout
    assert killer in done.stderr
    assert killer not in {it.by for it in read_results(own).values()}


def test_a_process_that_a_test_starts_has_the_mutant_too(tmp_path: Path) -> None:
    place = tmp_path / "toy" / "code.py"
    place.parent.mkdir()
    place.write_text("UP = 5\n")
    (tmp_path / "mutant").write_text("UP = 6\n")
    root = RUN.parents[2]
    paths = {"PYTHONPATH": os.pathsep.join((str(tmp_path), str(root), finder.SITE)),
             "PYTEST_DISABLE_PLUGIN_AUTOLOAD": "1"}  # fmt: skip
    names = os.pathsep.join((str(place), "toy/code.py", str(tmp_path / "mutant")))
    say = "from toy import code; print(code.UP, code.__file__)"
    # A suite whose plug-in it is: pytest would rewrite that itself.
    run = "import pytest; pytest.main(['--co', '-q', '-p', 'toy.code', 'toy']); "
    for before in ("", run):
        ask = [sys.executable, "-c", before + say]
        for env, up in (({}, 5), ({finder.MUTATED: names}, 6)):
            done = subprocess.run(
                ask, cwd=tmp_path, env=paths | env, capture_output=True, text=True, check=True
            )
            assert done.stdout.splitlines()[-1] == f"{up} {place}"


# -- which mutants there are ----------------------------------------------------------------------


def of(tmp_path: Path, source: str) -> list[Mutant]:
    (tmp_path / "toy").mkdir(exist_ok=True)
    (tmp_path / "toy" / "code.py").write_text(textwrap.dedent(source))
    return mutants(tmp_path, "toy/code.py")


def lines(found: Sequence[Mutant]) -> set[int]:
    return {mutant.line for mutant in found}


def test_what_nobody_can_observe_is_left_out(tmp_path: Path) -> None:
    found = of(
        tmp_path,
        '''\
        """A text with 1 + 1."""
        from collections.abc import Callable
        from dataclasses import dataclass
        from functools import cache
        from typing import TYPE_CHECKING, ClassVar, cast
        Number = int | float
        Report = Callable[[int | None], None]
        if TYPE_CHECKING:
            X = 1
        class A:
            __slots__ = ("a", "b")
            a: int | None
            b: "ClassVar[int | None]"
            def f(self, x: int | None) -> int | None:
                return cast(int | None, x)
            @cache
            def g(self):
                pass
        ''',
    )
    assert lines(found) == set()


def test_tables_defaults_and_decorators_are_mutated(tmp_path: Path) -> None:
    found = of(
        tmp_path,
        """\
        KP = 0x61
        BOTH = KP | 2
        class A:
            TABLE: "dict[int, int]" = {
                3: 4,
            }
            @property
            def f(self, x: int = 7) -> int:
                return x
        """,
    )
    assert lines(found) == {1, 2, 5, 7, 8}
    assert {mutant.scope for mutant in found} == {"KP", "BOTH", "A.TABLE", "A.f"}
    assert not any(mutant.runs for mutant in found)


def test_the_frozen_of_a_dataclass_is_left_out_and_its_order_is_not(tmp_path: Path) -> None:
    found = of(
        tmp_path,
        """\
        @dataclass(frozen=True, slots=True)
        class A: ...
        @dataclass(frozen=True, order=True)
        class B: ...
        class C(B, frozen=True): ...
        """,
    )
    assert [mutant.scope for mutant in found if "True" in mutant.operator] == ["B"]


def test_is_and_equal_are_taken_as_the_same(tmp_path: Path) -> None:
    assert same_by_construction("ReplaceComparisonOperator_Eq_Is")
    assert not same_by_construction("ReplaceComparisonOperator_Eq_IsNot")
    found = of(tmp_path, "def f(a, b):\n    return a == b\n")
    assert {mutant.operator.rpartition("_")[2] for mutant in found} == {
        "NotEq", "Lt", "LtE", "Gt", "GtE", "IsNot",
    }  # fmt: skip


def test_the_digest_is_of_the_code_and_of_no_comment_docstring_or_layout(tmp_path: Path) -> None:
    source = 'X = 1\n"""One."""\n\ndef f(a):\n    """Add."""\n    return a + 1\n'
    digests = [mutant.digest for mutant in of(tmp_path, source)]
    for old, new in (
        ("Add", "Add one"), ("One", "1"), ("1\n", "1  # a number\n"), ("(a)", "(\n    a\n)"),
        ("    return", "    # one more\n    return"),
    ):  # fmt: skip
        assert [it.digest for it in of(tmp_path, source.replace(old, new))] == digests, new
    changed = [it.digest for it in of(tmp_path, source.replace("a + 1", "1 + a"))]
    assert changed[: digests.index(digests[-1])] == digests[: digests.index(digests[-1])]
    assert not {*changed} >= {*digests}


def test_a_mutant_keeps_its_name_when_something_else_is_edited(tmp_path: Path) -> None:
    plain = of(tmp_path, CODE)
    edited = CODE.replace("UP = 5", "UP = 9\nMORE = 3").replace("value * 3", "value * 33")
    moved = of(tmp_path, edited)
    lost = {mutant.scope for mutant in plain if mutant.id not in {it.id for it in moved}}
    assert lost == {"UP", "forgotten"}


def test_two_equal_lines_of_a_function_are_two_mutants_and_of_another_function_others(
    tmp_path: Path,
) -> None:
    found = of(tmp_path, "def f():\n    a = 1\n    a = 1\n\ndef g():\n    a = 1\n")
    assert len({mutant.id for mutant in found}) == 6


def test_a_sample_has_one_mutant_of_a_site_and_takes_no_notice_of_new_code(
    tmp_path: Path,
) -> None:
    of(tmp_path, CODE)
    few = first(tmp_path, ["toy/code.py"], 5, "")
    assert len(few) == 5
    every = first(tmp_path, ["toy/code.py"], 1000, "")
    assert len(every) == len({mutant.rank.partition("/")[0] for mutant in every})
    new = of(tmp_path, CODE + "\ndef added():\n    return 1\n")
    assert {mutant.id for mutant in every if mutant.operator != "Forget"} < {
        mutant.id for mutant in one_per_site(new)
    }
    assert few != first(tmp_path, ["toy/code.py"], 5, "another")


def test_a_sample_takes_its_share_of_each_folder(tmp_path: Path) -> None:
    for name in ("vbus/chips/lm628", "vbus/chips", "vbus/core/kernel", "vbus/native"):
        (tmp_path / name).mkdir(parents=True, exist_ok=True)
        rows = "".join(f"V{i} = {i}\n" for i in range(50))
        (tmp_path / name / "one.py").write_text(rows)
    found = sample(tmp_path, 300, "")
    assert Counter(folder(mutant.file) for mutant in found) == {
        "vbus/chips/lm628": QUOTAS["vbus/chips/lm628"] // 10,
        "vbus/chips": QUOTAS["vbus/chips"] // 10,
        "vbus/core/kernel": QUOTAS["vbus/core/kernel"] // 10,
    }


def test_one_mutant_of_five_is_a_statement_left_out(tmp_path: Path) -> None:
    rows = "".join(f"    a.b = {i}\n" for i in range(50))
    of(tmp_path, f"def f(a):\n{rows}")
    found = first(tmp_path, ["toy/code.py"], 20, "")
    assert Counter(mutant.operator for mutant in found)["Forget"] == 4
    assert len(found) == 20
    assert mutated(tmp_path, found[0]).count("    pass\n") == 1


def test_the_sample_is_as_large_as_it_has_to_be() -> None:
    assert sum(QUOTAS.values()) >= 3000
    assert sum(share for name, share in QUOTAS.items() if name.startswith("vbus/chips")) >= 1200


def test_a_mutant_that_does_not_compile_is_none(tmp_path: Path) -> None:
    (star,) = {mutant.id: mutant for mutant in of(tmp_path, "def f(a, *, b): ...\n")
               if mutant.operator.endswith("Mul_Add")}.values()  # fmt: skip
    assert mutated(tmp_path, star) == ""


# -- the report -----------------------------------------------------------------------------------

MUTANT = Mutant("1", "a.py", "f", 3, (3, 3), True, "NumberReplacer", 0, "x/y", "d")


def verdict(name: str, digest: str = "d") -> dict[str, Result]:
    return {"1": Result("1", digest, name, "", 1, 0.1)}


def listed(reason: str, number: str = "1") -> list[Entry]:
    return [Entry(number, "a.py", "f", "1", "2", reason)]


@pytest.mark.parametrize(
    ("results", "entries", "problems"),
    [
        (verdict("killed"), [], []),
        (verdict("timeout"), [], []),
        (verdict("survived"), listed("so"), []),
        (verdict("survived"), [], ["1 mutants survive and are not listed"]),
        (verdict("unreached"), [], ["no test of the map gets to 1 mutants"]),
        (verdict("survived"), listed(""), ["a.py: 1 is listed without a reason"]),
        (verdict("killed"), listed("so"), ["a.py:3: 1 is listed, but killed"]),
        (verdict("killed"), listed("so", "2"), ["a.py: 2 is listed, but is not in the sample"]),
        (verdict("killed", "e"), [], ["1 of 1 mutants have not been tried as they are now"]),
        ({}, [], ["1 of 1 mutants have not been tried as they are now"]),
    ],
)
def test_what_the_report_complains_of(
    results: dict[str, Result], entries: list[Entry], problems: list[str]
) -> None:
    assert judge(Path(), [MUTANT], results, entries)[1] == problems
