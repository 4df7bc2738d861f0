"""Sizes of a scene over all of its instants."""

import base64

import numpy as np
import pytest

from twin.scene import Environment, Wall, page, still_frames
from twin.scene.frames import Frames, Track, Vectors

ROD = np.array([[[0.0, 0.0], [0.3, 0.0]], [[0.0, 0.0], [0.3, 0.4]], [[np.nan, 0.0], [np.nan, np.nan]]])


def test_bounds_hold_every_instant():
    frames = Frames("rod", None, np.arange(3.0), lines=(Track("rod", ROD),))
    assert len(frames.extent_points) == 4
    assert frames.arrow == pytest.approx(0.14 * 0.5)
    assert frames.bounds == pytest.approx((-0.016, -0.016, 0.316, 0.416))


def test_tips_of_arrows_are_within_the_bounds():
    """The longest one has the length of `arrow`, whatever its unit."""
    vectors = np.array([[[0.0, -20.0]], [[0.0, 10.0]], [[np.nan, 0.0]]])
    load = Vectors("load", np.array([[[0.3, 0.0]]] * 3), vectors, "N")
    frames = Frames("rod", None, np.arange(3.0), lines=(Track("rod", ROD),), arrows=(load,))
    assert frames.bounds[1] == pytest.approx(-0.07 - 0.04 * 0.47)


def test_a_scene_without_a_point_has_a_size():
    frames = Frames("nothing", None, np.arange(3.0), points=(Track("tip", np.full((3, 1, 2), np.nan)),))
    assert frames.bounds == (-0.1, -0.1, 0.1, 0.1)


SQUARE = np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0]])
WALLS = (
    Wall("pad", SQUARE, closed=True, moves="heart", direction=np.array([0.0, 1.0]), thickness=0.002),
    Wall("floor", SQUARE[:2] - 2.0),
)
ROOM = Environment("room", "A room", WALLS, np.zeros(2), np.array([1.0, 0.0]), np.array([[0.0, 0.5], [3.0, 0.5]]))
BEAT = np.array([0.0, 0.25, -0.5, 0.1])


def scene(**more):
    return Frames("scene", ROOM, np.array([0.0, 0.1, 0.2, 0.35]), **more)


def test_walls_move_with_their_motion():
    """A wall without a recorded motion stays where it was drawn."""
    moving = scene(motions={"heart": BEAT})
    (pad, outline), (floor, line) = moving.walls(1)
    assert (pad.name, floor.name) == ("pad", "floor")
    np.testing.assert_allclose(outline, np.vstack([SQUARE, SQUARE[:1]]) + np.array([0.0, 0.25]))
    np.testing.assert_allclose(line, SQUARE[:2] - 2.0)
    for still in (scene(), scene(motions={"other": BEAT})):
        np.testing.assert_allclose(still.walls(1)[0][1], np.vstack([SQUARE, SQUARE[:1]]))
    assert Frames("none", None, np.zeros(1)).walls(0) == []


@pytest.mark.parametrize(
    ("motions", "low", "high"), [({"heart": BEAT}, -0.5, 1.25), (None, 0.0, 1.0), ({"other": BEAT}, 0.0, 1.0)]
)
def test_the_extent_holds_walls_at_both_ends_of_their_motion(motions, low, high):
    points = scene(motions=motions).extent_points
    above = points[points[:, 1] > -1.0]
    assert (above[:, 1].min(), above[:, 1].max()) == (low, high)
    assert (points[:, 0].min(), points[:, 0].max(), points[:, 1].min()) == (-2.0, 3.0, -2.0)  # floor and path


def test_instants_are_selected_thinned_and_resampled():
    tip = Track("tip", np.arange(8.0).reshape(4, 1, 2))
    load = Vectors("load", tip.points, -tip.points, "N")
    every = scene(lines=(tip,), points=(tip,), arrows=(load,), motions={"heart": BEAT}, curves=(("x", BEAT),))
    some = every.select(np.array([3, 1]))
    assert some.time.tolist() == [0.35, 0.1]
    for array in (some.lines[0].points, some.points[0].points, some.arrows[0].at, -some.arrows[0].vectors):
        np.testing.assert_array_equal(array[:, 0], [[6.0, 7.0], [2.0, 3.0]])
    assert (some.motions["heart"].tolist(), some.curves[0][1].tolist()) == ([0.1, 0.25], [0.1, 0.25])
    assert scene().select(np.array([0])).motions == {}
    assert [every.thin(most).time.tolist() for most in (9, 4, 3, 2, 1)] == [
        [0.0, 0.1, 0.2, 0.35],
        [0.0, 0.1, 0.2, 0.35],
        [0.0, 0.2],
        [0.0, 0.2],
        [0.0],
    ]
    assert every.resample(0.1).time.tolist() == [0.0, 0.1, 0.2, 0.2]  # the last before each
    assert every.resample(0.15).time.tolist() == [0.0, 0.1, 0.2]
    assert every.resample(1.0).time.tolist() == [0.0]


def test_a_film_holds_what_moves_in_millimeters():
    """Fewer instants where there are many coordinates, at least two; curves have their own."""
    tip = Track("tip", np.arange(8.0).reshape(4, 1, 2), 0.002)
    load = Vectors("load", tip.points, -tip.points, "N")
    none = Vectors("none", tip.points, np.zeros((4, 1, 2)), "N")
    frames = scene(
        lines=(tip,), points=(tip, tip), arrows=(load, none), motions={"heart": BEAT}, curves=(("x", BEAT),), unit="mm"
    )
    film = page.film_data(frames)
    assert film["bounds"] == pytest.approx([1e3 * edge for edge in frames.bounds])
    assert film["path"] == [0.0, 500.0, 3000.0, 500.0]
    assert [(wall["name"], wall["closed"], wall["thickness"], wall["moves"]) for wall in film["walls"]] == [
        ("pad", True, 2.0, "heart"),
        ("floor", False, 0.0, ""),
    ]
    assert film["walls"][0]["points"] == (SQUARE.ravel() * 1e3).tolist()
    assert film["walls"][0]["direction"] == [0.0, 1.0]
    (line,), points, (arrow,) = film["lines"], film["points"], film["arrows"]
    assert (line["label"], line["width"], line["color"], line["low"], line["count"]) == ("tip", 2.0, 0, 0.0, 2)
    assert [point["color"] for point in points] == [3, 4]
    assert (arrow["label"], arrow["unit"], arrow["low"], arrow["at"]["low"]) == ("load", "N", -7.0, 0.0)
    assert arrow["longest"] == pytest.approx(load.longest)
    assert film["motions"]["heart"]["low"] == -500.0
    assert (film["curves"][0]["label"], film["curves"][0]["color"], film["curves"][0]["low"]) == ("x", 4, -0.5)
    assert (film["arrow"], film["unit"]) == (pytest.approx(1e3 * frames.arrow), "mm")
    assert len(film["time"]) == length(film["when"]) == 4
    assert len(page.film_data(frames, 28)["time"]) == 2  # fourteen coordinates
    assert len(page.film_data(frames, 1)["time"]) == 2
    few, more = (page.film_data(frames, 1, times)["time"] for times in ((), frames.time[1:2] + 1e-4))
    assert more == sorted({*few, frames.time[1]})  # with the instant nearest to a time
    assert length(page.film_data(frames, 1)["when"]) == 4
    empty = page.film_data(Frames("none", None, np.arange(3.0)))
    assert (empty["walls"], empty["path"], empty["motions"], len(empty["time"])) == ([], [], {}, 3)


def length(packed):
    """Number of instants of packed numbers, two bytes each."""
    return len(base64.b64decode(packed["data"])) // 2 // packed["count"]


def test_a_drawing_alone_stands_still():
    frames = still_frames(ROOM)
    assert (frames.title, frames.time.tolist()) == ("A room", [0.0])
    assert {name: values.tolist() for name, values in frames.motions.items()} == {"heart": [0.0]}
