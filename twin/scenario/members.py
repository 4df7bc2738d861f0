"""From a name to a member: one of `fmus/`, a person's own `module:Class`, or any FMU file."""

from __future__ import annotations

import inspect
from contextlib import suppress
from enum import StrEnum
from functools import partial
from itertools import count
from pathlib import Path
from typing import TYPE_CHECKING, Any

from twin import clock, compiler
from twin.component import Component, PythonComponent, Role, catalog, resampled
from twin.coupling import Member, MemberVariable, RecordMember, declared_variables, driven
from twin.errors import CouplingError, ScenarioError, TwinError, described

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Mapping

    from twin.fmi import FMUMember
    from twin.scenario.spec import Exchange, MemberSpec


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


def has_source(cls: type[Component]) -> bool:
    """Whether the text of a component's functions can be found, from which C is made; not if `exec` defined them."""
    functions = (getattr(cls, name, None) for name in ("initialize", "step", "derivatives"))
    try:
        return all(inspect.findsource(function) for function in functions if inspect.isfunction(function))
    except OSError:
        return False


def component_of(spec: MemberSpec) -> str | type[Component]:
    """What a member is made of; a sampled component as one that samples at the period that the scenario gives."""
    if spec.component.endswith(".fmu"):
        return spec.component
    if spec.period_ns and samples(cls := spec.made or catalog.component(spec.component)):
        return resampled(cls, whole(spec.period_ns, f"{spec.places.get('period', spec.where)}: period"))
    return spec.made or spec.component


def whole(time: clock.Time, where: str) -> int:
    """A time in whole nanoseconds, which components count in."""
    if not isinstance(time, int):
        near = clock.exact_text(round(time))
        raise ScenarioError(
            f"{where}: {clock.text(time)}: components count in whole nanoseconds. Use {near} or the like."
        )
    return time


def samples(cls: type[Component]) -> bool:
    """Whether a component has a period of its own that can be changed: those inside a group are its members'."""
    return bool(cls.period_ns) and not getattr(cls, "parts", None)


def tick(spec: MemberSpec) -> clock.Time:
    """What a member samples at by itself [ns], 0 if it does not: also an FMU that declares a fixed internal step."""
    made = component_of(spec)
    if isinstance(made, str) and made.endswith(".fmu"):
        from twin.fmi import FMUMember

        member = FMUMember("member", made)
        member.close()
        return clock.nanoseconds(member.fixed_step or 0.0)
    return (catalog.component(made) if isinstance(made, str) else made).period_ns


def communication(spec: MemberSpec) -> clock.Time | None:
    """How often a member takes inputs and publishes [ns] where the scenario says so; else as its component does."""
    if spec.communication_ns or not spec.period_ns:
        return spec.communication_ns
    return spec.period_ns if isinstance(made := component_of(spec), str) or not samples(made) else None


def make(
    name: str,
    component: str | type[Component],
    values: Mapping[str, Any],
    form: Form,
    build: Path,
    exchange: Exchange | None = None,
) -> Member:
    """A member with its start values set. Python-side components, and those without a source, run as Python.

    That is, whatever `form` says; and those that are integrated by a solver (`exchange`) as an FMU.
    """
    if isinstance(component, str) and component.endswith(".fmu"):
        return imported(name, Path(component), values, exchange)
    cls = catalog.component(component) if isinstance(component, str) else component
    asked = exchange is not None and exchange.is_asked_for
    if asked and (issubclass(cls, PythonComponent) or not has_source(cls)):
        raise CouplingError(f"{name}: is Python-side and no FMU. Leave out `interface` and what belongs to it.")
    form = (Form.fmu if asked else form) if has_source(cls) else Form.interpreted
    if form is Form.fmu and not issubclass(cls, PythonComponent):
        return exported(name, cls, values, build, exchange)
    native = form is Form.compiled and not issubclass(cls, PythonComponent)
    part = instance(name, cls, values)
    code = compiler.load_component(cls, build) if native else None
    kind = "python" if issubclass(cls, PythonComponent) else str(form if native else Form.interpreted)
    return RecordMember(name, part, code, identity={"kind": kind, "component": str(component)})


def derivative(name: str) -> str:
    """FMI's name of a derivative: `der(x)` for `der_x`, in a group `der(part.x)` for `part.der_x`."""
    part, dot, own = name.rpartition(".")
    return f"der({part}{dot}{own.removeprefix('der_')})"


def exported(
    name: str, cls: type[Component], values: Mapping[str, Any], build: Path, exchange: Exchange | None = None
) -> FMUMember:
    """A component's FMU as a member, built if it is not there as it would be built now."""
    from twin.fmi import fmu_cache

    member = imported(name, fmu_cache.build(cls, "3.0", build), values, exchange)
    member.period_ns, member.driven = cls.period_ns, frozenset(driven(cls))
    for variable in cls.variables:
        if variable.role is Role.derivative:
            member.rename(derivative(variable.name), variable.name)
    return member


def prebuild(
    components: Iterable[str | type[Component]],
    form: Form,
    build: Path,
    progress: Callable[[str, float], object],
) -> None:
    """Build what the members of a run need and lack, side by side on all cores, and show it.

    What cannot be built is told when its member is made.
    """
    compiler.reset_fingerprints()
    if form is Form.interpreted:
        return
    from twin.fmi import fmu_cache

    classes = {
        one: catalog.component(one) if isinstance(one, str) else one
        for one in dict.fromkeys(components)
        if not str(one).endswith(".fmu")
    }
    is_there = fmu_cache.is_built if form is Form.fmu else compiler.is_translated
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
                fmu_cache.build(cls, "3.0", build)
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


def imported(name: str, path: Path, values: Mapping[str, Any], exchange: Exchange | None = None) -> FMUMember:
    """Any FMU as a member."""
    from twin.fmi import member

    if exchange is None:
        return member(name, path, dict(values))
    solver, tolerance = exchange.solver, exchange.solver_tolerance
    return member(name, path, dict(values), interface=exchange.interface, solver=solver, tolerance=tolerance)
