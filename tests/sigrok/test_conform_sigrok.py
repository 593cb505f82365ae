"""``vbus conform`` with what sigrok-cli makes of captures: sessions, tables, and VCD files."""

import json
import subprocess
from pathlib import Path

import pytest

from tests.e2e.command import vbus
from tests.sigrok.test_sigrok import sigrok  # noqa: F401 - a fixture
from tests.unit.views.captures import BOARDS, Shot, vcd

PARTS = {"lm628": ("LM629N-8", "8 MHz"), "mc1241a": ("MC1241A", "25 MHz"),
         "mcp1200": ("MCP-1200", "8 MHz")}  # fmt: skip
DOWNSAMPLE = {"lm628": 200, "mc1241a": 200, "mcp1200": 50}
"""Of 10 GHz: 50 MHz, and 200 MHz for the shorter strobes."""


def convert(program: str, source: Path, to: Path, read: str, write: str) -> None:
    done = subprocess.run(
        [program, *(["-I", read] if read else []), "-i", source, "-O", write, "-o", to],
        capture_output=True, text=True, timeout=120,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    assert to.exists()


@pytest.mark.slow
@pytest.mark.parametrize("family", sorted(BOARDS))
def test_what_sigrok_makes_of_a_capture_conforms_too(
    sigrok: str,  # noqa: F811
    tmp_path: Path, family: str,
) -> None:  # fmt: skip
    part, clock = PARTS[family]
    first = tmp_path / "run.vcd"
    first.write_text(vcd(family))
    shot = Shot(family, first.read_text())
    expected = shot.compare(wish="start")
    session = tmp_path / "run.sr"
    convert(sigrok, first, session, f"vcd:downsample={DOWNSAMPLE[family]}", "srzip")
    tables = {
        "timed.csv": "csv:time=true:dedup=true",
        "named.csv": "csv:time=true:dedup=true:label=channel",
        "again.vcd": "vcd",
    }
    if family == "mc1241a":  # the others are long
        tables["plain.csv"] = "csv:dedup=false"
    for name, form in tables.items():
        convert(sigrok, session, tmp_path / name, "", form)
    for name in ("run.vcd", "run.sr", *tables):
        done = vbus("conform", part, tmp_path / name, "--clock", clock, "--from", "start")
        assert (done.returncode, done.stderr) == (0, "")
        assert done.stdout.splitlines()[1].startswith(
            f"no difference in {expected.cycles} bus cycles, {expected.reads} of them reads, and "
        )


@pytest.mark.slow
def test_a_difference_in_a_session_is_at_the_instant_it_has_in_the_capture(
    sigrok: str,  # noqa: F811
    tmp_path: Path,
) -> None:  # fmt: skip
    shot = Shot("lm628")
    begin, end = shot.pulses("/RD")[-1]
    shot.change(begin, end, flip=1 << shot.wiring.data[5])
    spoiled = tmp_path / "spoiled.vcd"
    spoiled.write_text(shot.text())
    session = tmp_path / "run.sr"
    convert(sigrok, spoiled, session, "vcd:downsample=500", "srzip")
    done = vbus("conform", "LM629N-8", session, "--clock", "8 MHz", "--json")
    assert done.returncode == 1
    found = json.loads(done.stdout)["mismatch"]
    assert abs(found["when"] - end) <= 50_000  # a sample
    assert found["silicon"] == "20H in RDSTAT 20H POSITION_ERROR"
    assert found["model"] == "00H in RDSTAT 00H -"
