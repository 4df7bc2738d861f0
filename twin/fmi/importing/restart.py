"""Initialization of an FMU anew, at any time and from its continuous states, to set what cannot be set while it runs."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Mapping

    from twin.fmi.importing.fmu_member import FMUMember


def continuous_states(member: FMUMember) -> list[str]:
    """Return the names of the continuous states that an FMU declares."""
    structure = member._unpacked.description.continuous
    names = {variable.references[0]: name for name, variable in member.variables.items()}
    return [] if structure is None else [names[reference] for reference in structure.states]


def restart_problem(member: FMUMember) -> str:
    """Return why an FMU cannot be initialized anew at its present state; empty if it can, but for discrete states."""
    states = continuous_states(member)
    if not states:
        return "it declares no continuous states"
    fixed = [name for name in states if member.variables[name].initial not in ("exact", "approx")]
    return f"its state {fixed[0]} has no start value" if fixed else ""


def restart(member: FMUMember, t: float, values: Mapping[str, np.ndarray[Any, Any]]) -> None:
    """Initialize an FMU anew at t [s] with these start values in addition to its own; SimulationError if it refuses."""
    member._start |= {name: np.array(value).reshape(member.variables[name].shape) for name, value in values.items()}
    if member.continuous:
        restart_exchange(member, t, values)
        return
    member.reinitialize(t)


def restart_exchange(member: FMUMember, t: float, values: Mapping[str, np.ndarray[Any, Any]]) -> None:
    """Set the states of an FMU for Model Exchange; initialize it anew if a fixed parameter is set, too."""
    from twin.fmi.model_exchange.model_exchange_member import ExchangeMember

    assert isinstance(member, ExchangeMember)
    if any(member.variables[name].variability == "fixed" for name in values):
        member.restart(t)
    else:
        member.set_states({name: values[name] for name in continuous_states(member)})
