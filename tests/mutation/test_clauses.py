"""Which code belongs to a clause, and how it is broken."""

from pathlib import Path

import pytest

from tests.mutation import clauses
from tests.mutation.breaks import BREAKS
from tests.mutation.mutants import Layout, mutants, mutated

ROOT = Path(__file__).parents[2]


@pytest.mark.parametrize(
    ("operator", "before", "after"),
    [
        ("Forget", "    self.x = 1\n", "    pass\n"),
        ("Forget", "    self.x += word\n", "    pass\n"),
        ("Forget", "    self.take(word)\n", "    pass\n"),
        ("Narrow", "    return word & ds.MASK\n", "    return word & ((ds.MASK) >> 1)\n"),
        ("Narrow", "    return 0x7FFF\n", "    return 16383\n"),
        ("FirstOnly", "    for one in self.all:\n", "    for one in [*(self.all)][:1]:\n"),
        ("FirstOnly", "    return sum(a for a in self.all)\n",
         "    return sum(a for a in [*(self.all)][:1])\n"),
    ],
)  # fmt: skip
def test_an_operator_breaks_one_behaviour(
    tmp_path: Path, operator: str, before: str, after: str
) -> None:
    body = "        self.look(one)\n" if before.endswith(":\n") else ""
    (tmp_path / "code.py").write_text(f"def f(self, word):\n{before}{body}")
    found = [it for it in mutants(tmp_path, "code.py", breaks=True) if it.operator == operator]
    changed = [mutated(tmp_path, it) for it in found]
    assert f"def f(self, word):\n{after}{body}" in changed
    assert not {it.operator for it in mutants(tmp_path, "code.py")} & BREAKS.keys()


def test_nothing_is_forgotten_that_only_gives_a_name(tmp_path: Path) -> None:
    (tmp_path / "code.py").write_text("def f(self):\n    x: int = 1\n    y = 2\n    return x + y\n")
    found = mutants(tmp_path, "code.py", breaks=True)
    assert "Forget" not in {it.operator for it in found}


@pytest.mark.parametrize(
    ("text", "names"),
    [
        ("LM-BUS-7", {"LM-BUS-7"}),
        ("bits set stay (PMD-CMD-72, -73)", {"PMD-CMD-72", "PMD-CMD-73"}),
        ("(PMD-INT-1 to -3)", {"PMD-INT-1", "PMD-INT-2", "PMD-INT-3"}),
        ("(PMD-INT-1 to PMD-INT-3)", {"PMD-INT-1", "PMD-INT-2", "PMD-INT-3"}),
        ("(MCP-OUT-1 to 3, 9).", {"MCP-OUT-1", "MCP-OUT-2", "MCP-OUT-3", "MCP-OUT-9"}),
        ("LM-TRJ-8, 16 bits", {"LM-TRJ-8"}),
        ("LM-TRJ-8, LM-TRJ-9", {"LM-TRJ-8", "LM-TRJ-9"}),
        ("MCP-VEL-1 and PMD-TRJ-6", {"MCP-VEL-1", "PMD-TRJ-6"}),
        ("ISO-9001-1", set()),
    ],
)
def test_a_text_names_clauses(text: str, names: set[str]) -> None:
    assert clauses.named(text) == names


@pytest.mark.parametrize(
    ("home", "file", "text", "names"),
    [
        # The hook of two rows.
        ("lm628", "commands.py", "def load_threshold", {"LM-CMD-15", "LM-CMD-16"}),
        # A docstring.
        ("mc1241a", "commands.py", "shared.sensing = bool(on)", {"PMD-CMD-72", "PMD-CMD-73"}),
        # A row of a table.
        ("lm628", "datasheet.py", 'Command("LPES", 0x1A', {"LM-CMD-15"}),
        # Not that of the rows whose option is a "count", as this function is called.
        ("lm628", "encoder.py", "return self._to", {"LM-POS-1", "LM-POS-3"}),
        # A comment at a statement.
        ("mc1241a", "axis.py", 'refused = "acceleration changed in a trap', {"PMD-ERR-1"}),
    ],
)
def test_code_belongs_to_the_clauses_of_the_smallest_place_around_it(
    home: str, file: str, text: str, names: set[str]
) -> None:
    path = f"vbus/chips/{home}/{file}"
    line = next(n for n, it in enumerate(Layout((ROOT / path).read_text()).lines) if text in it)
    place = clauses._smallest(clauses._places(ROOT, home)[path], line)
    assert place is not None
    assert place.clauses == names


def test_a_clause_is_asked_by_tests_of_its_own_alone() -> None:
    tests = clauses.own_tests()
    assert tests["PMD-INT-2"]
    asked = {name for names in tests.values() for name in names}
    assert not asked & set(clauses.RANDOM)
    assert all((ROOT / name.partition("::")[0]).exists() for name in clauses.RANDOM)


@pytest.mark.parametrize(
    ("proof", "failed", "proves"),
    [
        ("a.py::test_x", "a.py::test_x[1-cycle]", True),
        ("a.py::test_x[T2 8 MHz]", "a.py::test_x[cycle-T2 8 MHz]", True),
        ("a.py::test_x[T2 8 MHz]", "a.py::test_x[T3 8 MHz]", False),
        ("a.py::test_x", "a.py::test_xy", False),
    ],
)
def test_a_failed_case_is_a_proof_of_its_function(proof: str, failed: str, proves: bool) -> None:
    assert clauses.proves(proof, failed) is proves
