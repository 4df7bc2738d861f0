"""What an FMU declares, from FMPy's model description to this project's words."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from twin import clock
from twin.coupling import DTYPES, MemberVariable, TerminalMember
from twin.errors import CouplingError, FMUError
from twin.fmi import values

if TYPE_CHECKING:
    from collections.abc import Iterable

LARGEST = 1 << 27  # scalars of one variable

# FMI 2.0 type -> FMI 3.0 name, type of one scalar in memory; fmi2Boolean and enumerations are C ints
FMI2_TYPES: dict[str, tuple[str, np.dtype[Any]]] = {
    "Real":        ("Float64",     np.dtype(np.float64)),
    "Integer":     ("Int32",       np.dtype(np.int32)),
    "Boolean":     ("Boolean",     np.dtype(np.int32)),
    "Enumeration": ("Enumeration", np.dtype(np.int32)),
    "String":      ("String",      np.dtype(object)),
}  # fmt: skip

# the loop does not move clocks: they need event mode
FMI3_TYPES = {kind: (kind, dtype) for kind, dtype in {**DTYPES, "Clock": np.dtype(object)}.items()}


@dataclass(frozen=True, slots=True)
class Experiment:
    """DefaultExperiment: what the FMU's maker suggests [s], None where nothing is suggested."""

    start: float | None = None
    stop: float | None = None
    tolerance: float | None = None
    step_size: float | None = None


def experiment(declared: Any, where: str) -> Experiment:
    """The suggested experiment."""
    numbers: list[float | None] = []
    for name in ("startTime", "stopTime", "tolerance", "stepSize"):
        text = getattr(declared, name, None)
        try:
            numbers.append(None if text is None else float(text))
        except ValueError:
            raise FMUError(f"{where}: DefaultExperiment has {name}={text!r}, expected a number [s].") from None
    return Experiment(*numbers)


def step_size(text: str | None, where: str) -> float | None:
    """The step [s] from fixedInternalStepSize of FMI 3.0."""
    try:
        return None if text is None else float(text)
    except ValueError:
        raise FMUError(f"{where}: has fixedInternalStepSize={text!r}, expected a number [s].") from None


def period(fixed: float | None, suggested: float | None, where: str) -> int:
    """Period [ns] of an FMU whose step size must not vary; a suggestion (FMI 2.0) that is no whole ns is left out."""
    step = suggested if fixed is None else fixed
    try:
        size = clock.nanoseconds(step, "fixed step size") if step else 0
    except CouplingError as error:
        if fixed is not None:
            raise FMUError(f"{where}: {error}") from None
        size = 0
    if size < 0 and fixed is not None:
        raise FMUError(f"{where}: fixed step size {step} s is negative. Export the FMU once more.")
    return max(size, 0)


def items(declared: Any, where: str) -> values.Items:
    """Items of an enumeration; none for other types."""
    try:
        return {item.name: int(item.value) for item in getattr(declared.declaredType, "items", [])}
    except (TypeError, ValueError):
        raise FMUError(
            f"{where}: the items of {declared.name} have no whole numbers. Export the FMU once more."
        ) from None


def dependencies(description: Any) -> dict[str, tuple[str, ...] | None]:
    """Inputs that outputs depend on, by the output's name; None where the FMU does not say."""
    found: dict[str, tuple[str, ...] | None] = {}
    for unknown in [*description.outputs, *description.initialUnknowns]:
        names = None
        if unknown.dependencies is not None:
            names = tuple(known.name for known in unknown.dependencies if known.causality == "input")
        found[unknown.variable.name] = names
    return found


def refuse_clocks(declared: Iterable[Any], where: str) -> None:
    """Input clocks tick in event mode only, which is not supported."""
    clocks = [each.name for each in declared if each.type == "Clock" and each.causality == "input"]
    if clocks:
        names = ", ".join(clocks[:3]) + (", ..." if len(clocks) > 3 else "")
        raise FMUError(f"{where}: has input clocks ({names}). They need event mode, which is not supported yet.")


def variable(
    declared: Any,
    types: dict[str, tuple[str, np.dtype[Any]]],
    sizes: dict[int, int],
    depends: dict[str, tuple[str, ...] | None],
    where: str,
    terminals: tuple[TerminalMember, ...] = (),
) -> MemberVariable:
    """A variable; `sizes` are structural parameters by value reference, where they are not at their start."""
    kind, dtype = types[declared.type]
    shape = tuple(
        size.start if size.start is not None else sizes.get(size.valueReference, int(size.variable.start))
        for size in declared.dimensions
        if size.start is not None or size.variable is not None
    )
    if math.prod(shape) > LARGEST:
        by = " x ".join(map(str, shape))
        raise FMUError(f"{where}: {declared.name} has {by} elements, more than {LARGEST}. Use a smaller size.")
    common = declared.declaredType
    bare = MemberVariable(
        declared.name, declared.causality, declared.variability, kind, dtype, shape,
        declared.unit or getattr(common, "unit", "") or "",
        declared.displayUnit or getattr(common, "displayUnit", "") or "",
        None, declared.description or getattr(common, "description", "") or "",
        depends.get((declared.alias or declared).name) if declared.causality == "output" else (),
        (declared.valueReference,),
        "" if declared.variability == "constant" else declared.initial or "", tuple(items(declared, where).items()),
        bound(declared, "min", where), bound(declared, "max", where), terminals,
    )  # fmt: skip
    return with_start(bare, declared.start, where)


def bound(declared: Any, side: str, where: str) -> float | None:
    """The `min` or `max` of a variable, else that of its type; None if there is none."""
    text = getattr(declared, side, None)
    if text is None:
        text = getattr(declared.declaredType, side, None)
    try:
        return None if text is None else float(text)
    except ValueError:
        raise FMUError(f"{where}: {declared.name} has {side}={text!r}, expected a number.") from None


def with_start(bare: MemberVariable, text: str | None, where: str) -> MemberVariable:
    """The variable with its start value; None if there is none, or it does not fit a shape that was changed."""
    if text is None or bare.type == "Clock":
        return bare
    parts = text.split() if bare.shape and bare.type not in ("String", "Binary") else [text]
    if len(parts) != bare.size:
        return bare
    parse = values.scalar_of(bare, {}, f"{where}: modelDescription.xml, start")
    start = np.empty(bare.size, dtype=bare.dtype)
    for place, part in enumerate(parts):
        start[place] = parse(part)
    return replace(bare, start=start.reshape(bare.shape)[()])
