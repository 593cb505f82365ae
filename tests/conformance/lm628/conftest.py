"""Fixtures: a chip on a bench, reached by whole bus cycles and by strobes."""

from collections.abc import Callable, Iterator

import pytest

from tests.conformance.lm628.bench import Bench

MakeBench = Callable[..., Bench]


@pytest.fixture(params=["cycle", "strobe"])
def mode(request: pytest.FixtureRequest) -> str:
    return request.param


@pytest.fixture
def make(mode: str) -> Iterator[MakeBench]:
    """Make benches; at the end no cycle of theirs may have broken an AC limit of the bus."""
    benches: list[Bench] = []

    def build(**settings) -> Bench:
        benches.append(Bench(mode, **settings))
        return benches[-1]

    yield build
    for bench in benches:
        bench.chip.advance()
        assert bench.ac_rules() == [], "the bench moves its strobes at legal times"


@pytest.fixture
def bench(make: MakeBench) -> Bench:
    """An LM628N-8 at 8 MHz, reset done at instant 0, without mechanics."""
    return make()
