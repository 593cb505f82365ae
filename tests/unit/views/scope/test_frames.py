"""Frames: bytes as the page's decoder takes them."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.unit.views.scope.decoded import Frame, frames
from vbus.views.scope import frames as made


def test_a_frame_byte_for_byte() -> None:
    data = made.frame(made.SAMPLES, 7, 3, 1 << 40, made.differences([0, 300, 299]))
    assert data.hex() == (
        "01" "01" "0700" "03000000" "0000000000010000"  # kind, columns, lane, rows, first
        "02" "000000" "04000000"  # differences, four bytes of them
        "00" "d804" "01" "00000000"  # 0, +300, -1, and zeros
    )  # fmt: skip


@given(st.lists(st.integers(-(1 << 62), 1 << 62)))
def test_differences_can_be_undone(values: list[int]) -> None:
    (found,) = frames(made.frame(1, 0, len(values), 0, made.differences(values)))
    assert found.columns == [values]


@pytest.mark.parametrize(
    ("column", "values", "type_"),
    [
        (made.numbers, [1, -(1 << 31), (1 << 31) - 1], made.INTEGERS),
        (made.numbers, [1, 1 << 31], made.DOUBLES),
        (made.numbers, [-(1 << 31) - 1], made.DOUBLES),
        (made.numbers, [1, 0.5], made.DOUBLES),
        (made.small, [1, (1 << 53) - 1, 1 - (1 << 53)], made.DIFFERENCES),
        (made.small, [1 << 53], made.DOUBLES),
        (made.small, [0.25], made.DOUBLES),
        (made.kinds, [0, 255], made.BYTES),
        (made.texts, ["µ", None, {"a": 1}], made.TEXT),
    ],
)
def test_a_column_has_the_type_its_values_fit_into(column, values, type_) -> None:  # type: ignore[no-untyped-def]
    assert column(values)[0] == type_
    (found,) = frames(made.frame(1, 0, len(values), 5, column(values)))
    assert found == Frame(1, 0, len(values), 5, [values])
