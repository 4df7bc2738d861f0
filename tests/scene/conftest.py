"""The browser of all pages."""

from tests.web.browser import browser, chromium

__all__ = ["browser", "chromium"]
