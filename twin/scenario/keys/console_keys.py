"""`console:` of a scenario: operator controls, listed parameters, and their ranges in the units of the variables."""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING, Any

from twin.errors import CouplingError
from twin.scenario.keys import quantities
from twin.scenario.resolution.variable_names import find, nearest

if TYPE_CHECKING:
    from collections.abc import Callable, Collection, Mapping

    from twin.coupling import Catalog, MemberVariable
    from twin.scenario.keys.schema import ControlKeys, TargetKeys, WarningKeys
    from twin.scenario.spec import Case, ScenarioSpec


@dataclass(frozen=True)
class ResolvedControl:
    """A control resolved against its input. `low`, `high`, `rest` are in the input's unit; 0 and 1 for a Boolean."""

    spec: ControlKeys
    variable: MemberVariable
    low: float
    high: float
    rest: float
    along: Mapping[str, Any]


def check_console(scenario: ScenarioSpec) -> list[str]:
    """Check controls without variables: variants that do not exist, keys or buttons assigned twice."""
    problems: list[str] = []
    control_by_device: dict[tuple[str, Any], ControlKeys] = {}
    variant_names = [case.variant for case in scenario.variants]
    for i, control in enumerate(scenario.console):
        where = location(scenario, "controls", i)
        problems += [
            f"{where}: console: there is no variant `{name}`.{nearest(name, variant_names)}"
            for name in control.variants
            if name not in variant_names
        ]
        devices = [("stick", control.stick), ("axis", control.axis), *(("key", key) for key in control.keys)]
        devices += [("button", button) for button in control.buttons]
        for device in (pair for pair in devices if pair[1] not in ("", None)):
            other_control = control_by_device.setdefault(device, control)
            if other_control is not control and share_variant(other_control, control):
                problems.append(
                    f"{where}: console: {device[0]} {device[1]} moves {other_control.input} too. Use another one."
                )
    return problems


def location(scenario: ScenarioSpec, *keys: str | int) -> str:
    """Return file:line of a key of `console`."""
    return str(scenario.tree.find(("console", *keys)).location)


def share_variant(first: ControlKeys, second: ControlKeys) -> bool:
    """Whether two controls are active in the same variant."""
    return not first.variants or not second.variants or not {*first.variants}.isdisjoint(second.variants)


def in_any_case(resolve: Callable[[Catalog], Any]) -> Callable[[Case, Catalog], Any]:
    """Return a function of a case and its catalog that ignores the case."""
    return lambda _case, catalog: resolve(catalog)


def check_controls(scenario: ScenarioSpec, catalogs: Mapping[str, Catalog]) -> list[str]:
    """Check controls against the members' variables."""
    problems = []
    for i, control in enumerate(scenario.console):
        reasons = []
        cases = [case for case in scenario.variants if case.variant in (control.variants or catalogs)]
        for case in cases:
            try:
                resolve_control(control, catalogs[case.variant], connected(case, catalogs[case.variant]))
            except CouplingError as error:
                reasons.append(error.problems[0])
        if reasons and (control.variants or len(reasons) == len(cases)):
            problems.append(f"{location(scenario, 'controls', i)}: console: {reasons[0]}")
    resolvers: dict[tuple[Any, ...], Callable[[Case, Catalog], Any]] = {
        ("parameters", name): partial(slider_range, scenario, name=name) for name in scenario.console_parameters
    }
    if targets := scenario.console_targets:
        resolvers["targets",] = in_any_case(partial(resolve_targets, targets))
    for i, warning in enumerate(scenario.console_warnings):
        resolvers["warnings", i] = in_any_case(partial(resolve_warning, warning))
    for key, resolve in resolvers.items():
        reasons = []
        for case in scenario.variants:
            try:
                resolve(case, catalogs[case.variant])
            except CouplingError as error:
                reasons.append(error.problems[0])
        if len(reasons) == len(scenario.variants):
            problems.append(f"{location(scenario, *key)}: console: {reasons[0]}")
    return problems


def resolve_targets(spec: TargetKeys, catalog: Catalog) -> dict[str, Any]:
    """Return targets in the signal's unit: signal, tolerance, points, path and hint if given; CouplingError if they do not fit the signal."""
    variable, _ = find(spec.signal, catalog)
    points = {}
    for name, point in spec.points.items():
        if len(point) != variable.size:
            size = f"{variable.size} values" if variable.size > 1 else "one value"
            raise CouplingError(f"{spec.signal}: target {name}: expected {size}, not {len(point)}.")
        points[name] = [number(value, variable, f"{spec.signal}: target {name}") for value in point]
    tolerance = number(spec.tolerance, variable, f"{spec.signal}: tolerance")
    if not tolerance > 0.0:
        raise CouplingError(f"{spec.signal}: tolerance: expected a distance above zero.")
    path, _ = find(spec.signals[1], catalog)
    if path.unit != variable.unit:
        raise CouplingError(f"{spec.path}: is in {path.unit or '1'}. Its travel is a path in {variable.unit or '1'}.")
    more = {key: text for key in ("path", "hint") if (text := getattr(spec, key))}
    return {"signal": spec.signal, "tolerance": tolerance, "points": points, **more}


def resolve_warning(spec: WarningKeys, catalog: Catalog) -> dict[str, Any]:
    """Return a warning with its limits in the signal's unit; CouplingError for an array or a text.

    A limit above zero is one of the magnitude, such as of a force in either direction: `below` is its negative.
    """
    for name in spec.signals:
        variable, index = find(name, catalog)
        if variable.shape or index or variable.dtype.kind == "O":
            raise CouplingError(f"{name}: expected a single number, not an array, an element of one, or a text.")
    unit = find(spec.signal, catalog)[0].unit
    if variable.unit != unit:
        raise CouplingError(
            f"{spec.minus}: is in {variable.unit or '1'}. It is subtracted from a value in {unit or '1'}."
        )
    for name in spec.remedy:
        find(name, catalog)
    above = number(spec.above, variable, f"{spec.signal}: above")
    more: dict[str, Any] = {key: value for key in ("minus", "remedy") if (value := getattr(spec, key))}
    more |= {"below": -above} if above > 0.0 else {}
    return {"signal": spec.signal, "above": above, "text": spec.text, **more}


def slider_range(scenario: ScenarioSpec, case: Case, catalog: Catalog, name: str) -> tuple[float, float] | None:
    """Return the ends of a listed parameter's slider in its unit, or None; CouplingError if it cannot be set in a session."""
    variable, _ = find(name, catalog)
    is_tunable = variable.causality == "parameter" and variable.variability == "tunable"
    if not is_tunable and (variable.causality != "input" or name.partition("[")[0] in connected(case, catalog)):
        raise CouplingError(f"{name} is neither a tunable parameter nor a free input. Name one that a person can set.")
    ends = scenario.console_parameters[name]
    if not ends:
        return None
    if len(ends) != 2:
        raise CouplingError(f"{name}: expected both ends of its slider, such as [0.5 Hz, 2 Hz], or [] for none.")
    low, high = (number(end, variable, name) for end in ends)
    for value in (low, high):
        violation, advice = variable.outside(value)
        if violation:
            raise CouplingError(f"{name}: range{violation}. {advice}")
    if not low < high:
        raise CouplingError(f"{name}: the range is empty. Write the lower end first, such as [0.5 Hz, 2 Hz].")
    return low, high


def controls_of(scenario: ScenarioSpec, case: Case, catalog: Catalog) -> list[ResolvedControl]:
    """Return the controls of a case whose inputs exist and are not connected; CouplingError if the control names variants."""
    targets, available = connected(case, catalog), []
    for spec in scenario.console:
        if spec.variants and case.variant not in spec.variants:
            continue
        try:
            available.append(resolve_control(spec, catalog, targets))
        except CouplingError:
            if spec.variants:
                raise
    return available


def connected(case: Case, catalog: Catalog) -> set[str]:
    """Return the connected inputs of a case, including arrays of which an element is connected."""
    targets = {connection.target for connection in case.system(catalog).single()[0]}
    return targets | {name.partition("[")[0] for name in targets}


def resolve_control(spec: ControlKeys, catalog: Catalog, targets: Collection[str]) -> ResolvedControl:
    """Resolve a control against its input; CouplingError if it is invalid."""
    variable = free_input(spec.input, catalog, targets)
    for name, value in spec.along.items():
        quantities.resolve(value, free_input(name, catalog, targets), name)
    if variable.type == "Boolean":
        if spec.range is not None:
            raise CouplingError(f"{spec.input} is true or false. Leave `range` out.")
        pressed = quantities.resolve(False if spec.rest is None else spec.rest, variable, f"{spec.input}: rest")
        return ResolvedControl(spec, variable, 0.0, 1.0, float(pressed), spec.along)
    if spec.range is None:
        raise CouplingError(f"{spec.input}: `range` is missing. Say how far it goes, such as `range: 20 mm/s`.")
    rest = number(0.0 if spec.rest is None else spec.rest, variable, f"{spec.input}: rest")
    limits = spec.range if isinstance(spec.range, list) else [spec.range]
    if len(limits) not in (1, 2):
        raise CouplingError(f"{spec.input}: range: expected one value or two, such as [-5 mm/s, 20 mm/s].")
    numbers = [number(value, variable, f"{spec.input}: range") for value in limits]
    low, high = numbers if len(numbers) == 2 else (2 * rest - numbers[0], numbers[0])
    if not low <= rest <= high or low == high:
        text = f"{variable.shown(low)} to {variable.shown(high)}"
        raise CouplingError(f"{spec.input}: rest {variable.shown(rest)} is not inside {text}. Change range or rest.")
    for value in (low, high):
        violation, advice = variable.outside(value)
        if violation:
            raise CouplingError(f"{spec.input}: range{violation}. {advice}")
    return ResolvedControl(spec, variable, low, high, rest, spec.along)


def number(value: Any, variable: MemberVariable, what: str) -> float:
    """Convert a limit of a range to the input's unit."""
    return quantities.number(value, variable.unit, what)


def free_input(name: str, catalog: Catalog, targets: Collection[str]) -> MemberVariable:
    """Return an unconnected scalar input or element of an input; CouplingError otherwise."""
    variable, index = find(name, catalog)
    if variable.causality != "input":
        raise CouplingError(f"{name} is {variable.causality}, not an input. A person moves inputs alone.")
    if variable.shape or variable.dtype.kind == "O":
        what = f"an array of {variable.size}. Name one element, such as {name}[1]" if variable.shape else "no number"
        raise CouplingError(f"{name} is {what}.")
    if name in targets or (index and name.rpartition("[")[0] in targets):
        raise CouplingError(f"{name} is connected and would be written over. Disconnect it, or name a free input.")
    return variable
