"""Members and what couples them: systems, groups, and the compiled co-simulation loop."""

from typing import TYPE_CHECKING

import lazy_loader

from twin.coupling.algorithms import Algorithm
from twin.coupling.component_member import RecordMember, declared_variables, driven
from twin.coupling.conditions import Condition
from twin.coupling.cosimulation import CoSimulation
from twin.coupling.events import Events
from twin.coupling.execution.recorder import MemoryRecorder, Recorder, Ring, RowLayout
from twin.coupling.fixed_point import FixedPoint
from twin.coupling.isolation.isolated_member import IsolatedMember
from twin.coupling.member import DTYPES, Access, Member, MemberVariable, StateAccess, TerminalMember, renamed
from twin.coupling.model_exchange_groups import integrated_with
from twin.coupling.system import (
    READABLE,
    Catalog,
    Connection,
    CoupledSystem,
    Reference,
    ResolvedConnection,
    direct_followers,
    find,
    is_real,
    stepping_order,
)
from twin.coupling.variable_step.rollback import cannot_go_back, unfaithful, verify_rollback
from twin.former import note_former

if TYPE_CHECKING:
    from twin.coupling.execution import condition_loop
    from twin.coupling.execution.profiler import Stopwatch
    from twin.coupling.groups.group import Group, at_border, compose, group_layout, group_start, nested
    from twin.coupling.groups.group_writer import GroupMember, GroupWriter, subscript
    from twin.coupling.saved_state import (
        LOOP_FIELDS,
        SavedState,
        published_address,
        published_copies,
        restore_state,
        save_state,
        serialization_problems,
    )
    from twin.coupling.stability.growth import Growth, growth
    from twin.coupling.state_transfer import StateTransfer, shared_state, verify_copy
    from twin.coupling.transfer import Transfer

# Lazy attribute access (PEP 562): a run of FMUs needs none of these.
lazy_attribute, _, _ = lazy_loader.attach(
    __name__,
    submod_attrs={
        "execution": ["condition_loop"],
        "execution.profiler": ["Stopwatch"],
        "groups.group": ["Group", "at_border", "compose", "group_layout", "group_start", "nested"],
        "groups.group_writer": ["GroupMember", "GroupWriter", "subscript"],
        "saved_state": [
            *("LOOP_FIELDS", "SavedState", "published_address", "published_copies", "restore_state", "save_state"),
            "serialization_problems",
        ],
        "stability.growth": ["Growth", "growth"],
        "state_transfer": ["StateTransfer", "shared_state", "verify_copy"],
        "transfer": ["Transfer"],
    },
)


def __getattr__(name: str) -> object:
    """Return a lazily imported object, or one under its former name."""
    if name == "Link":
        note_former("twin.coupling.Link", "twin.coupling.ResolvedConnection")
        return ResolvedConnection
    return lazy_attribute(name)


__all__ = [
    "DTYPES",
    "LOOP_FIELDS",
    "READABLE",
    "Access",
    "Algorithm",
    "Catalog",
    "CoSimulation",
    "Condition",
    "Connection",
    "CoupledSystem",
    "Events",
    "FixedPoint",
    "Group",
    "GroupMember",
    "GroupWriter",
    "Growth",
    "IsolatedMember",
    "Member",
    "MemberVariable",
    "MemoryRecorder",
    "RecordMember",
    "Recorder",
    "Reference",
    "ResolvedConnection",
    "Ring",
    "RowLayout",
    "SavedState",
    "StateAccess",
    "StateTransfer",
    "Stopwatch",
    "TerminalMember",
    "Transfer",
    "at_border",
    "cannot_go_back",
    "compose",
    "condition_loop",
    "declared_variables",
    "direct_followers",
    "driven",
    "find",
    "group_layout",
    "group_start",
    "growth",
    "integrated_with",
    "is_real",
    "nested",
    "published_address",
    "published_copies",
    "renamed",
    "restore_state",
    "save_state",
    "serialization_problems",
    "shared_state",
    "stepping_order",
    "subscript",
    "unfaithful",
    "verify_copy",
    "verify_rollback",
]
