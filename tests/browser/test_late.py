"""A page that is opened when all is over: the real server, what really ran, all its samples."""

import itertools
import json
import os
import re
import signal
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest

from tests.boards import AXIS
from tests.browser.conftest import Open
from tests.e2e.command import start, vbus
from tests.unit.views.scope.decoded import of_page
from tests.waiting import until

pytestmark = pytest.mark.slow

LATE = 5.0
"""Seconds after the end until somebody opens the page."""
SAMPLE = 256_000_000
"""Of an LM629 with 8 MHz (ps)."""
MOVE = """\
import itertools
import json
import os
from vbus import connect
from vbus.client.lm628 import Lm628
with connect(os.environ["VBUS_LINK"]) as bus:
    axis = Lm628(bus)
    axis.load_filter(kp=300, kd=2000)
    for target in 500, -300, 0:
        axis.move(target, acc=40, vel=2 << 16)
"""
LINE = re.compile(r"scope: (\S+) +\(process (\d+)\)$")
HAS = """\
([name, last]) => {
  const lane = scope.lane(name);
  return lane?.rows && Number(lane.instant(lane.rows - 1)) >= last;
}
"""
ROWS = """\
(name) => {
  const lane = scope.lane(name);
  return [...Array(lane.rows).keys()].map((row) => {
    const at = lane.instant(row);
    return [Number(at), lane.at(at)];
  });
}
"""


@pytest.fixture(autouse=True)
def own_runtime(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("VBUS_RUNTIME", str(tmp_path / "run"))


@contextmanager
def ran(*arguments: str | Path) -> Iterator[str]:
    """Run a verb with a scope to its end; give the link of the page, which the block may open."""
    process = start(*arguments)
    assert process.stderr is not None
    line = process.stderr.readline()  # not all of it: the scope holds on to it, and stays
    found = LINE.match(line)
    assert found is not None, line
    try:
        assert process.wait(timeout=120) == 0
        yield found[1]
    finally:
        os.kill(int(found[2]), signal.SIGTERM)
        process.communicate(timeout=60)


def opened(new_page: Open, link: str, enough: str) -> Any:
    """Open a page late; return it once it has what is enough."""
    time.sleep(LATE)
    page = new_page()
    page.goto(link)
    until(lambda: page.evaluate(f"window.scope && {enough}"), page.content)
    return page


@pytest.mark.parametrize("time_policy", ["realtime", "lockstep"])
def test_what_a_program_did_is_drawn_with_all_its_samples(
    tmp_path: Path, new_page: Open, time_policy: str
) -> None:
    board, journal = tmp_path / "late.toml", tmp_path / "run.vbj"
    board.write_text(AXIS.format(time=time_policy, model="dc_motor"))
    (tmp_path / "move.py").write_text(MOVE)
    program = ("--", sys.executable, tmp_path / "move.py")
    lanes = ("desired", "real", "error", "profile", "output", "current")
    with ran("exec", "--board", board, "--journal", journal, "--scope", *program) as link:
        assert vbus("scope", journal, "-o", tmp_path / "run.html").returncode == 0
        recorded = of_page((tmp_path / "run.html").read_bytes())
        last = {f"x.{name}": recorded.rows[f"x.{name}"][-1][0] for name in lanes}
        page = opened(new_page, link, f"Object.entries({json.dumps(last)}).every({HAS})")
        shown = {name: page.evaluate(ROWS, f"x.{name}") for name in lanes}
        left_out = page.evaluate("scope.lane('left out').rows")
    assert left_out == 0
    for name in lanes:
        scale = next(
            lane["scale"] for lane in recorded.description["lanes"]
            if (lane["axis"], lane["name"]) == ("x", name)
        )  # fmt: skip
        known = [[at, value * scale] for at, value in recorded.rows[f"x.{name}"]]
        begin = shown[name][0][0]  # when the scope had joined; the program began then
        before = [value for at, value in known if at <= begin]
        assert shown[name][0][1] == before[-1], name
        assert shown[name][1:] == [row for row in known if row[0] > begin], name
        assert len(shown[name]) > 100, name


def test_a_demo_is_drawn_with_all_its_samples(new_page: Open) -> None:
    with ran("demo", "lm629", "--headless", "--scope") as link:
        page = opened(new_page, link, "scope.lane('x.desired')?.rows > 1000")
        instants = [at for at, _ in page.evaluate(ROWS, "x.desired")]
    steps = [after - before for before, after in itertools.pairwise(instants)]
    assert len(steps) > 1000
    assert sum(step == SAMPLE for step in steps) > 0.95 * len(steps), "it changes at each sample"


def test_a_demo_begins_when_its_page_is_there(
    new_page: Open, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    asked = tmp_path / "asked"
    (tmp_path / "browser").write_text(
        f'#!/bin/sh\necho "$1" > {asked}.part\nmv {asked}.part {asked}'
    )
    (tmp_path / "browser").chmod(0o755)
    monkeypatch.setenv("BROWSER", str(tmp_path / "browser"))
    process = start("demo", "lm629", "--headless", "--open")
    assert process.stderr is not None
    line = process.stderr.readline()
    said = process.stderr.readline()
    until(asked.exists, lambda: said)
    link, pid = LINE.match(line).groups()  # type: ignore[union-attr]
    try:
        assert asked.read_text() == f"{link}\n"
        assert said.startswith("scope: opening it in a browser; waiting up to 60 s for the page")
        (chip,) = json.loads(vbus("ls", "--json").stdout)[0]["chips"]
        assert chip["writes"] == 0, "no host has begun"
        page = new_page()
        page.goto(link)
        assert process.wait(timeout=120) == 0
        until(lambda: page.evaluate("scope.lane('x bus').rows > 100"), page.content)
    finally:
        os.kill(int(pid), signal.SIGTERM)
        process.communicate(timeout=60)


def test_a_wait_for_a_page_is_left_by_ctrl_c(monkeypatch: pytest.MonkeyPatch) -> None:
    for name in ("DISPLAY", "WAYLAND_DISPLAY", "BROWSER"):
        monkeypatch.delenv(name, raising=False)
    process = start("demo", "lm629", "--headless", "--open")
    assert process.stderr is not None
    pid = int(LINE.match(process.stderr.readline())[2])  # type: ignore[index]
    said = process.stderr.readline()
    assert said.startswith("scope: no browser here; open that link; waiting up to 60 s")
    process.send_signal(signal.SIGINT)
    assert process.wait(timeout=60) == 130
    process.communicate(timeout=60)  # the scope has let go of it: it has ended too
    until(lambda: not Path(f"/proc/{pid}").exists(), "the end of the scope")
