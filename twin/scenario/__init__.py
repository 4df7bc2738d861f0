"""Scenario files: runs and acceptance criteria in YAML with units; every error gives file and line."""

from typing import TYPE_CHECKING

import lazy_loader

if TYPE_CHECKING:
    from twin.scenario import members, scenario_paths, ssp_reader
    from twin.scenario.check import check_events, event_problems
    from twin.scenario.event_specs import ConditionSpec, EventSpec, FaultSpec
    from twin.scenario.grouping import group, part
    from twin.scenario.keys.console_keys import (
        connected,
        controls_of,
        resolve_targets,
        resolve_warning,
        slider_range,
    )
    from twin.scenario.keys.dimensions import displayed
    from twin.scenario.keys.key_types import Keys, Moment, Period, Reference, Seed, Text, Time, Value, reference
    from twin.scenario.keys.metric_keys import first_unit
    from twin.scenario.keys.quantities import duration, nanoseconds, number, resolve, short
    from twin.scenario.keys.space_keys import space_problem
    from twin.scenario.keys.validation_messages import KeyFile, dotted, quoted, validate
    from twin.scenario.load import changed, lint, load_scenario, made_scenario, parse_scenario, with_events
    from twin.scenario.members import Backend, has_source, make
    from twin.scenario.resolution.variable_names import nearest
    from twin.scenario.resolution.variable_resolution import resolve_variables
    from twin.scenario.spec import (
        Case,
        ConnectionSpec,
        MemberSpec,
        RecordSpec,
        ScenarioSpec,
        member_seed,
    )
    from twin.scenario.ssp_writer import pack
    from twin.scenario.yaml_files.single_case_yaml import criteria_yaml, single_case_yaml
    from twin.scenario.yaml_files.yaml_node import Node
    from twin.scenario.yaml_files.yaml_reader import read
    from twin.scenario.yaml_files.yaml_writer import Dumper

__all__ = [
    "Backend",
    "Case",
    "ConditionSpec",
    "ConnectionSpec",
    "Dumper",
    "EventSpec",
    "FaultSpec",
    "KeyFile",
    "Keys",
    "MemberSpec",
    "Moment",
    "Node",
    "Period",
    "RecordSpec",
    "Reference",
    "ScenarioSpec",
    "Seed",
    "Text",
    "Time",
    "Value",
    "changed",
    "check_events",
    "connected",
    "controls_of",
    "criteria_yaml",
    "displayed",
    "dotted",
    "duration",
    "event_problems",
    "first_unit",
    "group",
    "has_source",
    "lint",
    "load_scenario",
    "made_scenario",
    "make",
    "member_seed",
    "members",
    "nanoseconds",
    "nearest",
    "number",
    "pack",
    "parse_scenario",
    "part",
    "quoted",
    "read",
    "reference",
    "resolve",
    "resolve_targets",
    "resolve_variables",
    "resolve_warning",
    "scenario_paths",
    "short",
    "single_case_yaml",
    "slider_range",
    "space_problem",
    "ssp_reader",
    "validate",
    "with_events",
]

__getattr__, _, _ = lazy_loader.attach(
    __name__,
    submodules=["members", "scenario_paths", "ssp_reader"],
    submod_attrs={
        "check": ["check_events", "event_problems"],
        "keys.console_keys": [
            "connected",
            "controls_of",
            "resolve_targets",
            "resolve_warning",
            "slider_range",
        ],
        "keys.dimensions": ["displayed"],
        "grouping": ["group", "part"],
        "load": ["changed", "lint", "load_scenario", "made_scenario", "parse_scenario", "with_events"],
        "members": ["Backend", "has_source", "make"],
        "keys.metric_keys": ["first_unit"],
        "keys.quantities": ["duration", "nanoseconds", "number", "resolve", "short"],
        "resolution.variable_resolution": ["resolve_variables"],
        "keys.key_types": ["Keys", "Moment", "Period", "Reference", "Seed", "Text", "Time", "Value", "reference"],
        "yaml_files.single_case_yaml": ["criteria_yaml", "single_case_yaml"],
        "event_specs": ["ConditionSpec", "EventSpec", "FaultSpec"],
        "spec": [
            "Case",
            "ConnectionSpec",
            "MemberSpec",
            "RecordSpec",
            "ScenarioSpec",
            "member_seed",
        ],
        "ssp_writer": ["pack"],
        "keys.space_keys": ["space_problem"],
        "keys.validation_messages": ["KeyFile", "dotted", "quoted", "validate"],
        "resolution.variable_names": ["nearest"],
        "yaml_files.yaml_node": ["Node"],
        "yaml_files.yaml_reader": ["read"],
        "yaml_files.yaml_writer": ["Dumper"],
    },
)
