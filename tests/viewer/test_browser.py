"""The page in a browser, as a person uses it: served, and as a file without any network.

Over 400 lines: one browser and its runs serve all tests.
"""

import json
import os
import re
import shutil
import signal
import subprocess
import sys
import urllib.error
import urllib.request
from contextlib import contextmanager
from time import monotonic
from urllib.parse import unquote

import numpy as np
import pytest

from tests.viewer.recorded import BEATS, FORCE, beats, folder_of, runs, wave
from twin.process import process_identity
from twin.results import Journal, column_to_dict
from twin.viewer import embedded_page
from twin.viewer.curve_data import KINDS
from twin.viewer.runs import ViewedCurve

pytest.importorskip("nicegui")
pytestmark = pytest.mark.slow
MINUS = "\N{MINUS SIGN}"


@pytest.fixture(scope="module")
def folders(tmp_path_factory):
    """A and B: two hearts, and the same half as far."""
    places = [tmp_path_factory.mktemp(name) for name in ("a", "b")]
    half = BEATS.replace("blend_in: 0 s", "blend_in: 0 s, scale: 0.5")
    return beats(places[0]), beats(places[1], half)


@contextmanager
def viewed(*words):
    """Where `twin view` says that it is; at the end Ctrl-C is answered with a sentence."""
    words = ["twin", "view", *map(str, words), "--no-open"]
    server = subprocess.Popen(
        [sys.executable, "-c", "import sys; sys.argv = sys.argv[1:]; from twin.cli import main; main()", *words],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )
    try:
        yield server.stdout.readline().strip()
    finally:
        server.send_signal(signal.SIGINT)
        out, err = server.communicate(timeout=20)
    assert (out, err, server.returncode) == ("The viewer is closed.\n", "", 0)


@pytest.fixture(scope="module")
def address(folders):
    """Where the page of A and B is."""
    with viewed(*folders) as found:
        yield found


class Page:
    """A page with what it asked for, and what went wrong in it."""

    def __init__(self, context, address):
        self.asked, self.wrong = [], []
        context.set_default_timeout(60_000)  # where many tests share few cores
        self.page = context.new_page()
        self.page.on("request", lambda one: self.asked.append(one.url))
        self.page.on("pageerror", lambda error: self.wrong.append(str(error)))
        self.page.on("console", lambda said: self.wrong.append(said.text) if said.type == "error" else None)
        self.page.goto(address)
        self.drawn()

    def until(self, condition):
        """Wait for a condition; a file's security policy lets a browser evaluate it once, not again and again by itself."""
        end = monotonic() + 60.0
        while not self.page.evaluate(condition):
            assert monotonic() < end, condition
            self.page.wait_for_timeout(20)

    def drawn(self):
        """Wait until nothing is asked any more and all curves are there."""
        self.until("""() => { const { chart } = document.getElementById("chart");
            return chart && !chart.stale && !chart.asking && chart.panes.flatMap((one) => one.curves).every((one) => chart.data[one.name]); }""")

    @property
    def state(self):
        """What the address keeps; it is written a moment later."""
        self.until("""() => { const { chart } = document.getElementById("chart"), own = (one) => JSON.stringify(one);
            try { const kept = JSON.parse(decodeURIComponent(location.hash.slice(1)));
                  return own(kept.window) === own(chart.window) && own(kept.cursors) === own(chart.cursors); } catch { return false; } }""")
        return json.loads(unquote(self.page.url.partition("#")[2]))

    def place(self, part, pane=0):
        """Where a part of the time axis is on the screen."""
        return self.page.evaluate(
            """([part, pane]) => { const { chart, canvas = chart.canvas } = document.getElementById("chart"), box = chart.boxes[pane];
            const { left, top } = canvas.getBoundingClientRect(), [from, to] = chart.axis();
            return [left + box.across(from + part * (to - from)), top + box.top + box.height / 2]; }""",
            [part, pane],
        )

    def drag(self, begin, end):
        """Drag over the first pane."""
        mouse = self.page.mouse
        mouse.move(*self.place(begin))
        mouse.down()
        mouse.move(*self.place(end), steps=3)
        mouse.up()
        self.drawn()

    def curves(self):
        """Title, unit and points of every pane."""
        self.page.wait_for_timeout(60)
        self.drawn()
        return self.page.evaluate("""() => { const { chart } = document.getElementById("chart");
            return chart.panes.map(({ title, unit, curves, spans, limits }) => ({ title, unit, spans, limits,
              curves: curves.map(({ name, label }) => ({ label, x: [...chart.data[name].x], y: [...chart.data[name].y] })) })); }""")


@pytest.fixture
def open_page(browser, address):
    opened = []

    def one(where="", **options):
        context = browser.new_context(viewport={"width": 1280, "height": 900}, **options)
        opened.append((context, Page(context, address + where)))
        return opened[-1][1]

    yield one
    for context, page in opened:
        context.close()
        assert page.wrong == []


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


def test_what_failed_is_shown_first_and_shaded(open_page, folders):
    page = open_page()
    (pane,) = page.curves()
    assert (pane["title"], pane["unit"]) == ("heart.position", "mm")
    opened = runs(*folders)
    recording = opened.runs[0].recording
    time, position = (recording.column(("fast", 1), name) for name in ("time", "heart.position"))
    first = time[(position > 4e-3) & (time >= 0.5)][0]
    assert pane["spans"][0]["from"] == first
    assert pane["limits"][0]["y"] == 4.0
    page.page.get_by_text("A: it stays near").click()
    page.drawn()
    window = page.state["window"]
    assert window[0] < first < window[1] < first + 0.5


def test_signals_are_found_picked_and_dragged(open_page):
    page = open_page()
    search = page.page.get_by_label("search signals")
    search.fill("wall speed mm/s")
    assert page.page.locator("#count").inner_text() == "1 of 3"
    page.page.locator(".leaf").click()
    titles = [(one["title"], one["unit"]) for one in page.curves()]
    assert titles == [("heart.position", "mm"), ("heart.velocity", "mm/s")]
    search.fill("beats")
    page.page.locator(".leaf").drag_to(page.page.locator("#chart canvas"), target_position={"x": 400, "y": 60})
    titles = [one["title"] for one in page.curves()]
    assert titles == ["heart.position", "heart.beats", "heart.velocity"]  # of another unit: in a pane below
    page.page.locator(".leaf").click()
    assert [one["title"] for one in page.curves()] == ["heart.position", "heart.velocity"]
    page.page.get_by_label("add an expression").fill("abs(heart.position) + ")
    page.page.get_by_role("button", name="Add").first.click()
    page.drawn()
    wrong = page.page.locator(".wrong")
    wrong.wait_for()
    assert "is not an expression" in wrong.inner_text()


def test_panes_zoom_together_and_the_address_keeps_it(open_page, address):
    page = open_page()
    page.page.locator("#tree summary").click()
    page.page.locator(".leaf", has_text="velocity").click()
    page.drawn()
    page.drag(0.25, 0.75)
    kept = page.state
    assert kept["window"] == pytest.approx([0.5, 1.5], abs=0.01)
    panes = page.curves()
    assert all(curve["x"][1] > 0.48 and curve["x"][-2] < 1.52 for pane in panes for curve in pane["curves"])
    again = open_page("#" + page.page.url.partition("#")[2])
    assert again.state == kept
    assert [one["title"] for one in again.curves()] == [one["title"] for one in panes]
    page.page.keyboard.press("ArrowRight")
    assert page.state["window"] == pytest.approx([0.7, 1.7], abs=0.01)
    page.page.locator("#all").click()
    assert page.state["window"] is None
    page.page.evaluate("for (const one of ['%7B', 'null', '%7B%22panes%22:%5B%7B%7D%5D%7D']) location.hash = one")
    assert [one["title"] for one in page.curves()] == [one["title"] for one in panes]


def table(page, wanted):
    """The rows of the table of values, once its heading has some columns."""
    page.page.wait_for_function(
        "wanted => { const head = document.querySelector('#values tr')?.innerText ?? ''; return wanted.every((one) => head.includes(one)); }",
        arg=wanted,
    )
    rows = page.page.locator("#values tr")
    return [rows.nth(k).locator("th, td").all_inner_texts() for k in range(rows.count())]


def numbers(texts):
    """The numbers that cells begin with."""
    return [float(text.split()[0]) for text in texts]


def samples_of(folders, number, signal="heart.position"):
    """Times and shown values of a case of A and B."""
    own = runs(*folders).samples(ViewedCurve(signal, number))
    return own.time, own.shown(own.y)


def test_two_cursors_snap_to_samples_and_are_dragged(open_page, folders):
    page = open_page()
    page.page.locator("#band").uncheck()
    page.drawn()
    for part in (0.25, 0.5):
        page.page.mouse.click(*page.place(part))
    a, b = page.state["cursors"]
    time, own = samples_of(folders, page.state["cases"][0])
    assert np.min(np.abs(time - a)) == np.min(np.abs(time - b)) == 0.0
    _, times, _, line, *_ = table(page, ["A", "B", "B \u2212 A"])
    assert numbers(times[1:4]) == pytest.approx([a, b, b - a], abs=1e-3)
    assert times[4] == f"1 / (B \u2212 A): {1 / (b - a):.4g} Hz"
    expected = [own[np.searchsorted(time, one)] for one in (a, b)]
    resolution = np.ptp(own) / 1000
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


def test_seeds_are_a_mean_in_its_range_and_runs_differ_by_dash(open_page, folders):
    page = open_page()
    (pane,) = page.curves()
    assert [one["label"] for one in pane["curves"]] == [
        "A: slow, 2 seeds",
        "A: fast, 2 seeds",
        "B: slow, 2 seeds",
        "B: fast, 2 seeds",
    ]
    drawn = page.page.evaluate("""() => { const { chart } = document.getElementById("chart");
        return chart.panes[0].curves.map(({ color, dash, low, high }) => [color, dash.join(), [...chart.data[low].y], [...chart.data[high].y]]); }""")
    assert [one[:2] for one in drawn] == [[0, ""], [1, ""], [0, "7,3"], [1, "7,3"]]
    seeds = [samples_of(folders, number)[1] for number in (0, 1)]
    np.testing.assert_allclose(pane["curves"][0]["y"], np.mean(seeds, axis=0))
    np.testing.assert_allclose(drawn[0][2], np.min(seeds, axis=0))
    np.testing.assert_allclose(drawn[0][3], np.max(seeds, axis=0))
    page.page.locator("#band").uncheck()
    assert len(page.curves()[0]["curves"]) == 8


def test_a_name_is_completed_and_kinds_of_plots_are_at_the_top(open_page):
    page = open_page()
    field = page.page.get_by_label("add an expression")
    field.press_sequentially("m")
    assert page.page.locator(".matches:visible .match").first.inner_text() == "min("
    field.fill("")
    field.press_sequentially("abs(vel")
    page.page.locator(".matches:visible .match").first.wait_for()
    field.press("ArrowDown")
    field.press("Enter")
    assert field.input_value() == "abs(heart.velocity"
    field.press_sequentially(")")
    page.page.get_by_label("kind of plot").select_option("spectrum")
    field.press("Enter")
    page.page.wait_for_function("document.getElementById('signal').value === ''")
    assert [one["title"] for one in page.curves()] == ["heart.position", "Spectrum of abs(heart.velocity)"]
    page.page.get_by_label("kind of plot").select_option("xy")
    field.fill("heart.position")
    page.page.get_by_label("signal of the x axis").fill("heart.velocity")
    page.page.get_by_label("signal of the x axis").press("Enter")
    page.page.wait_for_function("document.getElementById('signal').value === ''")
    assert page.curves()[-1]["title"] == "heart.position over heart.velocity"


def test_the_time_plays_and_stops(open_page):
    page = open_page()
    page.page.get_by_label("speed").select_option("10")
    page.page.get_by_label("play", exact=True).click()
    page.page.wait_for_function("document.getElementById('chart').chart.time > 1.99")
    page.page.get_by_label("play", exact=True).wait_for()  # it has stopped at the end
    for _ in range(50):  # until the values at the end have come
        (head, times, *_) = table(page, ["now"])
        if (now := numbers([times[head.index("now")]])) == [2.0]:
            break
        page.page.wait_for_timeout(100)
    assert now == [2.0]
    page.page.get_by_label("take the time cursor away").click()
    assert page.page.evaluate("document.getElementById('chart').chart.time") is None


COLORS = """() => { const { chart } = document.getElementById("chart");
    return chart.panes.map(({ curves }) => Object.fromEntries(curves.map(({ label, color, opacity, dash }) => [label, [color, opacity, dash.join()]]))); }"""


def test_a_variant_keeps_its_color(open_page):
    page = open_page()
    (shown,) = page.page.evaluate(COLORS)
    assert {label[0:7]: color for label, (color, *_) in shown.items()} == {
        "A: slow": 0,
        "A: fast": 1,
        "B: slow": 0,
        "B: fast": 1,
    }
    for button in page.page.get_by_role("button", name="slow", exact=True).all():
        button.click()
    page.drawn()
    assert page.page.evaluate(COLORS) == [{label: look for label, look in shown.items() if "fast" in label}]
    page.page.get_by_role("button", name="slow", exact=True).first.click()
    page.page.locator("#chart .menu summary").first.click()
    page.page.get_by_text("A pane for each variant").click()
    page.drawn()
    panes = page.page.evaluate(COLORS)
    assert [{color for color, *_ in pane.values()} for pane in panes] == [{1}, {0}]
    page.page.locator("#band").uncheck()
    page.drawn()
    seeds, slow = page.page.evaluate(COLORS)
    assert {color for color, *_ in seeds.values()} == {1}
    assert [slow[f"A: slow, seed {seed}"] for seed in (1, 2)] == [[0, 1, ""], [0, 0.7, ""]]
    swatches = page.page.locator("#values tr:has-text('slow') .twin-swatch line")
    swatches.nth(1).wait_for(state="attached")
    assert {swatches.nth(k).evaluate("one => one.style.stroke") for k in range(2)} == {"var(--line-0)"}


def test_a_wrong_expression_is_marked_and_adds_no_pane(open_page):
    page = open_page()
    field, wrong = page.page.get_by_label("add an expression"), page.page.locator(".wrong")
    for text, reason in (
        ("heart.position - ", "is not an expression"),
        ("heart.position - nosuch.x", "'nosuch.x' was not recorded"),
        ("derivative(heart.position)", "cannot be used"),
    ):
        field.fill(text)
        field.press("Enter")
        page.page.locator(".wrong", has_text=reason).wait_for()
        assert (field.input_value(), field.get_attribute("aria-invalid"), wrong.count()) == (text, "true", 1)
        assert len(page.curves()) == 1
    field.fill("2 * heart.position")
    field.press("Enter")
    wrong.wait_for(state="detached")
    page.page.wait_for_function("document.getElementById('chart').chart.panes.length === 2")
    assert (field.input_value(), field.get_attribute("aria-invalid")) == ("", "false")
    page.page.get_by_label("kind of plot").select_option("xy")
    field.fill("heart.position")
    across = page.page.get_by_label("signal of the x axis")
    across.fill("nosuch.x")
    across.press("Enter")
    wrong.wait_for()
    assert (field.get_attribute("aria-invalid"), across.get_attribute("aria-invalid")) == ("false", "true")
    page.page.locator("#all").click()
    wrong.wait_for(state="detached")


def test_a_passed_expectation_shows_what_is_judged(browser, tmp_path):
    text = BEATS + "  - {title: Other, signals: [heart.velocity]}\n"
    text = text.replace(
        "  - {name: it never stops, ",
        "  - {name: fast beats, signal: heart.beats, at_least: 0, from: 1 s, to: 1.5 s, variants: [fast]}\n"
        "  - {name: it never stops, ",
    ).replace(", tolerance: 90 %", "")
    with viewed(beats(tmp_path, text)) as address:
        context = browser.new_context(viewport={"width": 1400, "height": 900})
        page = Page(context, address)
        assert page.page.locator("#metrics summary").inner_text() == "Metrics: 1 compared, no tolerance given"
        page.page.locator(".outcome", has_text="fast beats").click()
        page.drawn()
        assert page.state["window"] == [1.0, 1.5]
        assert [curve["label"] for curve in page.curves()[0]["curves"]] == ["fast, 2 seeds"]
        assert len(page.curves()[1]["curves"]) == 2
        again = Page(context, page.page.url)
        assert [curve["label"] for curve in again.curves()[0]["curves"]] == ["fast, 2 seeds"]
        page.page.locator("#chart .menu summary").first.click()
        page.page.get_by_text("Show all variants").click()
        assert len(page.curves()[0]["curves"]) == 2
        page.page.locator("#chart .menu summary").first.click()
        page.page.get_by_label("difference from").first.select_option("slow, seed by seed")
        less = page.curves()[1]
        assert (less["title"], [curve["label"] for curve in less["curves"]]) == (
            f"heart.beats {MINUS} slow",
            [f"fast, seed {seed} {MINUS} slow" for seed in (1, 2)],
        )
        assert page.wrong + again.wrong == []
        context.close()


def test_plots_stay_tall_and_the_table_has_room(open_page):
    page = open_page()
    page.page.set_viewport_size({"width": 1400, "height": 900})
    page.page.locator("#band").uncheck()
    for text in ("heart.velocity", "heart.beats", "2 * heart.velocity", "2 * heart.beats"):
        page.page.get_by_label("add an expression").fill(text)
        page.page.get_by_role("button", name="Add").first.click()
        page.page.wait_for_function("document.getElementById('signal').value === ''")
    page.drawn()
    heights = page.page.evaluate("document.getElementById('chart').chart.boxes.map((box) => box.height)")
    assert min(heights) >= 114
    legends = page.page.evaluate("[...document.querySelectorAll('.twin-names')].map((one) => one.offsetHeight)")
    assert max(legends) <= 50
    page.page.evaluate("document.getElementById('drawing').scrollTop = 0")
    for part in (0.25, 0.5):
        page.page.mouse.click(*page.place(part))
    table(page, ["B", "rate"])
    hidden = page.page.evaluate(
        "(() => { const box = document.getElementById('values'); return box.scrollWidth - box.clientWidth; })()"
    )
    assert hidden <= 0
    columns = page.page.evaluate(
        "[...document.querySelectorAll('#values tr')].slice(3, 6).map((row) => [...row.cells].slice(1, 9).map((one) => one.innerText))"
    )
    for column in zip(*columns, strict=True):
        assert len({len(text.partition(".")[2]) for text in column if text != "0"}) == 1
    page.page.get_by_role("button", name="Clear A, B").click()
    assert page.state["cursors"] == []


def test_values_at_the_cursors_are_read_on_a_phone(browser, address):
    context = browser.new_context(viewport={"width": 360, "height": 740}, has_touch=True)
    page = Page(context, address)
    page.page.locator("#chart").scroll_into_view_if_needed()
    for part in (0.25, 0.5):
        page.page.touchscreen.tap(*page.place(part))
        page.page.wait_for_timeout(400)
    values = page.page.locator("#chart .twin-chip b")
    assert (values.first.is_visible(), "\N{RIGHTWARDS ARROW}" in values.first.inner_text()) == (True, True)
    assert page.page.evaluate("document.documentElement.scrollWidth") == 360
    context.close()


def test_the_table_follows_while_the_time_plays(open_page):
    page = open_page()
    page.page.get_by_label("speed").select_option("0.5")
    page.page.get_by_label("play", exact=True).click()
    head, *_ = table(page, ["now"])
    column = head.index("now")
    page.page.wait_for_function(
        "k => { const at = parseFloat(document.querySelectorAll('#values tr')[1].cells[k].innerText); return at > 0.5 && at < 1.9; }",
        arg=column,
    )
    assert page.page.get_by_label("pause", exact=True).locator("path").nth(1).is_visible()
    page.page.get_by_label("pause", exact=True).click()


def test_panes_fill_the_page_and_their_border_is_dragged(open_page):
    page = open_page()
    page.page.locator("#tree summary").click()
    page.page.locator(".leaf", has_text="velocity").click()
    page.drawn()
    boxes = "(() => { const { chart } = document.getElementById('chart'); return chart.boxes.map(({ height, edge }) => [height, edge]); })()"
    page.page.locator("#values tr", has_text="velocity").wait_for()  # the table takes height from the chart
    (one, edge), (two, _) = page.page.evaluate(boxes)
    assert one == pytest.approx(two)
    bottom = page.page.locator("#values").bounding_box()
    assert bottom["y"] + bottom["height"] == pytest.approx(900, abs=12)  # to the end of the window
    mouse = page.page.mouse
    for _ in range(3):  # on a busy machine the page may still be laid out anew between
        chart = page.page.locator("#chart canvas").bounding_box()
        (one, edge), (two, _) = page.page.evaluate(boxes)
        mouse.move(chart["x"] + 300, chart["y"] + edge)
        mouse.down()
        mouse.move(chart["x"] + 300, chart["y"] + edge - 60, steps=3)
        mouse.up()
        page.page.wait_for_timeout(1000)
        if page.page.evaluate(boxes)[0][0] < one - 50:
            break
    taller, smaller = page.page.evaluate(boxes)[1][0], page.page.evaluate(boxes)[0][0]
    assert (smaller, taller) == (pytest.approx(one - 60, abs=2), pytest.approx(two + 60, abs=2))


def test_metrics_stand_beside_the_curves(open_page):
    page = open_page()
    metric = page.page.locator("#metrics .metric").first
    assert metric.locator("th").all_inner_texts()[1:3] == ["twin", "paper"]
    slow = metric.locator("tr").nth(1).locator("td").all_inner_texts()
    assert (slow[0], float(slow[2]), slow[3]) == ("slow", 20.0, "pass")
    metric.locator(".name").click()
    assert [one["title"] for one in page.curves()] == ["heart.velocity", "heart.position"]
    assert page.state["window"] == pytest.approx([0.5, 2.0])


def test_difference_spectrum_and_x_y_from_the_menu(open_page):
    page = open_page()

    def choose(text):
        page.page.locator("#chart .menu summary").first.click()
        page.page.locator("#chart .menu[open]").get_by_text(text).click()
        page.drawn()

    def subtract(text):
        page.page.locator("#chart .menu summary").first.click()
        page.page.locator("#chart .menu[open]").get_by_label("difference from").select_option(text)
        page.drawn()

    page.page.locator("#band").uncheck()
    subtract("run A, case by case")
    choose("Spectrum of the visible window")
    page.page.locator("#chart .menu summary").first.click()
    page.page.get_by_placeholder("x-y plot: over signal").first.fill("heart.velocity")
    page.page.keyboard.press("Enter")
    page.page.wait_for_function("document.getElementById('chart').chart.panes.length === 4")
    titles = [(one["title"], one["unit"]) for one in page.curves()]
    assert titles == [
        ("heart.position", "mm"),
        ("heart.position over heart.velocity", "mm"),
        ("Spectrum of heart.position", "mm²/Hz"),
        (f"heart.position {MINUS} A", "mm"),
    ]
    whole, _, _, less = page.curves()
    own = {one["label"]: one for one in whole["curves"]}
    assert less["curves"]
    for one in less["curves"]:
        case = one["label"].removesuffix(f" {MINUS} A")
        expected = np.array(own[case]["y"]) - own[case.replace("B:", "A:")]["y"]
        np.testing.assert_allclose(one["y"], expected, atol=1e-9)


def test_runs_are_moved_in_time(open_page):
    page = open_page()
    page.page.get_by_title("by how much the run is moved").nth(1).fill("0.5")
    page.page.keyboard.press("Enter")
    (pane,) = page.curves()
    first = {one["label"][0]: one["x"][0] for one in pane["curves"]}
    assert first == {"A": 0.0, "B": 0.5}


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
    first, second = page.curves()
    assert (first["title"], first["unit"], second["unit"]) == ("heart.position", "mm", "mm/s")
    expected = opened.samples(ViewedCurve("heart.position", 2))
    np.testing.assert_allclose(first["curves"][0]["y"], expected.shown(expected.y))
    assert (first["spans"] != [], first["limits"][0]["y"]) == (True, 4.0)
    assert page.page.evaluate("document.getElementById('chart').chart.marks") == [
        {"at": 1, "text": "heart.scale = 0.5"}
    ]
    page.drag(0.5, 0.6)
    assert page.state["window"] == pytest.approx([1.0, 1.2], abs=0.01)
    page.page.mouse.click(*page.place(0.5))
    assert len(table(page, ["A", "mean"])) == 8
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
    shown = table(page, ["mean", "RMS", "slope"])[-1][1:]
    assert [cell.replace("\u2013", "") for cell in shown] == [
        "",
        "",
        "",
        *(f"{v:.2f}" for v in (low, high, high - low)),
        "",
        "",
    ]
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
