"""What was found: unknowns and their places, verdicts, remarks, the parameter set, and the text of its file."""

from dataclasses import replace

import numpy as np
import pytest
import yaml

from tests.every_case import every_case
from tests.study.identified import COVARIANCE, DRAG, OFFSET, PLAY, POSITIONS, known, output, problem, recording, result
from twin.identify import Fit
from twin.identify.result import command_line, pairs, verdicts
from twin.identify.search import Start


@every_case(
    ("unknown", "position", "value", "slope"),
    [
        (PLAY, 0.0, 0.0, 2e-3),
        (PLAY, 0.25, 0.5e-3, 2e-3),
        (OFFSET, 0.75, 5e-3, 0.02),
        (DRAG, 0.0, 0.1, 0.1 * np.log(100)),
        (DRAG, 0.5, 1.0, np.log(100)),
        (DRAG, 1.0, 10.0, 10 * np.log(100)),
    ],
)
def test_a_place_between_the_bounds_is_a_value(unknown, position, value, slope):
    assert unknown.value(position) == pytest.approx(value)
    assert unknown.position(value) == pytest.approx(position)
    assert unknown.slope(position) == pytest.approx(slope)


@every_case(
    ("position", "bound"), [(0.0, "lower"), (9e-4, "lower"), (1e-3, ""), (0.999, ""), (0.9991, "upper"), (1.0, "upper")]
)
def test_a_place_at_a_bound(position, bound):
    assert PLAY.at_bound(position) == bound


def test_values_are_shown_in_their_display_unit():
    assert [PLAY.shown(x) for x in (1.234567e-3, float("nan"), float("inf"))] == [
        "1.235 mm",
        "unbounded",
        "unbounded",
    ]
    assert DRAG.shown(2.5) == "2.5 N"
    assert replace(PLAY, unit="degC", display_unit="K").shown(26.85) == "300 K"
    assert (PLAY.path, OFFSET.path) == ("sheath.play", ".")


def test_a_problem_of_two_recordings(tmp_path):
    slow = recording("slow", output(), left_out=("a", "b", "c"), files=("tip.csv", "a.csv"), own=("sheath.drag",))
    fast = recording(
        "fast", output("q", (1, 2), "fast"), output("r", (3,), ""), left_out=("c", "a"), model="b", members=("motor",)
    )
    alone = replace(PLAY, name="play of slow", recording="slow")
    motor = replace(PLAY, member="motor", recording="fast")
    both = problem(tmp_path, slow, fast, unknowns=(PLAY, DRAG, OFFSET, alone, motor))
    assert [one.label for one in both.outputs] == ["tip [mm] in slow", "q in fast", "r"]
    assert [one.shown for one in both.files] == ["tip.csv", "a.csv"]
    assert both.model == "sheath and others, 2 recordings"
    assert both.left_out == ("a", "c")
    assert both.of(slow) == (PLAY, alone)  # drag is looked for in slow alone, by another unknown
    assert both.of(fast) == (motor,)
    assert both.count == 5 + 2 + 1
    assert both.title == "A sheath"
    assert both.values(np.array([0.25, 0.5, 0.75, 0.5, 1.0])) == {
        "sheath.play": pytest.approx(2e-3),  # the last of this name
        "sheath.drag": pytest.approx(1.0),
        "offset of tip in slow": pytest.approx(5e-3),
        "play of slow": pytest.approx(1e-3),
    }
    both.keys.title = ""
    assert both.title == "Identification of sheath and others, 2 recordings"
    assert problem(tmp_path, slow, replace(fast, model="sheath")).model == "sheath, 2 recordings"
    assert problem(tmp_path, slow).model == "sheath"


def texts(tmp_path, covariance=COVARIANCE, positions=POSITIONS, **fields):
    return verdicts(problem(tmp_path), Fit(np.array(positions), [1.0]), known(covariance, positions, **fields))


def correlated(r, deviation=0.1):
    return deviation**2 * np.array([[1.0, r, 0.0], [r, 1.0, 0.0], [0.0, 0.0, 1.0]])


ONE = "not identifiable beside {}: the data do not tell one combination of them"
OPEN = "not identifiable: flat profile, open up to its {} bound"
WIDE = "not identifiable: its interval is wider than its bounds"
NAN = float("nan")


@pytest.mark.parametrize(
    ("fields", "expected"),
    [
        ({}, [[], [], []]),
        ({"effect": [True, False, True]}, [[], ["not identifiable: it changes nothing of what is compared"], []]),
        (
            {"positions": [0.0, 0.5, 1.0]},
            [
                [f"at its {bound} bound: move the bound if the value makes no sense there"] if bound else []
                for bound in ("lower", "", "upper")
            ],
        ),
        ({"half": [0.5, 0.51, 0.1]}, [[], [WIDE], []]),
        ({"half": [0.5, 0.51, 0.1], "method": "bootstrap"}, [[], [WIDE], []]),
        ({"half": [0.5, 0.51, 0.1], "method": "profile"}, [[], [], []]),
        (
            {"half": [NAN, 0.1, 0.1], "method": "profile"},
            [["not identifiable: flat profile, open up to its lower and its upper bound"], [], []],
        ),
        ({"half": [NAN, 0.1, 0.1]}, [[], [], []]),
        (
            {"covariance": correlated(-0.96)},
            [
                ["cannot be separated from sheath.drag: correlation -0.9600"],
                ["cannot be separated from sheath.play: correlation -0.9600"],
                [],
            ],
        ),
        ({"covariance": correlated(0.949)}, [[], [], []]),
        ({"covariance": correlated(0.96, 0.02)}, [[], [], []]),  # intervals of 0.08: narrow, so the values are known
        (
            {"covariance": correlated(0.96, 0.02), "half": [0.0501, 0.0499, 0.1]},
            [["cannot be separated from sheath.drag: correlation 0.9600"], [], []],
        ),
        # a direction of two unknowns of which the data tell nothing; parts below 0.3 do not belong to it
        (
            {"singular": [0.1, 0.51], "directions": [[0, 0.6, 0.8], [0.8, 0.29, -0.5]]},
            [[ONE.format("offset of tip in slow")], [], [ONE.format("sheath.play")]],
        ),
        (
            {"singular": [0.6], "directions": [[0.6, 0.6, 0.5]]},
            [
                [ONE.format("sheath.drag and offset of tip in slow")],
                [ONE.format("sheath.play and offset of tip in slow")],
                [ONE.format("sheath.play and sheath.drag")],
            ],
        ),
        ({"singular": [0.5], "directions": [[0.6, 0.6, 0.5]]}, [[], [], []]),
        ({"singular": [0.9], "directions": [[1.0, 0.2, 0.1]]}, [[], [], []]),
        # what a correlation says is not said twice
        (
            {"covariance": correlated(0.99), "singular": [0.9], "directions": [[0.7, 0.7, 0.0]]},
            [
                ["cannot be separated from sheath.drag: correlation 0.9900"],
                ["cannot be separated from sheath.play: correlation 0.9900"],
                [],
            ],
        ),
    ],
)
def test_verdicts(tmp_path, fields, expected):
    assert texts(tmp_path, **fields) == expected


def test_a_profile_that_is_open_at_one_end(tmp_path):
    knowledge = known(COVARIANCE, POSITIONS, method="profile")
    knowledge.low[0] = knowledge.high[1] = np.nan
    own = verdicts(problem(tmp_path), Fit(np.array(POSITIONS), [1.0]), knowledge)
    assert own == [[OPEN.format("lower")], [OPEN.format("upper")], []]


@pytest.mark.parametrize(
    ("r", "half", "count"),
    [(-0.96, 0.0499, 1), (0.95, 0.0499, 0), (0.96, 0.0499, 1), (0.96, 0.0501, 0), (0.2, 0.0499, 0)],
)
def test_unknowns_that_are_known_together(tmp_path, r, half, count):
    found = pairs(problem(tmp_path), known(correlated(r), POSITIONS, half=[half, 0.04, 0.01]))
    assert (
        found
        == [f"sheath.drag and sheath.play cannot be separated, correlation {r:.4f}. Take both from one file."] * count
    )


def test_values_intervals_and_covariance_have_units(tmp_path):
    own = result(tmp_path)
    assert own.values == pytest.approx([0.5e-3, 1.0, 5e-3])
    slopes = np.array([2e-3, np.log(100), 0.02])
    assert own.slopes == pytest.approx(slopes)
    assert own.covariance == pytest.approx(np.array(COVARIANCE) * np.outer(slopes, slopes))
    assert own.intervals[0] == pytest.approx((0.42e-3, 0.58e-3))  # 0.25 +- 2 * 0.02 of 2 mm
    assert own.intervals[1] == pytest.approx((100**-0.02, 100**0.02))
    assert own.interval_text(0) == "0.42 mm to 0.58 mm"
    assert own.passed
    assert not replace(own, fit=replace(own.fit, interrupted=True)).passed
    assert not result(tmp_path, knowledge=known(COVARIANCE, POSITIONS, effect=[True, True, False])).passed


@pytest.mark.parametrize(
    ("low", "high", "text"),
    [
        (0.1, 0.9, "0.2 mm to 1.8 mm"),
        (-0.1, 1.1, "wider than its bounds"),
        (0.0, 1.1, "0 mm to 2.2 mm"),
        (-0.1, 1.0, "-0.2 mm to 2 mm"),
        (NAN, 0.9, "open to 1.8 mm"),
        (0.1, NAN, "0.2 mm to unbounded"),
        (NAN, NAN, "not known"),
    ],
)
def test_an_interval_in_words(tmp_path, low, high, text):
    knowledge = known(COVARIANCE, POSITIONS)
    knowledge.low[0], knowledge.high[0] = low, high
    assert result(tmp_path, knowledge=knowledge).interval_text(0) == text


def remarks(tmp_path, *, fit=None, noise=None, notes=(), starts=(1.0, 1.005), **fields):
    of = problem(tmp_path, recording("slow", output(noise=noise), output(noise=0.1)), notes=notes)
    of_fit = Fit(
        np.array(POSITIONS), [0.1, 0.1], [Start(np.zeros(3), np.zeros(3), cost) for cost in starts], **(fit or {})
    )
    return result(tmp_path, of=of, fit=of_fit, knowledge=known(COVARIANCE, POSITIONS, **fields)).notes()


@pytest.mark.parametrize(
    ("case", "expected"),
    [
        ({}, []),
        ({"notes": ("a note",)}, ["a note"]),
        ({"fit": {"interrupted": True}}, ["interrupted: the best so far, which need not be the best there is."]),
        ({"starts": (1.0, 1.02)}, ["only one of 2 starts came to this. Try more: --starts 8."]),
        ({"starts": (1.0,)}, []),
        ({"starts": (1.0, 1.0, 9.0)}, []),
        (
            {"fit": {"derivatives": "differences, since a is odd"}},
            ["the Jacobian is made of differences, since a is odd."],
        ),
        ({"fit": {"failures": 3, "simulations": 40}}, ["the model failed in 3 of 40 simulations. Narrow the bounds."]),
        ({"inflation": 2.0}, []),
        (
            {"inflation": 9.0},
            [
                "residuals follow each other: the model does not explain all that was measured. The intervals are 3 times as wide for it, which is a guess."
            ],
        ),
        ({"residual": 1.3}, []),
        ({"noise": 0.1, "residual": 1.2}, []),
        (
            {"noise": 0.1, "residual": 1.3},
            ["residuals are 1.3 times the stated noise: the model or the noise is wrong."],
        ),
    ],
)
def test_remarks(tmp_path, case, expected):
    assert remarks(tmp_path, **case) == expected


def test_a_rough_model_and_verdicts_are_noted(tmp_path):
    verdict, rough = remarks(tmp_path, rough=np.array([True, False, True]), effect=[True, False, True])
    assert verdict == "sheath.drag: not identifiable: it changes nothing of what is compared."
    assert rough.startswith("sheath.play and offset of tip in slow: small changes change the model at random")


def test_a_parameter_set_has_what_members_have_in_all_recordings(tmp_path):
    """Neither offsets, nor what is looked for in one recording, nor what changes nothing; FMUs by relative paths."""
    alone = replace(DRAG, name="drag in slow", variable="mass", recording="slow")
    dead = replace(DRAG, name="sheath.lag", variable="lag")
    motor = replace(DRAG, name="motor.drag", member="motor")
    of = problem(
        tmp_path,
        unknowns=(PLAY, OFFSET, alone, dead, motor),
        components={"sheath": "sheath", "motor": str(tmp_path / "m.fmu")},
    )
    knowledge = known(np.eye(5), [0.25, 0.5, 0.5, 0.5, 1.0], effect=[True, True, True, False, True])
    own = result(tmp_path, of=of, fit=Fit(np.array([0.25, 0.5, 0.5, 0.5, 1.0]), [1.0, 1.0]), knowledge=knowledge)
    assert own.parameter_set(tmp_path / "here") == {
        "sheath": {"play": 0.5e-3},
        "../m.fmu": {"drag": pytest.approx(10.0)},
    }


def test_the_file_of_a_result(tmp_path):
    knowledge = known(COVARIANCE, POSITIONS, effect=[True, True, False], method="profile")
    knowledge.high[0] = np.nan
    own = result(tmp_path, knowledge=knowledge)
    nothing = "not identifiable: it changes nothing of what is compared"
    text = own.text(tmp_path)
    assert text.splitlines()[:5] == [
        "# A sheath: twin identify a.yaml, 2026-03-04",
        f"# sheath.play: 0.5 mm, 0.9 confidence: 0.42 mm to unbounded (profile); {OPEN.format('upper')}",
        "# sheath.drag: 1 N, 0.9 confidence: 0.912 N to 1.096 N (profile)",
        f"# offset of tip in slow: 5 mm, 0.9 confidence: 3.8 mm to 6.2 mm (profile); {nothing}",
        "sheath: {play: 0.0005, drag: 1.0}",
    ]
    tree = yaml.safe_load(text)
    about = tree.pop("identified")
    assert tree == {"sheath": {"play": 0.5e-3, "drag": 1.0}}
    versions = about.pop("versions")
    assert {"scipy", "numpy"} <= versions.keys()
    assert [about[key] for key in ("unknowns", "units", "bounds", "confidence", "method", "model")] == [
        ["sheath.play", "sheath.drag", "offset of tip in slow"],
        ["m", "N", "m"],
        [[0.0, 2e-3], [0.1, 10.0], [-0.01, 0.01]],
        0.9,
        "profile",
        "sheath, 2 recordings",
    ]
    assert about["values"] == pytest.approx([0.5e-3, 1.0, 5e-3])
    assert np.array(about["covariance"]) == pytest.approx(own.covariance)
    assert about["intervals"][0] == [pytest.approx(0.42e-3), None]
    assert about["intervals"][1] == pytest.approx([100**-0.02, 100**0.02])
    assert about["remarks"] == [f"sheath.play: {OPEN.format('upper')}", f"offset of tip in slow: {nothing}"]
    assert about["residuals"] == [
        {"column": "tip [mm] in slow", "rms": pytest.approx(1e-3 * np.sqrt(0.03)), "unit": "m", "noise": 1e-4},
        {"column": "tip [mm] in fast", "rms": pytest.approx(1e-3 * np.sqrt(0.02 / 3)), "unit": "m", "noise": 2e-4},
    ]
    assert about["files"] == [{"file": "tip.csv", "sha256": "sum of tip.csv"}]
    assert (about["command"], about["started"], about["interrupted"]) == (
        "twin identify a.yaml",
        "2026-03-04T05:06:07+00:00",
        False,
    )
    none = result(tmp_path, knowledge=known(COVARIANCE, POSITIONS, effect=[False] * 3)).text(tmp_path)
    assert none.splitlines()[4].startswith("identified:")


def test_a_command_line_can_be_pasted():
    assert command_line(["my file.yaml", "--starts", "2"]) == "twin identify 'my file.yaml' --starts 2"
