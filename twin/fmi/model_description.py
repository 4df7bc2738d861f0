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

CAPABILITIES = (  # those that a run depends on
    "canBeInstantiatedOnlyOncePerProcess",
    "canGetAndSetFMUState",
    "canSerializeFMUState",
    "providesDirectionalDerivatives",
    "canHandleVariableCommunicationStepSize",
    "canInterpolateInputs",
    "mightReturnEarlyFromDoStep",
    "hasEventMode",
)


@dataclass(frozen=True, slots=True)
class Dimension:
    """A size of an array: fixed, or the value of a structural parameter, which starts with `start`."""

    start: int
    reference: int | None = None


@dataclass(frozen=True, slots=True)
class Declared:
    """A variable, with the defaults of its type. `type` is FMI's; numbers are texts as they are written.

    `alias_of`: the name it is an alias of; `items`: (name, value) of an enumeration; `is_relative`: it is a difference.
    """

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
    items: tuple[tuple[str, str], ...] = ()
    dimensions: tuple[Dimension, ...] = ()
    alias_of: str = ""
    is_relative: bool = False


@dataclass(frozen=True, slots=True)
class DeclaredUnit:
    """A unit in base units, or by its name alone (no `size`); display units are (name, factor, offset).

    Factor 0: of the inverse, as min/km of m/s, in which nothing is shown.
    """

    name: str
    size: units.Unit | None
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
    types = {  # definition and description
        name: (type_definition(fmi, element), element.get("description", ""))
        for element in definitions
        if element.tag != "ClockType" and (name := element.get("name"))
    }
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


def type_definition(fmi: FmiVersion, element: Any) -> Any:
    """Return the element with the attributes of a type: FMI 2.0 has it inside of SimpleType."""
    return next((child for child in element if isinstance(child.tag, str)), element) if fmi == FMI2 else element


def is_relative(element: Any, default: bool) -> bool:
    """Whether values are differences, so that units have no offset (relativeQuantity)."""
    text = element.get("relativeQuantity")
    return default if text is None else text in ("true", "1")


def variable(fmi: FmiVersion, element: Any, types: dict[str, tuple[Any, str]], sizes: dict[str, Any]) -> Declared:
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
    definition, about = (value, "") if declared_type is None else types[declared_type]

    def attribute(key: str) -> Any:
        return value.get(key) or definition.get(key)

    return Declared(
        name,
        int(element.get("valueReference")),
        kind,
        causality,
        variability,
        initial,
        value.get("start") if holder is None else holder.get("value"),
        (attribute("unit") if kind in FLOATS else None) or "",
        (attribute("displayUnit") if kind in FLOATS else None) or "",
        element.get("description") or about,
        None if kind in BOUNDLESS else attribute("min"),
        None if kind in BOUNDLESS else attribute("max"),
        tuple((entry.get("name", ""), entry.get("value", "")) for entry in definition.iterfind("Item")),
        tuple(dimension(child, sizes) for child in element.iterfind("Dimension")) if fmi == FMI3 else (),
        is_relative=is_relative(value, is_relative(definition, default=False)),
    )


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
    try:
        return DeclaredUnit(
            element.get("name", ""),
            None
            if base is None
            else units.Unit(
                float(base.get("factor", 1.0)),
                float(base.get("offset", 0.0)),
                tuple(int(base.get(symbol, 0)) for symbol in units.BASE),
            ),
            tuple(
                (
                    child.get("name", ""),
                    0.0 if child.get("inverse") in ("true", "1") else float(child.get("factor", 1.0)),
                    float(child.get("offset", 0.0)),
                )
                for child in element.iterfind("DisplayUnit")
            ),
        )
    except ValueError as error:
        raise ValueError(f"line {element.sourceline}: unit {element.get('name')!r}: {error}") from None
