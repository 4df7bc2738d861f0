"""modelDescription.xml of FMI 2.0 and FMI 3.0, from a component's declarations.

`Exposed` is what both the XML and the C table of an FMU are made from, so that neither can say what the other does not.
"""

from __future__ import annotations

import inspect
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from lxml import etree

import twin
from twin import clock
from twin.compiler import Tangents, flow, tangents
from twin.component import Boolean, Float64, Int64, PythonComponent, Role, Variable, evaluation, unit
from twin.errors import BuildError

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable

    from twin.component import Component

LOG_CATEGORIES = {
    "logCalls": "every call of a function, with the state it was made in",
    "logStatusWarning": "a step that went on with a warning",
    "logStatusDiscard": "a step or a question that could not be answered",
    "logStatusError": "why a call was refused or failed; sent even if logging is off",
    "logStatusFatal": "why the instance cannot be used any more; sent even if logging is off",
}

SAMPLE_CLOCK = "sample_clock"  # name of the clock of an FMU with one; its value reference is the last

CAUSALITY = {Role.input: "input", Role.output: "output", Role.parameter: "parameter"}


@dataclass(frozen=True, slots=True)
class Exposed:
    """One value reference of an FMU: a variable (FMI 3.0) or one of its elements (FMI 2.0)."""

    name: str
    reference: int
    variable: Variable
    offset: int  # in the record [byte]
    shape: tuple[int, ...]
    start: tuple[Any, ...]
    initial: str
    variability: str
    element: int = 0  # index among its variable's elements

    @property
    def causality(self) -> str:
        """FMI's word for the variable's role."""
        return CAUSALITY.get(self.variable.role, "local")

    @property
    def has_start(self) -> bool:
        """Whether the start value holds until something is set: initialization does not compute it."""
        return self.initial == "exact"


@dataclass(frozen=True, slots=True)
class ModelStructure:
    """Dependencies by variable name: at communication points, and in Initialization Mode."""

    output_dependencies: dict[str, frozenset[str]]
    feedthrough: dict[str, frozenset[str]]


def structure(cls: type[Component]) -> ModelStructure:
    """A step publishes later what it reads now, so only `derivatives` makes an output follow an input at once."""
    return ModelStructure(flow(cls, ("initialize", "derivatives")), flow(cls, ("derivatives",)))


def is_continuous(cls: type[Component]) -> bool:
    """Whether a component has equations that an importer can solve."""
    return evaluation(cls) is not None


def offers_exchange(cls: type[Component]) -> bool:
    """Whether the FMU offers Model Exchange besides Co-Simulation: by its equations, or with its ticks as time events."""
    return is_continuous(cls) or (bool(cls.period_ns) and not issubclass(cls, PythonComponent))


def switches(cls: type[Component]) -> list[Variable]:
    """Variables whose zeros are events, in the order of the event indicators."""
    return [next(v for v in cls.variables if v.name == name) for name in cls.switches]


def offers_derivatives(cls: type[Component]) -> bool:
    """Whether the FMU provides directional derivatives: the source of a continuous component can be differentiated."""
    return is_continuous(cls) and isinstance(tangents(cls), Tangents)


def is_intermediate(cls: type[Component], exposed: Exposed) -> bool:
    """Whether a variable can be set or read between communication points: a continuous input or output can."""
    is_signal = exposed.variable.role in (Role.input, Role.output) and exposed.variability == "continuous"
    return is_continuous(cls) and not cls.period_ns and is_signal


def _properties(cls: type[Component], variable: Variable, dependencies: dict[str, frozenset[str]]) -> tuple[str, str]:
    """`initial` and `variability`; a start value is exact unless initialization may write the variable."""
    if variable.role is Role.parameter:
        return "exact", "fixed" if variable.fixed else "tunable"
    continuous = is_continuous(cls) and variable.type is Float64
    is_calculated = variable.name in dependencies or variable.role is Role.derivative
    return "calculated" if is_calculated else "exact", "continuous" if continuous else "discrete"


def derivative_name(name: str) -> str:
    """FMI's name of a derivative: `der(x)` for `der_x`, in a group `der(part.x)` for `part.der_x`."""
    part, dot, own = name.rpartition(".")
    return f"der({part}{dot}{own.removeprefix('der_')})"


def expose_arrays(cls: type[Component]) -> list[Exposed]:
    """FMI 3.0: every variable under one value reference, counted from 1; 0 is time."""
    dependencies = structure(cls).output_dependencies
    starts = cls.start_values()
    result = []
    for reference, variable in enumerate(cls.variables, 1):
        name = derivative_name(variable.name) if variable.role is Role.derivative else variable.name
        initial, variability = _properties(cls, variable, dependencies)
        start = tuple(starts[variable.name].reshape(-1).tolist())
        offset = cls.layout.offset(variable.name)
        result.append(Exposed(name, reference, variable, offset, variable.shape, start, initial, variability))
    return result


def expose_scalars(cls: type[Component]) -> list[Exposed]:
    """FMI 2.0: every element under its own value reference, counted from 0.

    Integer has 32 bits: an Int64 local, such as the state of a random-number stream, is left out. An Int64 parameter,
    input or output is an Integer, and a getter fails if its value does not fit.
    """
    result: list[Exposed] = []
    for array in expose_arrays(cls):
        variable = array.variable
        if variable.type is Int64 and variable.role is Role.local:
            continue
        if variable.type is Int64 and array.has_start and not all(-(2**31) <= v < 2**31 for v in array.start):
            raise BuildError(
                f"{cls.__name__}.{variable.name}: start does not fit 32 bits of FMI 2.0. Export for FMI 3.0."
            )
        for index, element in enumerate(variable.elements()):
            name = derivative_name(element) if variable.role is Role.derivative else element
            offset = array.offset + index * variable.dtype.itemsize
            start = (array.start[index],)
            traits = (array.initial, array.variability)
            result.append(Exposed(name, len(result), variable, offset, (), start, *traits, element=index))
    return result


# ------------------------------------------------------------------------------------------------------------- pieces


def text(value: Any) -> str:
    """A value as XML Schema writes it; floats read back to the same bits."""
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, float):
        return {"nan": "NaN", "inf": "INF", "-inf": "-INF"}.get(repr(value), repr(value))
    return str(value)


def summary(cls: type[Component]) -> str:
    """First line of a component's docstring: one sentence, by the house rules."""
    return inspect.cleandoc(cls.__doc__ or "").split("\n", maxsplit=1)[0]


def add(parent: Any, tag: str, **attributes: Any) -> Any:
    """A child element with those attributes that are not None or empty."""
    nonempty_attributes = {name: text(value) for name, value in attributes.items() if value is not None and value != ""}
    return etree.SubElement(parent, tag, nonempty_attributes)


def _units(root: Any, variables: Iterable[Variable]) -> None:
    displayed: dict[str, set[str]] = {}
    for variable in variables:
        if variable.unit and variable.type is Float64:
            displayed.setdefault(variable.unit, set()).update({variable.display_unit} - {"", variable.unit})
    if not displayed:
        return
    definitions = add(root, "UnitDefinitions")
    for name in sorted(displayed):
        described = unit.describe(name)
        element = add(definitions, "Unit", name=name)
        exponents = {base: power for base, power in zip(unit.BASE, described.exponents, strict=True) if power}
        scale = {"factor": described.factor if described.factor != 1.0 else None, "offset": described.offset or None}
        add(element, "BaseUnit", **exponents, **scale)
        for display in sorted(displayed[name]):
            factor, offset = unit.conversion(name, display, f"display unit of {name}")
            add(element, "DisplayUnit", name=display, factor=factor, offset=offset or None)


def _add_context(root: Any, cls: type[Component]) -> None:
    """Add units, log categories, and the suggested experiment."""
    _units(root, cls.variables)
    categories = add(root, "LogCategories")
    for name, description in LOG_CATEGORIES.items():
        add(categories, "Category", name=name, description=description)
    step = clock.seconds(cls.period_ns) if cls.period_ns else 0.001
    add(root, "DefaultExperiment", startTime=0.0, stopTime=1.0, stepSize=step)


def _attributes(e: Exposed) -> dict[str, Any]:
    """Return the attributes of a variable that do not depend on its type."""
    return {
        "name": e.name,
        "valueReference": e.reference,
        "description": e.variable.description,
        "causality": e.causality,
        "variability": e.variability,
        "initial": None if e.causality == "input" else e.initial,
    }


def _limits(variable: Variable) -> dict[str, Any]:
    """Attributes that a variable's type can carry: a Boolean none, an integer no unit."""
    if variable.type is Boolean:
        return {}
    if variable.type is not Float64:
        limits = {"min": variable.minimum, "max": variable.maximum}
        return {name: None if value is None else int(value) for name, value in limits.items()}
    return {
        "unit": variable.unit,
        "displayUnit": variable.display_unit if variable.unit and variable.display_unit != variable.unit else None,
        "min": None if variable.minimum is None else float(variable.minimum),
        "max": None if variable.maximum is None else float(variable.maximum),
        "nominal": None if variable.nominal is None else float(variable.nominal),
    }


Unknown = tuple[int, list[int]]  # index of an exposed variable, indices of those it depends on


def unknowns(cls: type[Component], exposed: list[Exposed]) -> dict[str, list[Unknown]]:
    """ModelStructure: outputs and derivatives with their dependencies, and the initial unknowns."""
    flows = structure(cls)
    knowns = [i for i, e in enumerate(exposed) if e.variable.role in (Role.input, Role.state)]
    first_knowns = [i for i, e in enumerate(exposed) if e.has_start]

    def rows(chosen: Callable[[Exposed], bool], among: list[int], sources: dict[str, frozenset[str]]) -> list[Unknown]:
        return [
            (i, [k for k in among if exposed[k].variable.name in sources.get(e.variable.name, ())])
            for i, e in enumerate(exposed)
            if chosen(e)
        ]

    starting = (Role.output, Role.derivative, Role.state)
    return {
        "outputs": rows(lambda e: e.variable.role is Role.output, knowns, flows.feedthrough),
        "derivatives": rows(lambda e: e.variable.role is Role.derivative, knowns, flows.feedthrough),
        "initial": rows(
            lambda e: not e.has_start and e.variable.role in starting, first_knowns, flows.output_dependencies
        ),
    }


def _add_unknown(parent: Any, tag: str, reference: str, row: Unknown, number: Callable[[int], int]) -> None:
    index, sources = row
    element = add(parent, tag, **{reference: number(index)})
    element.set("dependencies", " ".join(str(number(source)) for source in sources))


def _state_indices(exposed: list[Exposed]) -> dict[tuple[str, int], int]:
    """Index of every state element, by the name of its derivative."""
    names = [e.variable.name.rpartition(".") for e in exposed]
    return {
        (f"{part}{dot}der_{own}", e.element): i
        for i, (e, (part, dot, own)) in enumerate(zip(exposed, names, strict=True))
        if e.variable.role is Role.state
    }


def _document(cls: type[Component], **attributes: Any) -> Any:
    root = etree.Element("fmiModelDescription")
    about = {"description": summary(cls), "version": twin.__version__, "generationTool": f"twin {twin.__version__}"}
    for name, value in {**attributes, **about, "variableNamingConvention": "structured"}.items():
        root.set(name, value)
    return root


def serialized(root: Any) -> bytes:
    """An XML file."""
    return bytes(etree.tostring(root, pretty_print=True, xml_declaration=True, encoding="UTF-8"))


# ------------------------------------------------------------------------------------------------------- the versions

TYPES_2 = {"Float64": "Real", "Int32": "Integer", "Int64": "Integer", "Boolean": "Boolean"}


def describe_2(cls: type[Component], name: str, token: str, exposed: list[Exposed]) -> bytes:
    """modelDescription.xml of FMI 2.0; ModelStructure counts variables from 1."""
    root = _document(cls, fmiVersion="2.0", modelName=name, guid=token)
    interface = {
        "modelIdentifier": name,
        "canNotUseMemoryManagementFunctions": True,
        "canGetAndSetFMUstate": True,
        "canSerializeFMUstate": True,
        "providesDirectionalDerivative": offers_derivatives(cls) or None,
    }
    if offers_exchange(cls):
        root.set("numberOfEventIndicators", str(sum(v.size for v in switches(cls))))
        add(root, "ModelExchange", **interface, completedIntegratorStepNotNeeded=True)
    add(root, "CoSimulation", **interface, canHandleVariableCommunicationStepSize=True)
    _add_context(root, cls)
    states = _state_indices(exposed)
    variables = add(root, "ModelVariables")
    for e in exposed:
        variable = add(variables, "ScalarVariable", **_attributes(e))
        state = states.get((e.variable.name, e.element))
        value = e.start[0] if e.has_start else None
        kind = TYPES_2[e.variable.type]
        add(variable, kind, **_limits(e.variable), start=value, derivative=None if state is None else state + 1)
    group = add(root, "ModelStructure")
    for tag, rows in zip(("Outputs", "Derivatives", "InitialUnknowns"), unknowns(cls, exposed).values(), strict=True):
        parent = add(group, tag) if rows else group
        for row in rows:
            _add_unknown(parent, "Unknown", "index", row, lambda index: index + 1)
    return serialized(root)


def describe_3(
    cls: type[Component], name: str, token: str, exposed: list[Exposed], *, has_clock: bool = False
) -> bytes:
    """modelDescription.xml of FMI 3.0. `has_clock`: the sample period is an input clock, for Scheduled Execution too."""
    root = _document(cls, fmiVersion="3.0", modelName=name, instantiationToken=token)
    interface = {
        "modelIdentifier": name,
        "canGetAndSetFMUState": True,
        "canSerializeFMUState": True,
        "providesDirectionalDerivatives": offers_derivatives(cls) or None,
    }
    if offers_exchange(cls):
        add(root, "ModelExchange", **interface)
    add(
        root,
        "CoSimulation",
        **interface,
        canHandleVariableCommunicationStepSize=True,
        fixedInternalStepSize=clock.seconds(cls.period_ns) if cls.period_ns else None,
        providesIntermediateUpdate=(is_continuous(cls) and not cls.period_ns) or None,
        canReturnEarlyAfterIntermediateUpdate=(is_continuous(cls) and not cls.period_ns) or None,
        hasEventMode=bool(cls.period_ns) or None,
        mightReturnEarlyFromDoStep=bool(cls.period_ns) or None,
    )
    if has_clock:
        add(root, "ScheduledExecution", modelIdentifier=name)
    _add_context(root, cls)
    _add_variables_3(add(root, "ModelVariables"), cls, exposed, has_clock=has_clock)
    group = add(root, "ModelStructure")
    tags = ("Output", "ContinuousStateDerivative", "InitialUnknown")
    for tag, rows in zip(tags, unknowns(cls, exposed).values(), strict=True):
        for row in rows:
            if not (has_clock and tag == "InitialUnknown" and exposed[row[0]].causality == "output"):  # it has a clock
                _add_unknown(group, tag, "valueReference", row, lambda index: exposed[index].reference)
    references = {e.variable.name: e.reference for e in exposed}
    for variable in switches(cls):
        add(group, "EventIndicator", valueReference=references[variable.name])
    return serialized(root)


def _add_variables_3(variables: Any, cls: type[Component], exposed: list[Exposed], *, has_clock: bool) -> None:
    states = _state_indices(exposed)
    clock_reference = len(exposed) + 1
    add(variables, "Float64", name="time", valueReference=0, causality="independent", variability="continuous")
    for e in exposed:
        state = states.get((e.variable.name, e.element))
        variable = add(
            variables,
            e.variable.type,
            **_attributes(e),
            **_limits(e.variable),
            start=" ".join(map(text, e.start)) if e.has_start else None,
            derivative=None if state is None else exposed[state].reference,
            intermediateUpdate=is_intermediate(cls, e) or None,
            clocks=clock_reference if has_clock and e.variable.role in (Role.input, Role.output) else None,
        )
        for length in e.shape:
            add(variable, "Dimension", start=length)
    if has_clock:
        about = "ticks where the component takes its inputs, and publishes the outputs of the tick before"
        interval = {"intervalVariability": "constant", "intervalDecimal": clock.seconds(cls.period_ns)}
        words = {"name": SAMPLE_CLOCK, "valueReference": clock_reference, "description": about, "causality": "input"}
        add(variables, "Clock", **words, **interval)
