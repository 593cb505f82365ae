"""A real browser that opens the page of the scope; nothing it asks for comes from a network."""

from collections.abc import Callable, Iterator
from typing import Any

import pytest

from tests.browser.recordings import PAGE, Recording
from tests.left_out import require
from tests.waiting import PATIENCE, until

ADDRESS = "http://scope.test/"
Open = Callable[..., Any]


@pytest.fixture(scope="module")
def browser() -> Iterator[Any]:
    sync_api = pytest.importorskip("playwright.sync_api", reason="needs playwright")
    path = require("chromium")
    with sync_api.sync_playwright() as playwright:
        # What is drawn by software anyway costs less without the process that stands in for a GPU.
        arguments = ["--no-sandbox", "--disable-gpu"]
        browser = playwright.chromium.launch(
            executable_path=path, args=arguments, timeout=1000 * PATIENCE
        )
        yield browser
        browser.close()


def serve(page: Any, text: str) -> None:
    """Answer what the page asks for from the folder of its files."""

    def answer(route: Any) -> None:
        path = route.request.url.removeprefix(ADDRESS).partition("#")[0]
        if not path:
            route.fulfill(body=text, content_type="text/html; charset=utf-8")
        elif path.startswith("page/") and (file := PAGE / path.removeprefix("page/")).is_file():
            route.fulfill(path=file)
        else:
            route.fulfill(status=404)

    page.route("**/*", answer)


def keeps_out(page: Any, *rules: str, part: str | None = None) -> list[tuple[str, list[str]]]:
    """Return what axe-core has against a page: the rules it breaks, and where.

    Args:
        page: the page.
        rules: those that are asked about; all without any.
        part: what of the page is looked at; all of it without one.
    """
    axe = pytest.importorskip(
        "axe_playwright_python.sync_playwright", reason="needs axe-playwright-python"
    )
    if not page.evaluate("'axe' in window"):
        page.evaluate(axe.Axe().axe_script)
    options = {"resultTypes": ["violations"], **({"runOnly": rules} if rules else {})}
    found = page.evaluate(
        "([part, options]) => axe.run(part ?? document, options).then(({ violations }) =>"
        " violations.map(({ id, nodes }) => [id, nodes.map(({ html }) => html)]))",
        [part, options],
    )
    return [(rule, places) for rule, places in found]


@pytest.fixture
def new_page(browser: Any) -> Iterator[Open]:
    """Return what makes a page; a mistake in one of its scripts fails the test."""
    contexts, mistakes = [], []

    def make(**options: Any) -> Any:
        options.setdefault("viewport", {"width": 1280, "height": 800})
        contexts.append(browser.new_context(**options))
        page = contexts[-1].new_page()
        page.set_default_timeout(1000 * PATIENCE)
        page.on("pageerror", lambda error: mistakes.append(str(error)))
        return page

    yield make
    for context in contexts:
        context.close()
    assert mistakes == []


def until_drawn(page: Any) -> None:
    """Wait until a recording is on its page.

    It is asked from here: the page's policy lets no text be evaluated by the page itself, as
    wait_for_function() does where the first look is too early.
    """
    drawn = "window.scope && scope.state.read > 0 && scope.state.frames > 1"
    until(lambda: page.evaluate(drawn), page.content)


@pytest.fixture
def open_recording(new_page: Open) -> Open:
    """Return what opens a recording in a page of its own."""

    def make(recording: Recording | str, **options: Any) -> Any:
        page = new_page(**options)
        serve(page, recording if isinstance(recording, str) else recording.page())
        page.goto(ADDRESS)
        until_drawn(page)
        return page

    return make
