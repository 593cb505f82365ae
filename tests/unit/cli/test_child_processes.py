"""When what does not end after a signal is killed: by the turns it had, not by a clock alone."""

import asyncio
import signal
import subprocess
from contextlib import closing

import pytest

from vbus.cli.child_processes import ChildProcesses
from vbus.serve.time import watchdog_process


@pytest.mark.parametrize(
    ("state", "share", "waited"),
    [("R", 0.0, 2.0), ("D", 0.0, 2.0), ("R", 0.5, 0.8), ("R", 1.0, 0.7), ("S", 0.0, 0.7)],
    ids=["it has no turn", "it waits for a disk", "it has some", "it computes", "it waits"],
)
def test_a_program_that_has_no_turn_is_given_longer_to_end(
    monkeypatch: pytest.MonkeyPatch, state: str, share: float, waited: float
) -> None:
    monkeypatch.setattr(watchdog_process, "STARVED", 1.3)
    monkeypatch.setattr(watchdog_process, "states", lambda pid: {state})
    said: list[str] = []
    with closing(ChildProcesses(said.append)) as offspring:
        computed = lambda pid: share * offspring._waited  # noqa: E731
        monkeypatch.setattr(watchdog_process, "seconds_computed", computed)
        with subprocess.Popen(["sleep", "600"]) as process:
            asyncio.run(offspring.see_end(signal.SIGTERM, process.pid))
    assert process.returncode == -signal.SIGKILL
    assert said[0] == f"SIGTERM has not ended the program within {waited:.1f} s; it is killed"
