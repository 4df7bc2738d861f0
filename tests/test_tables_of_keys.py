"""docs/data/*_keys.csv list every key of a scenario, hardware, identify and validation file."""

import csv
from collections import defaultdict
from dataclasses import fields
from pathlib import Path

import pytest

from hw_bridge.hardware import keys as hardware
from twin.coupling import Algorithm
from twin.identify.recordings import schema as identify
from twin.scenario.keys import schema as scenario
from twin.validation import schema as validation

ROOT = Path(__file__).parents[1]
TABLES = {
    "hardware": {
        "file": hardware.HardwareKeys,
        "drive": hardware.NodeKeys,
        "limits": hardware.LimitKeys,
        "heartbeat": hardware.HeartbeatKeys,
        "homing": hardware.HomingKeys,
        "follow": hardware.FollowKeys,
        "contact": hardware.ContactKeys,
        "shadow": hardware.ShadowKeys,
        "units": hardware.UnitKeys,
        "module": hardware.ModuleKeys,
        "late_cycle": hardware.LateCycleKeys,
    },
    "scenario": {
        "file": scenario.ScenarioKeys,
        "member": scenario.MemberKeys,
        "connection": scenario.ConnectionKeys,
        "event": scenario.EventKeys,
        "record": scenario.RecordKeys,
        "metric": scenario.MetricKeys,
        "expectation": scenario.ExpectKeys,
        "analysis": scenario.AnalysisKeys,
        "plot": scenario.PlotKeys,
        "curve": scenario.CurveKeys,
        "scene": scenario.SceneKeys,
        "console": scenario.ConsoleKeys,
        "control": scenario.ControlKeys,
        "target": scenario.TargetKeys,
        "warning": scenario.WarningKeys,
        "valid_until": scenario.ValidityKeys,
        "mutations": scenario.MutationKeys,
    },
    "identify": {
        "file": identify.IdentifyKeys,
        "data": identify.FileKeys,
        "input": identify.InputKeys,
        "output": identify.OutputKeys,
        "fit": identify.RangeKeys,
    },
    "validation": {
        "file": validation.ValidationKeys,
        "set": validation.SetKeys,
        "output": validation.MeasuredSignalKeys,
        "folds": validation.FoldKeys,
    },
}


def names(model):
    return {field.alias or name for name, field in model.model_fields.items()}


@pytest.mark.parametrize("name", TABLES)
def test_the_table_lists_every_key(name):
    listed = defaultdict(set)
    with (ROOT / "docs" / "data" / f"{name}_keys.csv").open(newline="") as file:
        for row in csv.DictReader(file):
            listed[row["section"]].add(row["key"])
    expected = {section: names(model) for section, model in TABLES[name].items()}
    if name == "scenario":
        expected["algorithm"] = {option.name for one in Algorithm for option in fields(one) if option.init}
    assert listed == expected
