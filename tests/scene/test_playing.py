"""A recorded run as scenes: what moves is where it was, in every form that it is written in."""

import base64
import json
import re
import shutil
import subprocess
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from lxml import etree
from PIL import Image

from tests.scene.drawings import svg
from twin.errors import ScenarioError, SceneError
from twin.run import RunOptions, run_scenario, scenes
from twin.scenario import Backend, lint, load_scenario
from twin.scene import animation, page, picture, points_along_path, read_environment, still_frames

SCENARIO = """
title: Swing
stop_time: 1 s
step: 10 ms
members:
  swing: {component: "tests.scene.parts:Swing"}
scenes:
  - title: In the channel
    environment: moving.svg
    motions: {heart: swing.heart}
    lines: {signal: swing.shape, label: instrument <8 Fr>, width: 2 mm}
    points: [{along: swing.travel, label: gripper}, {signal: swing.contact_point, label: contact}, swing.tip]
    arrows: {signal: swing.contact_force, at: swing.contact_point, label: force}
    signals: [swing.travel]
    from: 0.1 s
  - title: In space
    lines: swing.spatial
    axes: [x, z]
plots:
  - {title: Travel, signals: [swing.travel], from: 0.3 s}
"""
PAD = '<path class="wall" id="pad" data-moves="heart" data-direction="90 deg" d="M120 -20 h20 v5 h-20 z"/>'
TITLE = "In the channel"
DATA = re.compile(r'<script type="application/json" id="data">(.*?)</script>', re.DOTALL)


@pytest.fixture(scope="module")
def run(tmp_path_factory):
    """The folder of a run of the scenario."""
    folder = tmp_path_factory.mktemp("swing")
    svg(folder, PAD, "moving.svg")
    (folder / "swing.yaml").write_text(SCENARIO)
    outcome = run_scenario(
        load_scenario(folder / "swing.yaml"), RunOptions(backend=Backend.interpreted, root=folder / "runs")
    )
    return outcome.folder


@pytest.fixture(scope="module")
def shown(run):
    return scenes.run_scenes(run, TITLE)[TITLE]


def test_scenes_of_a_scenario(tmp_path):
    """What has no label is called as its signal is; what is along the path needs a path."""
    svg(tmp_path, PAD, "moving.svg")
    file = tmp_path / "swing.yaml"
    file.write_text(SCENARIO.replace(", label: force", ""))
    channel, space = load_scenario(file).scenes
    assert channel.environment is not None
    assert {wall.name for wall in channel.environment.walls} >= {"pad", "upper"}
    assert [line.label for line in (*channel.lines, *space.lines)] == ["instrument <8 Fr>", "swing.spatial"]
    assert [mark.label for mark in channel.points] == ["gripper", "contact", "swing.tip"]
    assert [(arrow.label, arrow.at) for arrow in channel.arrows] == [("swing.contact_force", "swing.contact_point")]
    assert [curve.label for curve in channel.curves] == ["swing.travel"]
    assert (channel.axes, space.axes, space.environment) == ((0, 1), (0, 2), None)
    file.write_text(SCENARIO.replace("    environment: moving.svg\n", ""))
    with pytest.raises(ScenarioError, match="`along` needs an environment with a path"):
        load_scenario(file)


@pytest.mark.slow
def test_everything_is_where_it_was(run, shown):
    """In meters, in the scene's part of the run, forces in their own unit; what does not touch is not there."""
    time = shown.time
    assert (time[0], time[-1], len(time)) == (pytest.approx(0.1), 1.0, 91)
    y = 2e-3 * np.sin(2 * np.pi * time)
    np.testing.assert_allclose(shown.lines[0].points[:, 2], np.stack([np.full(91, 0.1), y], 1), atol=1e-12)
    assert shown.lines[0].width == pytest.approx(2e-3)
    gripper, contact, tip = shown.points
    np.testing.assert_allclose(gripper.points[:, 0], np.stack([0.1 + y, np.zeros(91)], 1), atol=1e-12)
    np.testing.assert_allclose(tip.points[:, 0, 1], y, atol=1e-12)
    touching = y > 0.0
    (force,) = shown.arrows
    assert force.unit == "mN"
    np.testing.assert_allclose(force.vectors[touching, 0, 1], -1e5 * y[touching], rtol=1e-9)
    assert force.longest == pytest.approx(200.0)
    for places in (contact.points, force.at, force.vectors):
        np.testing.assert_array_equal(np.isfinite(places[:, 0, 1]), touching)
        assert np.isnan(places[:, 1]).all()
    walls = {wall.name: outline for wall, outline in shown.walls(20)}
    np.testing.assert_allclose(walls["pad"][0], [0.12, 0.02 + y[20]], atol=1e-12)  # up by the motion
    np.testing.assert_allclose(walls["upper"][0], [0.01, 0.005], atol=1e-12)
    (curve,) = shown.curves
    assert (curve[0], shown.unit) == ("swing.travel", "m")
    space = scenes.run_scenes(run, "In space")["In space"]
    np.testing.assert_allclose(space.lines[0].points[:, 2, 1], 2e-3 * np.sin(2 * np.pi * space.time), atol=1e-12)


@pytest.mark.slow
def test_instants_of_a_film(shown):
    film_ = shown.resample(0.1)
    np.testing.assert_allclose(film_.time, np.arange(1, 11) / 10, atol=1e-9)
    assert len(shown.thin(40).time) <= 40
    left, bottom, right, top = shown.bounds
    assert (left < 0.0, right > 0.16, bottom < -0.005, top > 0.022) == (True,) * 4


def test_a_path_goes_on_straight_at_both_ends():
    environment = read_environment("two_bends")
    places = points_along_path(environment, np.array([-0.01, 0.1, environment.length + 0.02]))
    np.testing.assert_allclose(places, [[-0.01, 0.0], [0.1, 0.0], [0.383, 0.1]], atol=1e-9)


@given(arrays(float, (7, 3), elements=st.floats(-1e3, 1e3) | st.just(np.nan)))
def test_packed_numbers_come_back(values):
    found = page.pack_values(values)
    codes = np.frombuffer(base64.b64decode(found["data"]), "<u2").reshape(7, 3)
    back = np.where(codes == page.NAN_CODE, np.nan, found["low"] + codes * found["step"])
    span = np.ptp(values[np.isfinite(values)]) if np.isfinite(values).any() else 0.0
    np.testing.assert_allclose(back, values, atol=span / 131_000 + 1e-7)


def films_of(text):
    return json.loads(DATA.search(text)[1])


@pytest.mark.slow
def test_the_page_holds_everything_and_loads_nothing(run, shown):
    text = page.page_html("a <b> & c", {"first </script>": shown, "second": shown}, "note")
    assert "http" not in text.replace("http://www.w3.org", "")
    assert "a &lt;b&gt; &amp; c" in text
    one, other = films_of(text)
    assert (one["name"], other["name"]) == ("first </script>", "second")
    assert text.count("</script>") == 3  # what was called so did not end one
    assert one["lines"][0]["label"] == "instrument <8 Fr>"
    assert len(text) < 130_000
    assert films_of(page.page_html("t", {"e": still_frames(read_environment("aortic_arch"))}))[0]["lines"] == []


@pytest.mark.slow
@pytest.mark.skipif(shutil.which("chromium") is None, reason="needs chromium")
def test_a_browser_plays_the_page(tmp_path, shown):
    """Its script runs: the first instant stands beside the slider, everything is in the legends."""
    (tmp_path / "scene.html").write_text(page.page_html("Swing", {"first": shown}))
    done = subprocess.run(
        ["chromium", "--headless", "--no-sandbox", "--disable-gpu", "--dump-dom", f"file://{tmp_path}/scene.html"],
        capture_output=True,
        text=True,
        timeout=120,
        check=False,
    )
    html = done.stdout
    assert 'max="90"' in html, done.stderr
    assert ">0.100 s</output>" in html
    assert "instrument &lt;8 Fr&gt;" in html
    assert "force, longest 200 mN" in html


@pytest.mark.slow
def test_a_report_has_one_cursor_of_time(run, browser):
    """Of its curves and of the scene beside them."""
    page, wrong = browser.new_page(), []
    page.on("pageerror", lambda error: wrong.append(str(error)))
    page.goto(f"file://{run}/report.html")
    charts = "[...document.querySelectorAll('.twin-chart')].map((element) => element.chart)"
    page.wait_for_function(f"{charts}.length && {charts}.every((chart) => chart.frames)")
    assert page.locator(".player .now").inner_text() == "0.650 s"  # halfway
    page.locator(".player .time").fill("45")  # of 101 instants from 0 s to 1 s
    assert page.locator(".player .now").inner_text() == "0.450 s"
    assert page.evaluate(f"{charts}[0].time") == pytest.approx(0.45, abs=1e-3)
    chart = page.locator(".twin-chart").first
    chart.scroll_into_view_if_needed()
    box = chart.bounding_box()
    page.mouse.move(box["x"] + 0.8 * box["width"], box["y"] + 60)
    at = page.evaluate(f"{charts}[0].hover.at")
    assert page.locator(".player .now").inner_text() == f"{at:.3f} s"
    page.locator(".player .play").click()
    page.wait_for_function(f"(at) => {charts}[0].time > at", arg=at)
    assert wrong == []
    page.close()


@pytest.mark.slow
def test_the_same_picture_every_time(shown):
    first, second = (picture.figure_svg(picture.scene_figure(shown, "base", 3), "salt") for _ in range(2))
    assert first == second
    assert "instrument &lt;8 Fr&gt;" in first
    assert [f"base, {t} s" in first for t in ("0.1", "0.55", "1")] == [True] * 3


@pytest.mark.slow
def test_titles_are_no_formulas(shown):
    text = r"5 $\frac{ of $"
    named = replace(shown, title=text, lines=(replace(shown.lines[0], label=text),))
    assert picture.figure_svg(picture.scene_figure(named, text), "salt").count(text) == 2
    assert next(picture.render_images(named, 50)).ndim == 3


@pytest.mark.slow
def test_a_gif_shows_what_moves(tmp_path, shown):
    told = []
    animation.write_movie(shown, tmp_path / "swing.gif", 10.0, 1.0, told.append)
    assert told == pytest.approx(np.arange(1, 11) / 10)
    with Image.open(tmp_path / "swing.gif") as gif:
        assert gif.n_frames == 10
        assert gif.info["duration"] == 100
        images = []
        for number in (1, 6):
            gif.seek(number)
            images.append(np.asarray(gif.convert("RGB"), int))
    change = np.abs(images[0] - images[1]).max(axis=2) > 60
    assert 0.0005 < change.mean() < 0.1  # the line and the wall, not the axes


@pytest.mark.slow
def test_an_mp4_is_one(tmp_path, shown):
    imageio_ffmpeg = pytest.importorskip("imageio_ffmpeg")
    animation.write_movie(shown, tmp_path / "swing.mp4", 10.0, 1.0, lambda _: None)
    frames = imageio_ffmpeg.read_frames(str(tmp_path / "swing.mp4"))
    about = next(frames)
    assert (about["fps"], len(list(frames))) == (10.0, 10)
    assert [path.name for path in tmp_path.iterdir()] == ["swing.mp4"]


@pytest.mark.slow
def test_a_moving_svg_follows_the_signals(shown):
    root = etree.fromstring(animation.animated_svg(shown, 10.0, 1.0).encode())
    space = "{http://www.w3.org/2000/svg}"
    (line,) = [one for one in root.iter(f"{space}polyline") if one.get("stroke-width") == "2.00"]
    values = line.find(f"{space}animate").get("values").split(";")
    tips = [float(one.split(",")[-1]) for one in values]
    np.testing.assert_allclose(tips, -2.0 * np.sin(2 * np.pi * np.arange(1, 11) / 10), atol=0.006)
    (wall,) = list(root.iter(f"{space}animateTransform"))
    assert wall.get("values").split(";")[0] == f"0.00,{-2 * np.sin(0.2 * np.pi):.2f}"
    assert wall.get("dur") == "1.000s"


@pytest.mark.slow
def test_what_cannot_be_filmed(tmp_path, shown, monkeypatch):
    with pytest.raises(SceneError, match=r"5400 frames are more than the 750 of a \.gif. Use --speed 0.07 or"):
        animation.write_movie(shown, tmp_path / "a.gif", 60.0, 0.01, print)
    with pytest.raises(SceneError, match="is a still picture"):
        animation.animated_svg(still_frames(read_environment("two_bends")), 25.0, 1.0)
    monkeypatch.setitem(__import__("sys").modules, "imageio_ffmpeg", None)
    with pytest.raises(SceneError, match="pip install imageio-ffmpeg"):
        animation.write_movie(shown, tmp_path / "a.mp4", 10.0, 1.0, lambda _: None)
    assert not (tmp_path / "a.mp4").exists()


@pytest.mark.slow
def test_a_report_shows_each_scene(run):
    text = (run / "report.html").read_text()
    assert all(f"<b>{title}</b>" in text for title in ("In the channel", "In space"))


@pytest.mark.slow
def test_scenes_of_a_run_are_named(run):
    assert list(scenes.run_scenes(run)) == ["In the channel", "In space"]
    with pytest.raises(SceneError, match=r"has no scene 'In space\?'. Did you mean 'In space'"):
        scenes.run_scenes(run, "In space?")
    with pytest.raises(SceneError, match="there is no seed 7"):
        scenes.run_scenes(run, seed=7)


WRONG = """
title: wrong
stop_time: 1 s
members:
  swing: {component: "tests.scene.parts:Swing"}
scenes:
  - title: A
    environment: moving.svg
    lines: swing.shap
    points: [{label: x}, {along: swing.contact_force, label: y}]
    axes: [x, x]
    from: 2 s
  - title: B
    environment: two_bens
    lines: [swing.contact_force, swing.tip, swing.travel, "swing.shape[1,1]"]
    arrows: {signal: swing.shape, at: swing.contact_point}
    signals: [swing.travel]
    unit: N
  - {title: C, enviroment: two_bends, motions: {heart: sving.heart}}
  - {title: D, environment: two_bends, motions: {hart: swing.heart}, points: swing.tip, variants: [PI], signals: {signal: swing.travel, x: swing.heart}}
"""


def test_every_mistake_of_scenes_in_one_go(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    svg(tmp_path, PAD.replace("h-20", "h-20 v-9"), "moving.svg")
    (tmp_path / "wrong.yaml").write_text(WRONG)
    assert [problem.replace(f"{tmp_path}/", "") for problem in lint("wrong.yaml")[1]] == [
        "wrong.yaml:7: swing.contact_force is an array of 2 x 2, expected a single value. Name one of swing.contact_force[1,1] to swing.contact_force[2,2].",
        "wrong.yaml:7: scene `A`: `swing.contact_force` is in mN, which does not convert to m. Name a length.",
        "wrong.yaml:7: scene `A`: lines: swing has no variable `shap`. Did you mean `shape`?",
        "wrong.yaml:8: scene `A`: moving.svg:3: wall `pad`: crosses itself at (120, 24) mm. Draw it apart there, or as two walls.",
        "wrong.yaml:10: scene `A`: points: give either `signal` or `along`.",
        "wrong.yaml:11: scene `A`: axes: x is given twice. Give two, such as [x, z].",
        "wrong.yaml:12: scene `A`: from 2 s lies outside the run, 0 s to 1 s. Change it or set stop_time to more than 2 s.",
        "wrong.yaml:13: scene `B`: `swing.travel` is in m, which does not convert to N. Use unit: m.",
        "wrong.yaml:13: scene `B`: lines: swing.contact_force is in mN, expected a length. Name points in space.",
        "wrong.yaml:13: scene `B`: lines: swing.tip has 2 elements, expected 2 or 3 numbers for each point: n x 2. Name such an array.",
        "wrong.yaml:13: scene `B`: lines: swing.travel is a single value, expected 2 or 3 numbers for each point: n x 2. Name such an array.",
        "wrong.yaml:13: scene `B`: lines: swing.shape[1,1] is one element. Name the whole array.",
        "wrong.yaml:13: scene `B`: arrows: swing.contact_point has 2 x 2 elements, swing.shape has 3 x 2 elements. One vector for each point is needed.",
        "wrong.yaml:14: scene `B`: There is no environment 'two_bens'. Did you mean 'two_bends'?",
        "wrong.yaml:19: scenes[3]: unknown key `enviroment`. Did you mean `environment`?",
        "wrong.yaml:19: scene `C`: shows nothing that moves. Add `lines`, `points`, `arrows` or `space`.",
        "wrong.yaml:19: there is no member `sving`. Did you mean `swing`?",
        "wrong.yaml:20: scene `D`: no wall of two_bends moves with `hart`. It has no moving walls.",
        "wrong.yaml:20: scene `D`: signals are shown over time. Leave `x` out.",
        "wrong.yaml:20: scene `D`: there is no variant `PI`. Known: base.",
    ]
