"""The garbage collector is as it was before it was held."""

import gc

import pytest

from vbus.core.interpreter import collection_held


@pytest.mark.parametrize("collects", [True, False])
def test_garbage_is_searched_for_again_if_it_was_before(collects: bool) -> None:
    before = gc.isenabled()
    try:
        gc.enable() if collects else gc.disable()
        with collection_held():
            assert not gc.isenabled()
        assert gc.isenabled() == collects
    finally:
        gc.enable() if before else gc.disable()
