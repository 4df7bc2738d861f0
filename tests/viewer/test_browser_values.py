"""Values in the page: cursors, read-out, ranges of seeds, axes, tables, metrics."""

import re

import numpy as np
import pytest

from tests.viewer.pages import Page, numbers, samples_of, table
from tests.viewer.recorded import FORCE, folder_of, runs, wave
from twin.viewer import embedded_page

pytest.importorskip("nicegui")
pytestmark = pytest.mark.slow
MINUS = "\N{MINUS SIGN}"


def test_two_cursors_snap_to_samples_and_are_dragged(open_page, folders):
    page = open_page()
    page.page.locator("#band").uncheck()
    page.drawn()
    for part in (0.25, 0.5):
        page.page.mouse.click(*page.place(part))
    a, b = page.state["cursors"]
    time, own = samples_of(folders, page.state["cases"][0])
    assert np.min(np.abs(time - a)) == np.min(np.abs(time - b)) == 0.0
    head, _, line, *_ = table(page, ["t1", "t2", "t2 \u2212 t1"])
    assert [cell.splitlines()[0] for cell in head[1:4]] == ["at t1", "at t2", "t2 \u2212 t1"]
    assert numbers([cell.splitlines()[1] for cell in head[1:4]]) == pytest.approx([a, b, b - a], abs=1e-3)
    assert head[0].strip() == f"1 / (t2 \u2212 t1): {1 / (b - a):.4g} Hz"
    expected = [own[np.searchsorted(time, one)] for one in (a, b)]
    resolution = np.ptp(own) / 200
    assert numbers(line[1:4]) == pytest.approx([*expected, expected[1] - expected[0]], abs=resolution)
    between = own[(time >= a) & (time <= b)]
    statistics = [
        between.mean(),
        between.std(),
        np.sqrt(np.mean(between**2)),
        between.min(),
        between.max(),
        np.ptp(between),
    ]
    assert numbers(line[4:10]) == pytest.approx(statistics, abs=resolution)
    page.drag(0.5, 0.75)  # cursor B
    moved = page.state["cursors"]
    assert (moved[0], page.state["window"]) == (a, None)
    assert moved[1] == pytest.approx(1.5, abs=0.02)
    assert np.min(np.abs(time - moved[1])) == 0.0


def test_the_pointer_reads_values_and_a_click_on_a_name_dims(open_page, folders):
    page = open_page()
    page.page.mouse.move(*page.place(0.5))
    page.page.locator(".twin-hover").wait_for()
    title, *rows = page.page.locator(".twin-hover").inner_text().splitlines()
    assert float(title.split()[0]) == pytest.approx(1.0, abs=0.01)
    assert len([one for one in rows if " mm (" in one]) == 4  # means with their ranges
    page.page.get_by_role("button", name="A: slow, 2 seeds", exact=True).click()
    assert page.page.locator(".twin-dimmed").count() == 1
    page.page.mouse.move(*page.place(0.6))
    page.page.wait_for_function("document.querySelectorAll('.twin-hover > div').length === 3")
    box = page.page.locator("#chart").bounding_box()
    page.page.mouse.move(box["x"] + 5, box["y"] + box["height"] - 3)
    page.page.locator(".twin-hover").wait_for(state="hidden")


def test_seeds_are_a_mean_in_its_range_and_runs_differ_by_width(open_page, folders):
    page = open_page()
    (pane,) = page.curves()
    assert [one["label"] for one in pane["curves"]] == [
        "A: slow, 2 seeds",
        "B: slow, 2 seeds",
        "A: fast, 2 seeds",
        "B: fast, 2 seeds",
    ]
    drawn = page.page.evaluate("""() => { const { chart } = document.getElementById("chart");
        return chart.panes[0].curves.map(({ color, dash, width = 0, low, high }) => [color, width + dash.join(), [...chart.data[low].y], [...chart.data[high].y]]); }""")
    assert [one[:2] for one in drawn] == [[0, "5"], [0, "0"], [1, "5"], [1, "0"]]  # solid: limits are dashed
    seeds = [samples_of(folders, number)[1] for number in (0, 1)]
    np.testing.assert_allclose(pane["curves"][0]["y"], np.mean(seeds, axis=0))
    np.testing.assert_allclose(drawn[0][2], np.min(seeds, axis=0))
    np.testing.assert_allclose(drawn[0][3], np.max(seeds, axis=0))
    page.page.locator("#band").uncheck()
    assert len(page.curves()[0]["curves"]) == 8


def test_the_time_plays_and_stops(open_page):
    page = open_page()
    page.page.get_by_label("speed").select_option("10")
    page.page.get_by_label("play", exact=True).click()
    page.page.wait_for_function("document.getElementById('chart').chart.time > 1.99")
    page.page.get_by_label("play", exact=True).wait_for()  # it has stopped at the end
    for _ in range(50):  # until the values at the end have come
        (head, *_) = table(page, ["now"])
        if (now := numbers([head[1].partition("\n")[2]])) == [2.0]:
            break
        page.page.wait_for_timeout(100)
    assert now == [2.0]
    page.page.get_by_label("take the time cursor away").click()
    assert page.page.evaluate("document.getElementById('chart').chart.time") is None


def test_the_time_cursor_stays_in_the_window(open_page):
    """Scene, read-out and table show one instant: the picture is of the window."""
    page = open_page()
    page.page.evaluate("document.getElementById('chart').chart.notify('time', { at: 0.25 })")
    assert page.page.locator("#now").inner_text() == "0.2500 s"
    page.page.locator("#from").fill("1.2")
    page.page.locator("#from").press("Enter")
    page.page.wait_for_function("parseFloat(document.getElementById('now').innerText) === 1.2")
    assert (page.state["window"], page.state["time"]) == ([1.2, 2.0], 1.2)
    assert page.page.evaluate("document.getElementById('chart').chart.time") == 1.2
    page.page.wait_for_function(
        "parseFloat(document.querySelector('#values tr').cells[1].innerText.split('\\n')[1]) === 1.2"
    )


def test_a_time_that_is_typed_is_not_overwritten(open_page):
    """The window changes while somebody types, as that of a run in progress does each second."""
    page = open_page()
    field, change = page.page.locator("#from"), "document.getElementById('chart').chart.notify('window', "
    field.click()
    page.page.evaluate(f"{change}{{ from: 0.5, to: 1.5 }})")
    assert field.input_value() == "0.5"  # nothing is typed yet
    field.fill("0.7")
    page.page.evaluate(f"{change}{{ from: 0.6, to: 1.6 }})")
    assert (field.input_value(), page.page.locator("#to").input_value()) == ("0.7", "1.6")
    field.press("Enter")
    assert page.state["window"] == [0.7, 1.6]


def test_values_at_the_cursors_are_read_on_a_phone(browser, address):
    context = browser.new_context(viewport={"width": 360, "height": 740}, has_touch=True)
    page = Page(context, address)
    page.page.locator("#chart").scroll_into_view_if_needed()
    for part in (0.25, 0.5):
        page.page.touchscreen.tap(*page.place(part))
        page.page.wait_for_timeout(400)
    values = page.page.locator("#chart .twin-chip b")
    assert (values.first.is_visible(), values.first.inner_text()[-3:]) == (True, " mm")
    assert page.page.evaluate("document.documentElement.scrollWidth") == 360
    context.close()


def test_the_table_follows_while_the_time_plays(open_page):
    page = open_page()
    page.page.get_by_label("speed").select_option("0.25")
    page.page.get_by_label("play", exact=True).click()
    table(page, ["now"])
    page.page.wait_for_function(
        "() => { const at = parseFloat(document.querySelector('#values th small:not(:empty)').innerText); return at > 0.2 && at < 1.5; }"
    )
    assert page.page.get_by_label("pause", exact=True).locator("path").nth(1).is_visible()
    lag = page.page.evaluate(
        """() => new Promise((done) => { const lags = [], { chart } = document.getElementById("chart"), { draw } = chart;
        let painted = null;
        chart.draw = (...all) => { draw.apply(chart, all); painted = chart.time; };
        const read = () => { const at = +document.getElementById("time").value;
            if (painted !== null) lags.push(at - painted, parseFloat(document.getElementById("now").value) - parseFloat(document.querySelector("#values th small:not(:empty)").innerText));
            if (lags.length < 40) requestAnimationFrame(read); else done(Math.max(...lags.map(Math.abs))); }; requestAnimationFrame(read); })"""
    )
    assert lag < 1e-9  # curves and table have the time of the slider; they were late by a frame, and by a request
    page.page.get_by_label("pause", exact=True).click()


def test_statistics_are_gray_until_they_follow_a_cursor(open_page):
    page = open_page()
    gray = "document.getElementById('values').classList.contains('outdated')"
    page.until(f"() => !{gray}")
    page.page.route("**/statistics", lambda route: (page.page.wait_for_timeout(400), route.continue_()))
    page.page.evaluate(
        "const { chart } = document.getElementById('chart'); chart.cursors = [0.5, 1.5]; chart.notifyCursors()"
    )
    assert page.page.evaluate(gray)
    page.until(f"() => !{gray}")
    assert page.page.locator("#summarized").inner_text().startswith("between t1 and t2")
    page.page.evaluate("document.getElementById('time').value = 0.7; document.getElementById('time').oninput()")
    assert not page.page.evaluate(gray)  # they do not depend on the time cursor


def test_metrics_stand_beside_the_curves(open_page):
    page = open_page()
    metric = page.page.locator("#metrics .metric").first
    assert metric.locator("th").all_inner_texts()[1:] == ["A", "B", f"B {MINUS} A", "paper"]
    slow = metric.locator("tr").nth(1).locator("td").all_inner_texts()
    assert (slow[0], slow[1].split()[1], float(slow[4])) == ("slow", "✓", 20.0)
    metric.locator(".name").click()
    assert [one["title"] for one in page.curves()] == ["heart.velocity", "heart.position"]
    assert page.state["window"] == pytest.approx([0.5, 2.0])


def test_many_plots_stay_legible_and_the_table_has_room(open_page):
    page = open_page()
    page.page.set_viewport_size({"width": 1400, "height": 900})
    page.page.locator("#band").uncheck()
    for text in ("heart.velocity", "heart.beats", "2 * heart.velocity", "2 * heart.beats"):
        page.page.get_by_label("add an expression").fill(text)
        page.page.get_by_role("button", name="Add").first.click()
        page.page.wait_for_function("document.getElementById('signal').value === ''")
    page.drawn()
    heights = page.page.evaluate("document.getElementById('chart').chart.boxes.map((box) => box.height)")
    assert min(heights) >= 95  # three of them are seen together
    page.page.evaluate("document.getElementById('stage').scrollTop = 0")
    for part in (0.25, 0.5):
        page.page.mouse.click(*page.place(part))
    table(page, ["t2", "rate"])
    hidden = page.page.evaluate(
        "(() => { const box = document.getElementById('values'); return box.scrollWidth - box.clientWidth; })()"
    )
    assert hidden <= 0
    columns = page.page.evaluate(
        "[...document.querySelectorAll('#values tr')].slice(2, 5).map((row) => [...row.cells].slice(1, 9).map((one) => one.innerText))"
    )
    for column in zip(*columns, strict=True):
        assert len({len(text.partition(".")[2]) for text in column if text != "0"}) == 1
    page.page.get_by_role("button", name="Clear t1, t2").click()
    assert page.state["cursors"] == []


TICKS = """() => { const { chart } = document.getElementById("chart"), [pane] = chart.panes, counts = [];
    const { prototype } = CanvasRenderingContext2D, { fillText } = prototype;
    let count = 0;
    chart.height -= chart.boxes[0].height - 90;
    prototype.fillText = function (...text) { count += this.textAlign === "right"; return fillText.apply(this, text); };
    for (let k = 0; k < 60; k++) { pane.range = [0, 1 + k / 6]; count = 0; chart.draw(); counts.push(count); }
    prototype.fillText = fillText;
    return [chart.boxes[0].height, counts]; }"""


@pytest.fixture
def seeds_page(browser, tmp_path):
    """A page of two seeds, the second three times as large as the first."""
    time, force = wave(100.0, 2.0)
    cases = {("PI", seed): (time, {"sensor.force": factor * force}) for seed, factor in ((1, 1.0), (2, 3.0))}
    page = embedded_page(runs(folder_of(tmp_path / "run", cases, [FORCE])), ["sensor.force"], [0, 1])
    (tmp_path / "page.html").write_text(page.text)
    context = browser.new_context(viewport={"width": 1280, "height": 420}, offline=True)
    opened = Page(context, (tmp_path / "page.html").as_uri())
    yield opened
    context.close()
    assert opened.wrong == []


def test_the_slope_of_a_page_is_that_of_the_line(browser, tmp_path):
    """At irregular times, and without what is not a number."""
    time = np.sort(np.random.default_rng(1).uniform(0.0, 10.25, 900))
    force = 30.0 * time + 2.0 * np.sin(2 * np.pi * time)
    force[[0, 500]] = np.nan
    folder = folder_of(tmp_path / "run", {("PI", 1): (time, {"sensor.force": force})}, [FORCE])
    (tmp_path / "page.html").write_text(embedded_page(runs(folder), ["sensor.force"], [0]).text)
    context = browser.new_context(offline=True)
    page = Page(context, (tmp_path / "page.html").as_uri())
    head, *_, values = table(page, ["slope"])
    there = np.isfinite(force)
    shown = float(values[head.index("slope\n[N/s]")])
    assert shown == pytest.approx(np.polyfit(time[there], force[there], 1)[0], abs=0.05)
    context.close()


def test_statistics_of_seeds_are_those_of_metrics(browser, tmp_path):
    """The mean curve of these seeds is zero."""
    time, force = wave(100.0, 2.0)
    cases = {("PI", seed): (time, {"sensor.force": factor * (force + 1.0)}) for seed, factor in ((1, 1.0), (2, -1.0))}
    page = embedded_page(runs(folder_of(tmp_path / "run", cases, [FORCE])), ["sensor.force"], [0, 1])
    (tmp_path / "page.html").write_text(page.text)
    context = browser.new_context(offline=True)
    opened = Page(context, (tmp_path / "page.html").as_uri())
    head, *_, values = table(opened, ["std"])
    shown = dict(zip(head[1:], map(float, values[1:]), strict=True))
    assert (shown["mean"], shown["std"]) == pytest.approx((0.0, force.std()), abs=0.01)
    extremes = (
        shown["min\n(least)"],
        shown["max\n(largest)"],
    )  # of the worst seed: means would pass a limit that it fails
    assert extremes == pytest.approx((-1.0 - force.max(), 1.0 + force.max()), abs=0.02)
    assert shown["peak to peak\n(largest)"] == pytest.approx(2.0 * force.max(), abs=0.02)
    lowest = opened.page.locator("#values tr").last.locator("td").nth(head.index("min\n(least)"))
    assert lowest.get_attribute("title") == f"seeds: {-1.0 - force.max():.6g} to {1.0 - force.max():.6g}"
    opened.page.evaluate(
        "const { chart } = document.getElementById('chart'); chart.cursors = [1, 1]; chart.notifyCursors()"
    )
    opened.until("() => document.querySelector('#values tr').innerText.includes('t2 \\u2212 t1')")
    assert opened.page.locator("#summarized").inner_text().startswith("of the whole time; over seeds the mean")
    context.close()


def test_the_read_out_of_a_spectrum_has_all_curves(seeds_page):
    seeds_page.page.locator("#band").uncheck()
    seeds_page.drawn()
    seeds_page.page.locator("#chart .menu summary").first.click()
    seeds_page.page.get_by_role("button", name="Spectrum of the visible window").click()
    seeds_page.curves()
    x, y = (
        seeds_page.page.evaluate("""() => { const { canvas, boxes: [, box] } = document.getElementById("chart").chart;
        canvas.scrollIntoView({ block: "end" });
        const { left, top } = canvas.getBoundingClientRect();
        return [left + box.across(3), top + box.top + 5]; }""")
    )
    seeds_page.page.mouse.move(x, y)
    seeds_page.page.locator(".twin-hover").wait_for()
    title, *rows = seeds_page.page.locator(".twin-hover").inner_text().splitlines()
    assert float(title.split()[1]) == pytest.approx(3.0, abs=0.5)
    values = [float(text.split()[0]) for text in rows if "N²/Hz" in text]
    assert values[1] == pytest.approx(9.0 * values[0], rel=1e-2)


def test_an_axis_of_a_small_pane_has_three_ticks(seeds_page):
    """Whatever its range; only a pane of less than 80 px may have fewer."""
    height, counts = seeds_page.page.evaluate(TICKS)
    assert height == pytest.approx(90, abs=1)
    assert min(counts) >= 3


def test_the_read_out_shows_the_range_of_the_seeds(seeds_page):
    time, force = wave(100.0, 2.0)
    for part in (0.1, 0.42, 0.9):
        seeds_page.page.mouse.move(*seeds_page.place(part))
        seeds_page.page.locator(".twin-hover").wait_for()
        title, *rows = seeds_page.page.locator(".twin-hover").inner_text().splitlines()
        own = force[np.argmin(np.abs(time - float(title.split()[0])))]
        shown = re.search(r"(\S+) N \(seeds (\S+) to (\S+)\)", " ".join(rows))
        values = [float(text.replace(MINUS, "-")) for text in shown.groups()]
        assert values == pytest.approx([2.0 * own, min(own, 3.0 * own), max(own, 3.0 * own)], abs=0.02)
        assert "±" not in title  # every sample is drawn


def test_the_pointer_reads_exact_samples_and_the_bracket_is_of_seeds(browser, tmp_path):
    """Two seeds of 40,000 samples: the extremes of a pixel are drawn, and say how far they are until the samples at the pointer are read."""
    time = np.arange(40_000) / 20_000
    forces = np.random.default_rng(1).normal(size=(2, 40_000))
    cases = {("PI", seed): (time, {"sensor.force": force}) for seed, force in enumerate(forces, 1)}
    (tmp_path / "page.html").write_text(
        embedded_page(runs(folder_of(tmp_path / "run", cases, [FORCE])), ["sensor.force"], [0, 1]).text
    )
    context = browser.new_context(viewport={"width": 900, "height": 420}, offline=True)
    page = Page(context, (tmp_path / "page.html").as_uri())
    page.page.evaluate("""() => { window.seen = []; const { chart } = document.getElementById("chart"), show = chart.showReadout.bind(chart);
        chart.showReadout = (hover) => { window.seen.push(hover.title); show(hover); }; }""")
    page.page.mouse.move(*page.place(0.43))
    page.until("() => window.seen.length > 1")
    first, *_, title = page.page.evaluate("window.seen")
    distance = float(re.fullmatch(r"\S+ s, within (\S+) ms", first)[1])
    assert 0.05 < distance < 10.0
    _, *rows = page.page.locator(".twin-hover").inner_text().splitlines()
    values = [float(text) for text in re.search(r"(\S+) N \(seeds (\S+) to (\S+)\)", " ".join(rows)).groups()]
    near = np.abs(time - float(re.fullmatch(r"(\S+) s", title)[1])) <= 1.01e-4  # the time has four digits
    samples = np.array([forces.mean(axis=0), forces.min(axis=0), forces.max(axis=0)])[:, near]
    assert np.abs(samples.T - values).max(axis=1).min() < 0.01
    context.close()
