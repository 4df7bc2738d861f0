"""Members and what couples them: systems, groups, and the compiled co-simulation loop."""

from typing import TYPE_CHECKING

from twin import late
from twin.coupling.algorithms import Algorithm
from twin.coupling.cosimulation import CoSimulation
from twin.coupling.events import Events
from twin.coupling.isolated import IsolatedMember
from twin.coupling.member import DTYPES, Access, Member, MemberVariable, TerminalMember, Way
from twin.coupling.record import RecordMember, declared_variables, driven
from twin.coupling.recorder import Layout, Memory, Recorder, Ring
from twin.coupling.system import (
    READABLE,
    Catalog,
    Connection,
    Link,
    Reference,
    System,
    direct_followers,
    find,
    stepping_order,
)
from twin.coupling.walk.back import cannot_go_back, trial, unfaithful

if TYPE_CHECKING:
    from twin.coupling.group import compose
    from twin.coupling.group_writer import Part
    from twin.coupling.stability import Growth, growth
    from twin.coupling.stopwatch import Stopwatch

# what no run of FMUs needs
__getattr__ = late.names(
    __name__,
    {
        "Growth": "stability",
        "Part": "group_writer",
        "Stopwatch": "stopwatch",
        "compose": "group",
        "growth": "stability",
    },
)

__all__ = [
    "DTYPES",
    "READABLE",
    "Access",
    "Algorithm",
    "Catalog",
    "CoSimulation",
    "Connection",
    "Events",
    "Growth",
    "IsolatedMember",
    "Layout",
    "Link",
    "Member",
    "MemberVariable",
    "Memory",
    "Part",
    "RecordMember",
    "Recorder",
    "Reference",
    "Ring",
    "Stopwatch",
    "System",
    "TerminalMember",
    "Way",
    "cannot_go_back",
    "compose",
    "declared_variables",
    "direct_followers",
    "driven",
    "find",
    "growth",
    "stepping_order",
    "trial",
    "unfaithful",
]
