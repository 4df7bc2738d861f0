"""Contrast of the texts of each page, light and dark, in a browser."""

import subprocess
import sys

import pytest

from tests.console.served import CARRIAGE, ROOT, console
from tests.viewer.recorded import beats, runs
from tests.web.browser import browser, chromium  # noqa: F401 - fixtures
from tests.web.contrast import contrast_failures
from twin.viewer import embedded_page

pytestmark = pytest.mark.slow
STUDY = """
title: Six hearts
scenario: beats.yaml
variants: [slow, fast]
metrics: [mean_speed]
samples: {method: latin_hypercube, count: 6, seed: 1}
vary: {heart.scale: {uniform: [0.8, 1.4], source: assumed}}
"""
EMPTY = {"light": {}, "dark": {}}
BENCH = ROOT / "hw_bridge/benches/simulated_force.yaml"


def failures_of(browser, address, ready="body", prepare=""):  # noqa: F811
    """Failures of a page with all its details open, by color scheme."""
    failures = {}
    for scheme in EMPTY:
        context = browser.new_context(viewport={"width": 1400, "height": 900}, color_scheme=scheme)
        page = context.new_page()
        page.goto(address, wait_until="commit")
        page.wait_for_selector(ready, timeout=60_000)
        page.wait_for_load_state()
        page.evaluate("document.querySelectorAll('details').forEach((each) => { each.open = true; })")
        if prepare:
            page.evaluate(f"document.querySelectorAll('{prepare}').forEach((each) => each.click())")
        page.wait_for_timeout(1500)  # colors and sections change slowly
        assert page.evaluate("document.body.classList.contains('body--dark')") == (scheme == "dark")
        failures[scheme] = contrast_failures(page)
        context.close()
    return failures


@pytest.fixture(scope="module")
def run(tmp_path_factory):
    """A run with a requirement that is met and another that is not."""
    return beats(tmp_path_factory.mktemp("contrast"))


@pytest.fixture(scope="module")
def study(run, build):
    """A study of the same scenario, which fails in some cases."""
    scenario_folder, runs_folder = run.parents[2], run.parents[1]
    (scenario_folder / "six.yaml").write_text(STUDY)
    words = ["study", str(scenario_folder / "six.yaml"), "--workers=1", f"--runs={runs_folder}", f"--build={build}"]
    subprocess.run([sys.executable, "-m", "twin", *words], check=True, capture_output=True)
    (folder,) = (runs_folder / "six").glob("2*")
    return folder


def test_texts_without_contrast_are_noticed(browser):  # noqa: F811
    page = browser.new_page()
    rows = "<p style='color: #777'>almost</p>" + "<p style='color: #767676'>enough</p>" * 10
    svg = "<svg><rect width=90 height=40 /><text x=9 y=20 fill='#333'>dark</text><text x=9 y=90 fill='#333'>beside</text></svg>"
    page.set_content(f"{rows}<p style='opacity: .5; color: #000'>faint</p><h1 style='color: #888'>large</h1>{svg}")
    assert sorted(contrast_failures(page).values()) == ["almost", "dark", "faint"]
    page.close()


def test_reports_and_viewer(browser, run, study):  # noqa: F811
    viewer = run / "viewer.html"
    viewer.write_text(embedded_page(runs(run), ["heart.position"], [0, 1, 2]).text)
    for file in (run / "report.html", viewer, study / "report.html"):
        assert failures_of(browser, file.as_uri()) == EMPTY


def test_console(browser, tmp_path, build):  # noqa: F811
    with console(runs=tmp_path, build=build) as served:
        assert failures_of(browser, served.address, ".twin-pick") == EMPTY
    with console(CARRIAGE, "--variant", "quiet", runs=tmp_path, build=build) as served:
        sections = ".q-expansion-item__container > .q-item"
        assert failures_of(browser, served.address, ".twin-chart canvas", sections) == EMPTY


def test_commissioning(browser, tmp_path, build):  # noqa: F811
    with console("--hardware", BENCH, runs=tmp_path, build=build, path="bench") as served:
        sections = ".q-expansion-item__container > .q-item"
        assert failures_of(browser, served.address, ".q-stepper", sections) == EMPTY
