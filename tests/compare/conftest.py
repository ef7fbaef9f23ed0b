"""A browser without a window, for pages."""

import shutil
import warnings

import pytest


def browser_program():
    return next(filter(None, map(shutil.which, ("chromium", "chromium-browser", "google-chrome", "chrome"))), None)


@pytest.fixture(scope="session")
def browser():
    sync_api = pytest.importorskip("playwright.sync_api")
    program = browser_program()
    if program is None:
        warnings.warn("NO CHROMIUM: the pages of comparisons are not tested", stacklevel=1)
        pytest.skip("NO CHROMIUM FOUND: install chromium to test the pages of comparisons")
    with sync_api.sync_playwright() as playwright:
        found = playwright.chromium.launch(executable_path=program, args=["--no-sandbox"])
        yield found
        found.close()


@pytest.fixture(params=["light", "dark"])
def open_page(browser, request):
    """Opens a file; no errors and nothing fetched by the end of the test."""
    context = browser.new_context(color_scheme=request.param, viewport={"width": 1200, "height": 900})
    page, trouble = context.new_page(), []
    page.on("console", lambda message: trouble.append(message.text) if message.type in ("error", "warning") else None)
    page.on("pageerror", lambda error: trouble.append(str(error)))
    page.on("request", lambda r: None if r.url.startswith(("file:", "data:")) else trouble.append(r.url))
    page.scheme = request.param

    def show(path):
        page.goto(path.resolve().as_uri())
        return page

    yield show
    context.close()
    assert not trouble
