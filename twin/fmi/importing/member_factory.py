"""Create members from third-party FMUs by interface. Model Exchange modules are imported only when it is used."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from twin.errors import FMUError, nearest
from twin.fmi.importing.fmu_member import FMUMember
from twin.fmi.importing.unpacked import share

if TYPE_CHECKING:
    from pathlib import Path

    from twin.fmi.importing.unpacked import Unpacked

INTERFACES = {
    "co_simulation": "CoSimulation",
    "model_exchange": "ModelExchange",
    "scheduled_execution": "ScheduledExecution",
    "": "",
}


def member(
    name: str,
    path: str | Path,
    start_values: dict[str, Any] | None = None,
    *,
    interface: str = "",
    solver: str = "",
    tolerance: float | None = None,
    **options: Any,
) -> FMUMember:
    """Create a member of an FMU with the requested interface, one of `INTERFACES`; else Co-Simulation if it has it.

    `solver`: of Model Exchange. `tolerance`: relative, of the solver or for the FMU's own; else its default experiment's.
    """
    if interface not in INTERFACES:
        raise FMUError(
            f"interface {interface!r} is not known. {nearest(interface, [name for name in INTERFACES if name])}"
        )
    with share(path, INTERFACES[interface]) as unpacked:
        if unpacked.interface == "ModelExchange":
            from twin.fmi.model_exchange.model_exchange_member import ExchangeMember

            made = ExchangeMember
            if unpacked.description.clocks.every:
                from twin.fmi.clocks.model_exchange_clocks import ClockedExchangeMember

                made = ClockedExchangeMember
            return made(name, path, start_values, solver=solver, tolerance=tolerance, **options)
        if solver:
            advice = "Use interface model_exchange" if unpacked.description.has_exchange else "Leave it out"
            raise FMUError(f"{path}: steps by itself in Co-Simulation, without a solver. {advice}.")
        stepping = stepping_class(unpacked)(name, path, start_values, **options)
        stepping.tolerance = tolerance or stepping.tolerance
        return stepping


def stepping_class(unpacked: Unpacked) -> type[FMUMember]:
    """Return the class of a member that steps by itself."""
    if unpacked.interface == "ScheduledExecution":
        from twin.fmi.clocks.scheduled_execution import ScheduledMember

        return ScheduledMember
    if unpacked.description.clocks.every and unpacked.description.capabilities["hasEventMode"]:
        from twin.fmi.clocks.event_mode import EventMember

        return EventMember
    return FMUMember
