"""How outputs of a continuous system depend on parameters, along a simulation: forward sensitivity equations.

With x' = f(x, u, p) and y = g(x, u, p), S = dx/dp follows S' = f_x S + f_p and dy/dp = g_x S + g_p. The members' directional
derivatives give all four, through the connections as in `system_jacobian`; parameters are knowns of Continuous-Time Mode
for FMUs that take them (ours do). S goes by the trapezoidal rule over the solver's own steps: of second order in them.

It ends, with a reason, where that does not hold: at an event at which the state or its derivative jumps, since the time of
the event depends on the parameters too. Values from outside may jump: their time does not.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from twin.fmi.model_exchange.solvers import Discarded
from twin.fmi.model_exchange.system_jacobian import Jacobian, offered

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from twin.coupling import Member, ResolvedConnection
    from twin.fmi.model_exchange.system import ContinuousSystem

Vector = np.ndarray[Any, Any]
VariableElement = tuple[str, str, int]  # member, variable, element counted from 0

JUMP = 1e-6  # relative change of states or derivatives at an event that counts as one


def watched(
    members: Mapping[str, Member],
    links: Sequence[ResolvedConnection],
    parameters: Sequence[VariableElement],
    outputs: Sequence[VariableElement],
) -> Sensitivity | None:
    """Create a sensitivity that is integrated with the members; None if they do not support it.

    All that outputs depend on must be integrated here, with directional derivatives; what is not may drive it, no more.
    """
    from twin.fmi.model_exchange.model_exchange_member import ExchangeMember

    integrated = {name: member for name, member in members.items() if isinstance(member, ExchangeMember)}
    requested_members = {member for member, _, _ in (*parameters, *outputs)}
    if not parameters or not requested_members <= set(integrated) or not offered(list(integrated.values())):
        return None
    if any(link.target.member not in integrated for link in links):
        return None
    made = Sensitivity(parameters, outputs)
    for exchange_member in integrated.values():
        exchange_member.sensitivity = made
    return made


class Sensitivity:
    """Derivatives of `outputs` by `parameters` at every communication point, as long as `failure` is empty.

    `times` [s]; `slopes`: an array of outputs x parameters for each of them.
    """

    def __init__(self, parameters: Sequence[VariableElement], outputs: Sequence[VariableElement]) -> None:
        self.parameters, self.outputs = list(parameters), list(outputs)
        self.times: list[float] = []
        self.slopes: list[Vector] = []
        self.failure = ""

    def start(self, system: ContinuousSystem) -> None:
        """The first communication point; the state there is taken to be independent of the parameters."""
        if not {member for member, _, _ in (*self.parameters, *self.outputs)} <= {
            member.name for member in system.members
        }:
            self.failure = "not all members are integrated together"
            return
        wanted: dict[str, list[str]] = {}
        for member, variable, _ in self.outputs:
            wanted.setdefault(member, []).append(variable)
        self.system_jacobian = Jacobian(system.members, system.links, system.move_to, wanted)
        self.names = [member.name for member in system.members]
        self.rows = [
            self.system_jacobian.outputs[member, variable] + element for member, variable, element in self.outputs
        ]
        self.states: Vector = np.zeros((len(system.y), len(self.parameters)))
        self.publish(system)

    def evaluated(self, system: ContinuousSystem, t: float, y: Vector) -> tuple[Vector, Vector, Vector, Vector] | None:
        """Return f_x, f_p, g_x, g_p at a point; None, with `failure` set, if a member refuses."""
        try:
            system.move_to(t, y)
            return self.system_jacobian.linearized([self.columns(system, name) for name in self.names])
        except (Discarded, np.linalg.LinAlgError) as error:
            self.failure = f"a directional derivative by a parameter was refused at t = {t:.6g} s ({error})"
            return None

    def columns(self, system: ContinuousSystem, member: str) -> Vector:
        """Derivatives of a member's unknowns along every parameter; zero along those of others."""
        part = self.system_jacobian.parts[self.names.index(member)]
        result = np.zeros((part.rows, len(self.parameters)))
        for number, (owner, name, element) in enumerate(self.parameters):
            if owner == member:
                variable = system.members[self.names.index(member)].variables[name]
                alone = len(variable.references) > 1  # FMI 2.0: a reference for each element
                reference = variable.references[element if alone else 0]
                seed = np.ones(1) if alone else np.eye(variable.size)[element]
                result[:, number] = part.member.direction(part.unknowns, reference, seed, part.rows)
        return result

    def before(self, system: ContinuousSystem, t: float, y: Vector) -> None:
        """Linearize at the begin of a solver step."""
        self.begin_linearization = None if self.failure else self.evaluated(system, t, y)

    def after(self, system: ContinuousSystem, h: float, t: float, y: Vector) -> None:
        """Advance the sensitivities by the trapezoidal rule at the end of a solver step."""
        if self.begin_linearization is None or (ended := self.evaluated(system, t, y)) is None:
            return
        (a, f, _, _), (b, g, _, _) = self.begin_linearization, ended
        identity = np.eye(len(y))
        self.states = np.linalg.solve(
            identity - 0.5 * h * b, (identity + 0.5 * h * a) @ self.states + 0.5 * h * (f + g)
        )

    def crossed(self, t: float, before: tuple[Vector, ...], after: tuple[Vector, ...]) -> None:
        """Stop at a jump. Takes states before and after an event, and derivatives if the event is internal."""
        for what, old, new in zip(("state", "derivative of a state"), before, after, strict=False):
            if np.any(np.abs(new - old) > JUMP * np.maximum(np.abs(old), np.abs(new))):
                self.failure = self.failure or f"a {what} jumps at an event at t = {t:.6g} s"

    def publish(self, system: ContinuousSystem) -> None:
        """Record the sensitivities of the outputs at a communication point."""
        if self.failure or (linearization := self.evaluated(system, system.t, system.y)) is None:
            return
        _, _, by_state, by_parameter = linearization
        self.times.append(system.t)
        self.slopes.append((by_state @ self.states + by_parameter)[self.rows])
