"""The scope that a run starts beside itself."""

import asyncio
import subprocess
from typing import Any

import pytest

from vbus.boardfile.sections import ScopeSection
from vbus.cli.look import scope_page
from vbus.cli.look.scope_page import PageRequest
from vbus.core.errors import TransportError


@pytest.mark.parametrize(
    "after", ["exec >&-; exec sleep 600", "trap '' TERM; exec >&-; exec sleep 600"]
)
def test_a_scope_that_did_not_begin_has_ended_when_that_is_told(
    after: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    begun: list[subprocess.Popen[bytes]] = []

    def start(board: str, scope: ScopeSection, control: bool, stdout: int) -> Any:
        begun.append(subprocess.Popen(["sh", "-c", after], stdout=stdout))
        return begun[0]

    monkeypatch.setattr(scope_page, "start_scope", start)
    monkeypatch.setattr(scope_page, "END_SECONDS", 0.2)
    with pytest.raises(TransportError, match="has ended at once"):
        asyncio.run(PageRequest().show("axis", ScopeSection(listen="127.0.0.1:0")))
    assert begun[0].returncode is not None
