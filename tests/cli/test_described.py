"""Environments, variables and components in words."""

from types import SimpleNamespace

import numpy as np
import pytest

from tests.cli.test_shown import rows
from tests.every_case import every_case
from twin.cli import describe, view
from twin.component import Component, input, local, output, parameter
from twin.errors import ScenarioError, SceneError
from twin.run import changes_of_base
from twin.scenario import lint, load_scenario
from twin.scene import Environment, Wall


def test_an_environment_in_words(tmp_path):
    path = np.array([[0.01, 0.02], [0.11, 0.02]])
    floor = Wall("floor", np.array([[0.0, 0.0], [0.2, 0.0]]), friction=0.2, thickness=0.002)
    pad = Wall("pad", np.array([[0.3, 0.1], [0.4, 0.1], [0.4, 0.2]]), closed=True, moves="heart", stiffness=260.0)
    room = Environment("room", "A room", (floor, pad), path[0], np.array([1.0, 0.0]), path)
    assert view.describe(room) == [
        "A room",
        "path: 100 mm from (10, 20) mm, clearance from center line to nearest wall 19 mm",
        "wall floor: 2 points, friction 0.2, thickness mm 2",
        "wall pad: 3 points, solid, moves with heart, stiffness N/m 260",
    ]
    with pytest.raises(SceneError, match=r"a\.txt: cannot be written\. Use \.svg, \.png\."):
        view.check_target(tmp_path / "a.txt", (".svg", ".png"))
    with pytest.raises(SceneError, match="there is no folder"):
        view.check_target(tmp_path / "none/a.svg", (".svg",))
    assert view.check_target(tmp_path / "a.svg", (".svg",)) == tmp_path / "a.svg"


def variable(**attributes):
    return SimpleNamespace(
        **{
            "name": "x",
            "shape": (),
            "type": "Float64",
            "start": None,
            "minimum": None,
            "maximum": None,
            "unit": "m",
            "display_unit": "",
        }
        | attributes
    )


@every_case(
    ("attributes", "name", "start", "bounds"),
    [
        ({}, "x [m]", "", ""),
        ({"display_unit": "mm", "start": 0.002, "minimum": 0.0}, "x", "2 mm", "at least 0 mm"),
        ({"start": np.zeros((2, 3)), "shape": (2, 3), "maximum": 1.5}, "x[2,3]", "0 m", "at most 1.5 m"),
        (
            {"start": np.array([1.0, 2.0]), "shape": (2,), "minimum": -1.0, "maximum": 1.0},
            "x[2]",
            "1, 2 m",
            "-1 m to 1 m",
        ),
        ({"start": np.arange(0.125, 9.0), "shape": (9,)}, "x[9]", "0.125 m, ... (--all)", ""),
        ({"unit": "mm", "start": 5.0, "minimum": 0.0, "maximum": 10.0}, "x", "5 mm", "0 mm to 10 mm"),
        ({"unit": "rpm", "start": 60.0}, "x", "60 rpm", ""),
        ({"unit": "degC", "display_unit": "K", "start": 20.0}, "x", "293.15 K", ""),
        (
            {"unit": "U/min {0.10472 s^-1*rad + 0.0}", "start": 60.0, "maximum": 90.0},
            "x",
            "60 U/min",
            "at most 90 U/min",
        ),
        ({"unit": "no unit", "display_unit": "mm", "start": 5.0}, "x", "5 no unit", ""),
        ({"type": "Boolean", "start": 1, "unit": ""}, "x", "true", ""),
        ({"type": "String", "start": "abc", "unit": ""}, "x", "abc", ""),
    ],
)
def test_a_variable_in_words(attributes, name, start, bounds):
    found = variable(**attributes)
    assert (describe.name_with_shape(found), describe.start(found), describe.bounds(found)) == (name, start, bounds)


def test_a_long_vector_is_shown_on_request():
    found = variable(start=np.arange(0.125, 9.0), shape=(9,))
    assert describe.start(found, everything=True).startswith("0.125, 1.125, 2.125")
    assert describe.start(found, everything=True).endswith("8.125 m")


@every_case(
    ("attributes", "text"),
    [
        ({"ordered": ("A", "B", "C"), "descending": True}, "A > B > C"),
        ({"ordered": ("A", "B"), "descending": False}, "A < B"),
        ({"at_least": 1.0, "at_most": 2.0}, "1 N to 2 N"),
        ({"at_least": 0.0}, "at least 0 N"),
        ({"at_most": 2.0}, "at most 2 N"),
        ({"ends": "completed"}, "completed"),
    ],
)
def test_limits_in_words(attributes, text):
    item = {"ordered": (), "at_least": None, "at_most": None, "ends": "", "shown": lambda limit: f"{limit:g} N"}
    assert describe.limits(SimpleNamespace(**item | attributes)) == text


class Valve(Component):
    """Valve of a line.

    Its source.
    """

    u = input("m", "opening", start=0.5, minimum=0.0, maximum=1.0, display_unit="mm")
    y = output("N", "force")
    k = parameter(2.0, "N/m", "stiffness", source="measured")
    z = local(0.0, "m", "memory")

    def step(self, t, h):
        self.y = self.k * self.u


def test_a_component_in_words(capsys):
    """What cannot be set or connected is shown on request; a text selects variables."""
    describe.show_component(Valve, everything=False, text="")
    shown = [
        ["Valve of a line."],
        ["Its source."],
        ["input", "start", "bounds", "description"],
        ["u", "500 mm", "0 mm to 1000 mm", "opening"],
        ["output", "start", "description"],
        ["y", "0 N", "force"],
        ["parameter", "start", "description"],
        ["k", "2 N/m", "stiffness"],
        ["Sources of the values, states and local variables: --all"],
    ]
    assert rows(capsys.readouterr().out) == shown
    describe.show_component(Valve, everything=True, text="")
    every = rows(capsys.readouterr().out)
    assert every[-1] == ["z", "0 m", "memory"]
    assert ["k", "2 N/m", "stiffness (from: measured)"] in every
    describe.show_component(Valve, everything=False, text="k")
    assert rows(capsys.readouterr().out) == shown[:2] + shown[-3:]
    assert describe.kind(Valve) == "component of the communication step"
    assert describe.kind(type("Slow", (Valve,), {"__doc__": "x", "period": 5e-3})) == "sampled component, 5 ms"


OWN = """extends: heart_wall_force
members: {heart: {parameters: {rate: 90 /min}}}
variants: {soft: {members: {wall: {parameters: {wall_modulus: 50 kPa}}}}}
"""


def test_a_scenario_of_ones_own_begins_with_its_changes(tmp_path):
    """Of the scenario that it extends; the value before only if that file sets one."""
    file = tmp_path / "mine.yaml"
    file.write_text(OWN)
    changes = changes_of_base(load_scenario(file))
    assert changes == "changed from heart_wall_force: heart.rate 90 /min; soft: wall.wall_modulus 50 kPa"
    second = tmp_path / "second.yaml"
    second.write_text("extends: mine\nmembers: {heart: {parameters: {rate: 1 Hz}}}\n")
    assert changes_of_base(load_scenario(second)) == "changed from mine: heart.rate 1.5 -> 1 Hz"


def test_a_short_stop_time_of_an_option_runs_and_one_of_a_file_does_not(tmp_path):
    """An impossible one is the only error; an option for a variant that is not run says so."""
    assert load_scenario("heart_wall_force", ["stop_time=5 s"]).stop_ns == 5 * 10**9
    file = tmp_path / "short.yaml"
    file.write_text("extends: heart_wall_force\nstop_time: 5 s\n")
    with pytest.raises(ScenarioError, match="outside the run"):
        load_scenario(file)
    with pytest.raises(ScenarioError) as refused:
        load_scenario("heart_wall_force", ["stop_time=-1 s"])
    assert refused.value.problems == ["--set stop_time=-1 s: stop_time -1 s is not after start_time 0 s."]
    option = "variants.PI.controller.proportional=10 mm/(s*N)"
    notes = load_scenario("heart_wall_force", [option]).replaced_values({"PI+FF"})
    assert notes == [f"--set {option}: PI is not run: no effect."]


def test_words_that_are_meant(tmp_path):
    """Keys of other tools have a counterpart here; a missing FMU is one problem."""
    file = tmp_path / "bad.yaml"
    file.write_text(
        "extends: heart_wall_force\nvariants: {soft: {description: x}}\nexpect:\n  - {metric: force_error_std, min: 2 N}\n"
    )
    problems = lint(file)[1]
    assert any("`description`. Did you mean `title`?" in problem for problem in problems)
    assert any("`min`. Did you mean `at_least`?" in problem for problem in problems)
    file.write_text("extends: heart_wall_force\nmembers: {other: {component: none.fmu}}\n")
    assert len(lint(file)[1]) == 1
