"""A Python-side component as PythonFMU and PythonFMU3 want it, made from its declaration; imported inside their FMUs."""

from __future__ import annotations

import importlib
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np

from twin import clock
from twin.component import catalog
from twin.coupling import RecordMember
from twin.errors import SimulationError
from twin.fmi.exporting.model_description_writer import TYPES_2, expose_arrays, expose_scalars

if TYPE_CHECKING:
    from twin.fmi.exporting.model_description_writer import Exposed

WARNING = 1  # the worst status of a step that went well
EXPOSE = {"2.0": expose_scalars, "3.0": expose_arrays}
PACKAGES = {"2.0": ("pythonfmu", "Fmi2"), "3.0": ("pythonfmu3", "Fmi3")}


class Part:
    """What the slave of an FMU stands for (FMUs that were exported name this class): a member of this project's own, called in FMI's order."""

    def __init__(self, slave: Any, component: str, version: str) -> None:
        cls = catalog.component(component)
        self.member = RecordMember(slave.instance_name, cls())
        package, prefix = PACKAGES[version]
        kinds = importlib.import_module(package)
        if prefix == "Fmi3":
            words = {"causality": kinds.Fmi3Causality.independent, "variability": kinds.Fmi3Variability.continuous}
            slave.register_variable(kinds.Float64("time", **words))
        for variable in EXPOSE[version](cls):
            slave.register_variable(made(variable, self.member, kinds, prefix))

    def enter(self, t: float) -> None:
        """Begin to take start values."""
        self.member.enter_initialization(t, None)

    def exit(self) -> None:
        """Settle."""
        self.member.exit_initialization()

    def step(self, t: float, h: float) -> None:
        """Step, at the component's own period if it has one."""
        period = self.member.period_ns
        count = 1 if not period else round(h * clock.NANOSECONDS / period)
        if period and abs(count * period - h * clock.NANOSECONDS) > 1:
            raise SimulationError(f"{self.member.name}: a step of {h:g} s is no multiple of {clock.text(period)}.")
        for i in range(count):
            status = self.member.component.advance(t + i * h / count, h / count)
            if status > WARNING:
                raise SimulationError(f"{self.member.name}: failed with status {status} at t = {t:g} s.")

    def close(self) -> None:
        """Release the component's resources."""
        self.member.close()


def made(exposed: Exposed, member: RecordMember, kinds: Any, prefix: str) -> Any:
    """A variable of PythonFMU for a value reference."""
    variable = exposed.variable
    kind = str(variable.type) if prefix == "Fmi3" else TYPES_2[variable.type]
    words = {
        "description": variable.description,
        "causality": getattr(getattr(kinds, f"{prefix}Causality"), exposed.causality),
        "variability": getattr(getattr(kinds, f"{prefix}Variability"), exposed.variability),
        "getter": partial(read, member, variable.name, exposed.element if prefix == "Fmi2" else None),
        "setter": partial(write, member, variable.name, exposed.element if prefix == "Fmi2" else None),
    }
    if prefix == "Fmi3" and exposed.shape:
        words["dimensions"] = [kinds.Dimension(start=str(size)) for size in exposed.shape]
    return getattr(kinds, kind)(exposed.name, **words)


def read(member: RecordMember, name: str, element: int | None) -> Any:
    """A variable's value, an array as a flat list; one element of it, if named."""
    value = np.asarray(member.get(name))
    if element is not None:
        return value.reshape(-1)[element].item()
    return value.reshape(-1).tolist() if value.shape else value.item()


def write(member: RecordMember, name: str, element: int | None, value: Any) -> None:
    """Set a variable, or one element of it."""
    array = np.array(member.get(name))
    if element is None:
        array[...] = np.reshape(value, array.shape)
    else:
        array.reshape(-1)[element] = value
    member.set(name, array)
