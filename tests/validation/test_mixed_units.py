"""Outputs of a quantity whose variables have different units, and units with an offset."""

import numpy as np
import pytest

from twin.component import Component, input, output, parameter
from twin.errors import ScenarioError
from twin.validation import fit_and_freeze, frozen_path, frozen_text, load, page, validate

FILE = """
title: Units
sets:
  all:
    files: "*.csv"
    train: train_*.csv
    columns: {u: {unit: mm}, x: {unit: mm}, y: {unit: mm}, T: {unit: degC}}
    component: tests.validation.test_mixed_units:Plane
    step: 10 ms
    inputs: {u: u}
    outputs: {x: {signal: x, unit: mm}, y: {signal: y, unit: mm}, T: {signal: temperature, unit: degC}}
    distance: {tip: [x, Y]}
"""


class Plane(Component):
    """A tip whose coordinates are in m and in mm, and a temperature in K."""

    period = 10e-3

    u = input("m", "in")
    x = output("m", "along u")
    y = output("mm", "against u")
    temperature = output("K", "temperature")
    rest = parameter(300.0, "K", "temperature at u = 0", source="chosen")

    def initialize(self):
        self.x = self.u
        self.y = -1000.0 * self.u
        self.temperature = self.rest + 1000.0 * self.u

    def step(self, t, h):
        self.x = self.u
        self.y = -1000.0 * self.u
        self.temperature = self.rest + 1000.0 * self.u


def opened(tmp_path, build, other):
    (tmp_path / "units.yaml").write_text(FILE.replace("Y]", f"{other}]"))
    return load(tmp_path / "units.yaml", tmp_path, build)


def test_a_distance_of_a_coordinate_in_m_and_one_in_mm(tmp_path, build, monkeypatch):
    """3 and 4 mm beside the model is 5 mm; 26.85 degC at rest is drawn as such."""
    u = np.sin(np.arange(100.0))
    for name, beside in (("train_1", 0.0), ("train_2", 0.0), ("off", 1.0)):
        table = np.stack([0.01 * np.arange(100), u, u + 3 * beside, -u + 4 * beside, 26.85 + u], 1)
        np.savetxt(tmp_path / f"{name}.csv", table, "%.12g", ",", header="time,u,x,y,T", comments="")
    own = opened(tmp_path, build, "y")
    frozen_path(own.path).write_text(frozen_text("units", fit_and_freeze(own)))
    [prediction] = validate(own, ["off.csv"])
    rows = {row["quantity"]: row for row in prediction.rows}
    assert rows["tip"]["rmse"] == pytest.approx(5.0)
    assert rows["tip"]["area"] == pytest.approx(5.0)
    assert rows["T"]["rmse"] == pytest.approx(0.0, abs=1e-9)
    monkeypatch.setattr(page.figure_files, "figure_to_svg", lambda figure: figure.axes)
    axes = page.svg(prediction, prediction.set.quantities[0], rows["T"], np.ones(100, bool))
    assert axes[0].lines[0].get_ydata()[0] == pytest.approx(26.85)


def test_a_distance_of_a_length_and_a_temperature_is_refused(tmp_path, build):
    with pytest.raises(ScenarioError, match=r"distance\.tip: T: K does not convert to m\."):
        opened(tmp_path, build, "T").open_set("all")
