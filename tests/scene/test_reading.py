"""Environments from files: both formats say the same, every mistake is one line with its place, nothing exhausts memory."""

import json
import math
import time

import numpy as np
import pytest

from tests.every_case import every_case
from tests.scene.drawings import SVG, feature, geojson, replaced, svg
from twin.errors import SceneError
from twin.scene import read_environment


def problems(path):
    with pytest.raises(SceneError) as caught:
        read_environment(path)
    assert all("\n" not in line for line in caught.value.problems)
    return [line.replace(f"{path.parent}/", "") for line in caught.value.problems]


def test_both_formats_say_the_same(tmp_path):
    one, other = read_environment(svg(tmp_path)), read_environment(geojson(tmp_path))
    assert one.title == other.title == "Channel"
    for a, b in zip(one.walls, other.walls, strict=True):
        assert (a.name, a.friction, a.thickness, a.moves, a.stiffness) == (b.name, 0.2, 1e-3, "", None)
        np.testing.assert_allclose(a.points, b.points, atol=1e-15)
    np.testing.assert_allclose(one.path, [[0, 0], [0.16, 0]])
    np.testing.assert_allclose(one.walls[0].points, [[0.01, 0.005], [0.15, 0.005]], atol=1e-15)  # y points up
    assert one.clearance == pytest.approx(4.5e-3)
    assert one.length == pytest.approx(0.16)
    np.testing.assert_array_equal(one.entry_direction, [1.0, 0.0])
    with pytest.raises(ValueError, match="read-only"):
        one.path[0] = 1.0


@pytest.mark.slow
@every_case("name", ["two_bends", "heart_wall", "free_gap", "aortic_arch", "left_ventricle"])
def test_shipped_environments_are_read_and_tell_their_sources(name):
    environment = read_environment(name)
    assert "estimate" in environment.source
    assert environment.clearance > 1.33e-3  # an instrument of 8 Fr fits


def test_two_bends_are_those_of_the_paper():
    """Straight, two opposite bends of 90 deg and 50 mm radius; the lumen is as wide everywhere."""
    environment = read_environment("two_bends")
    assert environment.length == pytest.approx(0.25 + 2 * math.pi / 2 * 0.05 + 0.013, abs=2e-5)
    steps = np.diff(environment.path, axis=0)
    angle = np.unwrap(np.arctan2(steps[:, 1], steps[:, 0]))
    assert (angle[0], angle[-1]) == pytest.approx((0.0, 0.0), abs=1e-9)
    assert angle.max() == pytest.approx(math.pi / 2, abs=0.02)  # half a chord's turn
    middle = environment.path[5:50]
    radius = np.hypot(middle[:, 0] - 0.25, middle[:, 1] - 0.05)
    np.testing.assert_allclose(radius, 0.05, atol=0.05 * 2.8e-4)  # arcs are drawn by cubics
    assert environment.clearance == pytest.approx(1.43e-3, abs=5e-6 + 1e-6)


def test_the_heart_s_wall_moves_along_the_instrument():
    (pad,) = [wall for wall in read_environment("heart_wall").walls if wall.moves]
    assert (pad.moves, pad.closed) == ("heart", True)
    np.testing.assert_array_equal(pad.direction, [1.0, 0.0])
    assert read_environment("heart_wall").motions == ("heart",)


def test_curves_keep_the_tolerance_and_transforms_nest(tmp_path):
    drawing = """<g transform="translate(100 40) rotate(90)"><g transform="scale(2)">
    <circle class="wall" id="ring" cx="0" cy="-10" r="5"/></g></g>"""
    text = SVG.format(drawing).replace('height="100mm"', 'height="100mm" data-tolerance="0.2 mm"')
    coarse = next(wall for wall in read_environment(written(tmp_path, text)).walls if wall.name == "ring")
    fine = next(
        w for w in read_environment(written(tmp_path, text.replace("0.2 mm", "0.01 mm"))).walls if w.name == "ring"
    )
    for wall, tolerance in ((coarse, 0.2e-3), (fine, 0.01e-3)):
        assert wall.closed
        middle = (wall.outline[:-1] + wall.outline[1:]) / 2
        for points in (wall.points, middle):  # scaled to 10 mm around (120, -40) mm
            away = np.abs(np.hypot(points[:, 0] - 0.12, points[:, 1] + 0.04) - 0.01)
            assert away.max() < tolerance + 0.01 * 2.8e-4
    assert len(fine.points) > 2 * len(coarse.points)


def written(folder, text, name="drawn.svg"):
    (folder / name).write_text(text)
    return folder / name


def test_every_mistake_of_a_drawing_in_one_go(tmp_path):
    path = svg(
        tmp_path,
        """<path class="wall" id="eight" d="M20 20 L60 40 L60 20 L20 40"/>
<path class="wal" id="typo" d="M0 0 H1"/>
<path class="wall" id="one" d="M20 30"/>
<path class="wall" id="nan" d="M20 30 LNaN 3"/>
<path class="wall" id="short" d="M20 30 L20 30 L30 40"/>
<path class="wall" id="soft" data-frction="0.1" data-stiffness="12" data-thickness="2 kg" data-moves="heart" d="M80 30 h9"/>
<path class="wall" id="across" d="M50 -20 V20"/>
<path id="bare" d="M0 0 H1"/>
<use href="#typo"/>
<rect class="wall" id="broken" x="0" width="five" height="2"/>
<path class="wall" id="few" d="M1 1 L2"/>
<path class="wall" id="flags" d="M1 1 A5 5 0 0"/>""",
    )
    assert problems(path) == [
        "channel.svg:3: wall `eight`: crosses itself at (40, -30) mm. Draw it apart there, or as two walls.",
        "channel.svg:4: class `wal` does not say what this is. Did you mean `wall`?",
        "channel.svg:5: wall `one`: has 1 points. 2 at least make a line.",
        "channel.svg:6: wall `nan`: has `N` among its numbers. Correct it.",
        "channel.svg:7: wall `short`: segment 1 at (20, -30) mm has no length. Remove a point.",
        "channel.svg:8: wall `soft`: unknown property `frction`. Did you mean `friction` or `direction`?",
        "channel.svg:8: wall `soft`: stiffness: `12` has no unit. Write it like 800 N/m.",
        "channel.svg:8: wall `soft`: thickness: `2 kg` does not convert to m. Write 2 mm.",
        "channel.svg:8: wall `soft`: has `moves` but no `direction`. Add it, such as 180 deg.",
        "channel.svg:10: <path> is no wall and no path. Give it, or a group around it, a class: wall, path or note.",
        "channel.svg:11: <use> is not read. Draw lines and shapes, or convert it to a path.",
        "channel.svg:12: wall `broken`: width=`five` is not a number. Give it in user units.",
        "channel.svg:13: wall `few`: Not enough coordinates for command 'L'.",
        "channel.svg:14: wall `flags`: Invalid arc command: 'A5 5 0 0'.",
        "channel.svg:19: path: leaves the walls: meets `across` at (50, 0) mm. Lead it around.",
    ]


def test_every_mistake_of_a_collection_in_one_go(tmp_path):
    path = geojson(
        tmp_path,
        feature("wall", [[20, 30], [float("nan"), 3]], name="nan"),
        feature("wall", [[20, 30, 1], [3, 3, 1]], name="space"),
        feature("wall", [[20, 20], [60, 40], [60, 20], [20, 40]], name="eight", friction=-0.1),
        feature("wall", [[[1, 30], [2, 30], [2, 31]]], "Polygon", name="open"),
        feature("wall", [[1, 2]], "Point", name="point"),
        feature("weir", [[1, 2], [3, 4]]),
        feature("path", [[1, 2], [3, 4]], friction=0.1),
        {"type": "Feature"},
        units=None,
        tittle="x",
    )
    found = problems(path)
    assert found == [
        "channel.geojson: unknown key `tittle`. Did you mean `title`?",
        'channel.geojson: units are missing. Say what coordinates are in: "units": "mm", "cm" or "m".',
        "channel.geojson: features[3]: wall `nan`: point 2 is not finite. Correct it.",
        "channel.geojson: features[4]: wall `space`: point 1 is `[20.0, 30.0, 1.0]`. Expected two numbers, [x, y].",
        "channel.geojson: features[5]: wall `eight`: friction -0.1 must be 0 or more.",
        "channel.geojson: features[5]: wall `eight`: crosses itself at (40, 30) mm. Draw it apart there, or as two walls.",
        "channel.geojson: features[6]: wall `open`: the ring does not end where it begins. Repeat its first point at the end.",
        "channel.geojson: features[7]: wall `point`: geometry `Point` is not read. Use LineString or Polygon, one per feature.",
        "channel.geojson: features[8]: class `weir` does not say what `feature8` is. Known: note, path, wall.",
        "channel.geojson: features[9]: path: has no property `friction`. Only walls have properties.",
        "channel.geojson: features[9]: a second path. Mark the one line along which an instrument is laid: class path.",
        "channel.geojson: features[10]: is no Feature with a geometry. Write type, properties and geometry.",
    ]


@pytest.mark.parametrize(
    ("old", "new", "expected"),
    [
        ('width="200mm"', 'width="200"', "channel.svg:1: width `200` has no unit of length."),
        ('width="200mm"', 'width="300mm"', "channel.svg:1: width and height are scaled differently by the viewBox."),
        ('viewBox="0 -50 200 100" ', "", "channel.svg:1: no viewBox."),
        ('height="100mm"', 'height="100mm" data-tolerance="5"', "channel.svg:1: data-tolerance: `5` has no unit."),
        ('class="path"', 'class="wall"', "channel.svg: no path."),
        ("M0 0 L160 0", "M20 5.3 L30 0", "channel.svg:8: path: begins at (20, -5.3) mm inside wall `lower`."),
        ("M0 0 L160 0", "M0 0 L160 0 z", "channel.svg:8: path: is closed."),
        ('id="lower"', 'id="upper"', "channel.svg:6: wall `upper`: another has this name, at"),
        ("M10 -5 H150", "M10 -5 H150e5", "channel.svg:5: wall `upper`: is 1.5e+04 m wide. Check the units"),
        ("M10 -5 H150", "M10 -5 H150e400", "channel.svg:5: wall `upper`: leads farther than 1e+09 units."),
        ("<title>", "<tittle>", "channel.svg:2: not XML"),
        ('class="path"', 'class="path" transform="spin(3)"', "channel.svg:8: transform `spin(3)` cannot be read."),
    ],
)
def test_what_a_drawing_lacks(tmp_path, old, new, expected):
    assert problems(replaced(tmp_path, old, new))[0].startswith(expected)


def test_a_path_does_not_begin_in_a_solid(tmp_path):
    block = feature("wall", [[[-5, -3], [5, -3], [5, 3], [-5, 3], [-5, -3]]], "Polygon", name="block")
    assert problems(geojson(tmp_path, block)) == [
        "channel.geojson: features[2]: path: begins at (0, 0) mm inside wall `block`. Begin it outside."
    ]


def test_names_are_suggested(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    with pytest.raises(SceneError, match=r"no environment 'two_bens'. Did you mean 'two_bends'\?"):
        read_environment("two_bens")
    svg(tmp_path)
    with pytest.raises(SceneError, match=r"no file chanel.svg. Did you mean 'channel.svg'\?"):
        read_environment("chanel.svg")
    with pytest.raises(SceneError, match=r"a.png: cannot be read. Expected .svg"):
        read_environment("a.png")
    assert read_environment("channel.svg").name == "channel"


def test_one_s_own_environments_come_first(tmp_path, monkeypatch):
    folder = tmp_path / "fmus/mine/environments"
    folder.mkdir(parents=True)
    geojson(folder, name="two_bends.geojson")
    monkeypatch.chdir(tmp_path)
    assert read_environment("two_bends").title == "Channel"


HOSTILE = {
    "laughs.svg": '<!DOCTYPE svg [<!ENTITY a "ha"><!ENTITY b "&a;&a;&a;">]>' + SVG.format("<text>&b;</text>"),
    "file.svg": '<!DOCTYPE svg [<!ENTITY a SYSTEM "file:///etc/passwd">]>' + SVG.format("<text>&a;</text>"),
    "deep.svg": SVG.format("<g>" * 200 + '<path class="wall" d="M0 9 H1"/>' + "</g>" * 200),
    "deeper.svg": SVG.format("<g>" * 50_000 + "</g>" * 50_000),
    "long.svg": SVG.format('<path class="wall" d="M0 20' + " l1 1 l1 -1" * 15_000 + '"/>'),
    "wide.svg": SVG.format('<path class="wall" d="M0 20' + " l.01 .01 l.01 -.01" * 8_000 + '"/>'),
    "curves.svg": SVG.format('<path class="wall" d="M0 20' + " c1e9 1e9 1e9 1e9 1 0" * 100 + '"/>'),
    "huge.svg": SVG.format("<!--" + "x" * 2_000_000 + "-->"),
    "overflow.svg": SVG.format('<path class="wall" d="M1e99 1e99 C1e999 2 3 4 5 6"/>'),
    "singular.svg": SVG.format('<path class="wall" transform="matrix(0 0 0 0 0 0)" d="M0 20 H40"/>'),
    "script.svg": SVG.format("<script>alert(1)</script>"),
    "deep.geojson": '{"type": "FeatureCollection", "units": "mm", "features": ' + "[" * 100_000 + "]" * 100_000 + "}",
    "points.geojson": json.dumps({"units": "mm", "features": [feature("wall", [[i, i % 2] for i in range(60_000)])]}),
    "numbers.geojson": '{"units": "mm", "features": [{"type": "Feature", "properties": {"class": "wall"}, "geometry":'
    ' {"type": "LineString", "coordinates": [[1' + "0" * 400 + ", 2], [3, 4]]}}]}",
    "many.geojson": json.dumps({"units": "mm", "features": [{}] * 100_000}),
    "control.geojson": json.dumps({"units": "mm", "features": [feature("\x1b[31m", [[1, 2], [3, 4]])]}),
    "binary.geojson": "\x00\x01\x02",
    "list.geojson": "[1, 2]",
    "empty.svg": "",
    "html.svg": "<html></html>",
}


@pytest.mark.slow_repetitions
@pytest.mark.parametrize("name", HOSTILE)
def test_hostile_files_end_in_a_message_and_soon(tmp_path, name):
    (tmp_path / name).write_text(HOSTILE[name])
    began = time.process_time()
    found = problems(tmp_path / name)
    assert time.process_time() - began < 5.0
    assert found[0].startswith(name)
    assert len(found) <= 51
    assert all(line.isprintable() and len(line) < 400 for line in found)
