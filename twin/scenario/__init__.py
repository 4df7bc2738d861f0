"""Scenario files: what is run, what is expected, in YAML with units; every error gives file and line."""

from twin.scenario import members
from twin.scenario.check import check_against, event_problems
from twin.scenario.dimensions import displayed
from twin.scenario.grouping import group, part
from twin.scenario.load import changed, examine, load_scenario, made_scenario, parse_scenario
from twin.scenario.lookup import look_up
from twin.scenario.members import Form, has_source, make
from twin.scenario.merge import nearest
from twin.scenario.message import dotted, quoted
from twin.scenario.model import Keys, Period, Reference, Text, Time, reference
from twin.scenario.spec import Case, ConnectionSpec, EventSpec, FaultSpec, MemberSpec, RecordSpec, Scenario, member_seed
from twin.scenario.tree import Node, read
from twin.scenario.value import duration, number, resolve, short

__all__ = [
    "Case",
    "ConnectionSpec",
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
    "Text",
    "Time",
    "changed",
    "check_against",
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
    "nearest",
    "number",
    "parse_scenario",
    "part",
    "quoted",
    "read",
    "reference",
    "resolve",
    "short",
]
