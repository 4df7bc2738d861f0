"""Verification by trial that members support rollback, for algorithms that repeat steps."""

from __future__ import annotations

from typing import TYPE_CHECKING

from twin import clock
from twin.component import PythonComponent
from twin.coupling import cannot_go_back, unfaithful, verify_rollback
from twin.errors import TwinError
from twin.fmi import member as made_of
from twin.scenario import members

if TYPE_CHECKING:
    from twin.coupling import Catalog
    from twin.scenario import Case, MemberSpec


def rollback_check(case: Case, variables: Catalog) -> list[str]:
    """Return a line for each member without rollback. Third-party FMUs are instantiated, with their initial inputs."""
    problems = []
    for name, spec in case.members.items() if case.algorithm.rolls_back else ():
        component = members.component_of(spec)
        if members.is_fmu(component):
            problem = check_fmu(name, component, case, variables)
        else:
            cls = members.class_of(component)
            problem = cannot_go_back(name, case.algorithm) if issubclass(cls, PythonComponent) else ""
            problem = "" if cls.period_ns else problem
        if problem and not has_own_period(spec, case):
            problems.append(f"{spec.where}: {problem}")
    return problems


def has_own_period(spec: MemberSpec, case: Case) -> bool:
    """Whether a member has its own communication step, and so never rolls back."""
    return members.communication(spec) not in (None, case.step_ns)


def check_fmu(name: str, path: str, case: Case, variables: Catalog) -> str:
    """Return why a third-party FMU does not roll back; empty if it does, or need not."""
    member = None
    try:
        member = made_of(name, path, case.values(name, variables[name]))
        if member.period_ns:
            return ""
        if not member.has_fmu_state:
            return cannot_go_back(name, case.algorithm)
        start = clock.seconds(case.start_ns)
        member.instantiate()
        member.enter_initialization(start, clock.seconds(case.stop_ns))
        member.exit_initialization()
        problem = verify_rollback(member, start, clock.seconds(case.step_ns)) or verify_rollback(
            member, start, clock.seconds(case.step_ns), True
        )
    except TwinError as error:
        return str(error)
    finally:
        if member is not None:
            member.close()
    return unfaithful(name, problem, case.algorithm) if problem else ""
