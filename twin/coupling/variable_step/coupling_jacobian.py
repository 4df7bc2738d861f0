"""Jacobian of a coupling for Newton's method, from each member's directional derivatives or from differences.

Over a step of h, outputs change with held inputs by C (integral of exp(A s) over h) B + D. A member without directional
derivatives is stepped and rolled back once for each of its inputs. The connections combine them to the derivatives of the
torn connections by their guesses.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from twin.coupling.stability.linear_member import zero_order_hold
from twin.coupling.variable_step.record_layout import ARRIVED, TO_ARRIVED

if TYPE_CHECKING:
    from twin.coupling.member import Member, MemberVariable
    from twin.coupling.variable_step.stage_tables import Element, Stages

Matrix = np.ndarray[Any, Any]
CHANGE = 1e-6  # of an input, relative to its size
SMALL = 1e-3  # size of an input that is zero [its SI unit]


def derivatives_over_step(a: Matrix, b: Matrix, c: Matrix, d: Matrix, h: float) -> Matrix:
    """Return the derivatives of outputs at the end of a step of h [s] by inputs held over it."""
    return np.asarray(c @ zero_order_hold(a, b, h)[1] + d)


def derivatives_by_differences(
    member: Member, inputs: list[MemberVariable], outputs: list[MemberVariable], t: float, h: float
) -> Matrix | None:
    """Compute the same derivatives by differences of steps with rollback; None if the member refuses a step."""
    flags = np.zeros(5, np.int64)

    def step_outputs() -> Matrix | None:
        saved = member.save()
        status = member.try_step(t, h, flags)
        values = np.concatenate([np.ravel(member.get(variable.name)).astype(np.float64) for variable in outputs])
        member.restore(saved)
        return values if status <= 1 else None

    base = step_outputs()
    columns = []
    for variable in inputs:
        before = np.array(member.get(variable.name), np.float64)
        for i in range(variable.size):
            changed = before.copy()
            change = CHANGE * max(abs(float(changed.reshape(-1)[i])), SMALL)
            changed.reshape(-1)[i] += change
            member.set(variable.name, changed[()])
            shifted = step_outputs()
            member.set(variable.name, before[()])
            if base is None or shifted is None:
                return None
            columns.append((shifted - base) / change)
    return np.array(columns).T.reshape(sum(variable.size for variable in outputs), len(columns))


class Coupling:
    """Members with variable steps and the elements between them, as matrices."""

    def __init__(self, plan: Stages) -> None:
        self.plan = plan
        moving = [element for element in plan.all_elements if element.is_moving]
        self.torn = [element for element in moving if element.is_torn]
        self.forward = [element for element in moving if element.source in (ARRIVED, TO_ARRIVED)]
        names = {end.member for element in moving for end in (element.link.source, element.link.target)}
        self.names = [name for name in plan.members if name in names]
        self.inputs = {name: unique([element.link.target for element in moving], name) for name in self.names}
        self.outputs = {name: unique([element.link.source for element in moving], name) for name in self.names}

    def jacobian(self, t: float, h: float) -> Matrix | None:
        """Return the derivatives of torn connections by their guesses, with all members at t [s]; None if unavailable."""
        n = self.plan.count
        gives = np.zeros((n, n))  # derivative of an element by another one, through one member
        for name in self.names:
            member, inputs, outputs = self.plan.members[name], self.inputs[name], self.outputs[name]
            if not inputs or not outputs:
                continue
            matrices = member.slopes(inputs, outputs)
            change = (
                derivatives_by_differences(member, inputs, outputs, t, h)
                if matrices is None
                else derivatives_over_step(*matrices, h)
            )
            if change is None:
                return None
            rows, columns = offsets(outputs), offsets(inputs)
            for target in (*self.torn, *self.forward):
                if target.link.target.member != name:
                    continue
                column = (
                    columns[target.link.target.variable.name] + target.link.target.first + self._element_index(target)
                )
                for out in (*self.torn, *self.forward):
                    if out.link.source.member == name:
                        row = rows[out.link.source.variable.name] + out.link.source.first + self._element_index(out)
                        gives[out.number, target.number] = change[row, column] * out.link.factor
        torn, forward = ([element.number for element in chosen] for chosen in (self.torn, self.forward))
        inner = np.linalg.solve(np.eye(len(forward)) - gives[np.ix_(forward, forward)], gives[np.ix_(forward, torn)])
        jacobian: Matrix = gives[np.ix_(torn, torn)] + gives[np.ix_(torn, forward)] @ inner
        return jacobian if np.isfinite(jacobian).all() else None

    def _element_index(self, element: Element) -> int:
        return element.number - self.plan.fed[id(element.link)][0].number


def unique(ends: list[Any], name: str) -> list[MemberVariable]:
    """Return the distinct variables of a member among the ends of connections."""
    return list({end.variable.name: end.variable for end in ends if end.member == name}.values())


def offsets(variables: list[MemberVariable]) -> dict[str, int]:
    """Return the offset of each variable's elements in a flat vector."""
    result, offset = {}, 0
    for variable in variables:
        result[variable.name] = offset
        offset += variable.size
    return result
