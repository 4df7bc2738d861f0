"""The page as it is served, and as a file without any network; runs that go on; ways between pages."""

import os
import re
import shutil
import subprocess
import sys
import urllib.error
import urllib.request

import numpy as np
import pytest

from tests.viewer.pages import Page, table, viewed
from tests.viewer.recorded import FORCE, folder_of, runs, wave
from twin.process import process_identity
from twin.results import Journal, RecordedVariable, column_to_dict
from twin.viewer import embedded_page
from twin.viewer.curve_data import KINDS
from twin.viewer.runs import ViewedCurve

pytest.importorskip("nicegui")
pytestmark = pytest.mark.slow


def test_only_this_server_is_asked_and_only_with_the_token(open_page, address):
    page = open_page()
    base = re.match(r"http://127\.0\.0\.1:\d+/", address)[0]
    assert {one for one in page.asked if not one.startswith(("data:", "blob:"))} <= {
        address,
        *(f"{base}{path}" for path in ("lines", "values", "statistics", "scene")),
    }
    assert page.page.title() == "Two hearts"
    for path, data in (("", None), ("lines", b"{}")):
        with pytest.raises(urllib.error.HTTPError, match="403"):
            urllib.request.urlopen(f"{base}{path}", data)
    refused = page.page.evaluate(
        "async () => { const one = await fetch('/lines', {method: 'POST', body: '[1]'}); return [one.status, await one.text()]; }"
    )
    assert refused == [400, "expected a JSON object."]
    page.wrong.clear()  # the browser reports the refusal


@pytest.mark.parametrize(("width", "scheme"), [(1280, "dark"), (400, "light")])
def test_dark_and_narrow(browser, address, width, scheme):
    context = browser.new_context(viewport={"width": width, "height": 800}, color_scheme=scheme)
    page = Page(context, address).page
    paper = page.evaluate("getComputedStyle(document.body).backgroundColor")
    assert (sum(map(int, re.findall(r"\d+", paper)[:3])) < 200) == (scheme == "dark")
    assert page.evaluate("document.documentElement.scrollWidth") == width
    context.close()


def test_a_page_of_a_file_needs_no_network(browser, folders, tmp_path):
    opened = runs(*folders)
    target = tmp_path / "page.html"
    target.write_text(embedded_page(opened, ["heart.position", "abs(heart.velocity)"], [2, 6]).text)
    context = browser.new_context(offline=True)
    page = Page(context, target.as_uri())
    assert [one for one in page.asked if not one.startswith(("data:", "blob:"))] == [target.as_uri()]
    chosen = page.page.locator("#chosen").inner_text()
    assert chosen == "2 of 2 shown; seed 2 not in this page"
    first, second = page.curves()
    assert (first["title"], first["unit"], second["unit"]) == ("heart.position", "mm", "mm/s")
    begin, end = page.state["window"]
    assert begin < first["spans"][0]["from"] < end < 1.5  # around the failure, as without --signal
    page.page.locator("#all").click()
    first, _ = page.curves()
    expected = opened.samples(ViewedCurve("heart.position", 2))
    np.testing.assert_allclose(first["curves"][0]["y"], expected.shown(expected.y))
    assert (first["spans"] != [], first["limits"][0]["y"]) == (True, 4.0)
    assert page.page.evaluate("document.getElementById('chart').chart.marks") == [
        {"at": 1, "text": "heart.scale = 0.5"}
    ]
    page.drag(0.5, 0.6)
    assert page.state["window"] == pytest.approx([1.0, 1.2], abs=0.01)
    page.page.mouse.click(*page.place(0.5))
    assert len(table(page, ["t1", "mean"])) == 7
    page.page.locator("#chart .menu summary").first.click()
    page.page.locator("#chart .menu[open]").get_by_label("difference from").select_option("run A, case by case")
    less = page.curves()[1]
    own = {one["label"]: np.array(one["y"]) for one in page.curves()[0]["curves"]}
    np.testing.assert_allclose(less["curves"][0]["y"], own["B: fast, seed 1"] - own["A: fast, seed 1"], atol=1e-9)
    assert page.wrong == []
    context.close()


def test_a_spectrum_in_a_file_is_the_server_s(browser, tmp_path, monkeypatch):
    time = np.concatenate([np.arange(3001) / 1000.0, [3.0005, 3.01]])  # an odd length, not even at its end
    wave = np.sin(2 * np.pi * 7.0 * time) + np.random.default_rng(1).normal(size=len(time))
    wave[500] = np.nan
    cases = {("PI", 1): (time, {"sensor.force": wave}), ("PI", 2): (time[:1500], {"sensor.force": 2 * wave[:1500]})}
    opened = runs(folder_of(tmp_path / "run", cases, [FORCE]))
    (tmp_path / "page.html").write_text(embedded_page(opened, ["sensor.force"], [0, 1]).text)
    context = browser.new_context(offline=True)
    page = Page(context, (tmp_path / "page.html").as_uri())
    page.page.locator("#chart .menu summary").first.click()
    page.page.locator("#chart .menu[open]").get_by_text("Spectrum").click()
    assert len(page.curves()[1]["curves"]) == 1  # of the first seed, as long as seeds are shown together
    page.page.locator("#band").uncheck()
    _, shown = page.curves()
    assert (shown["title"], shown["unit"], page.wrong) == ("Spectrum of sensor.force", "N²/Hz", [])
    assert len(shown["curves"]) == 2
    for number, one in enumerate(shown["curves"]):
        line = KINDS["spectrum"](opened, ViewedCurve("sensor.force", number), (-np.inf, np.inf), 8000)
        np.testing.assert_allclose(one["x"], line.x, rtol=1e-12)
        np.testing.assert_allclose(one["y"], line.y, rtol=1e-8, atol=1e-12 * max(line.y))
    page.until("decodeURIComponent(location.hash).includes('\"band\":false')")  # written a moment later
    kept = page.page.url.partition("#")[2]
    monkeypatch.setattr("twin.viewer.page.MAX_SAMPLES", 1000)
    (tmp_path / "thin.html").write_text(embedded_page(opened, ["sensor.force"], [0, 1]).text)
    page = Page(context, (tmp_path / "thin.html").as_uri() + "#" + kept)
    assert page.page.locator("#message").inner_text() == (
        "sensor.force: the page has the extremes of its samples alone. Look at its spectrum with twin view."
    )
    (tmp_path / "thin.html").write_text(embedded_page(opened, ["sensor.force"], [0]).text)
    page = Page(context, (tmp_path / "thin.html").as_uri())  # extremes have no mean, and no standard deviation
    low, high = np.nanmin(wave), np.nanmax(wave)
    shown = [cell.replace("\u2013", "") for cell in table(page, ["mean", "RMS", "slope"])[-1][1:]]
    assert shown == ["", "", "", *(f"{value:.2f}" for value in (low, high, high - low)), "", ""]
    context.close()


@pytest.mark.parametrize("width", [1280, 360])
def test_signals_of_many_variants_have_panes_and_whole_legends(browser, tmp_path, width):
    time, force = wave(100.0, 1.0)
    other = RecordedVariable("controller.force_of_the_estimator", unit="N")
    cases = {
        (f"PI+FF+BW with the gain {k}", 1): (time, {FORCE.name: k * force, other.name: -k * force}) for k in range(5)
    }
    opened = runs(folder_of(tmp_path / "run", cases, [FORCE, other]))
    (tmp_path / "page.html").write_text(embedded_page(opened, [FORCE.name, other.name], list(range(5))).text)
    context = browser.new_context(offline=True, viewport={"width": width, "height": 740})
    page = Page(context, (tmp_path / "page.html").as_uri())
    assert [(one["title"], len(one["curves"])) for one in page.curves()] == [(FORCE.name, 5), (other.name, 5)]
    while (folded := page.page.get_by_role("button", name="all 5")).count():  # on narrow pages
        folded.first.click()
    page.page.wait_for_timeout(200)  # the panes make room for wrapped names
    rows = page.page.evaluate("""() => { const { chart } = document.getElementById("chart"), { top } = chart.canvas.getBoundingClientRect();
        return [...document.querySelectorAll(".twin-names")].map((one, k) => [one.scrollHeight - one.clientHeight,
          one.getBoundingClientRect().bottom - top - chart.boxes[k].top, chart.boxes[k].height]); }""")
    for hidden, over, height in rows:
        assert (hidden <= 0, over <= 0, height >= 100) == (True, True, True)
    assert page.wrong == []
    context.close()


def test_the_axis_of_a_spectrum_has_six_decades(browser, tmp_path):
    """A curve that is nearly zero does not press the others together."""
    time, force = wave(100.0, 2.0)
    cases = {("PI", 1): (time, {FORCE.name: force}), ("PI+FF", 1): (time, {FORCE.name: 1e-6 * force})}
    (tmp_path / "page.html").write_text(
        embedded_page(runs(folder_of(tmp_path / "run", cases, [FORCE])), [FORCE.name], [0, 1]).text
    )
    context = browser.new_context(offline=True)
    page = Page(context, (tmp_path / "page.html").as_uri())
    page.page.locator("#chart .menu summary").first.click()
    page.page.locator("#chart .menu[open]").get_by_text("Spectrum").click()
    strong, _ = page.curves()[1]["curves"]
    low = page.page.evaluate("document.getElementById('chart').chart.boxes[1].low")
    assert low == pytest.approx(1e-6 * max(strong["y"]), rel=0.5)
    context.close()


def test_a_run_that_goes_on_is_followed_to_its_end(browser, tmp_path):
    time, force = wave(1000.0, 3.0)
    folder = tmp_path / "run"
    done = folder_of(tmp_path / "done", {("PI", 1): (time, {"sensor.force": force})}, [FORCE])
    folder.mkdir()
    shutil.copyfile(done / "scenario.yaml", folder / "scenario.yaml")
    journal = Journal(folder)
    about = {"name": "run", "title": "It goes on", "description": "", "source": "", "path": "", "overrides": []}
    about |= {"started": "2026-11-22T21:00:00+00:00", "cases": [["PI", 1]], "columns": [column_to_dict(FORCE)]}
    journal.create(about, process_identity())
    journal.start_case(0)
    journal.append_line(
        rows=0, begin=0, step=1, per_second=1000, words=2, columns=[["sensor.force", 1, [], "f", "N", ""]]
    )
    words = np.stack([np.arange(3000), force.view(np.int64)], 1)
    (folder / ".recording" / "0.rows").touch()
    with viewed(folder, "--signal", "sensor.force") as address:
        page = Page(browser.new_context(), address)
        waiting = page.page.get_by_text("Waiting for the first samples.")
        assert waiting.is_visible()
        words[:1000].tofile(folder / ".recording" / "0.rows")
        waiting.wait_for(state="detached")
        page.drawn()
        assert [len(curve["x"]) for pane in page.curves() for curve in pane["curves"]] == [1000]
        assert page.page.locator("#note").inner_text() == "run, 2026-11-22 21:00, in progress"
        with (folder / ".recording" / "0.rows").open("ab") as file:
            words[1000:].tofile(file)
        page.page.wait_for_function("document.getElementById('to').value === '2.999'")
        (pane,) = page.curves()
        assert pane["curves"][0]["x"][-1] == pytest.approx(2.999, abs=0.01)  # of every pixel the extremes
        for name in ("signals.parquet", "summary.json"):
            shutil.copyfile(done / name, folder / name)
        page.page.wait_for_function("document.getElementById('note').innerText.endsWith('21:00')")
        page.drawn()
        assert page.curves()[0]["title"] == "sensor.force"
        assert page.wrong == []


def test_without_the_extra_it_writes_a_page(folders):
    code = "import sys; sys.modules['nicegui'] = None; sys.argv = sys.argv[1:]; from twin.cli import main; main()"
    done = subprocess.run(
        [sys.executable, "-c", code, "twin", "view", str(folders[0]), "--no-open"],
        capture_output=True,
        text=True,
        check=False,
        env=dict(os.environ),
    )
    assert (done.returncode, done.stderr) == (0, "")
    page = folders[0] / "signals.html"
    assert str(page) in done.stdout
    assert "pip install 'catheter-twin[console]'" in done.stdout
    page.unlink()


def test_the_report_and_the_viewer_lead_to_each_other(open_page, folders):
    page = open_page()
    page.page.get_by_role("link", name="Report B").click()
    page.page.wait_for_url("**/report?run=1")
    links = page.page.get_by_role("link", name="Open in the viewer")
    assert links.first.get_attribute("href") == "/?"
    links.last.click()
    page.page.wait_for_url("**/?signal=heart.position*")
    page.drawn()
    assert [one["title"] for one in page.curves()] == ["heart.position"]
    base = page.page.url.partition("?")[0]
    for path, text in (("report?run=2", "not a number of a run"), ("report?run=0&case=7", "not a kept case")):
        answer = page.page.request.get(f"{base}{path}")
        assert (answer.status, text in answer.text()) == (404, True)
    assert "data-viewer=" not in (folders[0] / "report.html").read_text().partition("<body>")[0]
