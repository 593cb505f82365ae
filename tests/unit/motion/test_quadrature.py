"""Driven encoder inputs: filter, 4x decoding, index, limits. Times are in ns."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from vbus.chips.motion.quadrature import (
    ALL_LOW,
    COUNTED,
    INDEX_FELL,
    INDEX_INSIDE,
    INDEX_ROSE,
    SHORT_DWELL,
    SHORT_PULSE,
    SKIPPED,
    InputFilter,
    Quadrature,
)
from vbus.core import state
from vbus.core.kernel import NEVER

CLK = 125
"""Clock period at 8 MHz."""
UP = [(0, 0), (1, 0), (1, 1), (0, 1)]


def lm() -> Quadrature:
    """The LM628's inputs: a state of A and B must last 8 clocks, the index is taken as it is."""
    return Quadrature(8 * CLK, 0, together=True, dwell_limit=8 * CLK, pulse_limit=16 * CLK)


def pmd() -> Quadrature:
    """The MC1241A's inputs: each level must last 480 ns; a state should last 800 ns."""
    return Quadrature(480, 480, dwell_limit=800, pulse_limit=1600)


def mcp() -> Quadrature:
    """The MCP-1200's inputs at 8 MHz, divider 1: each level must last 3 clocks."""
    return Quadrature(3 * CLK, 3 * CLK)


KINDS = pytest.mark.parametrize("inputs", [lm, mcp, pmd])


def drain(decoder: Quadrature, now: int) -> list[tuple[int, int, int]]:
    """Settle up to ``now``: instant, what happened, and the count after it."""
    seen = []
    while found := decoder.settle(now):
        seen.append((decoder.at, found, decoder.count))
    return seen


def play(
    decoder: Quadrature, *edges: tuple[int, int, int, int], until: int = 1_000_000
) -> list[tuple[int, int, int]]:
    """Drive ``(instant, a, b, index)`` edges; return everything that came of them."""
    seen = []
    for now, a, b, index in edges:
        seen += drain(decoder, now)
        decoder.edge(now, a, b, index)
    return seen + drain(decoder, until)


@pytest.mark.spec("LM-POS-1", "MCP-ENC-1", "PMD-ENC-1")
@KINDS
def test_a_before_b_counts_up_and_b_before_a_counts_down(inputs):
    decoder = inputs()
    up = [(1000 * (i + 1), *UP[(i + 1) % 4], 1) for i in range(9)]
    assert [count for _, _, count in play(decoder, *up, until=10_000)] == list(range(1, 10))
    assert decoder.direction == 1
    down = [(11_000 + 1000 * i, *UP[(8 - i) % 4], 1) for i in range(12)]
    assert [count for _, _, count in play(decoder, *down)] == list(range(8, -4, -1))
    assert decoder.direction == -1


@pytest.mark.spec("LM-POS-1", "LM-TIM-2", "LM-T-16")
def test_a_state_of_7_clocks_is_lost_and_one_of_8_is_counted():
    assert play(lm(), (0, 1, 0, 1), (8 * CLK, 0, 0, 1)) == [
        (8 * CLK, COUNTED, 1),
        (16 * CLK, COUNTED, 0),
    ]
    assert play(lm(), (0, 1, 0, 1), (7 * CLK, 0, 0, 1)) == []
    # Where the lost state lay between two others, the next one is two steps away.
    assert play(lm(), (0, 1, 0, 1), (7 * CLK, 1, 1, 1)) == [(15 * CLK, SKIPPED, 0)]


@pytest.mark.spec("LM-T-16")
def test_the_highest_rate_of_8_clocks_per_state_is_counted_without_loss():
    decoder = lm()
    play(decoder, *((8 * CLK * i, *UP[i % 4], 1) for i in range(1, 1001)), until=2_000_000)
    assert decoder.count == 1000


@pytest.mark.spec("MCP-ENC-1")
def test_inputs_without_limits_find_no_level_too_short():
    decoder = mcp()
    for a in (1, 0, 1):
        assert decoder.edge(0, a, 0, 1) == 0
        assert (decoder.dwell, decoder.pulse) in ((1 << 60, 1 << 60), (0, 0))


@pytest.mark.spec("PMD-ENC-1", "PMD-ENC-2")
def test_a_level_is_believed_after_480_ns_and_not_1_ns_before():
    decoder = pmd()
    decoder.edge(1000, 1, 0, 1)
    assert decoder.due() == 1480
    assert drain(decoder, 1479) == []
    assert drain(decoder, 1480) == [(1480, COUNTED, 1)]


@pytest.mark.spec("PMD-ENC-2")
def test_1_75_million_counts_per_second_are_counted_though_each_dwell_is_too_short():
    decoder = pmd()
    found = []
    for i in range(1, 101):
        drain(decoder, 571 * i)
        found.append(decoder.edge(571 * i, *UP[i % 4], 1))
    drain(decoder, 100_000)
    assert decoder.count == 100
    assert found[0] == 0
    assert set(found[2:]) == {SHORT_DWELL | SHORT_PULSE}
    assert (decoder.dwell, decoder.pulse) == (571, 1142)


@pytest.mark.spec("MCP-ENC-1", "PMD-ENC-1")
@pytest.mark.parametrize(("inputs", "dwell"), [(mcp, 3 * CLK), (pmd, 480)])
def test_each_channel_is_filtered_on_its_own(inputs, dwell):
    # B wobbles for as long as it likes; A is believed at its own time.
    decoder = inputs()
    edges = [(100 * i, 1, i % 2, 1) for i in range(1, 20)]
    assert play(decoder, *edges, until=1900) == [(100 + dwell, COUNTED, 1)]


@pytest.mark.spec("MCP-ENC-1")
def test_the_filter_divider_lengthens_the_dwell_from_then_on():
    decoder = mcp()
    decoder.set_dwell(0, 3 * 4 * CLK, 3 * 4 * CLK)
    assert play(decoder, (0, 1, 0, 1)) == [(1500, COUNTED, 1)]
    decoder = mcp()
    decoder.edge(0, 1, 0, 1)
    decoder.set_dwell(300, 100, 100)
    assert drain(decoder, 300) == [(300, COUNTED, 1)]


@pytest.mark.spec("LM-POS-1")
@KINDS
def test_both_channels_at_once_count_nothing_and_are_told(inputs):
    decoder = inputs()
    ((_, found, count),) = play(decoder, (0, 1, 1, 1))
    assert (found, count) == (SKIPPED, 0)
    assert decoder.state == 3
    # The next single step counts from there.
    assert [count for _, _, count in play(decoder, (2_000_000, 0, 1, 1), until=3_000_000)] == [1]


@pytest.mark.spec("LM-TIM-1", "PMD-TIM-1")
@pytest.mark.parametrize(("inputs", "limit"), [(lm, 16 * CLK), (pmd, 1600)])
def test_a_pulse_shorter_than_its_limit_is_told_with_its_length(inputs, limit):
    for length, found in ((limit, 0), (limit - 1, SHORT_PULSE)):
        decoder = inputs()
        assert decoder.edge(0, 1, 0, 1) == 0
        drain(decoder, length)
        assert decoder.edge(length, 0, 0, 1) == found
        assert decoder.pulse == length


@pytest.mark.spec("LM-TIM-2", "PMD-TIM-2")
@pytest.mark.parametrize(("inputs", "limit"), [(lm, 8 * CLK), (pmd, 800)])
def test_a_state_shorter_than_its_limit_is_told_with_its_length(inputs, limit):
    for length, found in ((limit, 0), (limit - 1, SHORT_DWELL)):
        decoder = inputs()
        assert decoder.edge(0, 1, 0, 1) == 0
        drain(decoder, length)
        assert decoder.edge(length, 1, 1, 1) == found
        assert decoder.dwell == length


@pytest.mark.spec("LM-POS-3")
def test_the_lm628_sees_its_index_in_the_state_where_all_three_are_low():
    decoder = lm()
    decoder.preset(0, 1, 1)
    # The index covers the state exactly: set-up and hold time 0.
    seen = play(decoder, (0, 0, 0, 0), (1000, 1, 0, 1))
    assert seen == [
        (0, INDEX_FELL, 0),
        (1000, COUNTED | ALL_LOW, 1),
        (1000, INDEX_ROSE, 1),
        (2000, COUNTED, 2),
    ]


@pytest.mark.spec("LM-POS-3")
def test_the_state_may_also_be_entered_by_the_index():
    assert play(lm(), (0, 0, 0, 0)) == [(0, INDEX_FELL | ALL_LOW, 0)]


@pytest.mark.spec("LM-TIM-3", "PMD-TIM-3")
@KINDS
def test_an_index_that_moves_while_a_and_b_are_low_is_told(inputs):
    decoder = inputs()
    assert decoder.edge(0, 0, 0, 0) == INDEX_INSIDE
    decoder = inputs()
    decoder.preset(0, 1, 1)
    assert decoder.edge(0, 0, 0, 0) == 0


@pytest.mark.spec("PMD-CAP-1")
@pytest.mark.parametrize(
    ("edges", "instants"),
    [
        # Index first, then A, then B: the later of the two decides.
        ([(0, 1, 1, 0), (1000, 0, 1, 0), (2000, 0, 0, 0)], [2480]),
        ([(0, 1, 1, 0), (1000, 1, 0, 0), (2000, 0, 0, 0)], [2480]),
        # Together with the last channel: no set-up time is needed.
        ([(1000, 0, 1, 1), (2000, 0, 0, 0)], [2480]),
        # The index comes after A and B: not entered by them.
        ([(1000, 0, 1, 1), (2000, 0, 0, 1), (2001, 0, 0, 0)], []),
        # The index has gone again when they come.
        ([(0, 1, 1, 0), (1000, 0, 1, 0), (2000, 0, 0, 1)], []),
    ],
)
def test_an_index_counts_when_it_falls_before_a_and_b(edges, instants):
    decoder = pmd()
    decoder.preset(1, 1, 1)
    seen = play(decoder, *edges)
    assert [at for at, found, _ in seen if found & ALL_LOW and not found & INDEX_FELL] == instants


@pytest.mark.spec("MCP-ENC-1", "MCP-TIM-6")
def test_an_index_pulse_must_last_3_filter_clocks():
    assert play(mcp(), (0, 0, 0, 0), (3 * CLK, 0, 0, 1)) == [
        (3 * CLK, INDEX_FELL | ALL_LOW, 0),
        (6 * CLK, INDEX_ROSE, 0),
    ]
    assert play(mcp(), (0, 0, 0, 0), (3 * CLK - 1, 0, 0, 1)) == []


def test_an_edge_told_before_its_past_is_settled_is_refused():
    decoder = mcp()
    decoder.edge(0, 1, 0, 1)
    with pytest.raises(ValueError, match="settle what was due at 375"):
        decoder.edge(375, 1, 1, 1)


@pytest.mark.spec("PMD-ENC-1")
def test_a_single_input_is_filtered_the_same_way():
    home = InputFilter(480)
    home.edge(1000, 0)
    home.edge(1479, 1)
    assert home.due() == NEVER
    home.edge(2000, 0)
    assert (home.due(), home.level) == (2480, 1)
    home.take()
    assert (home.due(), home.level) == (NEVER, 0)


# One shaft: steps of the count with how long each state lasts, a spike now and then inside.
SHAFT = st.lists(
    st.tuples(
        st.sampled_from([-1, 1]),
        st.integers(1000, 3000),
        st.one_of(st.none(), st.tuples(st.integers(0, 900), st.integers(1, 99))),
    ),
    max_size=40,
)


@pytest.mark.spec("LM-POS-1", "MCP-ENC-1", "PMD-ENC-1")
@pytest.mark.parametrize(("inputs", "slowest"), [(lm, 2000), (mcp, 1000), (pmd, 1000)])
@given(shaft=SHAFT)
def test_the_count_follows_the_shaft_whatever_spikes_there_are(inputs, slowest, shaft):
    decoder = inputs()
    now, count = 5000, 0
    for turn, lasting, spike in shaft:
        count += turn
        a, b = UP[count % 4]
        drain(decoder, now)
        decoder.edge(now, a, b, 1)
        if spike is not None:
            begin, length = spike
            for at, level in ((now + begin, 1 - a), (now + begin + length, a)):
                if begin > 0:
                    drain(decoder, at)
                    decoder.edge(at, level, b, 1)
        # After a spike the whole dwell is needed again.
        now += slowest - 1000 + lasting + (1000 if spike else 0)
        drain(decoder, now - 1)
        assert decoder.count == count


@pytest.mark.spec("LM-POS-1")
@given(shaft=SHAFT, cut=st.integers(0, 40))
def test_a_saved_decoder_goes_on_where_it_was(shaft, cut):
    decoder = copy = pmd()
    now, count = 5000, 0
    for number, (turn, lasting, _) in enumerate(shaft):
        count += turn
        if number == cut:
            copy = mcp()
            state.load(copy, state.save(decoder))
        for each in {decoder, copy}:
            drain(each, now)
            each.edge(now, *UP[count % 4], number % 2)
        now += lasting
    assert state.save(copy) == state.save(decoder)
