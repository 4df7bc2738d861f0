"""Buffers of fixed size: a parameter that would outgrow one is rejected when a scenario is loaded."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Mapping

    from twin.component.component import Component

INVERSE = ("Hz", "1/s")  # units of parameters that are rates


def overflows(cls: type[Component], values: Mapping[str, Any], period: float) -> list[str]:
    """Overflows, one line each: parameters of `cls.buffers` against the periods that their buffers hold.

    `values`: those that differ from the start values, in SI; `period`: what the component samples at [s].
    """
    problems = []
    declared = {variable.name: variable for variable in cls.variables}
    for name, most in cls.buffers:
        variable = declared[name]
        value = float(np.max(np.asarray(values.get(name, variable.start_array()))))
        is_rate = variable.unit in INVERSE
        if is_rate and value <= 0.0:
            continue  # its own bounds say so
        periods = (1.0 / value if is_rate else value) / period
        if periods > most * (1.0 + 1e-9):
            problems.append(
                f"{name} = {value:g} {variable.unit} needs {periods:.4g} periods of {period:g} s, and its buffer holds {most:g}. "
                f"Give at {'least' if is_rate else 'most'} {1.0 / (most * period) if is_rate else most * period:.4g} {variable.unit}, or sample less often."
            )
    return problems
