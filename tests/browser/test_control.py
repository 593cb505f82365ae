"""A board that runs, controlled by a real page: pause, steps, faults, pins, bus cycles."""

import os
import re
import signal
import threading
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from tests.browser.conftest import Open, keeps_out
from tests.browser.test_page import colour, drawn
from tests.e2e.command import start, vbus
from tests.e2e.test_scope import BOARD, drive, entries, link_in
from tests.e2e.test_scope_control import attached
from tests.waiting import until


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv("VBUS_RUNTIME", str(tmp_path / "run"))
    (tmp_path / "bench.toml").write_text(BOARD.format(folder=tmp_path))
    return tmp_path


@pytest.fixture
def link(folder: Path) -> Iterator[str]:
    """The link of a board that runs with --scope-control."""
    board = start("run", folder / "bench.toml", "--scope-control")
    assert board.stderr is not None
    line = board.stderr.readline()
    (pid,) = map(int, re.findall(r"\(process (\d+)\)$", line))
    yield link_in(line)
    board.send_signal(signal.SIGINT)
    assert board.wait(timeout=60) == 0
    os.kill(pid, signal.SIGTERM)
    until(lambda: not Path(f"/proc/{pid}").exists(), "the end of the scope")
    board.communicate(timeout=60)


class Hand:
    """A page that may do something."""

    def __init__(self, page: Any) -> None:
        self.page = page

    def told(self, text: str, where: str = "control-told") -> None:
        """Wait until the page says so."""
        from playwright.sync_api import expect

        expect(self.page.locator(f"#{where}")).to_contain_text(text, timeout=60_000)

    def step(self, by: str, what: str) -> None:
        self.page.select_option("#step-by", by)
        self.page.fill("#step-what", what)
        self.page.click("#step")


@pytest.fixture
def hand(new_page: Open, link: str) -> Hand:
    page = new_page()
    page.goto(link)
    page.wait_for_selector("#control:not([hidden])")
    return Hand(page)


@pytest.mark.slow
def test_a_driver_in_the_hands_of_a_page(hand: Hand, folder: Path) -> None:
    page = hand.page
    page.click("#pause")
    hand.told("paused", "control-state")
    reached: list[int] = []
    driver = threading.Thread(target=lambda: reached.append(drive(folder)))
    driver.start()
    attached()
    page.select_option("#step-by", "cycle")
    page.fill("#step-what", "3")
    page.keyboard.press("Enter")
    hand.told("paused: 3 bus cycles", "control-state")
    hand.step("sample", "x")
    hand.told("paused: a sample of x", "control-state")
    hand.step("condition", "x.real > 20")
    hand.told("paused: x.real > 20", "control-state")
    assert reached == []
    page.click("#manual summary")
    page.click("#read")
    hand.told("00H at ")
    page.fill("#data", "5AH")
    page.fill("#address", "9")
    page.click("#write")
    hand.told("x has addresses 0 to 1")
    page.select_option("#fault", "jam")
    page.fill("#fault-parameters", "share")
    page.click("#fault-arm")
    hand.told('found "share"; write a parameter as NAME=VALUE')
    page.fill("#fault-parameters", "")
    page.click("#fault-arm")
    hand.told("acting, fired 1 times")
    page.click("#fault-clear")
    hand.told("over, fired 1 times")
    page.select_option("#pin", "x./RST")
    page.select_option("#level", "1")
    page.click("#drive")
    hand.told("x./RST is driven to 1")
    page.click("#journal-save")
    hand.told("saved in ")
    page.click("#go")
    hand.told("time runs", "control-state")
    driver.join(60)
    assert abs(reached[0] - 500) <= 2
    page.click("#back")
    hand.told("'' is no duration")
    page.fill("#rewind-to", "20 ms")
    page.click("#back")
    hand.told("the live board goes back only when it is paused")
    page.click("#pause")
    hand.told("paused", "control-state")
    page.click("#back")
    hand.told("paused: went back to 20000us", "control-state")
    page.fill("#address", "0")
    page.click("#read")
    hand.told("H at 2000")
    labels = [entry.args[0] for entry in entries(folder) if entry.op == "open"]
    assert labels == ["scope", "host0", "scope"]
    (saved,) = (folder / "run" / "journals").iterdir()
    assert vbus("replay", saved).returncode == 0
    assert vbus("replay", folder / "run.vbj").returncode == 0


@pytest.mark.slow
def test_the_bar_can_be_used_by_everybody(new_page: Open, link: str) -> None:
    page = new_page(color_scheme="light")
    page.goto(link)
    page.wait_for_selector("#control:not([hidden])")
    page.keyboard.press("g")
    Hand(page).told("paused", "control-state")
    page.click("#manual summary")
    assert keeps_out(page) == []
    page.emulate_media(color_scheme="dark")
    drawn(page)
    assert max(colour(page, "surface")) < 64
    assert keeps_out(page, "color-contrast") == []
