from pathlib import Path

import pytest

from tests.unit.native.conftest import compile_c


@pytest.fixture(autouse=True)
def runtime(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Give each test a runtime directory of its own, so that boards never meet."""
    monkeypatch.setenv("VBUS_RUNTIME", str(tmp_path / "run"))
    return tmp_path / "run"


@pytest.fixture(scope="session")
def polling_host(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a host in C that polls, compiled once."""
    program = tmp_path_factory.mktemp("polling") / "polling_host"
    compile_c(["gcc", "-std=c99"], Path(__file__).with_name("polling_host.c"), program)
    return program
