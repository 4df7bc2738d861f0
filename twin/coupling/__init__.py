"""Members and what couples them: systems, groups, and the compiled co-simulation loop."""

from twin.coupling.cosimulation import Algorithm, CoSimulation
from twin.coupling.group import Part, compose
from twin.coupling.isolated import IsolatedMember
from twin.coupling.member import (
    DTYPES,
    Access,
    Member,
    MemberVariable,
    RecordMember,
    TerminalMember,
    declared_variables,
    driven,
)
from twin.coupling.recorder import Layout, Memory, Recorder, Ring
from twin.coupling.system import (
    READABLE,
    Catalog,
    Connection,
    Link,
    System,
    direct_followers,
    find,
    stepping_order,
)

__all__ = [
    "DTYPES",
    "READABLE",
    "Access",
    "Algorithm",
    "Catalog",
    "CoSimulation",
    "Connection",
    "IsolatedMember",
    "Layout",
    "Link",
    "Member",
    "MemberVariable",
    "Memory",
    "Part",
    "RecordMember",
    "Recorder",
    "Ring",
    "System",
    "TerminalMember",
    "compose",
    "declared_variables",
    "direct_followers",
    "driven",
    "find",
    "stepping_order",
]
