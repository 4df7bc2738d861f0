"""`console:` of a scenario: by what a person moves which inputs, as numbers once the inputs are known."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from twin.errors import CouplingError
from twin.scenario import quantities
from twin.scenario.spec import ControlSpec
from twin.scenario.variable_names import find, nearest

if TYPE_CHECKING:
    from collections.abc import Collection, Mapping

    from twin.coupling import Catalog, MemberVariable
    from twin.scenario.schema import ScenarioKeys
    from twin.scenario.spec import Case, Scenario
    from twin.scenario.yaml_node import Node


@dataclass(frozen=True)
class Control:
    """A control whose input is known. `low`, `high`, `rest`: in the input's unit; of a Boolean 0 and 1."""

    spec: ControlSpec
    variable: MemberVariable
    low: float
    high: float
    rest: float
    along: Mapping[str, Any]


def controls(keys: ScenarioKeys, tree: Node) -> tuple[ControlSpec, ...]:
    """The controls as they are written."""
    return tuple(
        ControlSpec(
            one.input, one.label or one.input, one.description, one.range, one.rest, one.dead_zone, dict(one.along),
            one.stick, tuple(one.keys), one.axis, one.reverse, tuple(one.buttons), tuple(one.variants),
            str(tree.find(("console", i)).place),
        )
        for i, one in enumerate(keys.console)
    )  # fmt: skip


def check_console(scenario: Scenario) -> list[str]:
    """What is wrong with the controls by the file alone: variants that do not exist, keys that two of them have."""
    found, taken = [], dict[tuple[str, Any], ControlSpec]()
    known = [case.variant for case in scenario.variants]
    for one in scenario.console:
        found += [
            f"{one.where}: console: there is no variant `{name}`.{nearest(name, known)}"
            for name in one.variants
            if name not in known
        ]
        devices = [("stick", one.stick), ("axis", one.axis), *(("key", key) for key in one.keys)]
        devices += [("button", button) for button in one.buttons]
        for device in (pair for pair in devices if pair[1] not in ("", None)):
            other = taken.setdefault(device, one)
            if other is not one and meet(other, one):
                found.append(f"{one.where}: console: {device[0]} {device[1]} moves {other.input} too. Use another one.")
    return found


def meet(one: ControlSpec, other: ControlSpec) -> bool:
    """Whether two controls are there in one variant."""
    return not one.variants or not other.variants or not {*one.variants}.isdisjoint(other.variants)


def check_controls(scenario: Scenario, catalogs: Mapping[str, Catalog]) -> list[str]:
    """What is wrong with the controls once the members' variables are known."""
    found = []
    for one in scenario.console:
        wrong = []
        cases = [case for case in scenario.variants if case.variant in (one.variants or catalogs)]
        for case in cases:
            try:
                resolved(one, catalogs[case.variant], connected(case, catalogs[case.variant]))
            except CouplingError as error:
                wrong.append(error.problems[0])
        if wrong and (one.variants or len(wrong) == len(cases)):
            found.append(f"{one.where}: console: {wrong[0]}")
    return found


def controls_of(scenario: Scenario, case: Case, catalog: Catalog) -> list[Control]:
    """The controls of a case: those that are meant for it, and whose inputs are there and free."""
    targets, found = connected(case, catalog), []
    for one in scenario.console:
        if one.variants and case.variant not in one.variants:
            continue
        try:
            found.append(resolved(one, catalog, targets))
        except CouplingError:
            if one.variants:
                raise
    return found


def connected(case: Case, catalog: Catalog) -> set[str]:
    """The inputs that a case connects; an array of which an element is connected counts too."""
    targets = {one.target for one in case.system(catalog).single()[0]}
    return targets | {name.partition("[")[0] for name in targets}


def resolved(spec: ControlSpec, catalog: Catalog, targets: Collection[str]) -> Control:
    """A control as numbers; CouplingError says what is wrong with it."""
    variable = free_input(spec.input, catalog, targets)
    for name, one in spec.along.items():
        quantities.resolve(one, free_input(name, catalog, targets), name)
    if variable.type == "Boolean":
        if spec.range is not None:
            raise CouplingError(f"{spec.input} is true or false. Leave `range` out.")
        pressed = quantities.resolve(False if spec.rest is None else spec.rest, variable, f"{spec.input}: rest")
        return Control(spec, variable, 0.0, 1.0, float(pressed), spec.along)
    if spec.range is None:
        raise CouplingError(f"{spec.input}: `range` is missing. Say how far it goes, such as `range: 20 mm/s`.")
    rest = number(0.0 if spec.rest is None else spec.rest, variable, f"{spec.input}: rest")
    ends = spec.range if isinstance(spec.range, list) else [spec.range]
    if len(ends) not in (1, 2):
        raise CouplingError(f"{spec.input}: range: expected one value or two, such as [-5 mm/s, 20 mm/s].")
    numbers = [number(one, variable, f"{spec.input}: range") for one in ends]
    low, high = numbers if len(numbers) == 2 else (2 * rest - numbers[0], numbers[0])
    if not low <= rest <= high or low == high:
        text = f"{variable.shown(low)} to {variable.shown(high)}"
        raise CouplingError(f"{spec.input}: rest {variable.shown(rest)} is not inside {text}. Change range or rest.")
    for one in (low, high):
        wrong, advice = variable.outside(one)
        if wrong:
            raise CouplingError(f"{spec.input}: range{wrong}. {advice}")
    return Control(spec, variable, low, high, rest, spec.along)


def number(given: Any, variable: MemberVariable, what: str) -> float:
    """An end of a range, in the input's unit."""
    return quantities.number(given, variable.unit, what)


def free_input(name: str, catalog: Catalog, targets: Collection[str]) -> MemberVariable:
    """The input, or its element, that nothing is connected to; CouplingError if it is none."""
    variable, index = find(name, catalog)
    if variable.causality != "input":
        raise CouplingError(f"{name} is {variable.causality}, not an input. A person moves inputs alone.")
    if variable.shape or variable.dtype.kind == "O":
        what = f"an array of {variable.size}. Name one element, such as {name}[1]" if variable.shape else "no number"
        raise CouplingError(f"{name} is {what}.")
    if name in targets or (index and name.rpartition("[")[0] in targets):
        raise CouplingError(f"{name} is connected and would be written over. Disconnect it, or name a free input.")
    return variable
