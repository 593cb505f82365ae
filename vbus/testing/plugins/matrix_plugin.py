"""The part of the pytest plug-in that runs one test over parts, clocks, seeds and specimens."""

from collections.abc import Callable
from itertools import product
from typing import TYPE_CHECKING, Any, Final, cast

import pytest
from _pytest.runner import runtestprotocol

if TYPE_CHECKING:
    from vbus.testing.hostile import Extremes

SCENARIO: pytest.StashKey["Extremes | None"] = pytest.StashKey()
"""The specimen on which the test runs now."""
SEARCHING: pytest.StashKey[bool] = pytest.StashKey()
"""Whether it runs to find out under which extremes it fails; its last run is what counts."""
BOARD: pytest.StashKey[str] = pytest.StashKey()
"""The board file that the test ran on, as text."""
_LISTS: Final = ("part", "clock", "time", "seed")
_TIMES: Final = ("lockstep", "slaved")


def pytest_configure(config: pytest.Config) -> None:
    """Declare the marker."""
    config.addinivalue_line(
        "markers",
        "vbus_matrix(part, clock, time, seed, hostile): run a test once for each of these parts"
        ' ("PART", or "PART @ 6 MHz"), clocks, time policies and seeds; and on so many'
        " specimens that the manual allows",
    )


@pytest.fixture
def vbus_variant(request: pytest.FixtureRequest) -> dict[str, Any]:
    """What is otherwise in this variant of the test; see ``@pytest.mark.vbus_matrix``."""
    found: dict[str, Any] = getattr(request, "param", {})
    return found


def pytest_generate_tests(metafunc: pytest.Metafunc) -> None:
    """Make the variants of a test."""
    said: dict[str, Any] = {}
    for mark in reversed(list(metafunc.definition.iter_markers("vbus_matrix"))):
        if mark.args:
            _refuse(metafunc, "write lists by name, such as seed=[1, 2]")
        said |= mark.kwargs
    if not said:
        return
    if "vbus_variant" not in metafunc.fixturenames:
        _refuse(metafunc, "the test takes no fixture of vbus that has a board")
    hostile = said.pop("hostile", 0)
    if isinstance(hostile, bool) or not isinstance(hostile, int) or hostile < 0:
        _refuse(metafunc, f"hostile = {hostile!r}: write a number of specimens, such as 30")
    for key, values in said.items():
        _check(metafunc, key, values)
    if "clock" in said and any("@" in part for part in said.get("part", ())):
        _refuse(metafunc, 'a part has its clock ("PART @ 6 MHz") or the list of clocks, not both')
    keys = [key for key in _LISTS if key in said]
    variants = [dict(zip(keys, row, strict=True)) for row in product(*(said[k] for k in keys))]
    ids = ["-".join([_short(key, row[key]) for key in keys] or ["hostile"]) for row in variants]
    for row in variants:
        part, at, clock = str(row.get("part", "")).partition("@")
        row |= {"part": part.strip()} if part else {}
        row |= {"clock": clock.strip()} if at else {}
        row |= {"hostile": hostile} if hostile else {}
    metafunc.parametrize("vbus_variant", variants, ids=ids, indirect=True)


def _check(metafunc: pytest.Metafunc, key: str, values: Any) -> None:
    if key not in _LISTS:
        _refuse(metafunc, f"unknown keyword {key!r}; allowed are {', '.join(_LISTS)}, hostile")
    kind = int if key == "seed" else str
    some = isinstance(values, list | tuple | range) and values
    if not some or not all(isinstance(value, kind) for value in values):
        what = "numbers" if key == "seed" else "texts"
        _refuse(metafunc, f"{key} = {values!r}: write a list of {what}")
    for value in values:
        if key == "time" and value not in _TIMES:
            _refuse(metafunc, f"time = {value!r}: allowed are {' and '.join(_TIMES)}")


def _refuse(metafunc: pytest.Metafunc, sentence: str) -> None:
    where = metafunc.definition.nodeid
    pytest.fail(f"{where}: @pytest.mark.vbus_matrix: {sentence}", pytrace=False)


def _short(key: str, value: object) -> str:
    return f"seed{value}" if key == "seed" else str(value).replace(" ", "")


# -- specimens ------------------------------------------------------------------------------------


@pytest.hookimpl(tryfirst=True)
def pytest_runtest_protocol(item: pytest.Item, nextitem: pytest.Item | None) -> bool | None:
    """Look for a specimen under which a test fails; what is reported is its run on that one."""
    variant = getattr(item, "callspec", None)
    hostile = variant.params.get("vbus_variant", {}).get("hostile", 0) if variant else 0
    if not hostile:
        return None
    item.ihook.pytest_runtest_logstart(nodeid=item.nodeid, location=item.location)
    item.stash[SCENARIO] = _weak_on(item, hostile)
    runtestprotocol(item, nextitem=nextitem)
    item.ihook.pytest_runtest_logfinish(nodeid=item.nodeid, location=item.location)
    return True


def _weak_on(item: pytest.Item, examples: int) -> "Extremes | None":
    """Return the specimen with the fewest extremes under which a test fails, if there is one."""
    parent = cast(pytest.Item, item.parent)  # whose fixtures stay from one run to the next
    results: dict[Extremes | None, bool] = {}

    def fails(scenario: "Extremes | None") -> bool:
        if scenario not in results:
            item.stash[SCENARIO] = scenario
            reports = runtestprotocol(item, log=False, nextitem=parent)
            results[scenario] = any(report.failed for report in reports)
        return results[scenario]

    item.stash[SEARCHING] = True
    try:
        return None if fails(None) else _searched(item, fails, examples)
    finally:
        item.stash[SEARCHING] = False


def _searched(
    item: pytest.Item, fails: "Callable[[Extremes | None], bool]", examples: int
) -> "Extremes | None":
    """Try what failed in the last run first, then search, and keep what is found."""
    board = item.stash.get(BOARD, "")
    if not board:  # it was skipped, or has no board after all
        return None
    from vbus.testing.hostile import Extremes, possible, search

    cache = getattr(item.config, "cache", None)
    from hashlib import sha256

    key = f"vbus/hostile/{sha256(item.nodeid.encode()).hexdigest()[:16]}"
    kept = cache.get(key, None) if cache is not None else None
    if kept is not None:
        again = Extremes(tuple(map(tuple, kept["extremes"])), kept["seed"], kept["phase"])
        if possible(board, again) and fails(again):
            return again
    found = search(board, fails, examples)
    if cache is not None and (found is not None or kept is not None):
        value = found and {"extremes": found.extremes, "seed": found.seed, "phase": found.phase}
        cache.set(key, value)
    return found
