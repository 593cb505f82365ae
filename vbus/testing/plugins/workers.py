"""What a worker of pytest-xdist has seen is added, at its end, to what the run knows."""

import pickle
from typing import Any, Final

import pytest

_HANDED_OVER: Final[dict[str, pytest.StashKey[Any]]] = {}


def handed_over(name: str) -> pytest.StashKey[Any]:
    """Return a key for what workers hand over; its values have ``update()``, as sets do."""
    return _HANDED_OVER.setdefault(name, pytest.StashKey())


def is_worker(config: pytest.Config) -> bool:
    """Tell whether this process is a worker, whose run another process judges."""
    return hasattr(config, "workeroutput")


@pytest.hookimpl(trylast=True)
def pytest_sessionfinish(session: pytest.Session) -> None:
    """Hand over what this worker has seen."""
    stash = session.config.stash
    if is_worker(session.config):
        seen = {name: stash[key] for name, key in _HANDED_OVER.items() if key in stash}
        session.config.workeroutput["vbus"] = pickle.dumps(seen)  # type: ignore[attr-defined]


@pytest.hookimpl(optionalhook=True)
def pytest_testnodedown(node: Any, error: object) -> None:
    """Take over what a worker has seen, unless it has died."""
    stash, output = node.config.stash, getattr(node, "workeroutput", {})
    for name, value in pickle.loads(output["vbus"]).items() if "vbus" in output else ():
        key = _HANDED_OVER[name]
        if key in stash:
            stash[key].update(value)
        else:
            stash[key] = value
