"""A scenario with something of everything, and how its tests change and check it."""

from typing import Any

import numpy as np
import pytest

from twin.coupling import MemberVariable
from twin.errors import ScenarioError
from twin.scenario import parse_scenario
from twin.scenario.check import check_against

BASE = """\
title: Contact force
source: paper A, Fig. 8
stop_time: 10 s
seeds: [1, 2]
members:
  servo: {component: servomotor, parameters: {mass: 0.65 kg, limit: 5 N}}
  sensor: {component: force_sensor}
  controller: {component: control, parameters: {setpoint: 200 mN, gain: 3}}
connections:
  - controller.command -> servo.command
  - {from: sensor.force, to: [controller.force, servo.load]}
variants:
  PI: {members: {controller: {component: pi_control, parameters: {setpoint: 0.2 N}}}}
  PI+FF: {connections: [{from: null, to: servo.load}], events: [{at: 2 s, set: {controller.gain: 4}}]}
events:
  - {at: 6 s, override: {sensor.force: 0 N}}
  - {at: 7 s, release: sensor.force}
  - {at: 5 s, set: {controller.setpoint: 0.3 N}}
record: [sensor.force, servo.*]
metrics:
  error: {signal: sensor.force - 0.2, reduce: std, from: 4 s, unit: mN, reference: {PI: 36.2 mN, PI+FF: 0.0238 N}, tolerance: 20 %}
expect:
  - {metric: error, ordered: [PI, PI+FF]}
  - {signal: sensor.force, within: [0.1 N, 0.4 N], from: 4 s}
plots:
  - {title: Force, signals: [sensor.force], per: variant, unit: N, band: [100 mN, 0.4 N], lines: 0.2 N}
"""


def problems(text: str, *overrides: str) -> list[str]:
    with pytest.raises(ScenarioError) as caught:
        parse_scenario(text, "s.yaml", overrides)
    assert all("\n" not in line and len(line) < 400 for line in caught.value.problems)
    return caught.value.problems


def variable(name: str, causality: str = "parameter", unit: str = "", **options: Any) -> MemberVariable:
    options = {"variability": "tunable", "type": "Float64", "dtype": np.dtype(np.float64), "start": 0.0} | options
    return MemberVariable(name, causality, unit=unit, **options)


def catalog() -> dict[str, dict[str, MemberVariable]]:
    integer = {"type": "Int64", "dtype": np.dtype(np.int64)}
    members = {
        "servo": [
            variable("mass", unit="kg", variability="fixed"),
            variable("limit", unit="N"),
            variable("load", "input", "N"),
            variable("command", "input", "m"),
            variable("position", "output", "m"),
            variable("r", unit="m", shape=(3,), start=np.ones(3)),
            variable("on", type="Boolean", dtype=np.dtype(bool)),
            variable("count", **integer),
            variable("x", "local", "m", shape=(2,)),
            variable("log", "output", type="String", dtype=np.dtype(object)),
        ],
        "sensor": [variable("force", "output", "N"), variable("seed", **integer)],
        "controller": [
            variable("setpoint", unit="N"),
            variable("gain"),
            variable("force", "input", "N"),
            variable("command", "output", "m"),
        ],
    }
    return {name: {one.name: one for one in variables} for name, variables in members.items()}


def changed(old: str, new: str) -> str:
    assert old in BASE
    return BASE.replace(old, new, 1)


def against(text: str) -> list[str]:
    scenario = parse_scenario(text, "s.yaml")
    return check_against(scenario, {case.variant: catalog() for case in scenario.variants}, {})
