"""What the verbs show of the frozen runs is the same bytes."""

import pytest

from tests.frozen import views

EXPECTED = views.read_views()


@pytest.mark.parametrize("name", views.names())
def test_a_view_of_a_frozen_run_is_the_same_bytes(name: str) -> None:
    now = views.hashes(name)
    different = [view for view in now if EXPECTED[name].get(view) != now[view]]
    assert not different, f"{name} is shown otherwise by {', '.join(different)}"


def test_views_toml_is_as_the_generator_writes_it() -> None:
    assert views.text_of(EXPECTED) == views.VIEWS.read_text()
    assert {name: list(row) for name, row in EXPECTED.items()} == {
        name: list(views.shown_of(name)) for name in views.names()
    }
    assert len(EXPECTED) > 100
