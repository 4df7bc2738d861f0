"""Scenario files: runs and acceptance criteria in YAML with units; every error gives file and line."""

from typing import TYPE_CHECKING

import lazy_loader

if TYPE_CHECKING:
    from twin.scenario import members, scenario_paths, ssp_reader
    from twin.scenario.check import check_against, event_problems
    from twin.scenario.console_keys import Control, connected, controls_of, slider_range
    from twin.scenario.dimensions import displayed
    from twin.scenario.grouping import group, part
    from twin.scenario.load import changed, lint, load_scenario, made_scenario, parse_scenario
    from twin.scenario.members import Backend, has_source, make
    from twin.scenario.quantities import duration, nanoseconds, number, resolve, short
    from twin.scenario.schema import Keys, Period, Reference, Seed, Text, Time, Value, reference
    from twin.scenario.single_case_yaml import single_case_yaml
    from twin.scenario.spec import (
        Case,
        ConnectionSpec,
        ControlSpec,
        EventSpec,
        FaultSpec,
        MemberSpec,
        RecordSpec,
        Scenario,
        member_seed,
    )
    from twin.scenario.ssp_writer import pack
    from twin.scenario.validation_messages import dotted, quoted, validate
    from twin.scenario.variable_names import nearest
    from twin.scenario.variable_resolution import resolve_variables
    from twin.scenario.yaml_node import Node
    from twin.scenario.yaml_reader import read
    from twin.scenario.yaml_writer import Dumper

__all__ = [
    "Backend",
    "Case",
    "ConnectionSpec",
    "Control",
    "ControlSpec",
    "Dumper",
    "EventSpec",
    "FaultSpec",
    "Keys",
    "MemberSpec",
    "Node",
    "Period",
    "RecordSpec",
    "Reference",
    "Scenario",
    "Seed",
    "Text",
    "Time",
    "Value",
    "changed",
    "check_against",
    "connected",
    "controls_of",
    "displayed",
    "dotted",
    "duration",
    "event_problems",
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
    "resolve_variables",
    "scenario_paths",
    "short",
    "single_case_yaml",
    "slider_range",
    "ssp_reader",
    "validate",
]

__getattr__, _, _ = lazy_loader.attach(
    __name__,
    submodules=["members", "scenario_paths", "ssp_reader"],
    submod_attrs={
        "check": ["check_against", "event_problems"],
        "console_keys": ["Control", "connected", "controls_of", "slider_range"],
        "dimensions": ["displayed"],
        "grouping": ["group", "part"],
        "load": ["changed", "lint", "load_scenario", "made_scenario", "parse_scenario"],
        "members": ["Backend", "has_source", "make"],
        "quantities": ["duration", "nanoseconds", "number", "resolve", "short"],
        "variable_resolution": ["resolve_variables"],
        "schema": ["Keys", "Period", "Reference", "Seed", "Text", "Time", "Value", "reference"],
        "single_case_yaml": ["single_case_yaml"],
        "spec": [
            "Case",
            "ConnectionSpec",
            "ControlSpec",
            "EventSpec",
            "FaultSpec",
            "MemberSpec",
            "RecordSpec",
            "Scenario",
            "member_seed",
        ],
        "ssp_writer": ["pack"],
        "validation_messages": ["dotted", "quoted", "validate"],
        "variable_names": ["nearest"],
        "yaml_node": ["Node"],
        "yaml_reader": ["read"],
        "yaml_writer": ["Dumper"],
    },
)
