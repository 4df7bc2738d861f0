"""Jacobian of an FMU's derivatives and outputs by its states and inputs, from directional derivatives, column by column."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from twin.fmi.importing.c_functions import CallError, MissingFunctionError

if TYPE_CHECKING:
    from twin.coupling import MemberVariable
    from twin.fmi.importing.fmu_member import FMUMember

Matrix = np.ndarray[Any, Any]


def slopes(
    member: FMUMember, inputs: list[MemberVariable], outputs: list[MemberVariable]
) -> tuple[Matrix, Matrix, Matrix, Matrix] | None:
    """Return A, B, C, D of der(x) = A x + B u, y = C x + D u, linearized now; None if the FMU does not provide them."""
    if not member.capabilities["providesDirectionalDerivatives"]:
        return None
    structure = member._unpacked.description.continuous
    if structure is None:
        return None
    sizes = {
        variable.references[0]: variable.size for variable in member.variables.values() if len(variable.references) == 1
    }
    own = [(state, sizes.get(state, 1)) for state in structure.states]
    given = [(reference, size) for v in inputs for reference, size in elements(v)]
    sized_unknowns = [(derivative, sizes.get(derivative, 1)) for derivative in structure.derivatives]
    sized_unknowns += [(reference, size) for v in outputs for reference, size in elements(v)]
    unknowns = np.array([reference for reference, _ in sized_unknowns], np.uint32)
    rows = sum(size for _, size in sized_unknowns)
    columns = []
    try:
        for value_reference, size in (*own, *given):
            columns += [member.directional_derivative(unknowns, value_reference, seed, rows) for seed in np.eye(size)]
    except (CallError, MissingFunctionError):
        return None
    matrix = np.array(columns).T.reshape(rows, len(columns))
    n = sum(size for _, size in own)
    return matrix[:n, :n], matrix[:n, n:], matrix[n:, :n], matrix[n:, n:]


def elements(variable: MemberVariable) -> list[tuple[int, int]]:
    """Value references of a variable with the size of each: FMI 2.0 has one per element."""
    if len(variable.references) == 1:
        return [(variable.references[0], variable.size)]
    return [(reference, 1) for reference in variable.references]
