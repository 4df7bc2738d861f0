"""What modelDescription.xml says that a run needs, of FMI 2.0 and 3.0 alike.

Read without the schema, since many FMUs break it in places that do not matter. Attributes that are absent have the default of
the standard: FMI 2.0.4, section 2.2.7; FMI 3.0.1, section 2.4.7.
"""

from __future__ import annotations

from contextlib import suppress
from dataclasses import dataclass, field, replace
from typing import Any

from twin.component import unit as units
from twin.fmi.clocks import clock_declarations as clocks
from twin.fmi.fmi_version import FMI2, FMI3, FmiVersion
from twin.fmi.xml_checks import TRUE, parse_int

INITIAL = {  # by variability and causality
    **{
        (variability, causality): initial
        for variability in ("fixed", "tunable")
        for causality, initial in (
            ("structuralParameter", "exact"),
            ("parameter", "exact"),
            ("calculatedParameter", "calculated"),
            ("local", "calculated"),
        )
    },
    **{
        (variability, causality): initial
        for variability in ("discrete", "continuous")
        for causality, initial in (("input", "exact"), ("output", "calculated"), ("local", "calculated"))
    },
    ("constant", "output"): "exact",
    ("constant", "local"): "exact",
    ("continuous", "independent"): "",
}
FIXED = {"parameter", "calculatedParameter", "structuralParameter"}  # in FMI 3.0, unless it says otherwise
FLOATS = {"Real", "Float64", "Float32"}
BOUNDLESS = {"Boolean", "String", "Binary", "Clock"}

CAPABILITIES = (  # of FMI 3.0, then those that FMI 2.0 alone has
    "needsExecutionTool",
    "canBeInstantiatedOnlyOncePerProcess",
    "canGetAndSetFMUState",
    "canSerializeFMUState",
    "providesDirectionalDerivatives",
    "providesAdjointDerivatives",
    "providesPerElementDependencies",
    "canHandleVariableCommunicationStepSize",
    "canInterpolateInputs",
    "providesIntermediateUpdate",
    "mightReturnEarlyFromDoStep",
    "canReturnEarlyAfterIntermediateUpdate",
    "hasEventMode",
    "providesEvaluateDiscreteStates",
    "canRunAsynchronuously",
    "canNotUseMemoryManagementFunctions",
)


@dataclass(frozen=True, slots=True)
class DeclaredType:
    """A type definition: defaults of the attributes of its variables. `items`: (name, value) of an enumeration."""

    unit: str = ""
    display_unit: str = ""
    description: str = ""
    minimum: str | None = None
    maximum: str | None = None
    items: tuple[tuple[str, str], ...] = ()


@dataclass(frozen=True, slots=True)
class Dimension:
    """A size of an array: fixed, or the value of a structural parameter, which starts with `start`."""

    start: int
    reference: int | None = None


@dataclass(frozen=True, slots=True)
class Declared:
    """A variable. `type` is FMI's; numbers are texts as they are written; `alias_of` is the name it is an alias of."""

    name: str
    reference: int
    type: str
    causality: str
    variability: str
    initial: str
    start: str | None
    unit: str
    display_unit: str
    description: str
    minimum: str | None
    maximum: str | None
    common: DeclaredType
    dimensions: tuple[Dimension, ...] = ()
    alias_of: str = ""


@dataclass(frozen=True, slots=True)
class DeclaredUnit:
    """A unit in base units, or by its name alone (no `factor`); display units are (name, factor, offset)."""

    name: str
    factor: float | None
    offset: float
    exponents: tuple[int, ...]  # of `unit.BASE`
    displays: tuple[tuple[str, float, float], ...]


@dataclass(frozen=True, slots=True)
class Continuous:
    """What Model Exchange needs: value references of the states and of their derivatives, in order, whole arrays.

    `indicators`: how many event indicators, as FMI 2.0 says it; FMI 3.0: queried from the FMU. `needs_completed_steps`:
    whether `CompletedIntegratorStep` is to be called after every step of the solver.
    """

    states: tuple[int, ...]
    derivatives: tuple[int, ...]
    indicators: int
    needs_completed_steps: bool


@dataclass(slots=True)
class ModelDescription:
    """A model description. `experiment` and `fixed_step` are texts as they are written.

    `dependencies`: names of the variables that an output or an initial unknown depends on, None where nothing is said.
    """

    fmi: FmiVersion
    identifier: str
    token: str
    generator: str
    capabilities: dict[str, bool]
    fixed_step: str | None
    experiment: dict[str, str]
    units: list[DeclaredUnit]
    has_exchange: bool = False  # whether Model Exchange is offered
    continuous: Continuous | None = None  # None if ModelStructure cannot be read, and it is not needed for steps
    variables: list[Declared] = field(default_factory=list)
    dependencies: dict[str, tuple[str, ...] | None] = field(default_factory=dict)
    clocks: clocks.Clocks = field(default_factory=clocks.Clocks)


def read(fmi: FmiVersion, root: Any, tag: str = "CoSimulation") -> ModelDescription:
    """The description from its root element, whose variables `xml_checks.check` has verified; ValueError with the line.

    `tag`: of the interface.
    """
    interface = root.find(tag)
    experiment = root.find("DefaultExperiment")
    model = ModelDescription(
        fmi,
        interface.get("modelIdentifier", ""),
        root.get(fmi.token, ""),
        root.get("generationTool", ""),
        capabilities(fmi, interface),
        interface.get("fixedInternalStepSize"),
        {} if experiment is None else dict(experiment.attrib),
        [unit(element) for element in root.iterfind("UnitDefinitions/Unit")],
        root.find("ModelExchange") is not None,
    )
    definitions = [element for element in root.iterfind(fmi.type_definitions) if isinstance(element.tag, str)]
    named_types = map(fmi2_type if fmi == FMI2 else fmi3_type, definitions)
    types = {name: declared_type for name, declared_type in named_types if name}
    elements = [element for element in root.find("ModelVariables") if isinstance(element.tag, str)]
    sizes = {element.get("valueReference", "").strip(): element for element in elements} if fmi == FMI3 else {}
    bare = [variable(fmi, element, types, sizes) for element in elements]
    aliases = [
        aliased(own, other) for own, element in zip(bare, elements, strict=True) for other in element.iterfind("Alias")
    ]
    model.variables = bare + aliases
    model.dependencies = dependencies(fmi, root, bare)
    if fmi == FMI3:
        model.clocks = clocks.read(root, bare)
    if tag == "ScheduledExecution":  # it makes no steps, and is in Event Mode when partitions run, so to speak
        model.capabilities |= dict.fromkeys(("canHandleVariableCommunicationStepSize", "hasEventMode"), True)
    elif tag == "ModelExchange":
        model.capabilities["hasEventMode"] = fmi == FMI3
        model.continuous = continuous(fmi, root, elements, bare)
        model.capabilities["canHandleVariableCommunicationStepSize"] = True  # a solver chooses its steps
    else:
        with suppress(ValueError):  # ModelStructure is used for derivatives and states only, not for stepping.
            model.continuous = continuous(fmi, root, elements, bare)
    return model


def continuous(fmi: FmiVersion, root: Any, elements: list[Any], bare: list[Declared]) -> Continuous:
    """What Model Exchange needs of ModelStructure and of the interface."""
    interface = root.find("ModelExchange")
    variables_by_key, key = by_key(fmi, bare), fmi.unknown_key
    of = {declared.name: element for declared, element in zip(bare, elements, strict=True)}
    states, derivatives = [], []
    for element in root.iterfind(fmi.derivatives):
        location = f"line {element.sourceline}: <{element.tag}>, {key}"
        derivative = named(element.get(key), variables_by_key, location)
        holder = of[derivative.name] if fmi == FMI3 else next(iter(of[derivative.name].iterfind("Real")), element)
        states.append(
            named(holder.get("derivative"), variables_by_key, f"{location}: {derivative.name!r}, derivative").reference
        )
        derivatives.append(derivative.reference)
    step_flag = (
        None
        if interface is None
        else interface.get("needsCompletedIntegratorStep" if fmi == FMI3 else "completedIntegratorStepNotNeeded")
    )
    return Continuous(
        tuple(states),
        tuple(derivatives),
        parse_int(root.get("numberOfEventIndicators")) or 0,
        (step_flag in TRUE) == (fmi == FMI3),
    )


def capabilities(fmi: FmiVersion, interface: Any) -> dict[str, bool]:
    """Capability flags under their FMI 3.0 names, for all versions."""
    return {name: interface.get(fmi.capability_names.get(name, name)) in TRUE for name in CAPABILITIES}


def fmi2_type(element: Any) -> tuple[str, DeclaredType]:
    """Read a SimpleType; its first element defines the type."""
    first = next((child for child in element if isinstance(child.tag, str)), element)
    return element.get("name", ""), common(first, element.get("description", ""))


def fmi3_type(element: Any) -> tuple[str, DeclaredType]:
    """A Float64Type and the like; clocks have no types that a run needs."""
    name = element.get("name", "") if element.tag != "ClockType" else ""
    return name, common(element, element.get("description", ""))


def common(element: Any, description: str) -> DeclaredType:
    """What a type says of its variables."""
    items = tuple((entry.get("name", ""), entry.get("value", "")) for entry in element.findall("Item"))
    texts = element.get("unit", ""), element.get("displayUnit", ""), description
    return DeclaredType(*texts, element.get("min"), element.get("max"), items)


def variable(fmi: FmiVersion, element: Any, types: dict[str, DeclaredType], sizes: dict[str, Any]) -> Declared:
    """A variable from its element."""
    value = element if fmi == FMI3 else next(child for child in element if child.tag in fmi.types)
    name, kind = element.get("name"), value.tag
    location = f"line {element.sourceline}: {name!r}"
    causality = element.get("causality", "local")
    variability = element.get("variability") or usual(fmi, causality, kind)
    initial = element.get("initial")
    if initial is None:
        initial = INITIAL.get((variability, causality))
        if initial is None:
            raise ValueError(
                f'{location} has causality="{causality}" with variability="{variability}", which FMI forbids'
            )
    declared_type = value.get("declaredType")
    if declared_type is not None and declared_type not in types:
        raise ValueError(f'{location} has declaredType="{declared_type}", which is not defined')
    holder = element.find("Start") if kind in ("String", "Binary") and fmi == FMI3 else None
    measures = kind in FLOATS
    return Declared(
        name,
        int(element.get("valueReference")),
        kind,
        causality,
        variability,
        initial,
        value.get("start") if holder is None else holder.get("value"),
        value.get("unit", "") if measures else "",
        value.get("displayUnit", "") if measures else "",
        element.get("description", ""),
        None if kind in BOUNDLESS else value.get("min"),
        None if kind in BOUNDLESS else value.get("max"),
        types[declared_type] if declared_type is not None else NO_TYPE,
        tuple(dimension(child, sizes) for child in element.iterfind("Dimension")) if fmi == FMI3 else (),
    )


NO_TYPE = DeclaredType()


def usual(fmi: FmiVersion, causality: str, kind: str) -> str:
    """The variability of a variable that says none."""
    if fmi == FMI2:
        return "continuous"
    if causality in FIXED:
        return "fixed"
    return "continuous" if kind in FLOATS else "discrete"


def dimension(element: Any, sizes: dict[str, Any]) -> Dimension:
    """A size; `xml_checks.check` has verified that it is a number, or refers to a variable that starts with one."""
    if element.get("start") is not None:
        return Dimension(int(element.get("start")))
    reference = element.get("valueReference").strip()
    return Dimension(int(sizes[reference].get("start")), int(reference))


def aliased(own: Declared, element: Any) -> Declared:
    """The same variable by another name, which may have a display unit and a description of its own."""
    return replace(
        own,
        name=element.get("name"),
        display_unit=element.get("displayUnit") or own.display_unit,
        description=element.get("description") or own.description,
        alias_of=own.name,
    )


def dependencies(fmi: FmiVersion, root: Any, bare: list[Declared]) -> dict[str, tuple[str, ...] | None]:
    """Return the inputs that outputs and initial unknowns depend on; None where the FMU does not declare them."""
    variables_by_key, key = by_key(fmi, bare), fmi.unknown_key
    inputs_by_unknown: dict[str, tuple[str, ...] | None] = {}
    for element in (element for path in (fmi.outputs, fmi.initial_unknowns) for element in root.iterfind(path)):
        dependency_text = element.get("dependencies")
        unknown, *others = (
            named(word, variables_by_key, f"line {element.sourceline}: <{element.tag}>, {what}")
            for what, word in (
                (key, element.get(key)),
                *(("dependencies", part) for part in (dependency_text or "").split()),
            )
        )
        names = tuple(other.name for other in others if other.causality == "input")
        inputs_by_unknown[unknown.name] = None if dependency_text is None else names
    return inputs_by_unknown


def by_key(fmi: FmiVersion, bare: list[Declared]) -> dict[int, Declared]:
    """Return the variables by what ModelStructure refers to: their index from 1 (FMI 2.0), or value reference."""
    return dict(enumerate(bare, 1)) if fmi == FMI2 else {declared.reference: declared for declared in bare}


def named(word: str | None, variables_by_key: dict[int, Declared], location: str) -> Declared:
    """Return the variable that an entry of ModelStructure refers to."""
    number = parse_int(word)
    if number not in variables_by_key:
        raise ValueError(f"{location}: there is no variable {word!r}")
    return variables_by_key[number]


def unit(element: Any) -> DeclaredUnit:
    """A unit with its display units."""
    base = element.find("BaseUnit")
    attributes = {} if base is None else dict(base.attrib)
    try:
        return DeclaredUnit(
            element.get("name", ""),
            None if base is None else float(attributes.pop("factor", 1.0)),
            float(attributes.pop("offset", 0.0)),
            tuple(int(attributes.get(symbol, 0)) for symbol in units.BASE),
            tuple(
                (child.get("name", ""), float(child.get("factor", 1.0)), float(child.get("offset", 0.0)))
                for child in element.iterfind("DisplayUnit")
            ),
        )
    except ValueError as error:
        raise ValueError(f"line {element.sourceline}: unit {element.get('name')!r}: {error}") from None
