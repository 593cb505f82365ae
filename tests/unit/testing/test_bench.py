"""The boards of one test."""

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from vbus.campaign.account import Account
from vbus.campaign.verdict import SLOW, judge
from vbus.campaign.world import PHASE, World
from vbus.core.errors import ConfigError
from vbus.core.kernel import US
from vbus.testing.bench import _NO_VARIANT, Bench
from vbus.testing.boards import Variant, of_part
from vbus.testing.execute import Execute
from vbus.testing.judge import Judge
from vbus.testing.limits import BUDGET, UNBOUNDED, HostStuck, Limits
from vbus.testing.plugins.acceptance import Acceptance, Acceptances
from vbus.views.findings.suppress import Suppression


def bench(budget: Limits | None = None, **keywords: Any) -> Bench:
    return Bench("test", keywords, [Path.cwd()], Path.cwd, judge=Judge(budget=budget or Limits()))


def test_the_chips_are_ahead_by_as_much_as_the_world_says() -> None:
    later = Bench("t", {}, [], Path.cwd, variant=Variant(world=World(PHASE, "+64us", "of 341us")))
    assert later.main("LM629N-8").board.now == 64 * US
    later.close()


def test_a_run_of_a_campaign_has_no_journal() -> None:
    for witnessed in (False, True):
        made = Bench("t", {}, [], Path.cwd, witnessed=witnessed)
        assert bool(made.main("LM629N-8").journal()) == (not witnessed)
        made.close()


def test_a_program_that_wall_time_has_ended_has_no_verdict_in_a_campaign(tmp_path: Path) -> None:
    program = tmp_path / "host.py"
    program.write_text("import time\ntime.sleep(600)\n")
    slow = Bench("t", {}, [tmp_path], lambda: tmp_path, witnessed=True)
    done = Execute(slow)(program, timeout=0.1)
    assert done.slow
    assert done.stuck.startswith("it was not done after 0.1 s of wall time; by then it had made 0")
    account = slow.account()
    assert account is not None
    assert (account.slow, account.stuck) == (True, done.stuck)
    assert judge(Account(), account).verdict == SLOW
    slow.close()


@pytest.fixture
def plain() -> Iterator[Bench]:
    made = bench()
    yield made
    made.close()


def test_the_board_that_a_test_names_comes_before_that_of_its_fixture(plain: Bench) -> None:
    named = bench(board="LM628N-6")
    assert [chip.part for chip in named.main("LM629N-8").board.chips] == ["LM628N-6"]
    named.close()
    assert [chip.part for chip in plain.main("LM629N-8").board.chips] == ["LM629N-8"]


def test_one_more_board_takes_no_keyword_that_is_none(plain: Bench) -> None:
    with pytest.raises(ConfigError, match=r"unknown keyword 'bord'; did you mean \"board\"\?"):
        plain.make("LM629N-8", bord=1)


def test_a_host_that_was_ended_may_put_its_machine_in_order_when_its_test_is_over() -> None:
    hung = bench(Limits(cycles=5))
    bus = hung.chip("LM629N-8").bus
    for _ in range(5):
        bus.read(0)
    with pytest.raises(HostStuck):
        bus.read(0)
    with pytest.raises(HostStuck):
        bus.read(0)
    hung.relent()
    bus.read(0)
    hung.close()


@pytest.mark.parametrize(
    ("scope", "test", "of_function"),
    [
        ("t.py::TestA::test_b", "t.py::TestA::test_b", True),
        ("t.py::TestA::test_b", "t.py::TestA::test_b[1]", True),
        ("t.py::TestA", "t.py::TestA::test_b", False),
        ("t.py", "t.py::TestA::test_b", False),
    ],
)
def test_what_a_function_accepts_is_told_from_what_its_class_does(
    scope: str, test: str, of_function: bool
) -> None:
    accepted = Acceptance(scope, Suppression("lm628", "", "known"), {test})
    assert accepted.of_function == of_function


def test_what_a_worker_has_needed_counts_with_what_others_have(
    pytestconfig: pytest.Config,
) -> None:
    """Workers of pytest-xdist say what each has seen of one acceptance."""
    whole, *workers = (Acceptances(pytestconfig) for _ in range(3))
    for number, worker in enumerate(workers):
        one = worker._add("t.py", Suppression("lm628", "", "known"))
        one.tests.add(f"t.py::test_{number}")
        one.suppression.used = number
        whole.update(worker)
    (merged,) = whole._all.values()
    assert merged.tests == {"t.py::test_0", "t.py::test_1"}
    assert not merged.needless(merged.tests)


def test_a_failing_test_is_told_how_to_run_it_again() -> None:
    of_both: dict[str, Any] = {"seed": 7, "strict": True}
    for again, settings in (("", {}), (" --vbus-seed=7 --vbus-strict", of_both)):
        failing = Bench("t.py::test_it", {}, [Path.cwd()], Path.cwd, **settings)
        assert failing.failure_report().lines == [f"again:   pytest t.py::test_it{again}"]
        failing.close()


def test_chip_time_is_no_bound_where_it_passes_by_itself_unless_the_test_says_so() -> None:
    for given, bound in ((BUDGET, UNBOUNDED), (replace(BUDGET, chip_time=5), 5)):
        *_, budget = bench(given)._read("LM629N-8", {"rate": 1.0}, _NO_VARIANT)
        assert budget.chip_time == bound


def test_motors_of_a_part_with_several_axes_are_numbered_from_1() -> None:
    text = of_part("MC1241A")
    assert 'plants = ["motor1", "motor2"]' in text
