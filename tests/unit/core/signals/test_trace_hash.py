"""The trace hash: what it covers, and that it does not depend on when something was told."""

from collections.abc import Callable

import pytest

from vbus.core.signals import TraceHash, Violation

FOUND = Violation(10, "a", "x.rule", "X-1", "error", 3, 5, "text")


def digest(*acts: Callable[[TraceHash], None]) -> str:
    trace = TraceHash(["a", "b"])
    for act in acts:
        act(trace)
    return trace.digest()


def cycle(
    when: int, chip: str = "a", write: bool = True, address: int = 1, data: int = 2, host: str = "h"
) -> Callable[[TraceHash], None]:
    return lambda trace: trace.bus_cycle(when, host, chip, write, address, data)


def edge(when: int, net: str, level: int = 1) -> Callable[[TraceHash], None]:
    return lambda trace: trace.edge(when, net, level)


def found(**parts: int | str) -> Callable[[TraceHash], None]:
    return lambda trace: trace.violation(FOUND._replace(**parts))  # type: ignore[arg-type]


def settled(when: int) -> Callable[[TraceHash], None]:
    return lambda trace: trace.settled(when)


def test_what_lies_at_the_settling_instant_may_still_get_company() -> None:
    """A chip that is first in the board file tells late what it did at that very instant."""
    expected = digest(edge(9, "b.y"), edge(10, "a.x"), cycle(10, "b"))
    late = (edge(9, "b.y"), cycle(10, "b"), settled(10), edge(10, "a.x"), settled(11))
    assert digest(*late) == expected
    assert digest(*late[:-1]) == expected
    # What is older is hashed as it stands, and what comes after it stays behind it.
    trace = TraceHash(["a", "b"])
    for act in (*late[:2], settled(10)):
        act(trace)
    assert len(trace.waiting()) == 1
    trace.settled(11)
    assert not trace.waiting()


def test_records_of_one_instant_stand_in_the_order_of_the_board_file_then_as_they_came() -> None:
    assert digest(cycle(5, "b"), cycle(5, "a")) == digest(cycle(5, "a"), cycle(5, "b"))
    assert digest(edge(5, "a.x"), edge(5, "a.y")) != digest(edge(5, "a.y"), edge(5, "a.x"))
    # A chip that is not in the file comes last.
    assert digest(edge(5, "c.x"), cycle(5, "b")) == digest(cycle(5, "b"), edge(5, "c.x"))
    assert digest(cycle(6), cycle(5, "b")) == digest(cycle(5, "b"), cycle(6))


@pytest.mark.parametrize(
    ("one", "other"),
    [
        (cycle(5), cycle(6)), (cycle(5), cycle(5, "b")), (cycle(5), cycle(5, write=False)),
        (cycle(5), cycle(5, address=2)), (cycle(5), cycle(5, data=3)),
        (edge(5, "a.x"), edge(5, "a.y")), (edge(5, "a.x"), edge(5, "a.x", 0)),
        (found(), found(measured=4)), (found(), found(limit=6)), (found(), found(rule="x.other")),
        (found(), found(chip="b")), (found(), found(when=11)),
    ],
)  # fmt: skip
def test_what_differs_gives_another_hash(
    one: Callable[[TraceHash], None], other: Callable[[TraceHash], None]
) -> None:
    assert digest(one) != digest(other)


@pytest.mark.parametrize(
    "parts",
    [("name", "a", "what", "other"), ("name", "a", "other", "text"), ("name", "b", "what", "text"),
     ("other", "a", "what", "text")],
)  # fmt: skip
def test_all_of_the_evidence_of_a_fault_counts(parts: tuple[str, str, str, str]) -> None:
    assert digest(lambda trace: trace.fault(5, *parts)) != digest(
        lambda trace: trace.fault(5, "name", "a", "what", "text")
    )


def test_who_asked_and_how_a_finding_is_worded_do_not_count() -> None:
    assert digest(cycle(5, host="h")) == digest(cycle(5, host="other"))
    assert digest(found()) == digest(found(detail="other", clause="X-2", severity="note"))
