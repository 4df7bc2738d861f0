"""The picture in three dimensions in a real browser, whose WebGL is computed without a graphics card."""

import io

import numpy as np
import pytest

from tests.console.served import console
from tests.web.browser import chromium  # noqa: F401 - fixture

pytestmark = pytest.mark.slow

FLAGS = ["--no-sandbox", "--enable-unsafe-swiftshader", "--use-gl=angle", "--use-angle=swiftshader"]
PICTURE = "document.querySelector('.twin-space').picture"
WIRE_TIP = f"{PICTURE}.frame?.lines[1].at(-1)"
NO_WEBGL = """const real = HTMLCanvasElement.prototype.getContext;
HTMLCanvasElement.prototype.getContext = function (kind, ...more) { return kind.startsWith("webgl") ? null : real.call(this, kind, ...more); };"""

# a warning, as the loop would send it; `covered`: whether one is seen, and whether it covers the score or the buttons of 2-D and 3-D
WARN = """async () => {
  const { channel } = await import('/console/channel.js');
  const setPage = async () => { for (let k = 0; k < 10; k++) await null; };  // the page is drawn anew before the next message comes
  await new Promise((sent) => channel.listeners.add(function warn(state) {
    if (!state.values) return;
    channel.listeners.delete(warn);
    for (const one of channel.listeners) one({ ...state, values: { ...state.values, 'friction.wall_force': 5 } });
    setPage().then(() => {
      const boxes = (names) => [...document.querySelectorAll(names)].map((each) => each.getBoundingClientRect()).filter((box) => box.height > 0);
      const meet = (a, b) => a.top < b.bottom && b.top < a.bottom && a.left < b.right && b.left < a.right;
      const warnings = boxes('.twin-picture .twin-warning'), others = boxes('.twin-picture .twin-score, .twin-picture .twin-dimensions');
      window.covered = [warnings.length > 0, warnings.some((one) => others.some((other) => meet(one, other)))];
      sent();
    });
  }));
}"""


@pytest.fixture(scope="module")
def served(tmp_path_factory, build):
    runs = tmp_path_factory.mktemp("runs")
    with console("vessel_teleoperation", "--variant", "rehearsed", runs=runs, build=build) as one:
        yield one


@pytest.fixture(scope="module")
def browser(chromium):  # noqa: F811
    from playwright.sync_api import sync_playwright

    with sync_playwright() as driver:
        one = driver.chromium.launch(executable_path=chromium, args=FLAGS)
        yield one
        one.close()


@pytest.fixture
def page_of(browser):
    contexts = []

    def new_page(**options):
        contexts.append(browser.new_context(**options))
        one = contexts[-1].new_page()
        one.set_default_timeout(60_000)  # machines that test are busy, and so is a processor that draws
        return one

    yield new_page
    for context in contexts:
        context.close()


@pytest.fixture
def page(page_of):
    return page_of(viewport={"width": 1400, "height": 900}, color_scheme="light")


def opened(page, served):
    page.goto(served.address, wait_until="commit")
    page.wait_for_selector(".twin-dimensions")
    page.locator(".twin-dimensions button", has_text="3-D").click()


def drawn(page, served):
    opened(page, served)
    page.wait_for_function("document.querySelector('.twin-space')?.picture?.quarter")  # its first view


def pixels(page):
    from PIL import Image

    return np.asarray(Image.open(io.BytesIO(page.locator(".twin-space canvas").screenshot())).convert("RGB"), int)


def test_the_first_view_shows_all_and_a_new_width_keeps_a_turned_one(page, served):
    """A scene with a height of its own centered its first point, and cut the line that leads to it."""
    drawn(page, served)
    ends = page.evaluate(
        f"""() => {{
          const picture = {PICTURE}, ends = [[0, 0, 0], [0, 0, 270]];
          Object.assign(picture.fixed, {{ size: 90, tube: null }});
          Object.assign(picture.frame, {{ lines: [ends], points: [ends[1]] }});
          picture.reset();
          return ends.map((point) => picture.camera.position.clone().set(...point).project(picture.camera)).flatMap(({{ x, y }}) => [x, y]);
        }}"""
    )
    assert all(abs(part) < 1.0 for part in ends)
    page.get_by_role("button", name="zoom in").click()
    zoom = page.evaluate(f"{PICTURE}.camera.zoom")
    page.set_viewport_size({"width": 1000, "height": 800})
    page.wait_for_function(f"{PICTURE}.camera.right < 400")
    assert page.evaluate(f"{PICTURE}.camera.zoom") == zoom


def test_it_draws_moves_turns_and_keeps_its_memory(page, served):
    wrong = []
    page.on("pageerror", lambda error: wrong.append(str(error)))
    drawn(page, served)
    page.click("[aria-label='run']")
    page.wait_for_function(f"{WIRE_TIP}?.[2] > 0")
    first, geometries = page.evaluate(WIRE_TIP), page.evaluate(f"{PICTURE}.renderer.info.memory.geometries")
    page.wait_for_function(f"{WIRE_TIP}[2] > {first[2] + 20.0}")  # it moves: millimeters along the vessel
    assert page.evaluate(f"{PICTURE}.renderer.info.memory.geometries") == geometries
    page.click("[aria-label='pause']")
    page.wait_for_timeout(500)

    light = pixels(page)
    assert len(np.unique(light.reshape(-1, 3), axis=0)) > 200  # shaded surfaces, not one color
    assert page.locator(".twin-space-bar").text_content() == "50 mm"
    covered = page.evaluate(
        f"""() => {{
          const picture = {PICTURE}, boxes = [...document.querySelectorAll('.twin-space-tools, .twin-space-bar')].map((one) => one.getBoundingClientRect());
          const space = document.querySelector('.twin-space').getBoundingClientRect(), target = picture.targets[0].label.position, before = target.clone();
          target.set(1 - 60 / space.width * 2, 1 - 30 / space.height * 2, 0).unproject(picture.camera);  // a target beside the buttons
          picture.placeNames();
          picture.names.render(picture.world, picture.camera);
          const name = picture.targets[0].label.element.getBoundingClientRect();
          target.copy(before);
          picture.render();
          return boxes.filter((box) => box.left < name.right && name.left < box.right && box.top < name.bottom && name.top < box.bottom).length;
        }}"""
    )
    assert covered == 0
    assert page.evaluate(
        f"parseFloat(document.querySelector('.twin-space-bar').style.width) / {PICTURE}.camera.zoom"
    ) == (pytest.approx(50.0))

    before = page.evaluate(f"{PICTURE}.camera.position.toArray()")
    box = page.locator(".twin-space canvas").bounding_box()
    page.mouse.move(box["x"] + 300, box["y"] + 200)
    page.mouse.down()
    page.mouse.move(box["x"] + 420, box["y"] + 240, steps=4)
    page.mouse.up()
    assert page.evaluate(f"{PICTURE}.camera.position.toArray()") != pytest.approx(before, abs=1.0)
    zoom = page.evaluate(f"{PICTURE}.camera.zoom")
    page.get_by_role("button", name="zoom in").click()
    assert page.evaluate(f"{PICTURE}.camera.zoom") == pytest.approx(1.25 * zoom)
    page.get_by_role("button", name="reset the view").click()
    assert page.evaluate(f"{PICTURE}.camera.position.toArray()") == pytest.approx(before, abs=1e-6)

    page.click("[aria-label='light or dark']")
    page.wait_for_timeout(500)
    assert abs(light.mean() - pixels(page).mean()) > 100.0
    page.locator(".twin-dimensions button", has_text="2-D").click()
    page.wait_for_selector(".twin-space", state="detached")
    assert page.locator(".twin-view").first.is_visible()
    assert wrong == []


@pytest.mark.parametrize("size", [(360, 780), (900, 800), (1400, 900)])
def test_no_control_moves_under_the_pointer(page_of, served, size):
    """While it is held, when it is released, and while a warning is shown."""
    page = page_of(viewport={"width": size[0], "height": size[1]}, has_touch=size[0] == 360)
    page.goto(served.address, wait_until="commit")
    page.wait_for_selector(".twin-control")
    page.wait_for_function("/operate|watch|no operator/.test(document.querySelector('.twin-role').textContent)")
    page.wait_for_timeout(1000)
    if (take := page.get_by_role("button", name="operate here")).is_visible():
        take.click()
    page.wait_for_function("!document.querySelector('.twin-control .way').disabled")
    if (run := page.get_by_label("run", exact=True)).is_visible():
        run.click()
    page.wait_for_function("document.querySelector('#twin-how').textContent.startsWith('running')")
    page.wait_for_timeout(1000)
    tops = """[...document.querySelectorAll('.twin-control .way, .twin-stick svg')].map((one) => one.getBoundingClientRect().top + scrollY)"""
    before, seen = page.evaluate(tops), []
    button = page.get_by_role("button", name="guidewire", exact=True)
    button.scroll_into_view_if_needed()
    box = button.bounding_box()
    page.mouse.move(box["x"] + 10, box["y"] + 10)
    page.mouse.down()
    for _ in range(8):
        page.wait_for_timeout(250)
        seen.append(page.evaluate(tops))
    page.mouse.up()
    page.wait_for_timeout(700)
    seen.append(page.evaluate(tops))
    page.evaluate(WARN)
    assert page.evaluate("covered") == [True, False]  # the warning has a strip of its own
    seen.append(page.evaluate(tops))
    page.wait_for_timeout(700)
    seen.append(page.evaluate(tops))
    if size[0] == 360:  # in three dimensions the picture is about as high, and follows the foremost tip
        page.locator(".twin-dimensions button", has_text="3-D").click()
        page.wait_for_function("document.querySelector('.twin-space')?.picture?.quarter")
        np.testing.assert_allclose(page.evaluate(tops), before, rtol=0, atol=10.0)  # it was 80 px
        ahead = "position.clone().set(0, 0, 500)"
        x, y = page.evaluate(
            f"""() => {{
              const picture = {PICTURE};
              picture.move({{ ...picture.frame, points: [picture.frame.points[0], [0, 0, 500]] }}, []);
              picture.apply();
              picture.camera.updateMatrixWorld();
              const {{ x, y }} = picture.camera.{ahead}.project(picture.camera);
              return [x, y];
            }}"""
        )
        assert max(abs(x), abs(y)) < 0.5
        page.locator(".twin-dimensions button", has_text="2-D").click()
    np.testing.assert_allclose(seen, [before] * len(seen), rtol=0, atol=0.5)


def test_without_webgl_the_other_picture_stays(page, served):
    page.add_init_script(NO_WEBGL)
    opened(page, served)
    page.wait_for_selector("text=3-D is not available: this browser has no WebGL.")
    page.wait_for_selector(".twin-space", state="detached")
    assert page.locator(".twin-view").first.is_visible()
