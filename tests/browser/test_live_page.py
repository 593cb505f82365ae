"""The page of the documentation on which a driver runs in the browser, without any server."""

import re
from functools import cache
from html import escape
from importlib.util import module_from_spec, spec_from_file_location
from pathlib import Path
from types import ModuleType
from typing import Any

import pytest

from tests.browser.conftest import ADDRESS, Open, until_drawn

ROOT = Path(__file__).parents[2]
TUTORIAL = (ROOT / "docs" / "tutorial.md").read_text()


@cache
def module(path: str) -> ModuleType:
    """Return a module of the documentation, which is no package."""
    spec = spec_from_file_location(Path(path).stem, ROOT / "docs" / path)
    assert spec is not None
    assert spec.loader is not None
    made = module_from_spec(spec)
    spec.loader.exec_module(made)
    return made


def block(kind: str) -> str:
    found = re.search(rf"```{kind}\n(.*?)```", TUTORIAL, re.S)
    assert found is not None
    return found[1]


@pytest.fixture(scope="module")
def site(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a folder with the page's files, as the site has them, and the page."""
    conf = module("conf.py")
    folder = tmp_path_factory.mktemp("site")
    got = conf.LIVE
    if not got.is_dir():
        got = folder / "got"
        try:
            module("live/get.py").get(got)
        except SystemExit as why:
            pytest.skip(f"needs what docs/live/get.py gets: {why}")
    conf.live_files(got, folder / "_static" / "live")
    blocks = "".join(
        f'<div class="highlight-{kind} notranslate"><pre>{escape(block(kind))}</pre></div>'
        for kind in ("toml", "python")
    )
    html = re.search(r"```\{raw\} html\n(.*?)```", conf.LIVE_BLOCK, re.S)
    assert html is not None
    (folder / "docs").mkdir()
    (folder / "docs" / "tutorial.html").write_text(blocks + html[1])
    return folder


@pytest.fixture
def live(site: Path, new_page: Open) -> tuple[Any, list[str]]:
    """Return the page, and what it asks for that the site has not."""
    page = new_page()
    elsewhere: list[str] = []

    def answer(route: Any) -> None:
        file = site / route.request.url.removeprefix(ADDRESS)
        if file.is_file():
            route.fulfill(path=file)
        else:
            elsewhere.append(route.request.url)
            route.fulfill(status=404)

    page.context.route("**/*", answer)
    page.goto(f"{ADDRESS}docs/tutorial.html")
    return page, elsewhere


def result(page: Any, driver: str | None = None) -> str:
    """Run a driver, or the one that stands there; return what it prints."""
    if driver is not None:
        page.get_by_label("axis.py").fill(driver)
    page.get_by_role("button", name="Run").click()
    page.get_by_role("button", name="Run").wait_for(timeout=300_000)
    return str(page.locator("#live pre").inner_text())


def test_a_driver_runs_in_the_browser_as_it_does_here(live: tuple[Any, list[str]]) -> None:
    page, elsewhere = live
    native = module("live/live.py").run(block("toml"), block("python"))

    printed = result(page)

    assert printed == native["printed"] != ""
    assert page.locator("#live output").inner_text() == f"trace hash {native['hash']}"
    frame = page.locator("#live iframe").element_handle().content_frame()
    until_drawn(frame)
    tracks = frame.evaluate("scope.state")["tracks"]
    assert "x.desired x.real" in [track["name"] for track in tracks]
    assert elsewhere == []

    assert "driver.py, line 2: ZeroDivisionError" in result(page, "here = 1\nhere / 0\n")
    assert "ready" in result(page, "print('ready')\n")

    page.get_by_label("axis.py").fill("while True: pass\n")
    page.get_by_role("button", name="Run").click()
    page.get_by_role("button", name="Stop").click()
    assert page.locator("#live output").inner_text() == "stopped"
