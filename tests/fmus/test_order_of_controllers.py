"""Where the order of the three controllers holds: up to 1.5 times the friction of the sheath, not at three times."""

import itertools
from pathlib import Path

import numpy as np
import pytest
from fmus.sheath.model import Sheath

from twin.run import RunOptions, run_scenario
from twin.scenario import Backend, parse_scenario

SCENARIOS = Path(__file__).parents[2] / "scenarios"
NAMES = ["PI", "PI+FF", "PI+FF+BW"]


@pytest.mark.slow
@pytest.mark.parametrize(
    ("factor", "holds"), [(0.5, True), pytest.param(1.5, True, marks=pytest.mark.slow), (3.0, False)]
)
def test_the_order_depends_on_friction(factor, holds, tmp_path, build):
    friction = ", ".join(f"{factor * one} N" for one in Sheath.friction.start)
    text = f"extends: heart_wall_replay.yaml\nmembers: {{sheath: {{parameters: {{friction: [{friction}]}}}}}}\nexpect: null\n"
    scenario = parse_scenario(text, SCENARIOS / "friction.yaml")
    outcome = run_scenario(
        scenario,
        RunOptions(backend=Backend.compiled, variants=NAMES, seeds=[1], root=tmp_path, build=build, report=False),
    )
    deviations = [np.std(outcome.tables[name, 1].values["sensor.measured_force"][2400:]) for name in NAMES]
    margins = [1.0 - after / before for before, after in itertools.pairwise(deviations)]
    assert bool(min(margins) > 0.05) is holds
