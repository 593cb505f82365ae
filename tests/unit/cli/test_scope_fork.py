"""Copies of a board that a page of the scope has opened."""

import asyncio
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from vbus.cli.look import scope_fork
from vbus.cli.look.scope_fork import LINK, MOST_FORKS, Forks


def test_a_copy_that_has_ended_makes_room_for_another_one(monkeypatch: pytest.MonkeyPatch) -> None:
    made: list[Any] = []

    async def begun(*words: str, **_: object) -> Any:
        async def line() -> bytes:
            return LINK + b"http://page again"

        made.append(SimpleNamespace(returncode=None, stderr=SimpleNamespace(readline=line)))
        return made[-1]

    monkeypatch.setattr(scope_fork.asyncio, "create_subprocess_exec", begun)

    async def run() -> None:
        forks = Forks("127.0.0.1:0")
        for _ in range(MOST_FORKS):
            assert await forks.open(Path("run.vbj"), "1 ms") == "http://page"
        with pytest.raises(ValueError, match=f"there are {MOST_FORKS} copies"):
            await forks.open(Path("run.vbj"), "")
        made[1].returncode = 0
        assert await forks.open(Path("run.vbj"), "") == "http://page"

    asyncio.run(run())


ENDS_SLOWLY = """
trap 'sleep 0.5; echo whole >journal; exit' TERM
echo 'scope: http://page again' >&2
while :; do sleep 0.01; done
"""


def test_a_scope_ends_when_its_copies_have(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    begin = asyncio.create_subprocess_exec

    async def begun(*words: str, **options: Any) -> Any:
        return await begin("sh", "-c", ENDS_SLOWLY, cwd=tmp_path, **options)

    monkeypatch.setattr(scope_fork.asyncio, "create_subprocess_exec", begun)

    async def run() -> None:
        forks = Forks("127.0.0.1:0")
        assert await forks.open(Path("run.vbj"), "") == "http://page"
        await forks.end()

    asyncio.run(run())
    assert (tmp_path / "journal").read_text() == "whole\n"
