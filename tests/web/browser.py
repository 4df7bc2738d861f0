"""A browser for the tests of pages: Debian's chromium, one for a module; skipped where it or its driver is missing."""

from pathlib import Path

import pytest

CHROMIUM = Path("/usr/bin/chromium")
FLAGS = ["--no-sandbox", "--disable-gpu", "--disable-background-networking"]


@pytest.fixture(scope="session")
def chromium():
    """Where it is."""
    pytest.importorskip("playwright", reason="playwright is not installed: pip install 'catheter-twin[test]'")
    if not CHROMIUM.exists():
        pytest.skip(f"there is no {CHROMIUM}: apt-get install chromium")
    return CHROMIUM


@pytest.fixture(scope="module")
def browser(chromium):
    """One that runs; each test makes its own context."""
    from playwright.sync_api import sync_playwright

    with sync_playwright() as driver:
        one = driver.chromium.launch(executable_path=chromium, args=FLAGS)
        yield one
        one.close()
