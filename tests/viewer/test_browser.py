"""The page in a browser, as a person uses it: signals, expressions, panes, kinds of plots.

Over 400 lines: one server and its runs serve all tests.
"""

import json
import re
import shutil

import numpy as np
import pytest

from tests.viewer.pages import Page, viewed
from tests.viewer.recorded import BEATS, FORCE, beats, folder_of, runs, wave
from tests.viewer.test_verdicts import worst_window

pytest.importorskip("nicegui")
pytestmark = pytest.mark.slow
MINUS = "\N{MINUS SIGN}"


def test_what_failed_is_shown_first_and_shaded(open_page, folders):
    page = open_page(is_whole=False)
    (pane,) = page.curves()
    assert (pane["title"], pane["unit"]) == ("heart.position", "mm")
    opened = runs(*folders)
    recording = opened.runs[0].recording
    time, position = (recording.column(("fast", 1), name) for name in ("time", "heart.position"))
    first = time[(position > 4e-3) & (time >= 0.5)][0]
    assert pane["spans"][0]["from"] == first
    assert pane["limits"][0]["y"] == 4.0
    begin, end = page.state["window"]
    assert begin < first < end < first + 0.5  # around the first violation
    assert page.page.locator("#pictured").input_value() == "2"  # the scene is of the first failed case
    legend = page.page.locator("#chart .violations")
    assert legend.inner_text() == "red: fails it stays near, in A: fast"
    page.page.mouse.move(*page.place(first / 2.0 + 0.002))
    page.page.locator(".twin-hover .twin-fail").wait_for()
    assert page.page.locator(".twin-hover .twin-fail").all_inner_texts() == ["fails: it stays near, in A: fast"]
    page.page.locator("#all").click()
    page.page.locator("#expectations").get_by_text("it stays near").click()
    page.drawn()
    window = page.state["window"]
    assert window[0] < first < window[1] < first + 0.5


def test_the_first_failure_in_time_is_shown_first_with_its_limit(browser, tmp_path):
    late = "  - {name: far away later, signal: heart.position, at_least: 50 mm, from: 1.5 s}\n"
    late += "  - {name: always too fast, metric: top_speed, at_most: -1 mm/s}\n"
    early = late.partition("\n")[0].replace("later", "from the start").replace("1.5 s", "0.1 s") + "\n"
    top = "metrics:\n  top_speed: {signal: heart.velocity, reduce: max, unit: mm/s}\n"
    with viewed(
        beats(tmp_path, BEATS.replace("expect:\n", f"expect:\n{late}{early}").replace("metrics:\n", top))
    ) as address:
        context = browser.new_context(viewport={"width": 900, "height": 900})
        page = Page(context, address)
        names = page.page.locator("#expectations .outcome.bad span > b").all_inner_texts()
        assert names == ["far away from the start", "it stays near", "far away later", "always too fast"]
        page.page.locator("#expectations").get_by_text("far away later").click()
        page.drawn()
        box = page.page.evaluate("document.getElementById('chart').chart.boxes[0]")
        assert box["low"] < 50.0 < box["high"]  # far from all samples
        assert [limit["y"] for limit in page.curves()[0]["limits"]] == [50.0]  # not those of other requirements
        cases = page.page.locator("#cases")
        left = page.page.locator("#left")
        assert cases.bounding_box()["y"] + cases.bounding_box()["height"] <= (
            left.bounding_box()["y"] + left.bounding_box()["height"]
        )  # nothing of it is cut off at a medium width
        assert page.wrong == []
        context.close()


def test_the_failure_of_a_metric_is_shown_over_the_whole_time_with_a_plot(browser, tmp_path):
    text = BEATS.replace("at_most: 4 mm", "at_most: 40 mm")
    limit = "expect:\n  - {name: slowly, metric: mean_speed, at_most: 1 mm/s}\n"
    with viewed(beats(tmp_path, text.replace("expect:\n", limit))) as address:
        context = browser.new_context(viewport={"width": 1280, "height": 900})
        page = Page(context, address)
        assert page.state["window"] is None
        assert [one["title"] for one in page.curves()] == ["heart.velocity", "heart.position"]
        assert page.wrong == []
        context.close()


def test_failed_spans_of_several_cases_are_as_light_as_of_one(open_page):
    page = open_page()
    pixel = """() => { const { chart } = document.getElementById("chart"), box = chart.boxes[0], at = chart.panes[0].spans[0];
        const x = box.across((at.from + at.to) / 2) * chart.ratio, y = (box.top + 3) * chart.ratio;
        return [...chart.picture.getContext("2d").getImageData(x, y, 1, 1).data]; }"""
    both = page.page.evaluate(pixel)
    page.page.locator("#cases .seed", has_text="2").nth(1).click()
    page.drawn()
    assert page.page.evaluate(pixel) == both


def test_the_read_out_stays_beside_the_tables(open_page):
    page = open_page()
    chart = page.page.locator("#chart").bounding_box()
    for part in (0.4, 0.6, 0.95):
        page.page.mouse.move(chart["x"] + part * chart["width"], chart["y"] + 0.5 * chart["height"])
        box = page.page.locator(".twin-hover").bounding_box()
        assert box["x"] + box["width"] <= chart["x"] + chart["width"]
    page.page.set_viewport_size({"width": 900, "height": 620})  # the pane is low: above it, so that no curve is covered
    page.page.wait_for_timeout(200)
    page.page.locator("#chart").scroll_into_view_if_needed()
    page.page.mouse.move(*page.place(0.5))
    box = page.page.locator(".twin-hover").bounding_box()
    pane = page.page.evaluate("""(() => { const { chart: { canvas, boxes: [box] } } = document.getElementById("chart"), { top } = canvas.getBoundingClientRect();
        return [top + box.top, top + box.top + box.height]; })()""")
    assert box["y"] + box["height"] <= pane[0] or box["y"] >= pane[1]


def test_the_space_bar_plays_after_a_click_and_cursors_move_nothing(open_page):
    page = open_page()  # `All` was clicked
    tops = []
    for part in (None, 0.3, 0.6):
        if part is not None:
            page.page.mouse.click(*page.place(part))
            page.page.locator("#values th", has_text=f"at t{len(tops)}").wait_for()
        tops.append(page.page.locator("#play").bounding_box()["y"])
    page.page.keyboard.press(" ")
    page.page.locator("#play[aria-label=pause]").wait_for()
    page.page.locator("#values th", has_text="now").wait_for(state="attached")
    page.page.keyboard.press(" ")
    page.page.locator("#play[aria-label=play]").wait_for()
    tops.append(page.page.locator("#play").bounding_box()["y"])
    assert max(tops) - min(tops) < 8


def test_plots_begin_in_their_window_with_their_variants(browser, tmp_path):
    plots = """
  - {title: Late, signals: [heart.position], unit: mm, from: 0.5 s, to: 1.5 s, variants: [fast]}
  - {title: Later, signals: [heart.velocity], unit: mm/s, from: 1 s, to: 5 s}
  - {title: First, signals: [heart.velocity], unit: mm/s, to: 0.25 s}
  - {title: Split, signals: [heart.position, heart.position * 2], unit: mm, per: variant}
"""
    text = BEATS.replace("at_most: 4 mm", "at_most: 40 mm").partition("plots:")[0] + f"plots:{plots}"
    with viewed(beats(tmp_path, text)) as address:
        context = browser.new_context(viewport={"width": 1280, "height": 900})
        page = Page(context, address)
        assert page.state["window"] == [0.5, 2.0]  # of both plots, as far as it was recorded
        late, later = page.curves()
        assert [one["label"] for one in late["curves"]] == ["fast, 2 seeds"]
        assert [one["label"] for one in later["curves"]] == ["slow, 2 seeds", "fast, 2 seeds"]
        page.page.locator("#plots summary").click()
        page.page.get_by_role("button", name="First").click()
        page.drawn()
        assert page.state["window"] == [0, 0.25]
        page.page.locator("#all").click()
        assert page.state["window"] is None
        page.page.set_viewport_size({"width": 1280, "height": 480})
        page.page.get_by_role("button", name="Split").click()
        page.drawn()
        first, stage = (page.page.locator(name).bounding_box() for name in (".twin-legend >> nth=3", "#stage"))
        assert abs(first["y"] - stage["y"]) < 20  # of its two panes the first begins at the top
        assert page.wrong == []
        context.close()


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
    assert page.page.locator(".matches:visible").count() == 0
    assert [one["title"] for one in page.curves()] == ["heart.position", "Spectrum of abs(heart.velocity)"]
    page.page.get_by_label("kind of plot").select_option("xy")
    assert field.get_attribute("placeholder") == "signal"  # a longer one was cut
    field.fill("heart.position")
    page.page.get_by_label("signal of the x axis").fill("heart.velocity")
    page.page.get_by_label("signal of the x axis").press("Enter")
    page.page.wait_for_function("document.getElementById('signal').value === ''")
    whole, loop = page.curves()[1:]
    assert loop["title"] == "heart.position over heart.velocity"
    page.page.evaluate(
        "const { chart } = document.getElementById('chart'); chart.cursors = [0.5, 1]; chart.notifyCursors()"
    )
    page.page.locator(".twin-legend", has_text="Spectrum").filter(
        has_text=re.compile(r"0\.50* to 1\.?0* s, seed 1")
    ).wait_for()
    part = page.curves()[1]  # a spectrum is of the time between the cursors
    assert part["curves"][0]["x"][0] > 3.0 * whole["curves"][0]["x"][0]
    texts = page.page.evaluate("""() => { const { chart } = document.getElementById("chart"), texts = [], { prototype } = CanvasRenderingContext2D, { fillText } = prototype;
        prototype.fillText = function (text) { texts.push(text); };
        chart.draw();
        prototype.fillText = fillText;
        return texts; }""")
    assert {text for text in texts if text.startswith("t")} == {
        "t1",
        "t2",
    }  # of a loop; their color says of which curve


def test_a_completion_list_closes_with_add(open_page):
    """The list of `heart.position` is open for the last word, `po`, of a valid expression while the caret is inside it."""
    page = open_page()
    field = page.page.get_by_label("add an expression")
    field.fill("2 * heart.psition")
    field.evaluate("one => one.setSelectionRange(11, 11)")
    page.page.keyboard.type("o")
    page.page.locator(".matches:visible .match").first.wait_for()
    field.press("Enter")
    page.page.wait_for_function("document.getElementById('signal').value === ''")
    assert page.page.locator(".matches:visible").count() == 0
    assert page.curves()[-1]["title"] == "2 * heart.position"


def test_two_runs_begin_with_the_same_cases_and_equal_ones_say_so(browser, tmp_path):
    time, force = wave(100.0, 1.0)
    own = {(f"PI {k}", 1): (time, {"sensor.force": k * force}) for k in range(1, 6)}
    other = {key: own[key] for key in reversed(own)} | {("PI 2", 1): (time, {"sensor.force": 7 * force})}
    folders = [folder_of(tmp_path / name, cases, [FORCE]) for name, cases in (("a", own), ("b", other))]
    with viewed(*folders, "--signal", "sensor.force") as address:
        context = browser.new_context(viewport={"width": 1280, "height": 900})
        page = Page(context, address)
        (pane,) = page.curves()
        assert [one["label"] for one in pane["curves"]] == [f"{run}: PI {k}" for k in (1, 2, 3) for run in "AB"]
        names = page.page.locator(".twin-chip-name")
        page.page.locator(".twin-chip", has_text="equal to A").first.wait_for()
        assert [text.strip() for text in names.all_inner_texts()] == [
            f"{run}: PI {k}" + (run == "B") * (f" (max |B {MINUS} A| 10 N)" if k == 2 else " (equal to A)")
            for k in (1, 2, 3)
            for run in "AB"
        ]
        assert [text.split() for text in page.page.locator("#runs > span").all_inner_texts()] == [
            ["A", "a", "a"],
            ["B", "b", "b"],
        ]  # names and folders
        widths = [line.evaluate("one => one.style.strokeWidth") for line in names.locator("line").all()]
        assert widths == ["5", ""] * 3  # the first run is a wide line behind the second
        page.page.locator("#chart .menu summary").first.click()
        page.page.get_by_label("difference from").first.select_option("run A, case by case")
        page.drawn()
        page.page.locator(".twin-chip", has_text="(equal)").first.wait_for()
        texts = page.page.locator(".twin-legend").nth(1).locator(".twin-chip-name").all_inner_texts()
        shown = [text.replace("\n", " ") for text in texts]
        assert shown == [f"B: PI {k} {MINUS} A{' (equal)' * (k != 2)}" for k in (1, 2, 3)]
        assert page.wrong == []
        context.close()


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
    ranges = page.page.evaluate("document.getElementById('chart').chart.boxes.map(({ low, high }) => [low, high])")
    assert ranges[0] == ranges[1]  # of one quantity
    panes = page.page.evaluate(COLORS)
    assert [{color for color, *_ in pane.values()} for pane in panes] == [{1}, {0}]
    page.page.locator("#band").uncheck()
    page.drawn()
    seeds, slow = page.page.evaluate(COLORS)
    assert {color for color, *_ in seeds.values()} == {1}
    assert [slow[f"A: slow, seed {seed}"] for seed in (1, 2)] == [[0, 0.45, ""], [0, pytest.approx(0.315), ""]]
    swatches = page.page.locator("#values tr:has-text('slow') .twin-swatch line")
    swatches.nth(1).wait_for(state="attached")
    assert {swatches.nth(k).evaluate("one => one.style.stroke") for k in range(2)} == {"var(--line-0)"}


def test_a_wrong_expression_is_marked_and_adds_no_pane(open_page):
    page = open_page()
    field, wrong = page.page.get_by_label("add an expression"), page.page.locator(".wrong")
    for text, reason in (
        ("heart.position - ", "is not an expression"),
        ("abs(heart.position", "'(' was never closed"),
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
    page.page.get_by_label("kind of plot").select_option("time")
    field.fill("1 / 0 * heart.position")
    field.press("Enter")
    wrong.wait_for()
    assert wrong.inner_text() == "1 / 0 * heart.position: has no finite value in the visible time."
    field.fill("")  # the reason is of a text that is not there any more
    assert (wrong.count(), field.get_attribute("aria-invalid")) == (0, "false")
    assert len(page.state["panes"]) == 2
    page.page.locator("#all").click()
    for number in (page.page.locator("#cases .run input").nth(1), page.page.locator("#from")):
        for text in ("abc", ""):
            number.fill(text)
            number.press("Enter")
            wrong.wait_for()
            assert (number.input_value(), number.get_attribute("aria-invalid")) == (text, "true")
        assert (page.state["offsets"], page.state["window"]) == ([0, 0], None)
        page.page.locator("#all").click()
        wrong.wait_for(state="detached")


def test_what_was_not_judged_is_not_counted_and_many_varied_values_are_folded(browser, folders, tmp_path):
    folder = shutil.copytree(folders[0], tmp_path / "other")
    summary = json.loads((folder / "summary.json").read_text())
    summary["metrics"]["mean_speed"]["variants"]["slow"]["verdict"] = "other"
    summary["expectations"][1]["verdict"] = "skipped"
    summary["overrides"] = [f"heart.scale[{k}]=0.123456789012345" for k in range(4)]
    (folder / "summary.json").write_text(json.dumps(summary))
    with viewed(folder) as address:
        context = browser.new_context(viewport={"width": 1400, "height": 900})
        page = Page(context, address).page
        assert page.locator("#metrics summary").inner_text() == "Metrics: 1 compared, settings differ from the paper's"
        assert page.locator("#metrics th").all_inner_texts() == ["", "twin", "paper", ""]
        assert page.locator("#expectations > summary").inner_text() == "Requirements: 1 of 1 failed, 1 not judged"
        folded = page.locator("#expectations div > details")
        assert folded.inner_text() == "not judged (1)"
        folded.locator("summary").click()
        assert folded.locator(".outcome b").all_inner_texts() == ["skipped", "it never stops"]
        varied = page.locator("#cases .run details")
        assert varied.inner_text() == "4 changed values"
        varied.locator("summary").click()
        assert "heart.scale[3]=0.123457" in varied.inner_text()
        context.close()


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
            [f"fast, 2 seeds {MINUS} slow"],
        )
        assert page.wrong + again.wrong == []
        context.close()


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


def test_results_of_two_runs_share_their_rows(browser, folders, tmp_path):
    """Each run has its own count: what is not judged in one does not add to what is judged in the other."""
    other = shutil.copytree(folders[1], tmp_path / "other")
    summary = json.loads((other / "summary.json").read_text())
    summary["metrics"]["mean_speed"]["variants"]["slow"]["verdict"] = "other"
    (other / "summary.json").write_text(json.dumps(summary))
    with viewed(folders[0], other) as address:
        context = browser.new_context(viewport={"width": 1400, "height": 900})
        page = Page(context, address).page
        texts = [page.locator(f"#{name} > summary").inner_text() for name in ("metrics", "expectations")]
        assert texts[0] == "Metrics: A: 1 of 1 as in the paper; B: 1 compared, settings differ from the paper's"
        assert texts[1] == "Requirements: A: 1 of 2 failed; B: 2, none failed"
        rows = page.locator("#metrics tr")
        assert rows.nth(0).locator("th").all_inner_texts() == ["", "A", "B", f"B {MINUS} A", "paper"]
        slow = rows.nth(1).locator("td").all_inner_texts()
        first, second = (float(text.split()[0]) for text in slow[1:3])
        assert (slow[0], slow[1].split()[1], float(slow[4])) == ("slow", "✓", 20.0)
        assert float(slow[3]) == pytest.approx(second - first, abs=1e-6)
        assert rows.count() == 3
        outcomes = [text.split() for text in page.locator("#expectations .outcome > div").all_inner_texts()]
        assert outcomes == [["A", "FAIL", "B", "pass"], ["A", "pass", "B", "pass"]]
        context.close()


def test_a_failed_analysis_opens_with_its_worst_window_and_says_what_it_hides(browser, tmp_path):
    with viewed(worst_window(tmp_path / "run")) as address:
        context = browser.new_context(viewport={"width": 1400, "height": 900})
        page = Page(context, address)

        def shown():
            titles = [(pane["title"], [curve["label"] for curve in pane["curves"]]) for pane in page.curves()]
            assert titles == [("sensor.force", ["PI"]), ("windows.force_std", ["PI"])]
            begin, end = page.state["window"]
            ((span,), (again,)) = (pane["spans"] for pane in page.curves())
            assert begin < 12.0 <= span["from"] < 12.1 < end == span["to"] == 22.0 == again["to"]
            assert [limit["y"] for limit in page.curves()[1]["limits"]] == [0.006]

        shown()
        red = page.page.locator("#chart .violations").first.inner_text()
        assert red == "red: fails quiet, in PI, worst window 12.005 s to 22 s"
        page.page.locator("#all").click()
        page.page.locator("#expectations .outcome").click()
        page.drawn()
        shown()
        hidden = page.page.locator("#chart .hidden").first
        assert hidden.inner_text() == "not judged here: PI+FF"
        hidden.click()
        page.drawn()
        assert [curve["label"] for curve in page.curves()[0]["curves"]] == ["PI", "PI+FF"]
        page.page.get_by_role("button", name="Show all in each pane").click()
        page.drawn()
        assert [len(pane["curves"]) for pane in page.curves()] == [2, 2]
        page.page.locator("#metrics .name", has_text="mean").click()
        page.drawn()
        levels = [limit for limit in page.curves()[0]["limits"] if limit.get("name") == "mean"]
        assert [(level["y"] == pytest.approx(0.2, abs=1e-3), level["color"]) for level in levels] == [
            (True, 0),
            (True, 1),
        ]
        assert page.wrong == []
        context.close()


def test_a_run_that_ends_early_is_marked_and_requirements_that_differ_come_first(browser, folders, tmp_path):
    """B is too short for its metric, whose value is of another window than that of A."""
    folder = beats(
        tmp_path,
        BEATS.replace("stop_time: 2 s", "stop_time: 1.5 s").replace("from: 0.5 s, unit", "from: 0.5 s, to: 2 s, unit"),
    )
    summary = json.loads((folder / "summary.json").read_text())
    summary["expectations"][1]["verdict"] = "skipped"
    (folder / "summary.json").write_text(json.dumps(summary))
    with viewed(folders[0], folder) as address:
        context = browser.new_context(viewport={"width": 1400, "height": 900})
        page = Page(context, address).page
        assert page.locator("#metrics summary").inner_text().endswith("; B: ends at 1.5 s, before 2 s")
        cells = page.locator("#metrics tr").nth(1).locator("td").all_inner_texts()
        assert (cells[2].endswith("run too short"), cells[3]) == (True, "\N{EN DASH}")
        kinds = page.locator("#expectations div > details > summary").all_inner_texts()
        assert kinds == ["differs (1)", "failed in both (1)"]
        differs = page.locator("#expectations div > details").first
        assert differs.locator(".outcome").inner_text().split()[:4] == ["A", "pass", "B", "skipped"]
        assert differs.locator("small").first.inner_text().startswith("B: ")  # why
        page.locator("#all").click()
        part = page.locator("#values tr", has_text="B: slow").locator("small")
        part.filter(has_text="to 1.5 s, 602 samples").wait_for()  # of two seeds
        context.close()
