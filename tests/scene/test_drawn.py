"""What is drawn of a scene: a rod that moves in a room, whose numbers are known, in every form that it is written in."""

import base64

import matplotlib.colors
import numpy as np
import pytest
from lxml import etree

from twin.errors import SceneError
from twin.results import PlotCurve, Signals, Window, expression
from twin.scene import (
    Arrow,
    Environment,
    Line,
    Mark,
    Scene,
    Wall,
    animation,
    page,
    picture,
    scene_instants,
    still_frames,
)
from twin.scene.frames import Frames, Track, Vectors

UP = np.array([0.0, 1.0])
PATH = np.array([[0.0, 0.05], [0.1, 0.05]])
FLOOR = Wall("floor", np.array([[0.0, 0.0], [0.2, 0.0]]), thickness=0.002)
PAD = Wall("pad", np.array([[0.1, 0.01], [0.12, 0.01], [0.12, 0.02]]), closed=True, moves="heart", direction=UP)
ROOM = Environment("room", "Room", (FLOOR, PAD), PATH[0], np.array([1.0, 0.0]), PATH)
TIME = np.array([0.0, 0.5, 1.0])
ROD = np.array([[[0.0, 0.05], [0.1, y]] for y in (0.05, 0.06, 0.03)])
FORCE = np.array([[[0.0, 2.0]], [[0.0, -4.0]], [[np.nan, np.nan]]])


@pytest.fixture(scope="module")
def frames():
    """Three instants: a rod, its tip that is missing at the end, a force on it, a pad that goes 10 mm up and back."""
    tip = ROD[:, 1:].copy()
    tip[2] = np.nan
    return Frames(
        "Rod <1>",
        ROOM,
        TIME,
        (Track("rod", ROD, 0.003),),
        (Track("tip", tip),),
        (Vectors("force", ROD[:, 1:], FORCE, "N"),),
        {"heart": np.array([0.0, 0.01, 0.0])},
        (("y", np.array([1.0, 3.0, 2.0])),),
        "mm",
    )


def test_instants_of_frames(frames):
    """Walls are where their motion has them; all that moves is selected together."""
    assert [(wall.name, outline[0].round(9).tolist()) for wall, outline in frames.walls(1)] == [
        ("floor", [0.0, 0.0]),
        ("pad", [0.1, 0.02]),
    ]
    assert len(frames.walls(0)[1][1]) == 4
    last = frames.select(np.array([2, 1]))
    assert last.time.tolist() == [1.0, 0.5]
    assert last.lines[0].points[:, 1, 1].tolist() == [0.03, 0.06]
    assert last.points[0].points[1, 0].tolist() == [0.1, 0.06]
    assert last.arrows[0].at[0, 0].tolist() == [0.1, 0.03]
    assert last.arrows[0].vectors[1, 0].tolist() == [0.0, -4.0]
    assert (last.motions["heart"].tolist(), last.curves[0][1].tolist()) == ([0.0, 0.01], [2.0, 3.0])
    many = Frames("many", None, np.arange(10.0))
    assert {n: many.thin(n).time.tolist() for n in (3, 5, 9, 10)} == {
        3: [0, 4, 8],
        5: [0, 2, 4, 6, 8],
        9: [0, 2, 4, 6, 8],
        10: list(range(10)),
    }
    assert many.resample(4.0).time.tolist() == [0.0, 4.0, 8.0]
    assert many.resample(4.5).time.tolist() == [0.0, 4.0, 9.0]  # the last one before 4.5 s
    assert frames.resample(0.25).time.tolist() == [0.0, 0.0, 0.5, 0.5, 1.0]


def test_sizes_of_a_scene(frames):
    """Everything that is ever drawn: the pad at both ends of its way, the tips of arrows, a margin of 4 %."""
    lowest, highest = frames.extent_points.min(axis=0), frames.extent_points.max(axis=0)
    assert (lowest.tolist(), highest.tolist()) == ([0.0, 0.0], [0.2, pytest.approx(0.06)])
    assert len(frames.extent_points) == 3 * 2 + 2 + 3 + 2 * 2 + 2 * 3 + 2
    arrow = 0.14 * np.hypot(0.2, 0.06)
    assert frames.arrow == pytest.approx(arrow)
    top, bottom = 0.05 + arrow / 2, min(0.06 - arrow, 0.0)
    assert frames.bounds == pytest.approx((-0.008, bottom - 0.008, 0.208, max(top, 0.06) + 0.008))
    flat = Frames("flat", None, TIME, lines=(Track("l", np.array([[[0.0, 0.0], [1.0, 0.1]]] * 3)),))
    assert flat.bounds == pytest.approx((-0.04, -0.04 - 0.05, 1.04, 0.14 + 0.05))  # a fifth as high as wide
    still = still_frames(ROOM)
    assert (still.title, still.time.tolist(), still.motions["heart"].tolist(), still.arrow > 0.0) == (
        "Room",
        [0.0],
        [0.0],
        True,
    )


def test_frames_of_recorded_signals():
    """Units become meters; what is in space is seen along the third axis; a force of zero has no arrow and no point."""
    signals = Signals(
        np.arange(4.0),
        {
            "a.shape": 1e3 * np.stack([np.zeros((4, 2)), np.ones((4, 2)), np.arange(8.0).reshape(4, 2)], axis=2),
            "a.tip": np.arange(8.0).reshape(4, 2),
            "a.at": np.ones((4, 2, 2)),
            "a.force": np.array([[[0, 0], [3, 4]]] * 4, float),
            "a.travel": 10.0 * np.arange(4.0),
            "a.flat": np.arange(4.0),
        },
        {"a.shape": "mm", "a.tip": "m", "a.at": "m", "a.force": "mN", "a.travel": "mm", "a.flat": "m"},
    )
    scene = Scene(
        "S",
        ROOM,
        {"heart": expression.parse("a.travel"), "lung": expression.parse("a.gone")},
        (Line("a.shape", "rod", 0.002), Line("a.gone", "gone"), Line("a.flat", "single value")),
        (Mark("tip", "a.tip"), Mark("contact", "a.at"), Mark("gripper", along=expression.parse("a.travel"))),
        (Arrow("a.force", "a.at", "force"), Arrow("a.tip", "a.at", "other shape")),
        (PlotCurve(expression.parse("a.travel"), "travel"),),
        axes=(0, 2),
        window=Window(1_000_000_000, 2_000_000_000),
    )
    frames = scene_instants(scene, signals)
    assert (frames.title, frames.environment, frames.time.tolist(), frames.unit) == ("S", ROOM, [1.0, 2.0], "mm")
    (line,) = frames.lines
    assert (line.label, line.width, line.points.tolist()) == ("rod", 0.002, [[[0, 2], [0, 3]], [[0, 4], [0, 5]]])
    tip, contact, gripper = frames.points
    assert tip.points.tolist() == [[[2, 3]], [[4, 5]]]
    np.testing.assert_array_equal(contact.points, [[[np.nan, np.nan], [1, 1]]] * 2)
    np.testing.assert_allclose(gripper.points, [[[0.01, 0.05]], [[0.02, 0.05]]])
    (force,) = frames.arrows
    assert (force.label, force.unit, force.longest) == ("force", "mN", pytest.approx(5.0))
    np.testing.assert_allclose(force.vectors, [[[np.nan, np.nan], [3, 4]]] * 2)
    np.testing.assert_array_equal(force.at, [[[np.nan, np.nan], [1, 1]]] * 2)
    assert {name: value.tolist() for name, value in frames.motions.items()} == {"heart": [0.01, 0.02]}
    assert [(label, y.round(9).tolist()) for label, y in frames.curves] == [("travel", [10.0, 20.0])]
    assert scene_instants(Scene("S", lines=(Line("a.gone", "gone"),)), signals) is None
    assert scene_instants(Scene("S", lines=(Line("a.tip", "tip"),), window=Window(9_000_000_000)), signals) is None
    mixed = Scene(
        "S", lines=scene.lines, curves=tuple(PlotCurve(expression.parse(name), name) for name in ("a.travel", "a.flat"))
    )
    assert scene_instants(mixed, signals).unit == ""
    assert [y[1] for _, y in scene_instants(mixed, signals).curves] == [0.01, 1.0]
    assert scene.names == ("a.travel", "a.gone", "a.shape", "a.flat", "a.tip", "a.at", "a.force")
    assert list(scene.arrays)[-2:] == [("a.at", "arrows", True), ("a.tip", "arrows", False)]


def unpacked(packed):
    """The numbers of a film."""
    codes = np.frombuffer(base64.b64decode(packed["data"]), "<u2").reshape(-1, packed["count"])
    return np.where(codes == page.NAN_CODE, np.nan, packed["low"] + codes * packed["step"])


def test_data_of_a_page(frames):
    """In millimeters, forces in their own unit; curves may have more instants than what moves."""
    film = page.film_data(frames)
    assert np.iinfo(np.uint16).max == page.NAN_CODE  # numbers have the codes below it
    np.testing.assert_allclose(film["bounds"], 1e3 * np.array(frames.bounds))
    assert film["walls"][1] == {
        "closed": True,
        "thickness": 0.0,
        "moves": "heart",
        "name": "pad",
        "direction": [0.0, 1.0],
        "points": [100.0, 10.0, 120.0, 10.0, 120.0, 20.0],
    }
    assert film["walls"][0]["thickness"] == 2.0
    assert (film["path"], film["unit"], film["arrow"]) == ([0.0, 50.0, 100.0, 50.0], "mm", 1e3 * frames.arrow)
    described = {
        name: [
            {key: part[key] for key in part if key not in ("low", "step", "count", "data", "at")} for part in film[name]
        ]
        for name in ("lines", "points", "arrows", "curves")
    }
    assert described == {
        "lines": [{"label": "rod", "width": 3.0, "color": 0}],
        "points": [{"label": "tip", "color": 3}],
        "arrows": [{"label": "force", "unit": "N", "longest": 4.0, "color": 1}],
        "curves": [{"label": "y", "color": 4}],
    }
    for packed, values in (
        (film["when"], TIME),
        (film["lines"][0], 1e3 * ROD),
        (film["arrows"][0], FORCE),
        (film["arrows"][0]["at"], 1e3 * ROD[:, 1:]),
        (film["motions"]["heart"], [0.0, 10.0, 0.0]),
        (film["curves"][0], [1, 3, 2]),
    ):
        np.testing.assert_allclose(unpacked(packed), np.reshape(values, (3, -1)), atol=2e-3)
    assert film["time"] == list(TIME)  # exact, however long the run is
    fewer = page.film_data(frames, max_values=2 * (4 + 2 + 4))  # two instants of four, two and four numbers
    assert (len(fewer["time"]), len(unpacked(fewer["when"]))) == (2, 3)
    assert page.film_data(still_frames(ROOM))["arrows"] == []
    assert page.round_values([np.pi, [1 / 3]]) == [3.141592654, [0.3333333333]]


def test_a_picture_holds_what_is_there(frames):
    """Three instants below each other: lines, marks and arrows in millimeters, as thick as they are."""
    figure = picture.scene_figure(frames, "base", 3)
    left, bottom, right, top = (1e3 * edge for edge in frames.bounds)
    assert [axis.get_title(loc="left") or axis.get_title() for axis in figure.axes] == [
        "base, 0 s",
        "base, 0.5 s",
        "base, 1 s",
    ]
    corners = np.array([axis.get_position(original=True).bounds for axis in figure.axes])
    width, height = figure.get_size_inches()
    panel = (picture.WIDTH - picture.EDGE, (picture.WIDTH - picture.EDGE) * (top - bottom) / (right - left))
    assert picture.panel_size(frames, panel[0]) == pytest.approx(panel)
    assert picture.panel_size(frames, 99.0, 2.0) == pytest.approx((2.0 * panel[0] / panel[1], 2.0))
    assert (width, height) == pytest.approx((picture.WIDTH, 3 * (panel[1] + picture.FOOT) + picture.HEAD))
    np.testing.assert_allclose(corners[:, 0] * width, picture.EDGE)
    tops = (corners[:, 1] + corners[:, 3]) * height
    np.testing.assert_allclose(height - tops, picture.HEAD + np.arange(3) * (panel[1] + picture.FOOT))
    for number, axis in enumerate(figure.axes):
        assert (*axis.get_xlim(), *axis.get_ylim()) == pytest.approx((left, right, bottom, top))
        floor, pad, rod, tip = axis.lines
        np.testing.assert_allclose(floor.get_xydata(), [[0, 0], [200, 0]])
        np.testing.assert_allclose(pad.get_xydata()[0], [100, 20 if number == 1 else 10])
        np.testing.assert_allclose(rod.get_xydata(), 1e3 * ROD[number])
        np.testing.assert_allclose(tip.get_xydata()[0], 1e3 * ROD[number, 1] if number < 2 else [np.nan] * 2)
        assert floor.get_linewidth() / rod.get_linewidth() == pytest.approx(2 / 3)
        assert (pad.get_linewidth(), len(axis.patches)) == (picture.MIN_LINE_WIDTH, 1)
        assert matplotlib.colors.same_color(pad.get_color(), picture.MOVING_WALL_COLOR)
        (arrows,) = axis.collections
        length = 1e3 * frames.arrow * FORCE[number, 0, 1] / 4.0
        np.testing.assert_allclose(arrows.V, [length] if number < 2 else [])
        np.testing.assert_allclose(arrows.X, [100.0] if number < 2 else [])
    labels = [text.get_text() for text in figure.legends[0].get_texts()]
    assert labels == ["rod", "tip", "force, longest 4 N"]
    assert max(line.get_linewidth() for line in figure.legends[0].get_lines()) <= picture.MAX_LEGEND_LINE_WIDTH


@pytest.mark.slow
def test_pictures_without_an_instrument_and_of_tall_scenes():
    (axis,) = picture.scene_figure(still_frames(ROOM)).axes
    np.testing.assert_allclose(axis.lines[-1].get_xydata(), 1e3 * PATH)  # there is no instrument: its path
    assert axis.get_title() == ""
    tall = Frames("tall", None, TIME, lines=(Track("l", np.array([[[0.0, 0.0], [0.1, 1.0]]] * 3)),))
    figure = picture.scene_figure(tall, "", 3)
    side_by_side = [axis.get_position(original=True).bounds[:2] for axis in figure.axes]
    width = (picture.WIDTH - 3 * picture.EDGE) / 3  # of a column, into which the height of a panel fits
    panel, _ = picture.panel_size(tall, width)
    columns = np.array([x for x, _ in side_by_side]) * figure.get_size_inches()[0]
    np.testing.assert_allclose(columns, picture.EDGE + np.arange(3) * (panel + picture.EDGE))
    assert len({round(y, 9) for _, y in side_by_side}) == 1


NAMESPACE = "{http://www.w3.org/2000/svg}"


def animated(element):
    """The values over time of each attribute that moves."""
    return {part.get("attributeName"): part.get("values").split(";") for part in element}


def test_an_animated_drawing(frames):
    """Two pictures a second at real time; y points down, what is missing is invisible."""
    root = etree.fromstring(animation.animated_svg(frames, 2.0, 1.0).encode())
    left, bottom, right, top = (1e3 * edge for edge in frames.bounds)
    assert root.get("viewBox") == f"{left:.2f} {-top:.2f} {right - left:.2f} {top - bottom:.2f}"
    floor, pad = root.iter(f"{NAMESPACE}path")
    assert (floor.get("class"), floor.get("stroke-width"), floor.get("d")) == (
        "wall",
        "2.00",
        "M0.00,-0.00 200.00,-0.00",
    )
    assert (pad.get("class"), pad.get("stroke-width"), animated(floor)) == ("pad solid", "0.40", {})
    assert animated(pad) == {"transform": ["0.00,0.00", "0.00,-10.00", "0.00,0.00"]}
    assert {part.get("dur") for part in root.iter() if part.get("dur")} == {"1.500s"}
    rod, force = root.iter(f"{NAMESPACE}polyline")
    assert (rod.get("stroke-width"), rod.get("points")) == ("3.00", "0.00,-50.00 100.00,-50.00")
    assert animated(rod)["points"][1:] == ["0.00,-50.00 100.00,-60.00", "0.00,-50.00 100.00,-30.00"]
    arrows = animated(force)["points"]
    assert arrows[2] == ""
    start, end, right_barb, again, left_barb = np.array(
        [[float(number) for number in point.split(",")] for point in arrows[1].split()]
    )
    length = 1e3 * frames.arrow
    np.testing.assert_allclose([start, end, again], [[100, -60], [100, -60 + length], [100, -60 + length]], atol=0.01)
    np.testing.assert_allclose(right_barb + left_barb, 2 * end - [0, 8], atol=0.03)  # barbs of 4 mm
    assert abs(right_barb[0] - left_barb[0]) == pytest.approx(4.0, abs=0.03)
    (circle,) = root.iter(f"{NAMESPACE}circle")
    assert (circle.get("cx"), circle.get("cy"), circle.get("opacity")) == ("100.00", "-50.00", "1")
    assert animated(circle)["opacity"] == ["1", "1", "0"]
    assert animated(circle)["cy"][:2] == ["-50.00", "-60.00"]
    text = root.find(f"{NAMESPACE}text")
    assert text.text == "rod, tip, force, 1 times real time"
    assert (text.get("x"), text.get("y")) == (f"{left + 2:.2f}", f"{-bottom - 2:.2f}")
    fast = etree.fromstring(animation.animated_svg(frames, 2.0, 2.0).encode())
    assert animated(next(fast.iter(f"{NAMESPACE}path")).getnext()) == {}  # 0 s and 1 s: the pad is where it was


def test_limits_of_an_animation(frames):
    """As many frames as the file may have; one instant is no animation."""
    assert len(animation.resample_frames(frames, 750.0, 1.0, ".gif").time) == 751
    with pytest.raises(SceneError, match=r"751 frames are more than the 750 of a \.gif\. Use --speed 1 or more"):
        animation.resample_frames(frames, 751.0, 1.0, ".gif")
    with pytest.raises(SceneError, match="Room: is a still picture"):
        animation.resample_frames(still_frames(ROOM), 1.0, 1.0, ".gif")
    assert animation.line_color(len(animation.plotting.COLORS)) == animation.line_color(0) != animation.line_color(1)
    short = animation.arrow_points(np.zeros(2), np.array([0.0, 1e-3]))  # barbs of 30 % of a short arrow
    assert short == "0.00,-0.00 0.00,-1.00 0.15,-0.70 0.00,-1.00 -0.15,-0.70"


@pytest.mark.slow
def test_images_of_a_film(frames):
    """Each instant on the same background: only what moves changes."""
    images = [image.astype(int) for image in picture.render_images(frames, 40)]
    assert [image.shape for image in images] == [images[0].shape] * 3
    changes = [np.argwhere(np.abs(images[0] - other).max(axis=2) > 40) for other in images[1:]]
    height = images[0].shape[0]
    assert all(0 < len(change) < 0.05 * images[0][..., 0].size for change in changes)
    assert all(change[:, 0].max() < 0.9 * height for change in changes)  # the axis below is the same
