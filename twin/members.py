"""From a name to a member: one of `fmus/`, a person's own `module:Class`, or any FMU file."""

from __future__ import annotations

from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Any

from twin import catalog, compiled
from twin.component import Component, PythonComponent
from twin.errors import CouplingError, described
from twin.member import Member, MemberVariable, RecordMember, declared_variables
from twin.variable import Role

if TYPE_CHECKING:
    from collections.abc import Mapping

    from twin.fmi.importer import FMUMember


class Form(StrEnum):
    """How the project's own components run; the results are the same to the bit."""

    fmu = "fmu"
    compiled = "compiled"
    interpreted = "interpreted"


def variables(component: str | type[Component], sizes: Mapping[str, Any] | None = None) -> Mapping[str, MemberVariable]:
    """The variables that a member made of `component` will have, without running anything.

    `sizes`: values of structural parameters, on which the shapes of others depend.
    """
    if isinstance(component, str) and component.endswith(".fmu"):
        from twin.fmi.importer import FMUMember

        member = FMUMember("member", component, dict(sizes or {}))
        member.close()
        return member.variables
    return declared_variables(catalog.component(component) if isinstance(component, str) else component)


def make(name: str, component: str | type[Component], values: Mapping[str, Any], form: Form, build: Path) -> Member:
    """A member with its start values set; a Python-side component runs as Python whatever `form` says."""
    if isinstance(component, str) and component.endswith(".fmu"):
        return imported(name, Path(component), values)
    cls = catalog.component(component) if isinstance(component, str) else component
    if form is Form.fmu and not issubclass(cls, PythonComponent):
        from twin.fmi import exporter

        member = imported(name, exporter.build(cls, "3.0", build), values)
        member.period_ns = cls.period_ns
        for variable in cls.variables:
            if variable.role is Role.derivative:
                member.rename(f"der({variable.name.removeprefix('der_')})", variable.name)
        return member
    native = form is Form.compiled and not issubclass(cls, PythonComponent)
    part = instance(name, cls, values)
    code = compiled.load_component(cls, build) if native else None
    kind = "python" if issubclass(cls, PythonComponent) else str(form if native else Form.interpreted)
    return RecordMember(name, part, code, identity={"kind": kind, "component": str(component)})


def instance(name: str, cls: type[Component], values: Mapping[str, Any]) -> Component:
    """An instance with start values that were checked against its variables."""
    try:
        part = cls(**values)
    except Exception as error:
        raise CouplingError(f"{name}: cannot be made: {described(error)}. Correct it there.") from None
    if not hasattr(part, "record"):
        raise CouplingError(f"{name}: {cls.__name__}.__init__ has to call super().__init__(**values). Add it.")
    return part


def imported(name: str, path: Path, values: Mapping[str, Any]) -> FMUMember:
    """Any FMU as a member."""
    from twin.fmi.importer import FMUMember

    return FMUMember(name, path, dict(values))
