"""Creation of members from a component name in `fmus/`, a class `module:Class`, or an FMU file."""

from __future__ import annotations

import inspect
from contextlib import suppress
from enum import StrEnum
from functools import partial
from itertools import count
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeGuard

from twin import clock, compiler
from twin.component import Component, PythonComponent, Role, catalog, resampled
from twin.coupling import Member, MemberVariable, RecordMember, declared_variables, driven
from twin.errors import CouplingError, ScenarioError, TwinError, described
from twin.store import Store

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Mapping

    from twin.fmi import FMUMember
    from twin.scenario.spec import Case, Exchange, MemberSpec


class Backend(StrEnum):
    """Execution backend of the project's components; all give bit-identical results."""

    fmu = "fmu"
    compiled = "compiled"
    interpreted = "interpreted"


def is_fmu(component: str | type[Component]) -> TypeGuard[str]:
    """Whether a component is the path of an FMU."""
    return isinstance(component, str) and component.endswith(".fmu")


def class_of(component: str | type[Component]) -> type[Component]:
    """Return the class of a component that is no FMU."""
    return catalog.component(component) if isinstance(component, str) else component


def variables(component: str | type[Component], sizes: Mapping[str, Any] | None = None) -> Mapping[str, MemberVariable]:
    """Return the variables of a component without instantiating its model.

    `sizes`: values of structural parameters, which determine the shapes of other variables.
    """
    if is_fmu(component):
        return closed_member(component, sizes or {}).variables
    return declared_variables(class_of(component))


def closed_member(path: str, sizes: Mapping[str, Any]) -> FMUMember:
    """Return a member of an FMU to look at, which holds no files. `sizes`: values of structural parameters."""
    from twin.fmi import FMUMember

    member = FMUMember("member", path, dict(sizes))
    member.close()
    return member


def has_source(cls: type[Component]) -> bool:
    """Whether the source of a component's functions is available for translation to C; false if `exec` defined them."""
    functions = (getattr(cls, name, None) for name in ("initialize", "step", "derivatives"))
    try:
        return all(inspect.findsource(function) for function in functions if inspect.isfunction(function))
    except OSError:
        return False


def component_of(spec: MemberSpec) -> str | type[Component]:
    """Return the component of a member; a sampled component is resampled at the scenario's period."""
    if spec.component.endswith(".fmu"):
        return spec.component
    if spec.period_ns and samples(cls := spec.made or catalog.component(spec.component)):
        return resampled(cls, whole_nanoseconds(spec.period_ns, f"{spec.locations.get('period', spec.where)}: period"))
    return spec.made or spec.component


def whole_nanoseconds(time: clock.Time, where: str) -> int:
    """Return a time in whole nanoseconds, the resolution of components; ScenarioError otherwise."""
    if not isinstance(time, int):
        nearest = clock.exact_text(round(time))
        raise ScenarioError(
            f"{where}: {clock.text(time)}: components count in whole nanoseconds. Use {nearest} or the like."
        )
    return time


def samples(cls: type[Component]) -> bool:
    """Whether a component has a changeable period; those inside a group belong to its members."""
    return bool(cls.period_ns) and not getattr(cls, "parts", None)


def tick(spec: MemberSpec) -> clock.Time:
    """Return a member's own sample period [ns], 0 if none; for an FMU its declared fixed internal step."""
    component = component_of(spec)
    if is_fmu(component):
        return clock.nanoseconds(closed_member(component, {}).fixed_step or 0.0)
    return class_of(component).period_ns


def communication(spec: MemberSpec) -> clock.Time | None:
    """Return the communication step [ns] of a member that the scenario sets; None: that of its component."""
    if spec.communication_ns or not spec.period_ns:
        return spec.communication_ns
    return spec.period_ns if isinstance(component := component_of(spec), str) or not samples(component) else None


def make(
    name: str,
    component: str | type[Component],
    values: Mapping[str, Any],
    backend: Backend,
    build: Path,
    exchange: Exchange | None = None,
    names: Mapping[str, str] | None = None,
    units: Mapping[str, str] | None = None,
) -> Member:
    """Create a member with its start values. `exchange` forces the FMU backend; `names`, `units`: as of a MemberSpec.

    Python-side components and those without source are interpreted regardless of `form`.
    """
    if is_fmu(component):
        return imported(name, Path(component), values, exchange, names, units)
    component_class = class_of(component)
    needs_fmu = exchange is not None and exchange.is_specified
    if needs_fmu and (issubclass(component_class, PythonComponent) or not has_source(component_class)):
        raise CouplingError(f"{name}: is Python-side and no FMU. Leave out `interface` and what belongs to it.")
    backend = (Backend.fmu if needs_fmu else backend) if has_source(component_class) else Backend.interpreted
    if backend is Backend.fmu and not issubclass(component_class, PythonComponent):
        return exported(name, component_class, values, build, exchange)
    native = backend is Backend.compiled and not issubclass(component_class, PythonComponent)
    component_instance = instance(name, component_class, values)
    code = compiler.load_component(component_class, build) if native else None
    member_kind = (
        "python" if issubclass(component_class, PythonComponent) else str(backend if native else Backend.interpreted)
    )
    return RecordMember(name, component_instance, code, identity={"kind": member_kind, "component": str(component)})


def derivative(name: str) -> str:
    """Return FMI's name of a derivative: `der(x)` for `der_x`, in a group `der(part.x)` for `part.der_x`."""
    prefix, dot, state = name.rpartition(".")
    return f"der({prefix}{dot}{state.removeprefix('der_')})"


def exported(
    name: str,
    component_class: type[Component],
    values: Mapping[str, Any],
    build: Path,
    exchange: Exchange | None = None,
) -> FMUMember:
    """Create a member from a component's FMU, which is built unless an up-to-date one is cached."""
    from twin.fmi import fmu_cache

    with Store(build).shared():
        member = imported(name, fmu_cache.build(component_class, "3.0", build), values, exchange)
    member.period_ns, member.driven = component_class.period_ns, frozenset(driven(component_class))
    member.rename({derivative(v.name): v.name for v in component_class.variables if v.role is Role.derivative})
    return member


def prebuild(
    components: Iterable[str | type[Component]],
    backend: Backend,
    build: Path,
    progress: Callable[[str, float], object],
) -> None:
    """Build the missing binaries of a run's members in parallel and report progress.

    Build errors are reported when the member is created.
    """
    compiler.reset_fingerprints()
    if backend is Backend.interpreted:
        return
    from twin.fmi import fmu_cache

    classes = dict.fromkeys(class_of(component) for component in dict.fromkeys(components) if not is_fmu(component))
    is_cached = fmu_cache.is_built if backend is Backend.fmu else compiler.is_translated
    missing: list[type[Component]] = []
    for cls in classes:
        with suppress(TwinError):
            if not issubclass(cls, PythonComponent) and not is_cached(cls, build):
                missing.append(cls)
    counter = count()

    def build_component(cls: type[Component]) -> None:
        done = next(counter)
        progress(f"building {compiler.model_name(cls)} ({done + 1} of {len(missing)})", done / len(missing))
        with suppress(TwinError):
            if backend is Backend.fmu:
                fmu_cache.build(cls, "3.0", build)
            else:
                compiler.load_component(cls, build)

    compiler.side_by_side(partial(build_component, cls) for cls in missing)


def translation_problems(cases: Iterable[Case], build: Path) -> list[str]:
    """Return a line for each reason why a component of a member cannot be translated to C; nothing is compiled.

    The C is stored in `build`, where the next run reads it.
    """
    compiler.reset_fingerprints()
    problems: dict[type[Component], list[str]] = {}
    lines = []
    for name, spec in (member for case in cases for member in case.members.items()):
        component = component_of(spec)
        if is_fmu(component):
            continue
        cls = class_of(component)
        if issubclass(cls, PythonComponent) or not has_source(cls):
            continue
        if cls not in problems:
            try:
                problems[cls] = compiler.problems(cls, build)
            except OSError:  # the folder cannot be written, which only the next run has to report
                problems[cls] = compiler.problems(cls)
            except TwinError as error:
                problems[cls] = str(error).splitlines()
        lines += [f"{spec.where}: member `{name}`: {text} Or use --backend interpreted." for text in problems[cls]]
    return list(dict.fromkeys(lines))


def instance(name: str, cls: type[Component], values: Mapping[str, Any]) -> Component:
    """Create an instance from checked start values; CouplingError if its constructor fails."""
    try:
        component = cls(**values)
    except Exception as error:
        raise CouplingError(f"{name}: cannot be made: {described(error)}. Correct it there.") from None
    if not hasattr(component, "record"):
        raise CouplingError(f"{name}: {cls.__name__}.__init__ has to call super().__init__(**values). Add it.")
    return component


def imported(
    name: str,
    path: Path,
    values: Mapping[str, Any],
    exchange: Exchange | None = None,
    names: Mapping[str, str] | None = None,
    units: Mapping[str, str] | None = None,
) -> FMUMember:
    """Create a member from an FMU file. `names`: names of its variables here -> its own; `units`: of those without."""
    from twin import fmi

    own_names = names or {}
    start_values = {own_name(key, own_names): value for key, value in values.items()}
    options = exchange.member_options if exchange is not None else {}
    created = fmi.member(name, path, start_values, **options)
    created.rename({own: key for key, own in own_names.items()})
    created.variables = fmi.units.stated(created.variables, units or {})
    return created


def own_name(name: str, names: Mapping[str, str]) -> str:
    """Return the FMU's own name of a variable, or of an element of it: `x[2]`."""
    variable, bracket, index = name.partition("[")
    return names.get(name) or f"{names.get(variable, variable)}{bracket}{index}"
