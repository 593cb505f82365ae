"""The keywords of Robot Framework, in a suite of its own."""

import re
import shlex
import subprocess
import sys
from pathlib import Path

SUITE = """\
*** Settings ***
Library    vbus.testing.robot

*** Test Cases ***
Reset Is Shown
    Open Board    LM629N-8    seed=4
    Bus Should Read    0    0x00
    Advance Time    5ms
    Bus Should Read    0    0x84
    Position Should Be    x.1    0    within=2

Reset Ends
    Open Board    LM629N-8
    ${instant}    Wait Until    x.status.TRAJECTORY_COMPLETE    within=5 ms
    Should Be True    ${instant} == 1_000_000_000

Never
    Open Board    LM629N-8
    Wait Until    x.real > 3 and x.HI    within=2 ms

Wrong Byte
    Open Board    LM629N-8
    Run Time Until    5ms
    Bus Should Read    0    0x55

Fault That Never Fires
    Open Board    LM629N-8
    Arm Fault    jam    when=at 10 s

Write Too Early
    Open Board    LM629N-8
    Write Bus    0    0x1E

Write Too Early Is Reported
    Open Board    LM629N-8    violations=report
    Write Bus    0    0x1E

Write Too Early Is Accepted
    Accept Violation    lm628.reset-write    the bootloader cannot wait
    Open Board    LM629N-8
    Write Bus    0    0x1E

Accepted In Vain
    Accept Violation    lm628.reset-write    the bootloader cannot wait
    Open Board    LM629N-8

Stop That Waits
    Open Board    LM629N-8
    Advance Time    5ms
    FOR    ${port}    ${byte}    IN
    ...    0    0x1E    1    0    1    0x08    1    0    1    0x10    0    0x04
    ...    0    0x1F    1    0    1    0x2A    1    0    1    0    1    0    1    9
    ...    1    0    1    1    1    0    1    0    1    0    1    0    1    0    1    0
    ...    0    0x01    0    0x1F    1    0x01    1    0
        Write Bus    ${port}    ${byte}
        Advance Time    100us
    END

No Board
    Read Bus    0
"""


def test_keywords_do_what_the_fixtures_do(tmp_path: Path) -> None:
    (tmp_path / "suite.robot").write_text(SUITE)
    done = subprocess.run(
        [sys.executable, "-m", "robot", "--output", "NONE", "--log", "NONE", "--report", "NONE",
         "--consolewidth", "200", "suite.robot"],
        cwd=tmp_path,
        capture_output=True,
        text=True,
        timeout=100,
    )  # fmt: skip
    printed = done.stdout
    assert done.returncode == 7, printed + done.stderr
    assert re.search(r"Reset Is Shown +\| PASS", printed), printed
    assert re.search(r"Reset Ends +\| PASS", printed), printed
    assert '"x.real > 3 and x.HI" has not come to hold within 2000us of chip time' in printed
    assert "a read at 0H gave 84h, not 55h" in printed
    assert "x RDSTAT 84H MOTOR_OFF TRAJECTORY_COMPLETE" in printed
    assert "never fired" in printed
    assert re.search(r"Write Too Early +\| FAIL", printed), printed
    assert "x broke lm628.reset-write at 1us: Nothing is written during reset" in printed
    assert len(re.findall(r"Write Too Early Is (Reported|Accepted) +\| PASS", printed)) == 2
    assert "lm628.reset-write is accepted (the bootloader cannot wait), and never hap" in printed
    assert "x broke lm628.off-waits at " in printed
    assert "there is no board yet: begin with Open Board" in printed
    replay = re.search(r"^replay:  vbus (replay .*)$", printed, re.MULTILINE)
    assert replay is not None
    again = subprocess.run(
        [sys.executable, "-m", "vbus", *shlex.split(replay[1])], capture_output=True, text=True
    )
    assert "no difference in" in again.stdout
