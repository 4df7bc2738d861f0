"""docs/data/*_keys.csv list every key of a scenario, hardware, identify and validation file; python_names.csv the objects of `twin`."""

import ast
import csv
import inspect
import re
from collections import defaultdict
from dataclasses import fields
from pathlib import Path
from typing import Annotated

import pytest
import yaml
from pydantic import BaseModel, TypeAdapter

import twin
from hw_bridge.hardware import keys as hardware
from twin.coupling import Algorithm
from twin.identify.recordings import schema as identify
from twin.scenario.keys import schema as scenario
from twin.scenario.keys import space_schema as space
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
        "space": space.SpaceKeys,
        "space path": space.SpacePathKeys,
        "space line": space.SpaceLineKeys,
        "space point": space.SpacePointKeys,
        "space surface": space.SurfaceKeys,
        "space force": space.SpaceForceKeys,
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


@pytest.mark.parametrize(("name", "least"), [("hardware", 30), ("scenario", 15), ("validation", 3)])
def test_what_is_left_out_has_the_value_of_the_table(name, least):
    """Read as a user would write it: `5 ms`, `-35 mm, 35 mm`, `true`, `hold`. Other texts say where a value comes from."""
    compared = 0
    with (ROOT / "docs" / "data" / f"{name}_keys.csv").open(newline="") as file:
        for row in csv.DictReader(file):
            if (model := TABLES[name].get(row["section"])) is None:
                continue
            field = next(field for key, field in model.model_fields.items() if row["key"] == (field.alias or key))
            default = field.get_default(call_default_factory=True)
            text = row["if left out"].partition(":")[0]
            if text == "must be given" or default in (None, "", [], {}, ()) or isinstance(default, BaseModel):
                continue
            if not (isinstance(default, bool | str | list) or re.fullmatch(r"-?[\d.]+( \S+)?", text)):
                continue
            value = yaml.safe_load(f"[{text}]" if isinstance(default, list) else text)
            kind = Annotated[field.annotation, *field.metadata] if field.metadata else field.annotation
            written = TypeAdapter(kind).validate_python(value)
            is_number = isinstance(default, float)
            assert (pytest.approx(written, rel=1e-12) if is_number else written) == default, (row, default)
            compared += 1
    assert compared >= least


def parameters(function):
    """Names of the parameters of a function or class, without self and former names."""
    return [name for name in inspect.signature(function).parameters if name not in ("self", "form")]


@pytest.mark.slow
def test_the_table_of_python_names_is_that_of_the_package():
    classes = {"scenario": twin.Scenario, "run": twin.Run, "system": twin.System, "simulation": twin.Simulation}
    classes["study"] = twin.StudyResult
    with (ROOT / "docs" / "data" / "python_names.csv").open(newline="") as file:
        full_rows = list(csv.DictReader(file))
    rows = [row["name"] for row in full_rows]
    for row in full_rows:  # an example of each, with its name
        nodes = list(ast.walk(ast.parse(row["example"])))
        used = {node.attr for node in nodes if isinstance(node, ast.Attribute)}
        names = set(re.findall(r"\.(\w+)", re.split(r"[(\[]", row["name"])[0]))
        assert names & used or (not names and any(isinstance(node, ast.Subscript) for node in nodes)), row
    listed = defaultdict(set)
    for text in rows:
        if call := re.fullmatch(r"(\w+)\.(\w+)\((.*)\)", text):
            owner = twin if call[1] == "twin" else classes[call[1]]
            function = ast.parse(f"def function({call[3]}): ...").body[0].args
            arguments = [*function.args, function.vararg, *function.kwonlyargs, function.kwarg]
            expected = parameters(getattr(owner, call[2]))
            assert {one.arg for one in arguments if one} == set(expected), text
            listed[call[1]].add(call[2])
        elif attributes := re.fullmatch(r"(\w+)\.(\w+(?:, \.\w+)*)", text):
            listed[attributes[1]] |= set(attributes[2].split(", ."))
    for name, cls in classes.items():
        assert {one for one in vars(cls) if not one.startswith("_")} <= listed[name]
        missing = [one for one in listed[name] if not hasattr(cls, one) and f"self.{one}" not in inspect.getsource(cls)]
        assert not missing, name
