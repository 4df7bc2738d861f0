"""The browser of all pages, and the page of two runs."""

import pytest

from tests.viewer.pages import Page, viewed
from tests.viewer.recorded import BEATS, beats
from tests.web.browser import browser, chromium

__all__ = ["browser", "chromium"]


@pytest.fixture(scope="session")
def folders(tmp_path_factory):
    """A and B: two hearts, and the same half as far."""
    places = [tmp_path_factory.mktemp(name) for name in ("a", "b")]
    half = BEATS.replace("blend_in: 0 s", "blend_in: 0 s, scale: 0.5")
    return beats(places[0]), beats(places[1], half)


@pytest.fixture(scope="module")
def address(folders):
    """Where the page of A and B is."""
    with viewed(*folders) as found:
        yield found


@pytest.fixture
def open_page(browser, address):
    opened = []

    def one(where="", is_whole=True, **options):
        context = browser.new_context(viewport={"width": 1280, "height": 900}, **options)
        opened.append((context, Page(context, address + where)))
        page = opened[-1][1]
        if is_whole and not where:  # the page opens around the first failure
            page.page.locator("#all").click()
            page.drawn()
        return page

    yield one
    for context, page in opened:
        context.close()
        assert page.wrong == []
