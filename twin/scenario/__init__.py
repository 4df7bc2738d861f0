"""Scenario files: what is run, what is expected, in YAML with units; every error gives file and line."""

from typing import TYPE_CHECKING

from twin import late

if TYPE_CHECKING:
    from twin.scenario import members, package, shipped
    from twin.scenario.alone import alone
    from twin.scenario.check import check_against, event_problems
    from twin.scenario.console import Control, connected, controls_of
    from twin.scenario.dimensions import displayed
    from twin.scenario.grouping import group, part
    from twin.scenario.load import changed, examine, load_scenario, made_scenario, parse_scenario
    from twin.scenario.lookup import look_up
    from twin.scenario.members import Form, has_source, make
    from twin.scenario.message import dotted, quoted, validate
    from twin.scenario.model import Keys, Period, Reference, Seed, Text, Time, Value, reference
    from twin.scenario.names import nearest
    from twin.scenario.node import Node
    from twin.scenario.packing import pack
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
    from twin.scenario.tree import read
    from twin.scenario.value import duration, nanoseconds, number, resolve, short
    from twin.scenario.written import Dumper

__all__ = [
    "Case",
    "ConnectionSpec",
    "Control",
    "ControlSpec",
    "Dumper",
    "EventSpec",
    "FaultSpec",
    "Form",
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
    "alone",
    "changed",
    "check_against",
    "connected",
    "controls_of",
    "displayed",
    "dotted",
    "duration",
    "event_problems",
    "examine",
    "group",
    "has_source",
    "load_scenario",
    "look_up",
    "made_scenario",
    "make",
    "member_seed",
    "members",
    "nanoseconds",
    "nearest",
    "number",
    "pack",
    "package",
    "parse_scenario",
    "part",
    "quoted",
    "read",
    "reference",
    "resolve",
    "shipped",
    "short",
    "validate",
]

__getattr__ = late.names(
    __name__,
    {
        "Case": "spec",
        "ConnectionSpec": "spec",
        "Control": "console",
        "ControlSpec": "spec",
        "Dumper": "written",
        "EventSpec": "spec",
        "FaultSpec": "spec",
        "Form": "members",
        "Keys": "model",
        "MemberSpec": "spec",
        "Node": "node",
        "Period": "model",
        "RecordSpec": "spec",
        "Reference": "model",
        "Scenario": "spec",
        "Seed": "model",
        "Text": "model",
        "Time": "model",
        "Value": "model",
        "alone": "alone",
        "changed": "load",
        "check_against": "check",
        "connected": "console",
        "controls_of": "console",
        "displayed": "dimensions",
        "dotted": "message",
        "duration": "value",
        "nanoseconds": "value",
        "event_problems": "check",
        "examine": "load",
        "group": "grouping",
        "has_source": "members",
        "load_scenario": "load",
        "look_up": "lookup",
        "made_scenario": "load",
        "make": "members",
        "member_seed": "spec",
        "members": "",
        "nearest": "names",
        "number": "value",
        "pack": "packing",
        "package": "",
        "parse_scenario": "load",
        "part": "grouping",
        "quoted": "message",
        "read": "tree",
        "reference": "model",
        "resolve": "value",
        "shipped": "",
        "short": "value",
        "validate": "message",
    },
)
