"""Members and what couples them: systems, groups, and the compiled co-simulation loop."""

from twin.coupling.cosimulation import Algorithm, CoSimulation
from twin.coupling.group import Part, compose
from twin.coupling.member import DTYPES, Access, Member, MemberVariable, RecordMember, declared_variables
from twin.coupling.system import (
    READABLE,
    Catalog,
    Connection,
    Link,
    System,
    direct_followers,
    find,
    nearest,
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
    "Link",
    "Member",
    "MemberVariable",
    "Part",
    "RecordMember",
    "System",
    "compose",
    "declared_variables",
    "direct_followers",
    "find",
    "nearest",
    "stepping_order",
]
