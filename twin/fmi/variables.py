"""What an FMU declares, from its model description to this project's words."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from twin import clock
from twin.coupling import DTYPES, MemberVariable, TerminalMember
from twin.errors import CouplingError, FMUError
from twin.fmi import units, values
from twin.fmi.clocks import clock_declarations
from twin.fmi.fmi_version import FMI2, FmiVersion

if TYPE_CHECKING:
    from collections.abc import Mapping

    from twin.fmi.model_description import Declared, ModelDescription

LARGEST = 1 << 27  # scalars of one variable

# FMI 2.0 type -> FMI 3.0 name, type of one scalar in memory; fmi2Boolean and enumerations are C ints
FMI2_TYPES: dict[str, tuple[str, np.dtype[Any]]] = {
    "Real": ("Float64", np.dtype(np.float64)),
    "Integer": ("Int32", np.dtype(np.int32)),
    "Boolean": ("Boolean", np.dtype(np.int32)),
    "Enumeration": ("Enumeration", np.dtype(np.int32)),
    "String": ("String", np.dtype(object)),
}

# `clocked` moves clocks
FMI3_TYPES = {kind: (kind, dtype) for kind, dtype in {**DTYPES, "Clock": np.dtype(object)}.items()}


@dataclass(frozen=True, slots=True)
class Experiment:
    """DefaultExperiment: values suggested by the FMU [s], None if absent."""

    start: float | None = None
    stop: float | None = None
    tolerance: float | None = None
    step_size: float | None = None


def number(text: str | None, what: str, unit: str = " [s]") -> float | None:
    """An optional number of the description; `what`: its owner and its name, for messages."""
    try:
        return None if text is None else float(text)
    except ValueError:
        raise FMUError(f"{what}={text!r}, expected a number{unit}.") from None


def experiment(declared: Mapping[str, str], where: str) -> Experiment:
    """The suggested experiment."""
    names = ("startTime", "stopTime", "tolerance", "stepSize")
    return Experiment(*(number(declared.get(name), f"{where}: DefaultExperiment has {name}") for name in names))


def period(fixed: float | None, suggested: float | None, where: str) -> clock.Time:
    """Period [ns] of an FMU whose step size must not vary; a suggestion (FMI 2.0) that is no time is left out."""
    step = suggested if fixed is None else fixed
    try:
        size: clock.Time = clock.nanoseconds(step, "fixed step size") if step else 0
    except CouplingError as error:
        if fixed is not None:
            raise FMUError(f"{where}: {error}") from None
        size = 0
    if size < 0 and fixed is not None:
        raise FMUError(f"{where}: fixed step size {step} s is negative. Export the FMU once more.")
    return max(size, 0)


def items(declared: Declared, where: str) -> values.Items:
    """Items of an enumeration; none for other types."""
    try:
        return {name: int(value) for name, value in declared.items}
    except ValueError:
        raise FMUError(
            f"{where}: the items of {declared.name} have no whole numbers. Export the FMU once more."
        ) from None


def variable(
    declared: Declared,
    types: dict[str, tuple[str, np.dtype[Any]]],
    sizes: dict[int, int],
    depends: dict[str, tuple[str, ...] | None],
    where: str,
    terminals: tuple[TerminalMember, ...] = (),
) -> MemberVariable:
    """A variable; `sizes` are structural parameters by value reference, where they are not at their start."""
    kind, dtype = types[declared.type]
    shape = tuple(
        size.start if size.reference is None else sizes.get(size.reference, size.start) for size in declared.dimensions
    )
    if math.prod(shape) > LARGEST:
        by = " x ".join(map(str, shape))
        raise FMUError(f"{where}: {declared.name} has {by} elements, more than {LARGEST}. Use a smaller size.")
    start = plain(kind, shape, declared.start)
    bare = MemberVariable(
        declared.name,
        declared.causality,
        declared.variability,
        kind,
        dtype,
        shape,
        declared.unit,
        declared.display_unit,
        start,
        declared.description,
        depends.get(declared.alias_of or declared.name) if declared.causality == "output" else (),
        (declared.reference,),
        "" if declared.variability == "constant" else declared.initial,
        tuple(items(declared, where).items()),
        number(declared.minimum, f"{where}: {declared.name} has min", ""),
        number(declared.maximum, f"{where}: {declared.name} has max", ""),
        terminals,
    )
    return bare if start is not None else with_start(bare, declared.start, where)


def plain(kind: str, shape: tuple[int, ...], text: str | None) -> Any:
    """The start value of real numbers, as nearly all are; None if the general parser must read it."""
    if kind != "Float64" or text is None:
        return None
    try:
        numbers = [float(part) for part in (text.split() if shape else (text,))]
    except ValueError:
        return None
    return np.array(numbers, np.float64).reshape(shape)[()] if len(numbers) == math.prod(shape) else None


def with_start(bare: MemberVariable, text: str | None, where: str) -> MemberVariable:
    """The variable with its start value; None if there is none, or it does not fit a shape that was changed."""
    if text is None or bare.type == "Clock":
        return bare
    parts = text.split() if bare.shape and bare.type not in ("String", "Binary") else [text]
    if len(parts) != bare.size:
        return bare
    parse = values.scalar_of(bare, {}, f"{where}: modelDescription.xml, start")
    start = np.empty(bare.size, dtype=bare.dtype)
    for index, part in enumerate(parts):
        start[index] = parse(part)
    return replace(bare, start=start.reshape(bare.shape)[()])


def variables(
    model: ModelDescription,
    fmi: FmiVersion,
    where: str,
    sizes: dict[int, int],
    terminal_members: Mapping[str, tuple[TerminalMember, ...]],
) -> dict[str, MemberVariable]:
    """Variables of a description. `sizes`: structural parameters by value reference; `terminal_members`: by variable."""
    types = FMI2_TYPES if fmi == FMI2 else FMI3_TYPES
    unit_names = units.names(model.units)
    variables_by_name = {
        declared.name: units.named(
            variable(declared, types, sizes, model.dependencies, where, terminal_members.get(declared.name, ())),
            unit_names,
            is_relative=declared.is_relative,
        )
        for declared in model.variables
    }
    return clock_declarations.shown(variables_by_name, model.clocks, model.capabilities)
