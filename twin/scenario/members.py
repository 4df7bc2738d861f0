"""From a name to a member: one of `fmus/`, a person's own `module:Class`, or any FMU file."""

from __future__ import annotations

from contextlib import suppress
from enum import StrEnum
from functools import partial
from itertools import count
from pathlib import Path
from typing import TYPE_CHECKING, Any

from twin import compiler
from twin.component import Component, PythonComponent, Role, catalog
from twin.coupling import Member, MemberVariable, RecordMember, declared_variables
from twin.errors import CouplingError, TwinError, described

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Mapping

    from twin.fmi import FMUMember


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
        from twin.fmi import FMUMember

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
    code = compiler.load_component(cls, build) if native else None
    kind = "python" if issubclass(cls, PythonComponent) else str(form if native else Form.interpreted)
    return RecordMember(name, part, code, identity={"kind": kind, "component": str(component)})


def prebuild(
    components: Iterable[str | type[Component]], form: Form, build: Path, progress: Callable[[str, float], object]
) -> None:
    """Build what the members of a run need and lack, side by side on all cores, and show it.

    What cannot be built is told when its member is made.
    """
    if form is Form.interpreted:
        return
    from twin.fmi import exporter

    classes = {one: catalog.component(one) if isinstance(one, str) else one
               for one in dict.fromkeys(components) if not str(one).endswith(".fmu")}  # fmt: skip
    is_there = exporter.is_built if form is Form.fmu else compiler.is_translated
    lacking: list[type[Component]] = []
    for cls in dict.fromkeys(classes.values()):
        with suppress(TwinError):
            if not issubclass(cls, PythonComponent) and not is_there(cls, build):
                lacking.append(cls)
    done = count()

    def make_one(cls: type[Component]) -> None:
        progress(f"building {compiler.model_name(cls)}", next(done) / len(lacking))
        with suppress(TwinError):
            if form is Form.fmu:
                exporter.build(cls, "3.0", build)
            else:
                compiler.load_component(cls, build)

    compiler.side_by_side(partial(make_one, cls) for cls in lacking)


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
    from twin.fmi import FMUMember

    return FMUMember(name, path, dict(values))
