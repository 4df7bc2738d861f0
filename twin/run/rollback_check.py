"""Whether the members of a case can go back to where a step began, if its algorithm takes steps back: tried, not believed."""

from __future__ import annotations

from typing import TYPE_CHECKING

from twin import clock
from twin.component import PythonComponent, catalog
from twin.coupling import cannot_go_back, trial, unfaithful
from twin.errors import TwinError
from twin.fmi import member as made_of
from twin.scenario import members

if TYPE_CHECKING:
    from twin.coupling import Catalog
    from twin.scenario import Case, MemberSpec


def rollback_check(case: Case, found: Catalog) -> list[str]:
    """A line for each member that cannot. FMUs of others are started for that, with their inputs as they begin."""
    problems = []
    for name, spec in case.members.items() if case.algorithm.rolls_back else ():
        made = members.component_of(spec)
        if isinstance(made, str) and made.endswith(".fmu"):
            wrong = refused(name, made, case, found)
        else:
            cls = catalog.component(made) if isinstance(made, str) else made
            wrong = cannot_go_back(name, case.algorithm) if issubclass(cls, PythonComponent) else ""
            wrong = "" if cls.period_ns else wrong
        if wrong and not is_slow(spec, case):
            problems.append(f"{spec.where}: {wrong}")
    return problems


def is_slow(spec: MemberSpec, case: Case) -> bool:
    """Whether a member is given a period: then it never has to go back."""
    return members.communication(spec) not in (None, case.step_ns)


def refused(name: str, path: str, case: Case, found: Catalog) -> str:
    """Why somebody's FMU does not go back; empty if it does, or need not."""
    member = None
    try:
        member = made_of(name, path, case.values(name, found[name]))
        if member.period_ns:
            return ""
        if not member.can_roll_back:
            return cannot_go_back(name, case.algorithm)
        start = clock.seconds(case.start_ns)
        member.instantiate()
        member.enter_initialization(start, clock.seconds(case.stop_ns))
        member.exit_initialization()
        wrong = trial(member, start, clock.seconds(case.step_ns)) or trial(
            member, start, clock.seconds(case.step_ns), True
        )
    except TwinError as error:
        return str(error)
    finally:
        if member is not None:
            member.close()
    return unfaithful(name, wrong, case.algorithm) if wrong else ""
