"""The driver against every LM629 that the manual allows: it reaches 100, whichever it has."""

import os

import pytest


@pytest.mark.vbus("board.toml", budget={"cycles": 10_000})
@pytest.mark.vbus_matrix(hostile=30)
def test_the_driver_lives_with_every_lm629(vbus_exec):
    done = vbus_exec("driver.c", "{link}", flags=os.environ.get("FLAGS", ""))
    assert done.output == "at 100\n"
