"""Scenario files: what is run, what is expected, in YAML with units; every error gives file and line."""

from twin.scenario.check import check_against
from twin.scenario.load import load_scenario, parse_scenario
from twin.scenario.spec import (
    Case,
    ConnectionSpec,
    EventSpec,
    FaultSpec,
    MemberSpec,
    RecordSpec,
    Scenario,
    member_seed,
)

__all__ = [
    "Case", "ConnectionSpec", "EventSpec", "FaultSpec", "MemberSpec", "RecordSpec", "Scenario", "check_against",
    "load_scenario", "member_seed", "parse_scenario",
]  # fmt: skip
