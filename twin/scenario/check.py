"""Checks of names, times and values, first without and then with the variables of the members.

The graph of members and connections (sources, units and causality of connections, loops, periods) is checked by
`twin.coupling.CoupledSystem`.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from twin import clock
from twin.errors import CouplingError, ScenarioError, suggestion
from twin.scenario.keys import quantities
from twin.scenario.keys.console_keys import check_console, check_controls
from twin.scenario.keys.dimensions import check_units, expression_uses
from twin.scenario.keys.key_types import NAME
from twin.scenario.resolution.variable_names import find, inside, matching, nearest, no_element
from twin.scenario.spec import SETTABLE

READABLE = ("output", "local")  # causalities of what a condition may read
MOST_STEPS = 1e12  # of a run; a fast machine computes 1e7 steps per second

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping

    from twin.component import Component
    from twin.coupling import Catalog
    from twin.results import Expression
    from twin.scenario.keys.conditions import Comparison
    from twin.scenario.keys.schema import ScenarioKeys
    from twin.scenario.spec import Case, EventSpec, MemberSpec, ScenarioSpec
    from twin.scenario.yaml_files.yaml_node import Node


def check(scenario: ScenarioSpec, keys: ScenarioKeys, tree: Node, trees: dict[str, Node]) -> list[str]:
    """Return every problem that can be found without the members' variables."""
    problems: list[str] = []
    if keys.stop_time is None and "stop_time" not in scenario.tree.entries:
        advice = "Use --set stop_time=10" if scenario.path.suffix == ".ssp" else "Add it, such as `stop_time: 10 s`"
        problems.append(f"{tree.location.file}: `stop_time` is missing. {advice}.")
    if "members" not in scenario.tree.entries and not any(case.members for case in scenario.variants):
        problems.append(
            f"{tree.location.file}: `members` is missing. Add it, such as `servo: {{component: servomotor}}`."
        )
    if keys.seed is not None:
        problems.append(f"{tree.find(('seed',)).location}: seed and seeds are both given. Keep one.")
    repeated = sorted({seed for seed in keys.seeds if keys.seeds.count(seed) > 1})
    problems += [
        f"{tree.find(('seeds',)).location}: seed {seed} is given twice. Every seed is one run." for seed in repeated
    ]
    for case in scenario.variants:
        problems += check_case(case, trees[case.variant], keys)
    members = {name for case in scenario.variants for name in case.members}
    for group, names in scenario.groups.items():
        if not NAME.fullmatch(group):
            problems.append(
                f"{tree.find(('groups', group)).location}: group `{group}`: use letters, digits and _ only."
            )
        for index, name in enumerate(names):
            if name not in members:
                location = tree.find(("groups", group, index)).location
                problems.append(f"{location}: group `{group}`: there is no member `{name}`.{nearest(name, members)}")
    members |= {analysis.name for analysis in scenario.analyses}
    problems += check_sets(tree, trees) + check_console(scenario)
    for where, name in references(scenario, keys, tree):
        member = name.partition(".")[0]
        if "*" not in member and member not in members:
            problems.append(f"{where}: there is no member `{member}`.{nearest(member, members)}")
    return problems


def check_sets(tree: Node, trees: dict[str, Node]) -> list[str]:
    """Report parameter sets for components that do not exist; sets for components that no member uses are allowed."""
    from twin.component import catalog

    roots = [entry.entries["parameter_sets"] for entry in (tree, *trees.values()) if "parameter_sets" in entry.entries]
    locations = {name: node.location for sets in roots for entry in sets.items for name, node in entry.entries.items()}
    names = (name for name in locations if not set(":#") & set(name) and not name.endswith(".fmu"))
    missing = [name for name in names if catalog.component_folder(name) is None]
    component_names = catalog.names() if missing else []
    return [
        f"{locations[name]}: parameter_sets: there is no component `{name}`.{nearest(name, component_names)}"
        for name in missing
        if name not in component_names
    ]


def references(scenario: ScenarioSpec, keys: ScenarioKeys, tree: Node) -> Iterable[tuple[str, str]]:
    """Yield (file:line, `member.variable`) for every reference in record, metrics, expectations, plots and scenes."""
    for index, pattern in enumerate(keys.record.variables):
        yield str(tree.find(("record", "variables", index)).location), pattern
    for use in expression_uses(scenario):
        yield from ((use.where, str(signal)) for signal in use.expression.signals if use.needed is not None)
    for scene in scenario.scenes:
        yield from ((scene.where, name) for name, _, _ in scene.arrays)
        yield from ((scene.where, name) for name in (scene.space.all_names if scene.space else ()))


def check_case(case: Case, tree: Node, keys: ScenarioKeys) -> list[str]:
    """Check members, connections, times and events of one variant."""
    problems: list[str] = []
    for name, member in case.members.items():
        if not NAME.fullmatch(name):
            problems.append(f"{member.where}: member `{name}`: use letters, digits and _ only.")
        if not member.component:
            hint = suggestion(name, case.members.keys() - {name}, "`")
            advice = f"{hint} A new one needs it" if hint else "Add one"
            problems.append(f"{member.where}: member `{name}` has no component. {advice}: `component: servomotor`.")
        elif member.component.endswith(".fmu"):
            problems += missing_file(name, member)
    for connection in case.connections:
        for end in (connection.source, connection.target):
            owner = end.partition(".")[0]
            if owner not in case.members:
                problems.append(f"{connection.where}: there is no member `{owner}`.{nearest(owner, case.members)}")
    stop = tree.find(("stop_time",)).location
    if keys.stop_time is not None or case.stop_ns:
        if case.stop_ns <= case.start_ns:
            problems.append(
                f"{stop}: stop_time {clock.text(case.stop_ns)} is not after start_time {clock.text(case.start_ns)}."
            )
        elif (case.stop_ns - case.start_ns) % case.step_ns:
            problems.append(
                f"{stop}: the run of {clock.text(case.stop_ns - case.start_ns)} is not a multiple of step"
                f" {clock.text(case.step_ns)}. Change stop_time or step."
            )
        elif (case.stop_ns - case.start_ns) / case.step_ns > MOST_STEPS:
            problems.append(
                f"{stop}: {float((case.stop_ns - case.start_ns) / case.step_ns):.3g} steps of {clock.text(case.step_ns)} until the end"
                f" are more than {MOST_STEPS:.0e}, which take days. Give a larger step or an earlier stop_time."
            )
    if keys.valid_until is not None and case.stop_ns > keys.valid_until.stop_time:
        problems.append(
            f"{stop}: stop_time {clock.text(case.stop_ns)} is later than {clock.text(keys.valid_until.stop_time)}, until which this"
            f" scenario is valid: {keys.valid_until.reason}"
        )
    try:
        case.algorithm.divisions(case.step_ns)
    except CouplingError as error:
        problems.append(f"{tree.find(('algorithm',)).location}: {error}")
    interval = keys.record.every
    if interval is not None and interval % case.step_ns:
        problems.append(misfit_of_record(interval, case.step_ns, tree))
    return problems + check_events(case)


def misfit_of_record(interval: clock.Time, step: clock.Time, tree: Node) -> str:
    """Return the error text for a recording interval that is no multiple of the step."""
    own = tree.find(("step",))
    if step < interval or own.value is None:
        where, text = tree.find(("record", "every")).location, clock.text(interval)
        fits = clock.parts_near(interval, step)
        return f"{where}: every {text} is not a multiple of step {clock.text(step)}. Give a step of {fits}."
    unit = " A number without a unit is in seconds." if isinstance(own.value, int | float) else ""
    return (
        f"{own.location}: step {clock.text(step)} is longer than {clock.text(interval)}, the `every` of `record`."
        f"{unit} Give at most {clock.text(interval)}."
    )


def check_buffers(
    where: str, name: str, member: MemberSpec, values: dict[str, Any], classes: Mapping[str, type[Component]]
) -> list[str]:
    """Report parameters that exceed the size of a buffer of the component."""
    from twin.component import buffers

    component_class = classes.get(member.component)
    if component_class is None or not (period_ns := member.period_ns or component_class.period_ns):
        return []
    overflows = buffers.overflows(component_class, values, float(clock.seconds(period_ns)))
    locations = (member.locations.get(overflow.partition(" ")[0], where) for overflow in overflows)
    return [f"{at}: {name}.{overflow}" for at, overflow in zip(locations, overflows, strict=True)]


def missing_file(name: str, member: MemberSpec) -> list[str]:
    """Report an FMU file that does not exist."""
    from pathlib import Path

    path = Path(member.component)
    if path.is_file():
        return []
    file_names = [other.name for other in path.parent.glob("*.fmu")] if path.parent.is_dir() else []
    return [f"{member.where}: member `{name}`: there is no file {path}.{nearest(path.name, file_names)}"]


def check_events(case: Case) -> list[str]:
    """Check the times and members of events, conditions and faults, and that releases follow an override."""
    problems = check_times(case)
    changes = [action for condition in case.conditions for action in condition.actions]
    overridden = {action.variable for action in changes if action.kind == "override"}  # at any time
    for event in case.actions:
        if (owner := event.variable.partition(".")[0]) not in case.members:
            problems.append(f"{event.where}: there is no member `{owner}`.{nearest(owner, case.members)}")
    all_overridden = overridden | {event.variable for event in case.events if event.kind == "override"}
    problems += [
        f"{action.where}: {action.variable} is released but never overridden."
        for action in changes
        if action.kind == "release" and action.variable not in all_overridden
    ]
    for event in case.events:
        when = clock.text(event.time_ns)
        if outside := outside_run(event.time_ns, case):
            problems.append(f"{event.where}: event {outside}")
        elif (event.time_ns - case.start_ns) % case.step_ns:
            step = clock.text(case.step_ns)
            problems.append(f"{event.where}: event at {when} is no multiple of step {step}. Move it.")
        if event.kind == "override":
            overridden.add(event.variable)
        elif event.kind == "release" and event.variable not in overridden:
            problems.append(f"{event.where}: {event.variable} is released but was not overridden before {when}.")
    for fault in case.faults:
        if outside := outside_run(fault.time_ns, case):
            problems.append(f"{fault.where}: fault {outside}")
    return problems


def outside_run(time_ns: clock.Time, case: Case) -> str:
    """Return the error text for a time outside the run, or ""."""
    if case.start_ns <= time_ns < case.stop_ns:
        return ""
    span = f"{clock.text(case.start_ns)} to {clock.text(case.stop_ns)}"
    return f"at {clock.text(time_ns)} is outside the run, {span}. Move it or the run's end."


def check_against(
    scenario: ScenarioSpec, catalogs: Mapping[str, Catalog], classes: Mapping[str, type[Component]]
) -> list[str]:
    """Check parameters, events, record, metrics and plots against `catalogs`: variant -> member -> variables.

    `classes`: of components by name; those that are not there may have buffers of any size.
    """
    problems: list[str] = []
    for case in scenario.variants:
        problems += check_values(case, catalogs[case.variant], classes)
    try:
        all_catalogs = scenario.with_derived(catalogs)
    except ScenarioError as error:
        return [*problems, *error.problems]
    problems += check_names(scenario, all_catalogs) + check_units(scenario, all_catalogs) + check_rows(scenario)
    if scenario.scenes:
        from twin.scenario.keys.scene_keys import check_arrays

        problems += check_arrays(scenario, all_catalogs)
    problems += check_controls(scenario, catalogs)
    return list(dict.fromkeys(problems))


def check_values(case: Case, catalog: Catalog, classes: Mapping[str, type[Component]]) -> list[str]:
    """Check parameters, events and conditions of a case. `classes`: as of `check_against`."""
    problems: list[str] = []
    for name, member in case.members.items():
        values, value_problems = member.values(name, catalog[name])
        problems += value_problems or check_buffers(member.where, name, member, values, classes)
    targets = {connection.target for connection in case.system(catalog).single()[0]}
    for event in case.actions:
        problems += event_problems(event, catalog, targets) or event_overflows(event, case, catalog, classes)
    return problems + check_conditions(case, catalog)


def check_names(scenario: ScenarioSpec, catalogs: Mapping[str, Catalog]) -> list[str]:
    """Check that recorded and plotted signals exist in at least one variant and are scalar where they exist."""
    problems: list[str] = []
    for pattern in scenario.record.patterns:
        if all(problem_of(pattern, (), catalog) for catalog in catalogs.values()):
            problems.append(f"{scenario.record.where}: {problem_of(pattern, (), next(iter(catalogs.values())))}")
    array_inputs = {
        id(signal) for analysis in scenario.analyses for signal in analysis.inputs.values() if signal.single
    }
    for use in expression_uses(scenario):
        if use.needed is None:
            continue
        where, expression = use.where, use.expression
        relevant = {name: catalogs[name] for name in use.variants or catalogs}
        missing = {
            name: reason
            for name, catalog in relevant.items()
            if (
                reason := next(
                    filter(None, (problem_of(signal.name, signal.index, catalog) for signal in expression.signals)), ""
                )
            )
        }
        if len(missing) == len(relevant):
            problems.append(f"{where}: {next(iter(missing.values()))}")
        elif missing_variants := [name for name in use.needed if name in missing]:
            problems.append(f"{where}: in variant `{missing_variants[0]}`: {missing[missing_variants[0]]}")
        arrays = {
            name: reason
            for name, catalog in relevant.items()
            if name not in missing
            and id(expression) not in array_inputs
            and (reason := array_problem(expression, catalog))
        }
        for name, reason in list(arrays.items())[:1]:
            prefix = "" if len(arrays) + len(missing) == len(relevant) else f"in variant `{name}`: "
            problems.append(f"{where}: {prefix}{reason}")
    return problems


def check_rows(scenario: ScenarioSpec) -> list[str]:
    """Check that analyses get rows from the time and at the interval that their functions expect."""
    return [
        problem
        for analysis in scenario.analyses
        for case in scenario.variants
        if not analysis.variants or case.variant in analysis.variants
        if (problem := analysis.rows_problem(case.start_ns, case.record.every_ns or case.step_ns))
    ]


def array_problem(expression: Expression, catalog: Catalog) -> str:
    """Return why an expression is not scalar, or ""."""
    return expression.array_problem({signal.name: find(signal.name, catalog)[0].shape for signal in expression.signals})


def problem_of(name: str, index: tuple[int, ...], catalog: Catalog) -> str:
    """Return why a signal or pattern cannot be recorded, or ""."""
    try:
        if "*" in name:
            return "" if matching(catalog, name) else f"{name} matches no variable. Write member.* or member.variable."
        variable, _ = find(name, catalog)
        if index and not inside(index, variable.shape):
            return no_element(name, index, variable)
    except CouplingError as error:
        return str(error)
    return "" if variable.connectable else f"{name} is {variable.type}: only numbers are recorded. Leave it out."


def event_overflows(
    event: EventSpec, case: Case, catalog: Catalog, classes: Mapping[str, type[Component]]
) -> list[str]:
    """Report a parameter that an event sets to more than a buffer of its component holds."""
    name, _, variable = event.variable.partition(".")
    if event.kind != "set" or "[" in variable:
        return []
    value = quantities.resolve(event.value, find(event.variable, catalog)[0], event.variable)
    problems = check_buffers(event.where, name, case.members[name], {variable: value}, classes)
    return [problem for problem in problems if problem.startswith(f"{event.where}: {event.variable} = ")]


def event_problems(event: EventSpec, catalog: Catalog, targets: set[str]) -> list[str]:
    """Check an event against its variable. `targets`: connected inputs."""
    try:
        variable, index = find(event.variable, catalog)
        if index and event.kind == "override" and variable.causality == "input":
            array_name = event.variable[: event.variable.rindex("[")]
            raise CouplingError(  # noqa: TRY301
                f"{event.variable}: an element of an input cannot be overridden. Override its source, or all of {array_name}."
            )
        if not variable.connectable and event.kind != "set":
            raise CouplingError(f"{event.variable} is {variable.type}: only numbers can be overridden.")  # noqa: TRY301
        if event.kind != "release":
            quantities.resolve(event.value, variable, event.variable)
    except CouplingError as error:
        return [f"{event.where}: {problem}" for problem in error.problems]
    if event.kind != "set":
        return []
    if variable.causality not in SETTABLE:
        return [f"{event.where}: {event.variable} is {variable.causality}, not a parameter or input. Use override."]
    if variable.causality != "input" and variable.variability != "tunable":
        return [f"{event.where}: {event.variable} is {variable.variability}. Set it in members."]
    if event.variable in targets:
        return [f"{event.where}: {event.variable} is connected and would be written over. Override its source instead."]
    return []


def check_times(case: Case) -> list[str]:
    """Report conditions that are not evaluated before the end of the run."""
    return [
        f"{condition.tree.find(('after',)).location}: after {clock.text(condition.after_ns)} is not before the end of the run, "
        f"{clock.text(case.stop_ns)}. Change it or stop_time."
        for condition in case.conditions
        if condition.after_ns is not None and condition.after_ns >= case.stop_ns
    ]


def check_conditions(case: Case, catalog: Catalog) -> list[str]:
    """Report signals of conditions that are no outputs, and values without a comparison that are no Booleans."""
    return [
        f"{condition.where}: {problem}"
        for condition in case.conditions
        for comparison in condition.condition.comparisons
        for problem in comparison_problems(comparison, catalog)
    ]


def comparison_problems(comparison: Comparison, catalog: Catalog) -> Iterable[str]:
    """Yield the problems of a comparison; unknown names are reported with those of all expressions."""
    for signal in comparison.expression.signals:
        try:
            variable, _ = find(str(signal), catalog)
        except CouplingError:
            continue
        kind = "an input" if variable.causality == "input" else f"a {variable.causality}"
        if variable.causality not in READABLE:
            advice = "Name the output that it is connected to" if variable.causality == "input" else "Name an output"
            yield f"{signal} is {kind}: conditions read outputs. {advice}."
        elif comparison.is_boolean and variable.type != "Boolean":
            yield f"{signal} is {variable.type}, neither true nor false. Compare it, as in {signal} > 0."
