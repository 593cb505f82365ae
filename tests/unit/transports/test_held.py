"""What killed processes have left is looked for once, with the first name taken in a directory."""

from pathlib import Path

import pytest

from vbus.core.runtime import lock_of
from vbus.transports import runtime
from vbus.transports.runtime import NameLock, sweep


def test_a_directory_is_swept_with_the_first_name_and_again_after_the_last(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    looked: list[Path] = []

    def names(directory: Path) -> list[Path]:
        looked.append(directory)
        return []

    monkeypatch.setattr(runtime, "locked_names", names)
    held = [NameLock(tmp_path / name) for name in ("a", "b", "c")]
    for lock in held:
        lock.take()
        sweep(tmp_path)
    assert looked == [tmp_path]
    for lock in held:
        lock.give_back()
        lock.give_back()
    assert not lock_of(tmp_path / "a").exists()
    held[0].take()
    sweep(tmp_path)
    held[0].give_back()
    assert looked == [tmp_path] * 2
