from collections.abc import Iterator
from pathlib import Path

import pytest

from tests.waiting import PATIENCE
from tests.zenoh.processes import Processes
from vbus.network.session import open_session


@pytest.fixture(autouse=True)
def runtime(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Give each test a runtime directory of its own, so that boards never meet."""
    monkeypatch.setenv("VBUS_RUNTIME", str(tmp_path / "run"))
    for name in ("VBUS_ZENOH", "VBUS_ZENOH_CERTIFICATE", "VBUS_ZENOH_KEY", "VBUS_ZENOH_AUTHORITY"):
        monkeypatch.delenv(name, raising=False)
    return tmp_path / "run"


@pytest.fixture
def processes(tmp_path: Path) -> Iterator[Processes]:
    """Run boards and routers as processes; whatever still runs at the end is stopped."""
    started = Processes(tmp_path)
    yield started
    started.stop()


@pytest.fixture(autouse=True)
def _patience(monkeypatch: pytest.MonkeyPatch) -> None:
    """Have boards and hosts in this process take their time, as they may on a busy machine."""
    for limit in ("network.session.OPEN", "network.session.ASK", "network.access.ASK"):
        monkeypatch.setattr(f"vbus.{limit}_SECONDS", PATIENCE)


@pytest.fixture(autouse=True)
def lease(monkeypatch: pytest.MonkeyPatch) -> None:
    """Have boards and hosts in this process not given up while it has no turn.

    Both are, where neither is in a process of its own, and what was on its way is lost.
    """
    assert open_session.__defaults__ is not None
    defaults = (*open_session.__defaults__[:-1], round(1000 * PATIENCE))
    monkeypatch.setattr(open_session, "__defaults__", defaults)
