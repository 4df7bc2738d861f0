"""The page in a real browser, from the list of scenarios to the end of a session.

Over 400 lines: one served session for all tests of its page.
"""

import itertools
import re
from urllib.parse import urlsplit

import pytest
import yaml

from tests.console.served import CARRIAGE, console
from tests.web.browser import browser, chromium  # noqa: F401 - fixtures

pytestmark = pytest.mark.slow

FRAMES = "document.querySelector('.twin-chart').chart.frames"
NEWEST = "document.querySelector('.twin-chart').chart.lastTime"


@pytest.fixture(scope="module")
def served(tmp_path_factory, build):
    with console(CARRIAGE, "--variant", "quiet", runs=tmp_path_factory.mktemp("runs"), build=build) as one:
        yield one


@pytest.fixture(scope="module")
def page(served, browser):  # noqa: F811
    """The page that operates; what it asks the network for, and what fails in it, is kept."""
    one = browser.new_context(accept_downloads=True).new_page()
    one.set_default_timeout(20_000)  # machines that test are busy
    one.asked, one.wrong = [], []
    one.on("request", lambda request: one.asked.append(request.url))
    one.on("pageerror", lambda error: one.wrong.append(str(error)))
    one.on("console", lambda said: one.wrong.append(said.text) if said.type == "error" else None)
    one.goto(served.address, wait_until="commit")
    one.wait_for_selector(".twin-chart canvas", timeout=60_000)
    said(one, "paused")
    return one


def said(page, phase):
    page.wait_for_function(f"document.querySelector('#twin-how').textContent.startsWith('{phase}')", timeout=30_000)


def press(page, label):
    page.click(f"[aria-label='{label}']")


def test_it_runs_pauses_and_steps(page):
    page.wait_for_selector("text=Paused: press Run, then hold a control.")
    press(page, "run")
    said(page, "running")
    page.wait_for_selector("text=Motion lasts while you hold a control.")
    page.wait_for_function(f"{NEWEST} > 0.2")
    page.wait_for_function("document.querySelector('.twin-view .on').textContent.endsWith(' mm')")  # the picture moves
    press(page, "pause")
    said(page, "paused")
    page.wait_for_timeout(300)
    before = float(re.search(r"([\d.]+) s", page.text_content("#twin-how"))[1])
    assert page.evaluate(NEWEST) == pytest.approx(before, abs=0.0011)  # charts, picture and read-out: one time
    press(page, "one step of 1 ms")
    page.wait_for_function(f"document.querySelector('#twin-how').textContent.includes('{before + 0.001:.3f} s')")
    for button, phase in (("run", "running"), ("pause", "paused")):  # the space bar presses the button that is shown
        page.wait_for_selector(f"[aria-label={button}]")
        page.evaluate("document.activeElement.blur()")
        page.keyboard.press("Space")
        said(page, phase)


def test_a_picture_is_hidden_until_its_values_are_there(page):
    """It had the values of the start for seconds, as if they were the result."""
    shown = page.evaluate(
        """async () => {
          const { default: picture } = await import("/console/picture.js");
          const views = [{ view: "rig", title: "", parts: [{ kind: "carriage", signals: { position: "carriage.position", velocity: "carriage.velocity" }, sizes: {} }] }];
          const own = { $el: document.createElement("div"), views, warnings: [], reached: [], controls: [], warn() {} };
          picture.mounted.call(own);
          const seen = [own.$el.style.visibility];
          for (const values of [{}, { "carriage.position": 0.001 }, {}]) { own.onTick({ values }); seen.push(own.$el.style.visibility); }
          picture.unmounted.call(own);
          return seen;
        }"""
    )
    assert shown == ["hidden", "hidden", "", "hidden"]


def test_forces_say_whether_they_are_measured_and_charts_at_what_time(page):
    """One view of a carriage in front of a wall, with a sensor and without; and the legend of a session that is paused."""
    texts = page.evaluate(
        """async () => {
          const { drawViews } = await import("/web/views.js");
          const part = (kind, ...names) => ({ kind, signals: Object.fromEntries(names.map((name) => [name, `${kind}.${name}`])), sizes: {} });
          const parts = [part("carriage", "position", "velocity"), part("wall", "force"), part("force", "measured_force")];
          const drawn = (own, values, more = {}) => {
            const place = document.createElement("div");
            drawViews(place, [{ view: "rig", title: "", band: [0.1, 0.4], parts: own, ...more }])(values);
            return [[...place.querySelectorAll("text")].map((text) => text.textContent), place.querySelector(".hand").getAttribute("x1")];
          };
          const values = { "carriage.position": 0.001, "wall.force": 0.25, "force.measured_force": 0.2 };
          return [drawn(parts, values), drawn(parts.slice(0, 2), values), drawn(parts.slice(0, 2), values, { is_judged: false })];
        }"""
    )
    (both, hand), (true_force, _), (unjudged, _) = texts
    assert "measured contact force 0.200 N, in range; true 0.250 N" in both
    assert "true contact force 0.250 N, in range" in true_force
    assert "true contact force 0.250 N" in unjudged
    assert {"10 \u00d7", "1.0 mm", "4 mm"} <= set(both)
    assert float(hand) == 20.0  # of a millimeter, beside 2 on the rail
    title, newest = page.locator(".twin-pane-title").first.inner_text(), page.evaluate(NEWEST)
    assert float(re.search(r" at ([\d.]+) s$", title)[1]) == pytest.approx(newest, abs=0.01)


@pytest.mark.parametrize(("width", "size"), [("330px", "17px"), ("600px", "18px")])
def test_names_in_a_vessel_cover_no_other(page, width, size):
    """Nor a target: tips beside each other, targets beside each other and at the edge; on a telephone the part around the tips.

    Tips and instruments have one color, and the distances are read beside the force, also in three dimensions.
    """
    overlaps, outside, part, drawn, colors, read = page.evaluate(
        """async () => {
          const { drawViews } = await import("/web/views.js");
          const signals = { vessel: "v", catheter: "c", wire: "w", catheter_tip: "ct", wire_tip: "wt", catheter_location: "cl", wire_location: "wl" };
          const targets = ["iliac artery", "abdominal aorta", "arch of the aorta"].map((name, k) => ({ name, at: [[0.1, 0.2, 0.5][k], 0.02], tolerance: 0.005 }));
          const place = document.body.appendChild(document.createElement("div"));
          place.className = "twin-views";
          place.style.width = "WIDTH";
          const move = drawViews(place, [{ view: "vessel", title: "", targets, limits: {}, parts: [{ kind: "fluoroscope", signals, sizes: {} }] }]);
          place.querySelectorAll("text").forEach((text) => (text.style.fontSize = "SIZE"));
          move({ v: [[0, 0], [0.5, 0], [0.5, 0.06], [0, 0.06]], c: [[0, 0.02], [0.05, 0.02]], w: [[0, 0.02], [0.06, 0.02]], ct: [0.05, 0.02], wt: [0.06, 0.02], cl: 0.05, wl: 0.06 });
          const shown = [...place.querySelectorAll("text")].filter((one) => one.textContent !== "50 mm" && getComputedStyle(one).visibility !== "hidden");
          const marks = [...place.querySelectorAll("circle.target")].map((one) => ["target", one.getBBox()]);
          const boxes = [...marks, ...shown.map((one) => [one.textContent, one.getBBox()])], { x: left, width } = place.querySelector("svg:not(.twin-gauge)").viewBox.baseVal;
          const drawn = shown.map((one) => one.textContent), colors = ["catheter", "guidewire"].map((name, k) => getComputedStyle(place.querySelectorAll("circle.tip")[k]).fill === getComputedStyle(place.querySelector(`polyline.${name}`)).stroke);
          const read = place.querySelector(".twin-readings").textContent;
          place.remove();
          const apart = (a, b) => a.x + a.width <= b.x || b.x + b.width <= a.x || a.y + a.height <= b.y || b.y + b.height <= a.y;
          return [boxes.flatMap(([name, a], k) => boxes.slice(k + 1).filter(([, b]) => !apart(a, b)).map(([other]) => [name, other])),
                  boxes.filter(([name, a]) => name !== "target" && (a.x < left || a.x + a.width > left + width)).map(([name]) => name), width, drawn, colors, read];
        }""".replace("WIDTH", width).replace("SIZE", size)
    )
    assert (overlaps, outside) == ([], [])
    assert (part, "arch of the aorta" in drawn) == ((460, False) if size == "17px" else (1000, True))
    assert (colors, read) == (
        [True, True],
        "catheter 50.0 mmguidewire 60.0 mm from the entry" + " in the image" * (size != "17px"),
    )


def test_a_scene_has_a_legend_and_a_warning_a_remedy(page):
    """The advice follows from the state, whichever key is held: of a force from the last motion of both instruments."""
    legend, remedies, said = page.evaluate(
        """async () => {
          const { drawViews } = await import("/web/views.js");
          const named = (label) => ({ signal: label, label, at: "at", width: 1 });
          const scene = { walls: [{ closed: true, points: [0, 0, 1, 1], thickness: 1 }], lines: [named("catheter")], points: [], arrows: [named("contact forces")], axes: [0, 1], motions: {} };
          const place = document.createElement("div");
          drawViews(place, [{ view: "scene", title: "", scene, parts: [{ kind: "scene", signals: {}, sizes: {} }] }]);
          const { methods } = (await import("/console/picture.js")).default, ways = { c: "back", w: "back" };
          const controls = [{ input: "c", label: "catheter", keys: ["ArrowUp", "ArrowDown"] }, { input: "w", label: "guidewire", keys: ["KeyW", "KeyS"] }];
          const warnings = [{ signal: "f", above: 2, below: -2, text: "force", remedy: ways }, { signal: "x", minus: "y", above: 0, text: "ahead", remedy: { w: "forward", c: "back" } }, { signal: "b", above: 0, text: "plain" }];
          const of = (values, moved) => { const one = { ...methods, controls, warnings, moved }; one.warn({ values: { f: 0, x: 0, y: 1, b: 0, ...values } }); return one.warning; };
          const { say } = (await import("/console/presence.js")).default.methods, below = document.getElementById("twin-message");
          const told = (hardware, text) => { say.call({ hardware }, null, text); return below.textContent; };
          const late = "hand: at rest. Release and press again.", said = [told(false, late), told(true, late), told(false, "refused")];
          told(false, "");
          return [[...place.querySelectorAll(".twin-readings span")].map((one) => one.textContent),
                  [of({}), of({ b: 1 }), of({ x: 2 }, { c: 1, w: 1 }), of({ x: 2 }, { w: 0 }), of({ f: 3 }, { c: 0, w: 1 }), of({ f: 3 }, { c: 1, w: 1 }), of({ f: -3 }, { c: 0, w: 1 }), of({ f: 3, x: 2 }, { c: 1, w: 1 })], said];
        }"""
    )
    assert legend == ["catheter", "contact forces", "wall"]
    ahead = "ahead: guidewire forward with W, or catheter back with ↓"
    assert remedies == [
        "",
        "plain",
        ahead,
        ahead,
        "force: guidewire back with S",
        "force: catheter back with ↓, or guidewire back with S",
        "force: catheter forward with ↑",
        "force: catheter back with ↓ · ahead: catheter back with ↓",  # the guidewire would help one and harm the other
    ]
    assert said == [
        "",
        "hand: at rest. Release and press again.",
        "refused",
    ]  # without drives the first stands beside the controls


def test_figures_of_two_carriages_do_not_cover_each_other(page):
    """With letters of a telephone, each carriage at the end toward the other; speeds with a decimal, the tip from its start."""
    figures, boxes = page.evaluate(
        """async () => {
          const { drawViews } = await import("/web/views.js");
          const carriage = (name) => ({ kind: "carriage", signals: { position: `${name}.position`, velocity: `${name}.velocity` }, sizes: {} });
          const instrument = { kind: "instrument", signals: { tip_position: "tip" }, sizes: {} };
          const place = document.body.appendChild(document.createElement("div"));
          drawViews(place, [{ view: "rig", title: "", band: [0.1, 0.4], parts: [carriage("a"), carriage("b"), instrument] }])(
            { "a.position": 0.025, "a.velocity": 0.1, "b.position": -0.025, "b.velocity": -0.1004, tip: 0.1032 });
          const texts = [...place.querySelectorAll("text")].filter((text) => /mm.s|from/.test(text.textContent));
          texts.forEach((text) => (text.style.fontSize = "30px"));
          const boxes = texts.map((text) => text.getBBox()).map(({ x, width }) => [x, x + width]);
          place.remove();
          return [texts.map((text) => text.textContent), boxes];
        }"""
    )
    assert sorted(figures) == ["-100.4 mm/s", "100.0 mm/s", "103.2 mm from the start"]
    boxes.sort()
    assert all(left[1] < right[0] for left, right in itertools.pairwise(boxes))
    assert boxes[0][0] >= 0
    assert boxes[-1][1] <= 1000


def test_a_rig_without_a_sheath_counts_from_the_entry(page):
    """As picture and charts of the vessel do; else from the start, and it says so."""
    texts = page.evaluate(
        """async () => {
          const { drawViews } = await import("/web/views.js");
          const told = (sizes) => {
            const instrument = { kind: "instrument", signals: { tip_position: "tip", insertion_depth: "depth" }, sizes };
            const place = document.createElement("div");
            drawViews(place, [{ view: "rig", title: "", band: [0.1, 0.4], parts: [instrument] }])({ tip: 0.1032, depth: 0.1232 });
            return [...place.querySelectorAll("text")].map((text) => text.textContent).filter((text) => text.includes("from"));
          };
          return [told({ section_length: [0, 0, 0] }), told({ section_length: [0.3, 0.1, 0.1] })];
        }"""
    )
    assert texts == [["123.2 mm from the entry, true"], ["103.2 mm from the start"]]


def test_a_replay_shows_reached_targets_from_their_time(page):
    classes = page.evaluate(
        """async () => {
          const { drawViews } = await import("/web/views.js");
          const part = { kind: "fluoroscope", signals: { vessel: "vessel" }, sizes: {} }, place = document.body.appendChild(document.createElement("div"));
          const target = { name: "arch", at: [0.005, 0.05], tolerance: 0.005, time: 3.5 };
          const move = drawViews(place, [{ view: "vessel", parts: [part], targets: [target, { ...target, name: "end", time: undefined }], limits: {} }]);
          const vessel = [[0, 0], [0, 0.1], [0.01, 0.1], [0.01, 0]];
          const seen = [3.4, 3.5].map((time) => { move({ vessel }, [], time); return [...place.querySelectorAll("circle.target")].map((one) => one.getAttribute("class")); });
          place.remove();
          return seen;
        }"""
    )
    assert classes == [["target", "target"], ["target reached", "target"]]


def test_a_live_chart_keeps_the_limit_of_a_warning_while_it_is_exceeded(page):
    ranges = page.evaluate(
        """async () => {
          const { verticalRange } = await import("/web/painter.js");
          const range = (y) => verticalRange({ follow: true }, { limits: [{ y: 2, failed: true, warns: true }] }, [{ x: [0, 1], y }], 0, 1);
          return [range([4.7, 5.1])[0], range([0.1, 0.11])[1]];
        }"""
    )
    assert ranges[0] <= 2.0  # exceeded
    assert ranges[1] < 1.0  # far away it would flatten the curve


def test_keys_move_a_control_after_a_choice_in_a_list(page):
    """The list keeps the focus; the arrow keys changed it instead. While it is open they choose."""
    page.keyboard.down("ArrowUp")
    page.wait_for_function("document.querySelector('.twin-hands p[role=status]').textContent.startsWith('Paused')")
    page.click("button[aria-label=run]")  # held through Run: it moves nothing
    page.wait_for_function("document.querySelector('.twin-hands p[role=status]').textContent.startsWith('Held since')")
    assert "held" not in page.locator(".twin-done").inner_text()
    page.keyboard.up("ArrowUp")
    page.locator(".twin-rate input").focus()
    page.keyboard.down("ArrowUp")
    page.wait_for_function("document.querySelector('.twin-control b').textContent.startsWith('20 ')")
    page.keyboard.up("ArrowUp")
    page.wait_for_function("document.querySelector('.twin-control b').textContent.startsWith('0 ')")
    assert page.locator(".q-menu").count() == 0
    page.click(".twin-rate")
    page.wait_for_selector(".twin-rate input[aria-expanded=true]")
    page.keyboard.press("ArrowUp")
    assert page.evaluate("[...twinHands.held.values()].every((sources) => !sources.size)")
    page.keyboard.press("Escape")
    page.click("button[aria-label=pause]")


def test_texts_that_change_move_no_button(page):
    """Requirements that are not met, messages, and a status with a late loop."""
    boxes = """[...document.querySelectorAll("button, .twin-stick, .q-select, .q-expansion-item")].filter((one) => one.offsetParent)
        .map((one) => ["x", "y", "width"].map((key) => Math.round(one.getBoundingClientRect()[key])))"""
    before = page.evaluate(boxes)
    page.evaluate(
        """() => {
          const long = "the catheter is never ahead of the wire; ".repeat(4);
          document.querySelector("#twin-message").textContent = long;
          document.querySelector("#twin-how").textContent = "running · 1234.5 s · 0.99 x real time, 0.25 s behind";
          document.querySelector(".twin-hands p[role=status]").textContent = "Stopped by the dead-man switch. Release and hold again.";
          const alert = document.querySelector(".twin-alert .twin-warning");
          alert.textContent = long;
          alert.classList.remove("hidden");
        }"""
    )
    after = page.evaluate(boxes)
    clipped = page.evaluate(
        """() => {
          const alert = document.querySelector(".twin-alert .twin-warning"), room = alert.parentElement;
          alert.textContent = "a warning that fills some of the line; ".repeat(12);
          const [own, around] = [alert, room].map((one) => one.getBoundingClientRect());
          return [alert.scrollHeight - alert.clientHeight, own.top < around.top, own.bottom > around.bottom];
        }"""
    )
    assert clipped == [0, False, False]  # an alarm is shown in full
    page.reload()
    said(page, "paused")
    assert after == before


def test_what_is_not_met_covers_no_picture(page):
    """Without joysticks, which must not move, it has a line of its own, which takes room only while it is shown."""
    tops = page.evaluate(
        """() => {
          const desk = document.createElement("div");
          desk.className = "twin-desk";
          desk.innerHTML = `<div class="twin-picture"><div><i class="twin-dimensions hidden"></i><div class="twin-alert">
            <p class="twin-warning hidden">Not met: contact</p></div></div><svg></svg></div>`;
          document.body.append(desk);
          const [alert, picture] = [".twin-warning", "svg"].map((each) => desk.querySelector(each));
          const top = () => picture.getBoundingClientRect().top - desk.querySelector(".twin-alert").getBoundingClientRect().top;
          const before = top();
          alert.classList.remove("hidden");
          const after = [top(), alert.getBoundingClientRect().height];
          desk.remove();
          return [before, ...after];
        }"""
    )
    assert tops[0] == 0
    assert tops[1] >= tops[2] > 10


def test_a_telephone_shows_picture_joysticks_curves_and_then_values(page):
    page.set_viewport_size({"width": 360, "height": 780})
    order = [
        page.locator(one).first.bounding_box()["y"]
        for one in (".twin-picture", ".twin-controls", ".twin-chart", ".twin-panels")
    ]
    for button in ("one step of 1 ms", "reset"):
        page.get_by_label(button, exact=True).wait_for()
    page.set_viewport_size({"width": 1400, "height": 1000})
    assert order == sorted(order)
    assert page.locator(".twin-controls").bounding_box()["x"] == page.locator(".twin-panels").bounding_box()["x"] > 700


def test_a_number_is_executed_as_it_is_typed(page):
    """While the session runs, at the speeds of a person, whom updates of the server meet between two keys."""
    page.get_by_text("Inputs and parameters").click()
    page.get_by_placeholder(re.compile("search .* inputs")).fill("servomotor.mass")
    field = page.locator(".twin-value", has_text="servomotor.mass").locator("input[inputmode=decimal]")
    press(page, "run")
    said(page, "running")

    def enter(text, delay):
        field.click()
        page.keyboard.press("Control+A")
        page.keyboard.type(text, delay=delay)
        assert field.input_value() == text
        page.keyboard.press("Enter")

    for delay, text in itertools.product((60, 130, 200), ("51.5", "0.305", "1e-3", "0.8")):
        enter(text, delay)
        page.wait_for_function(
            "value => parseFloat(document.querySelector('.twin-done .twin-line').textContent.split('= ')[1]) === value",
            arg=float(text),
        )
        page.wait_for_function("!document.activeElement.matches('input')")  # keys move controls again
    for text, reason in (("-1.25", "-1.25 is refused: at least"), ("42,5", "42,5: write a decimal point")):
        enter(text, 60)
        page.wait_for_selector(f".twin-value >> text={reason}")
    page.keyboard.press("Tab")
    page.wait_for_function("element => element.value === '0.8'", arg=field.element_handle())
    press(page, "pause")
    said(page, "paused")


def test_an_event_of_another_variant_and_a_session_as_scenario(page, tmp_path):
    page.get_by_text("Events of the scenario").click()
    page.locator(".twin-event", has_text="servomotor.position").click()
    page.wait_for_selector(".twin-done >> text=servomotor.position")
    press(page, "one step of 1 ms")  # what is done counts once the loop goes on
    page.wait_for_timeout(500)
    with page.expect_download() as waiting:
        page.get_by_text("download as scenario").click()
    waiting.value.save_as(tmp_path / "operated.yaml")
    events = yaml.safe_load((tmp_path / "operated.yaml").read_text())["events"]
    done = [name for one in events for kind in ("set", "override") for name in one.get(kind, {})]
    assert {"servomotor.mass", "servomotor.position"} <= set(done)


def test_another_page_watches(page, served, browser):  # noqa: F811
    context = browser.new_context()
    other = context.new_page()
    other.goto(served.address, wait_until="commit")
    other.wait_for_selector(".twin-chart canvas", timeout=60_000)
    other.wait_for_selector("text=you watch")
    other.wait_for_selector("text=This page only watches")
    gray = "[...document.querySelectorAll('[aria-label=run], .twin-rate')].every((one) => getComputedStyle(one).pointerEvents === 'none')"
    assert other.evaluate(gray)  # what has no effect looks so
    assert page.text_content("#twin-how").startswith("paused")
    assert other.locator(".twin-control .way").first.is_disabled()
    context.close()


def test_a_chart_zooms_and_has_cursors(page):
    box = page.locator(".twin-chart canvas").bounding_box()
    y = box["y"] + 60
    page.mouse.move(box["x"] + 200, y)
    page.mouse.down()
    page.mouse.move(box["x"] + 400, y, steps=3)
    page.mouse.up()
    page.wait_for_function("document.querySelector('.twin-chart').chart.window !== null")
    page.mouse.click(box["x"] + 250, y)
    page.mouse.click(box["x"] + 500, y)
    page.wait_for_selector("text=from t1 to t2")
    page.get_by_role("button", name="follow").click()
    page.wait_for_function("document.querySelector('.twin-chart').chart.follow")


def test_signals_are_found_and_picked(page):
    press(page, "signals")
    page.get_by_label("search signals").fill("current")
    page.locator(".twin-tree .q-checkbox").first.click()
    page.wait_for_selector(".twin-chip >> text=servomotor.current")


def test_eight_signals_follow_the_run(page):
    search = page.get_by_label("search signals")
    if not search.is_visible():  # where this test runs alone
        press(page, "signals")
    search.fill("servomotor")
    while (shown := page.locator(".twin-chip").count()) < 8:
        page.locator(".twin-tree .q-checkbox[aria-checked=false]").first.click()
        page.wait_for_function(f"document.querySelectorAll('.twin-chip').length > {shown}")
    press(page, "run")
    page.wait_for_function(f"{FRAMES} >= {page.evaluate(FRAMES) + 30}")
    press(page, "pause")


def test_nothing_leaves_this_machine_and_nothing_fails(page, served):
    assert {urlsplit(one).netloc for one in page.asked if not one.startswith("data:")} == {served.host}
    assert page.wrong == []


def test_escape_does_not_end_a_simulation_and_another_scenario_is_picked(page):
    page.locator("body").press("Escape")
    page.wait_for_timeout(300)
    assert page.text_content("#twin-how").startswith("paused")
    page.click("#twin-stop")
    page.wait_for_function("document.querySelector('#twin-how').textContent.startsWith('ended')")
    page.get_by_text(re.compile("^(Ended|Completed) at")).wait_for()
    page.get_by_text("another scenario").click()
    page.wait_for_selector("#twin-stop", state="hidden")  # nothing runs
    page.get_by_placeholder("search", exact=True).fill("bench buckling")
    page.wait_for_function("document.querySelectorAll('.twin-pick').length === 1")
    page.locator(".twin-pick", has_text="bench_buckling").click()
    page.wait_for_selector("[aria-label='run'], .twin-home >> text=bench_buckling")
