"""Scenario files: what is run, what is expected, in YAML with units; every error gives file and line."""

from twin.scenario import members
from twin.scenario.check import check_against
from twin.scenario.grouping import group
from twin.scenario.load import load_scenario, parse_scenario
from twin.scenario.lookup import look_up
from twin.scenario.members import Form, make
from twin.scenario.merge import nearest
from twin.scenario.message import dotted, quoted
from twin.scenario.model import Keys, Period, Reference, Text, Time, reference
from twin.scenario.spec import Case, ConnectionSpec, EventSpec, FaultSpec, MemberSpec, RecordSpec, Scenario, member_seed
from twin.scenario.tree import Node, read
from twin.scenario.value import duration, number, short

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
    "check_against",
    "dotted",
    "duration",
    "group",
    "load_scenario",
    "look_up",
    "make",
    "member_seed",
    "members",
    "nearest",
    "number",
    "parse_scenario",
    "quoted",
    "read",
    "reference",
    "short",
]
