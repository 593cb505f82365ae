from pathlib import Path

import pytest


@pytest.fixture(autouse=True)
def runtime(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Give each test a runtime directory of its own, so that boards never meet."""
    monkeypatch.setenv("VBUS_RUNTIME", str(tmp_path / "run"))
    return tmp_path / "run"
