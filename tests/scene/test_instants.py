"""From recorded signals to frames, and from frames to drawn elements, films and images, without a figure."""

import io
import sys
from types import SimpleNamespace

import numpy as np
import pytest
from PIL import Image

from tests.every_case import every_case
from twin.errors import SceneError
from twin.results import PlotCurve, Signals, Window, expression
from twin.scene import Arrow, Environment, Frames, Line, Mark, Scene, Wall, animation, picture, scene_instants
from twin.scene.frames import Track, Vectors

TIME = np.array([0.0, 0.5, 1.0, 1.5])
ROD = np.array([[0.0, 1.0], [2.0, 3.0]])  # two points
SIGNALS = Signals(
    TIME,
    {
        "a.shape": np.arange(4)[:, None, None] + ROD * 1e3,
        "a.space": np.arange(4)[:, None, None] + np.array([[1.0, 2.0, 3.0]]),
        "a.tip": np.stack([TIME, -TIME], axis=1),
        "a.contact": np.array([[[1.0, 1.0], [2.0, 2.0]]] * 4),
        "a.force": np.array(
            [[[0.0, 0.0], [3.0, 4.0]], [[1.0, 0.0], [0.0, 0.0]], [[0.0, 0.0], [0.0, 0.0]], [[0.0, -5.0]] * 2]
        ),
        "a.travel": np.array([0.0, 0.5, 1.0, 3.0]),
        "a.temperature": np.array([20.0, 21.0, 22.0, 23.0]),
        "a.heart": TIME * 2.0,
    },
    {
        "a.shape": "mm",
        "a.space": "m",
        "a.tip": "m",
        "a.contact": "m",
        "a.force": "mN",
        "a.travel": "m",
        "a.temperature": "degC",
    },
)
WALL = Wall(
    "pad", np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0]]), closed=True, moves="heart", direction=np.array([0.0, 1.0])
)
FLOOR = Wall("floor", np.array([[0.0, -1.0], [2.0, -1.0]]), thickness=0.002)
ROOM = Environment(
    "room", "A room", (WALL, FLOOR), np.zeros(2), np.array([1.0, 0.0]), np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0]])
)
parse = expression.parse


def test_frames_hold_what_was_recorded():
    """Positions in meters, forces and curves in their own unit; a point of arrows that are zero is not there."""
    scene = Scene(
        "Tip",
        ROOM,
        motions={"heart": parse("a.heart"), "breath": parse("a.missing")},
        lines=(Line("a.shape", "rod", 0.002), Line("a.missing", "none")),
        points=(Mark("gripper", along=parse("a.travel")), Mark("contact", "a.contact"), Mark("tip", "a.tip")),
        arrows=(
            Arrow("a.force", "a.contact", "load"),
            Arrow("a.tip", "a.contact", "odd"),
            Arrow("a.none", "a.contact", "no"),
        ),
        curves=(PlotCurve(parse("a.temperature"), "T"), PlotCurve(parse("a.none"), "none")),
        window=Window(500_000_000, 1_000_000_000),
    )
    frames = scene_instants(scene, SIGNALS)
    assert (frames.title, frames.environment, frames.time.tolist()) == ("Tip", ROOM, [0.5, 1.0])
    (rod,), (gripper, contact, tip), (load,), (curve,) = frames.lines, frames.points, frames.arrows, frames.curves
    np.testing.assert_allclose(rod.points, np.array([1e-3, 2e-3])[:, None, None] + ROD)
    assert (rod.label, rod.width) == ("rod", 0.002)
    np.testing.assert_allclose(gripper.points, [[[0.5, 0.0]], [[1.0, 0.0]]])
    np.testing.assert_allclose(tip.points, [[[0.5, -0.5]], [[1.0, -1.0]]])
    nan = [np.nan, np.nan]
    np.testing.assert_allclose(contact.points, [[[1.0, 1.0], nan], [nan, nan]])
    np.testing.assert_allclose(load.at, contact.points)
    np.testing.assert_allclose(load.vectors, [[[1.0, 0.0], nan], [nan, nan]])
    assert (load.label, load.unit) == ("load", "mN")
    assert {name: values.tolist() for name, values in frames.motions.items()} == {"heart": [1.0, 2.0]}
    assert (curve[0], curve[1].tolist()) == ("T", pytest.approx([21.0, 22.0]))
    assert frames.unit == "degC"


@pytest.mark.parametrize(
    ("arrows", "touching"),
    [((), [0, 1]), (("a.force",), [1]), (("a.force", "a.push"), [0, 1])],
)
def test_a_point_is_there_while_any_of_its_arrows_is(arrows, touching):
    values = {"a.contact": SIGNALS.values["a.contact"][:1], "a.force": SIGNALS.values["a.force"][:1]}
    values["a.push"] = values["a.force"][:, ::-1]
    scene = Scene(
        "s", points=(Mark("c", "a.contact"),), arrows=tuple(Arrow(name, "a.contact", name) for name in arrows)
    )
    frames = scene_instants(scene, Signals(TIME[:1], values, {}))
    assert np.flatnonzero(np.isfinite(frames.points[0].points[0, :, 0])).tolist() == touching


@pytest.mark.parametrize(("axes", "expected"), [((0, 1), [1.0, 2.0]), ((0, 2), [1.0, 3.0]), ((2, 1), [3.0, 2.0])])
def test_axes_of_points_in_space(axes, expected):
    """Points in a plane are as they are."""
    frames = scene_instants(Scene("s", lines=(Line("a.space", "l"), Line("a.shape", "r")), axes=axes), SIGNALS)
    assert frames.lines[0].points[0].tolist() == [expected]
    np.testing.assert_allclose(frames.lines[1].points[0], ROD)


@every_case(
    "scene",
    [
        Scene("s", lines=(Line("a.missing", "l"),)),
        Scene("s", lines=(Line("a.travel", "l"),)),
        Scene("s", ROOM, points=(Mark("g", along=parse("a.missing")),)),
        Scene("s", lines=(Line("a.shape", "l"),), window=Window(9_000_000_000, None)),
        Scene("s", curves=(PlotCurve(parse("a.travel"), "t"),)),
    ],
)
def test_a_scene_in_which_nothing_moves_is_none(scene):
    assert scene_instants(scene, SIGNALS) is None


@every_case(
    ("curves", "unit", "first"),
    [
        (("a.temperature",), "degC", [20.0]),
        (("a.temperature", "a.none"), "degC", [20.0]),  # what was not recorded does not count
        (("a.temperature", "a.travel"), "", [293.15, 0.0]),
        (("a.temperature + a.temperature",), "", None),
        ((), "", []),
    ],
)
def test_curves_have_their_common_unit_or_that_of_coherent_units(curves, unit, first):
    scene = Scene("s", lines=(Line("a.shape", "l"),), curves=tuple(PlotCurve(parse(text), text) for text in curves))
    frames = scene_instants(scene, SIGNALS)
    assert frames.unit == unit
    if first is not None:
        assert [values[0] for _, values in frames.curves] == pytest.approx(first)


class Axis:
    """Two points of paper for a millimeter; notes what is drawn."""

    def __init__(self):
        self.drawn = []
        self.figure = SimpleNamespace(dpi=144.0)
        self.transData = SimpleNamespace(transform=lambda points: [(4.0 * x, 4.0 * y) for x, y in points])

    def __getattr__(self, name):
        return lambda *data, **style: self.drawn.append((name, *data, style))


def drawn(draw, *arguments):
    """Kind, coordinates [mm] and style of what is drawn."""
    axis = Axis()
    draw(axis, *arguments)
    return [
        (name, [np.round(one, 9).tolist() for one in data if not isinstance(one, str)], style)
        for name, *data, style in axis.drawn
    ]


def test_walls_are_as_thick_as_they_are():
    frames = Frames("s", ROOM, TIME, motions={"heart": TIME})
    fill, pad, floor = drawn(picture.draw_walls, frames, 1)
    outline = [[0.0, 1000.0, 1000.0, 0.0], [500.0, 500.0, 1500.0, 500.0]]
    assert [fill[:2], pad[:2]] == [("fill", outline), ("plot", outline)]
    assert floor[:2] == ("plot", [[0.0, 2000.0], [-1000.0, -1000.0]])
    assert (pad[2]["linewidth"], floor[2]["linewidth"]) == (picture.MIN_LINE_WIDTH, 4.0)
    assert (pad[2]["color"], floor[2]["color"]) == (picture.MOVING_WALL_COLOR, picture.WALL_COLOR)
    assert [len(drawn(picture.draw_walls, frames, 1, moving)) for moving in ((False,), (True,))] == [1, 2]


def test_an_instant_is_drawn_in_millimeters():
    """The path where no line is; arrows in one scale for all instants, without those that are not there."""
    track = Track("tip", np.arange(16.0).reshape(4, 2, 2) * 1e-3, 0.002)
    vectors = np.array([[[3.0, 4.0], [np.nan, np.nan]]] * 3 + [[[0.0, 10.0], [0.0, 0.0]]])
    load = Vectors("load", track.points, vectors, "N")
    frames = Frames(
        "s", ROOM, TIME, lines=(track,), points=(track,), arrows=(load, Vectors("none", track.points, 0 * vectors, "N"))
    )
    line, point, arrows = drawn(picture.draw_instant, frames, 1)
    assert line[:2] == point[:2] == ("plot", [[4.0, 6.0], [5.0, 7.0]])
    assert (line[2]["linewidth"], line[2]["label"], point[2]["label"]) == (4.0, "tip", "tip")
    length = 100.0 * frames.arrow
    assert arrows[0] == "quiver"
    assert arrows[1] == [[4.0], [5.0], [pytest.approx(3.0 * length)], [pytest.approx(4.0 * length)]]
    assert arrows[2]["label"] == "load, longest 10 N"
    (path,) = drawn(picture.draw_instant, Frames("s", ROOM, TIME), 1)
    assert path[:2] == ("plot", [[0.0, 1000.0, 1000.0], [0.0, 0.0, 1000.0]])
    assert path[2]["label"] == "path"
    assert drawn(picture.draw_instant, Frames("s", None, TIME), 1) == []


def images(count, height=5, width=7):
    return iter([np.full((height, width, 3), 40 * k, np.uint8) for k in range(count)])


@pytest.mark.parametrize(("rate", "duration"), [(25.0, 40), (30.0, 30), (60.0, 20), (1.0, 1000)])
def test_a_gif_loops_and_its_durations_are_whole(rate, duration):
    file = io.BytesIO()
    file.name = "a.gif"
    animation.write_gif(images(4), file, rate)
    film = Image.open(file)
    assert (film.n_frames, film.size, film.info["duration"], film.info["loop"]) == (4, (7, 5), duration, 0)
    levels = []
    for k in range(4):
        film.seek(k)
        levels.append(film.convert("RGB").getpixel((3, 2))[0])
    assert levels == pytest.approx([0, 40, 80, 120], abs=20)


def test_a_film_has_even_sizes_and_is_closed(monkeypatch):
    sent, closed = [], []

    def write_frames(target, size, fps, macro_block_size):
        sent.append((target, size, fps, macro_block_size))
        return SimpleNamespace(send=sent.append, close=lambda: closed.append(True))

    monkeypatch.setitem(sys.modules, "imageio_ffmpeg", SimpleNamespace(write_frames=write_frames))
    animation.write_mp4(images(3), "a.mp4", 25.0)
    assert sent[:2] == [("a.mp4", (6, 4), 25.0, 2), None]
    assert [(frame.shape, frame[0, 0, 0]) for frame in sent[2:]] == [((4, 6, 3), 40 * k) for k in range(3)]
    assert closed == [True]
    monkeypatch.setitem(sys.modules, "imageio_ffmpeg", None)
    with pytest.raises(SceneError, match="imageio"):
        animation.write_mp4(images(1), "a.mp4", 25.0)
