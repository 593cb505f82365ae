"""Word widths, in plain integers and in machine words."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from vbus.core.bits import clamp, sign_extend, wrap, wrap_word

WORDS = st.one_of(st.integers(-(1 << 62), 1 << 62), st.sampled_from((-(1 << 62), 1 << 62)))


@given(WORDS, st.integers(1, 61))
def test_a_machine_word_wraps_as_any_integer_does(value: int, bits: int) -> None:
    assert wrap_word(value, 1 << bits - 1) == wrap(value, bits)
    assert (wrap(value, bits) - value) % (1 << bits) == 0
    assert -(1 << bits - 1) <= wrap(value, bits) < 1 << bits - 1


@given(st.integers(-(1 << 200), 1 << 200), st.integers(1, 128))
def test_integers_of_any_size_wrap_and_change_sign_alike(value: int, bits: int) -> None:
    assert wrap(value, bits) == sign_extend(value, bits)


@pytest.mark.parametrize(
    ("value", "limited"), [(32767, 32767), (32768, 32767), (-32768, -32768), (-32769, -32768)]
)
def test_a_value_beyond_a_limit_stops_at_it(value: int, limited: int) -> None:
    assert clamp(value, -32768, 32767) == limited
