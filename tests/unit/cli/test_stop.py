"""``vbus stop`` and boards that take their time."""

import subprocess

import pytest

from vbus.cli import exit_codes
from vbus.cli.run.running import stop
from vbus.serve import registry


def test_a_board_that_does_not_end_in_time_is_told(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    process = subprocess.Popen(
        ["bash", "-c", "trap '' TERM; echo ready; read forever"],
        stdin=subprocess.PIPE, stdout=subprocess.PIPE,
    )  # fmt: skip
    with process:
        assert process.stdout is not None
        assert process.stdout.readline() == b"ready\n"
        monkeypatch.setattr(registry, "running", lambda: [{"board": "bench", "pid": process.pid}])
        code = stop.main(["bench", "--timeout", "0.2"], standalone_mode=False)
        assert process.poll() is None

    assert code == exit_codes.FAILURE
    assert capsys.readouterr().err == (
        'vbus: bench has not ended within 0.2 s and still runs; "vbus logs bench" shows what it'
        " says, if it was started with --detach\n"
    )
