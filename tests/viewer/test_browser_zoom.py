"""Zooming, its undo, cursors, and what the panes show of the space they have."""

from itertools import pairwise

import numpy as np
import pytest

from tests.viewer.pages import Page, table, viewed
from tests.viewer.recorded import BEATS, FORCE, PLACE, beats, folder_of, runs, wave
from twin.results import RecordedVariable
from twin.viewer import embedded_page

pytest.importorskip("nicegui")
pytestmark = pytest.mark.slow
MINUS = "\N{MINUS SIGN}"
BOX = "(() => { const { top, height, low, high } = document.getElementById('chart').chart.boxes[0]; return [top, height, low, high]; })()"


def history(page, steps):
    """Wait until the browser has a number of steps of this page."""
    page.until(f"() => history.state === {steps}")


def test_cursors_survive_a_double_click_and_a_third_click(open_page):
    page = open_page()
    mouse = page.page.mouse
    for part in (0.25, 0.5):
        mouse.click(*page.place(part))
        page.page.wait_for_timeout(600)  # no double-click
    a, b = page.state["cursors"]
    page.drag(0.3, 0.7)
    assert page.state["window"] is not None
    mouse.dblclick(*page.place(0.4))
    page.drawn()
    assert (page.state["window"], page.state["cursors"]) == (None, [a, b])
    page.page.wait_for_timeout(600)
    mouse.click(*page.place(0.6))  # the nearer one moves
    moved = page.state["cursors"]
    assert (moved[0], moved[1]) == (a, pytest.approx(1.2, abs=0.02))
    page.page.wait_for_timeout(600)
    mouse.click(*page.place(moved[1] / 2))
    assert page.state["cursors"] == [a]


def test_a_zoom_is_undone_by_key_button_and_browser(open_page):
    page = open_page()
    page.until("() => !document.getElementById('undo').disabled")  # of the whole time, after the first failure
    begin = page.page.evaluate("history.state")
    page.drag(0.2, 0.6)
    zoomed = page.state["window"]
    history(page, begin + 1)
    page.drag(0.2, 0.6)
    history(page, begin + 2)
    page.page.keyboard.press("Control+z")
    history(page, begin + 1)
    assert page.state["window"] == zoomed
    page.page.locator("#undo").click()
    history(page, begin)
    assert page.state["window"] is None
    page.page.keyboard.press("Control+Shift+Z")
    history(page, begin + 1)
    assert page.state["window"] == zoomed
    page.page.go_back()
    assert page.state["window"] is None


def test_a_vertical_drag_and_the_wheel_over_numbers_zoom_y(open_page):
    page = open_page()
    x, y = page.place(0.5)
    page.page.mouse.move(x, y - 60)
    page.page.mouse.down()
    page.page.mouse.move(x + 3, y + 20, steps=4)
    page.page.mouse.up()
    page.until("() => !!document.getElementById('chart').chart.panes[0].range")
    page.page.wait_for_timeout(600)
    state = page.state
    low, high = state["panes"][0]["range"]
    assert (state["window"], state["cursors"]) == (None, [])
    assert page.page.evaluate(BOX)[2:] == [low, high]
    page.page.mouse.move(page.page.locator("#chart").bounding_box()["x"] + 20, y)
    page.page.mouse.wheel(0, 400)
    page.page.wait_for_timeout(600)
    wider = page.state["panes"][0]["range"]
    assert page.state["window"] is None
    assert wider[1] - wider[0] == pytest.approx((high - low) * 1.0015**400)
    page.page.mouse.dblclick(x, y)
    page.page.wait_for_timeout(600)
    assert "range" not in page.state["panes"][0]


def test_the_wheel_zooms_time_and_frequency_up_to_their_ends(open_page):
    page = open_page()
    page.page.locator("#chart .menu summary").first.click()
    page.page.get_by_role("button", name="Spectrum of the visible window").click()
    page.curves()
    page.page.mouse.move(*page.place(0.5))
    for distance in (-800, 400, 400, 400, 400):
        page.page.mouse.wheel(0, distance)
    page.page.wait_for_timeout(600)
    assert page.state["window"] == pytest.approx([0.0, 2.0], abs=0.01)  # it was -4 to 6 s
    page.page.keyboard.press("ArrowRight")
    page.page.wait_for_timeout(600)
    assert page.state["window"] == pytest.approx([0.0, 2.0], abs=0.01)
    page.drawn()
    x, y = page.page.evaluate("""() => { const { canvas, boxes: [, box] } = document.getElementById("chart").chart;
        canvas.scrollIntoView({ block: "end" });
        const { left, top } = canvas.getBoundingClientRect();
        return [left + box.across(10), top + box.top + box.height / 2]; }""")
    page.page.mouse.move(x, y)
    page.page.mouse.wheel(0, -400)
    page.page.wait_for_timeout(600)
    low, high = page.state["panes"][1]["domain"]
    assert (low < 10.0 < high, "range" in page.state["panes"][1]) == (True, False)
    for _ in range(3):
        page.page.mouse.wheel(0, 400)
    page.page.wait_for_timeout(600)
    ends = page.page.evaluate("""() => { const { chart } = document.getElementById("chart"), { x } = chart.data[chart.panes[1].curves[0].name];
        return [x[0], x.at(-1)]; }""")
    assert page.state["panes"][1]["domain"] == pytest.approx(ends, rel=1e-3)


def test_three_panes_are_seen_together_and_the_scene_opens_when_it_plays(browser, folders):
    names = [word for name in ("position", "velocity", "beats") for word in ("--signal", f"heart.{name}")]
    with viewed(*folders, *names) as address:
        context = browser.new_context(viewport={"width": 1400, "height": 900})
        page = Page(context, address)
        page.page.wait_for_timeout(500)
        stage, chart = (page.page.locator(name).bounding_box() for name in ("#stage", "#chart canvas"))
        assert chart["y"] + chart["height"] <= stage["y"] + stage["height"] + 8
        boxes = page.page.evaluate("document.getElementById('chart').chart.boxes.map(({ height }) => height)")
        assert (len(boxes), min(boxes) >= 80) == (3, True)
        heights = [names.bounding_box()["height"] for names in page.page.locator(".twin-legend .twin-names").all()]
        assert max(heights) <= 40  # two lines
        scene = page.page.locator("#scene")
        assert scene.get_attribute("open") is None
        page.page.get_by_label("play", exact=True).click()
        assert scene.get_attribute("open") is not None
        assert page.wrong == []
        context.close()


@pytest.mark.parametrize(("height", "is_low"), [(900, False), (600, True)])
def test_two_panes_with_their_times_are_seen_together(browser, tmp_path, height, is_low):
    plots = "  - {title: Fast, signals: [heart.velocity], unit: mm/s}\n"
    with viewed(beats(tmp_path, BEATS.replace("at_most: 4 mm", "at_most: 40 mm") + plots)) as address:
        context = browser.new_context(viewport={"width": 1400, "height": height})
        page = Page(context, address)
        page.page.wait_for_timeout(500)  # the scene and the table take their room
        stage, chart = (page.page.locator(name).bounding_box() for name in ("#stage", "#chart canvas"))
        assert chart["y"] + chart["height"] <= stage["y"] + stage["height"] + 8
        drawn = page.page.evaluate("""() => { const { chart } = document.getElementById("chart"), texts = [], { prototype } = CanvasRenderingContext2D, { fillText } = prototype;
            prototype.fillText = function (text, x, y) { if (String(text).endsWith(" s")) texts.push(y); };
            chart.draw();
            prototype.fillText = fillText;
            return [texts, chart.boxes.map(({ top, height }) => top + height), chart.boxes.map(({ height }) => height)]; }""")
        assert (len(drawn[0]), min(drawn[2]) >= 90) == (2, True)
        assert all(0 < at - bottom < 10 for at, bottom in zip(*drawn[:2], strict=True))
        assert (
            page.page.evaluate("['scene', 'values'].map((id) => document.getElementById(id).open)") == [not is_low] * 2
        )
        assert page.page.get_by_label("add an expression").bounding_box()["width"] > 450
        position = page.page.evaluate("getComputedStyle(document.getElementById('scene')).position")
        assert position == ("static" if is_low else "sticky")  # an open scene stays in view
        page.page.get_by_label("add an expression").fill("heart.beats")
        page.page.get_by_label("add an expression").press("Enter")
        page.until("() => document.getElementById('chart').chart.panes.length === 3")
        page.drawn()
        assert page.page.locator("#scene").get_attribute("open") is None  # three panes need its room
        title, stage = page.page.locator(".twin-legend").last.bounding_box(), page.page.locator("#stage").bounding_box()
        assert stage["y"] <= title["y"] <= stage["y"] + stage["height"] - 50  # no curve without a name
        assert page.wrong == []
        context.close()


@pytest.fixture
def held(tmp_path):
    """A force of 0.14 to 0.27 N in a band from -1 to 2 N, and a loop."""
    time, force = wave(200.0, 10.0, 0.5, 0.065)
    columns = {"sensor.force": 0.205 + force, "tip.position": 1e-3 * time}
    folder = folder_of(tmp_path / "held", {("PI", seed): (time, columns) for seed in (1, 2)}, [FORCE, PLACE])
    plots = """
plots:
  - {title: Force, signals: [sensor.force], unit: N, band: [-1 N, 2 N], from: 4 s}
  - {title: Loop, xy: [tip.position, sensor.force], unit: N, x_unit: mm, from: 4 s}
  - {title: Early, signals: [tip.position], unit: mm, from: 3 s, to: 5 s}
"""
    (folder / "scenario.yaml").write_text(f"title: held\nstop_time: 10 s\nstep: 5 ms\nmembers: {{}}\n{plots}")
    return folder


def test_the_vertical_axis_fits_the_curves_and_an_x_y_plot_shows_times(browser, held):
    with viewed(held) as address:
        context = browser.new_context(viewport={"width": 1400, "height": 900})
        page = Page(context, address)
        assert page.state["window"] == pytest.approx([4.0, 9.995])
        _, height, low, high = page.page.evaluate(BOX)
        assert height >= 130
        assert (low, high) == (pytest.approx(0.132, abs=0.01), pytest.approx(0.278, abs=0.01))
        drawn = page.page.evaluate("""() => { const { chart } = document.getElementById("chart"), texts = [], { fillText } = CanvasRenderingContext2D.prototype, circles = [], { arc } = CanvasRenderingContext2D.prototype;
            CanvasRenderingContext2D.prototype.fillText = function (text, x) { texts.push([text, x + this.measureText(text).width <= chart.width - 14]); };
            CanvasRenderingContext2D.prototype.arc = function (x, y) { circles.push([x, y]); };
            chart.cursors = [5]; chart.time = 6; chart.draw();
            Object.assign(CanvasRenderingContext2D.prototype, { fillText, arc });
            const { across } = chart.boxes[1];
            const times = circles.map(([x]) => across.inverse(x));
            CanvasRenderingContext2D.prototype.fillText = function (text, x) { texts.push([text, x + this.measureText(text).width <= chart.width - 14]); };
            chart.cursors = [9.99]; chart.time = null; chart.draw();
            Object.assign(CanvasRenderingContext2D.prototype, { fillText });
            return [texts, times]; }""")
        assert drawn[0].count(["t1", True]) >= 3  # a name at the right edge of the loop is left of its point
        assert page.page.locator(".twin-beyond").first.inner_text().endswith("band 2 \N{UPWARDS ARROW}")
        assert drawn[1] == pytest.approx([5.0, 6.0], abs=0.01)  # the loop is at its points of these times
        x, y = (
            page.page.evaluate("""() => { const { chart, canvas = chart.canvas } = document.getElementById("chart"), box = chart.boxes[1];
            chart.element.scrollIntoView({ block: "end" });
            const { left, top } = canvas.getBoundingClientRect(), { x, y } = chart.data[chart.panes[1].curves[0].name];
            return [left + box.across(x[400]), top + box.down(y[400])]; }""")
        )
        page.page.mouse.move(x, y)
        readout = page.page.locator(".twin-hover")
        readout.wait_for()
        time, _, value = readout.inner_text().splitlines()
        assert float(time.split()[0]) == pytest.approx(
            float(value.split()[3]), abs=0.01
        )  # the position is the time in mm
        page.page.locator("#plots summary").click()
        page.page.get_by_role("button", name="Early").click()
        page.drawn()
        assert page.state["window"] == pytest.approx([4.0, 9.995])  # a part of it is there
        below = page.page.locator("#chart").bounding_box()
        stage = page.page.locator("#stage").bounding_box()
        assert below["y"] + below["height"] - stage["y"] - stage["height"] < 100  # most of the new pane is seen
        assert page.wrong == []
        context.close()


def test_a_page_of_one_file_opens_as_the_viewer(browser, held, tmp_path):
    (tmp_path / "page.html").write_text(embedded_page(runs(held), (), [0]).text)
    context = browser.new_context(viewport={"width": 1400, "height": 900})
    page = Page(context, (tmp_path / "page.html").as_uri())
    assert page.state["window"] == pytest.approx([4.0, 9.995])
    assert [one["title"] for one in page.curves()] == ["sensor.force", "sensor.force over tip.position"]
    assert page.page.locator("#chosen").inner_text() == "1 of 1 shown; seed 2 not in this page"
    assert not page.page.locator("#together").is_visible()  # one seed has no range
    page.drag(0.6, 0.8)
    page.until("() => history.state === 1")
    page.page.keyboard.press("Control+z")
    page.until("() => history.state === 0")
    assert page.state["window"] == pytest.approx([4.0, 9.995])
    assert page.wrong == []
    context.close()


def test_the_table_has_the_unit_of_the_axis_and_the_read_out_stays_in_its_pane(browser, held):
    with viewed(held) as address:
        context = browser.new_context(viewport={"width": 1400, "height": 900})
        page = Page(context, address)
        *_, title, row = table(page, ["mean"])
        assert title[0] == "sensor.force [N]"
        assert float(row[1]) == pytest.approx(0.205, abs=1e-3)
        x, y = page.place(0.3)
        page.page.mouse.move(x, y)
        box = page.page.locator(".twin-hover").bounding_box()
        chart = page.page.locator("#chart canvas").bounding_box()
        top, height, *_ = page.page.evaluate(BOX)
        assert box["x"] >= x + 20  # not over the samples that are read
        assert box["y"] >= chart["y"] + top
        assert box["y"] + box["height"] <= chart["y"] + top + height
        assert page.wrong == []
        context.close()


def test_seeds_of_a_difference_are_one_curve_and_colors_mean_one_thing(browser, tmp_path, folders):
    two = "  - {title: Both, signals: [heart.position, heart.velocity]}\n"
    ok = BEATS.replace("at_most: 4 mm", "at_most: 40 mm")
    (tmp_path / "a").mkdir()
    with viewed(beats(tmp_path / "a", ok + two), folders[1], "--signal", "heart.position") as address:
        context = browser.new_context(viewport={"width": 1280, "height": 900})
        page = Page(context, address)
        page.page.locator("#chart .menu summary").first.click()
        page.page.get_by_label("difference from").first.select_option("run A, case by case")
        page.drawn()
        whole, less = page.curves()
        assert [one["label"] for one in less["curves"]] == [
            f"B: {name}, 2 seeds {MINUS} A" for name in ("slow", "fast")
        ]
        expected = [b - a for a, b in zip(whole["curves"][0]["y"], whole["curves"][1]["y"], strict=True)]
        assert less["curves"][0]["y"] == pytest.approx(expected, abs=1e-9)
        assert (
            len(page.page.evaluate("() => Object.values(document.getElementById('chart').chart.data)")) == 18
        )  # each with its range
        page.page.locator("#plots summary").click()
        page.page.get_by_role("button", name="Both").click()
        page.drawn()
        colors = page.page.evaluate(
            "document.getElementById('chart').chart.panes.map(({ curves }) => [...new Set(curves.map(({ color }) => color))])"
        )
        assert not set(colors[0]) & set(colors[2])  # of variants, of signals
        assert page.wrong == []
        context.close()


def test_a_long_legend_is_folded_and_escape_closes_the_menu(open_page):
    page = open_page()
    page.page.locator("#band").uncheck()
    page.drawn()
    legend = page.page.locator(".twin-legend .twin-names")
    folded = legend.bounding_box()["height"]
    assert folded <= 60  # three lines
    page.page.get_by_role("button", name="all 8").click()
    assert page.page.locator(".twin-legend .twin-names").bounding_box()["height"] > folded
    page.page.get_by_role("button", name="less").click()
    assert page.page.locator(".twin-legend .twin-names").bounding_box()["height"] == folded
    menu = page.page.locator("#chart .menu")
    menu.locator("summary").click()
    menu.locator("input").first.press("Escape")
    assert menu.get_attribute("open") is None
    page.page.get_by_label("search signals").fill("nosuch")
    assert "No recorded signal matches" in page.page.locator("#tree").inner_text()


def test_a_page_says_that_it_loads(browser, address):
    context = browser.new_context(viewport={"width": 900, "height": 700})
    page = context.new_page()
    waiting = []

    def hold(route):
        waiting.append(route)

    page.route("**/lines*", hold)
    page.goto(address)
    page.get_by_text("Loading ...").wait_for()
    page.wait_for_timeout(500)
    assert waiting
    page.unroute("**/lines*")  # those that wait go on
    page.get_by_text("Loading ...").wait_for(state="detached")
    boxes = [page.locator(name).bounding_box() for name in ("#cases", "#plots", "#expectations")]
    for above, below in pairwise(boxes):
        assert above["y"] + above["height"] <= below["y"]
    assert boxes[1]["height"] >= 30  # in one column, nothing is squeezed
    context.close()


def test_the_magnified_scale_stays_and_no_letter_leaves_the_picture(browser, tmp_path):
    time, names = np.arange(101) / 100.0, ("axis.position", "sensor.measured_force")
    columns = [RecordedVariable(name, unit="N" if "force" in name else "m") for name in names]
    folder = folder_of(tmp_path / "run", {("base", 0): (time, dict.fromkeys(names, 0.012 * (time - 0.5)))}, columns)
    members = "{axis: {component: servomotor}, sensor: {component: force_sensor}}"
    (folder / "scenario.yaml").write_text(f"stop_time: 1 s\nstep: 10 ms\nmembers: {members}\n")
    with viewed(folder) as address:
        context = browser.new_context(viewport={"width": 360, "height": 740})
        page = Page(context, address)
        page.page.locator("#picture .hand").wait_for(state="attached")
        places = [
            page.page.evaluate(
                f"""() => {{ document.getElementById("chart").chart.notify("time", {{ at: {at} }});
                return document.querySelector("#picture .hand").parentNode.getAttribute("transform"); }}"""
            )
            for at in (0.1, 0.9, 0.2, 0.8)
        ]
        assert len(set(places)) == 1  # -4.8 mm to 4.8 mm
        right = page.page.evaluate(
            """() => Math.max(...[...document.querySelectorAll("#picture text")].map((one) => one.getBBox()).map(({ x, width }) => x + width))"""
        )
        assert right <= 1000
        assert page.wrong == []
        context.close()
