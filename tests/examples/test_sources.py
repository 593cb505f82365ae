"""Sources of the examples have no warning; that they print what they say, their pages show."""

from pathlib import Path

import pytest

from tests.examples.boards import compile_c


@pytest.mark.parametrize(
    ("sources", "shim"),
    [
        (("lm629_c/main.c", "lm629_c/lm629_driver.c"), ""),
        (("mcp1200_c/main.c", "mcp1200_c/mcp1200_driver.c"), ""),
        (("mc1241a_isa_c/main.c", "mc1241a_isa_c/mc1241a_driver.c"), "linux-io"),
        (("hostile_lm629/driver.c",), ""),
    ],
)
def test_an_example_in_c_compiles_without_a_warning(
    sources: tuple[str, ...], shim: str, tmp_path: Path
) -> None:
    compile_c(tmp_path / "host", *sources, shim=shim)
