"""What killed processes have left is looked for once, with the first name taken in a directory."""

import os
import struct
from pathlib import Path

import pytest

from vbus.core.runtime import lock_of
from vbus.transports import runtime
from vbus.transports.linux import Inotify
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


def test_what_the_system_has_not_noted_is_told_and_what_nobody_asked_for_is_not() -> None:
    watch = Inotify()
    read, write = os.pipe()
    os.dup2(read, watch.fd)
    overflow, ignored, opened = (-1, 0x4000), (1, 0x8000), (2, 0x20)
    os.write(
        write, b"".join(struct.pack("iIII", *row, 0, 0) for row in (overflow, ignored, opened))
    )
    assert watch.read() == [(-1, 0), (2, 0x20)]
    watch.close()
    os.close(read)
    os.close(write)
