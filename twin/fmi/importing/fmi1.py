"""FMUs of FMI 1.0 for Co-Simulation, run as FMUs of FMI 2.0: the description is converted, a wrapper in C calls the library."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

from lxml import etree

from twin.errors import FMUError

if TYPE_CHECKING:
    from collections.abc import Iterator

WRAPPER = Path(__file__).parent / "c" / "fmi1_wrapper.c"
WRAPPER_PREFIX = "fmi1_wrapper_"  # of the wrapper's file name, before that of the library that it calls
NOTE = "is of FMI 1.0: it is called through a wrapper that has the functions of FMI 2.0"
CAPABILITIES = (
    "canHandleVariableCommunicationStepSize",
    "canInterpolateInputs",
    "canBeInstantiatedOnlyOncePerProcess",
    "canNotUseMemoryManagementFunctions",
)
FIELDS = ("unit", "displayUnit", "min", "max", "nominal", "quantity", "declaredType", "start")  # of a type
ZERO = {"Real": "0", "Integer": "0", "Enumeration": "1", "Boolean": "false", "String": ""}


def is_fmi1(root: Any) -> bool:
    """Whether a model description is of FMI 1.0."""
    return root.tag == "fmiModelDescription" and str(root.get("fmiVersion")) == "1.0"


def convert(where: str, root: Any) -> Any:
    """Return the model description as one of FMI 2.0; FMUError if it is not for Co-Simulation."""
    implementation = root.find("Implementation")
    standalone = None if implementation is None else implementation.find("CoSimulation_StandAlone")
    if standalone is None:
        what = "for Model Exchange only" if implementation is None else "coupled to its tool"
        raise FMUError(f"{where} is of FMI 1.0 and {what}; Co-Simulation is needed. Export it for FMI 2.0 or 3.0.")
    converted = etree.Element("fmiModelDescription", fmiVersion="2.0")
    for key in ("modelName", "guid", "description", "author", "version", "generationTool"):
        if key in root.attrib:
            converted.set(key, root.get(key))
    interface = etree.SubElement(converted, "CoSimulation", modelIdentifier=root.get("modelIdentifier", ""))
    capabilities = standalone.find("Capabilities")
    for key in CAPABILITIES:
        if capabilities is not None and key in capabilities.attrib:
            interface.set(key, capabilities.get(key))
    units = sorted({node.get("unit") for node in root.iter("Real", "RealType") if node.get("unit")})
    if units:
        definitions = etree.SubElement(converted, "UnitDefinitions")
        for name in units:
            etree.SubElement(definitions, "Unit", name=name)
    if (experiment := root.find("DefaultExperiment")) is not None:
        etree.SubElement(converted, "DefaultExperiment", dict(experiment.attrib))
    variables = etree.SubElement(converted, "ModelVariables")
    variables.extend(converted_variables(root))
    structure = etree.SubElement(converted, "ModelStructure")
    outputs = [number for number, node in enumerate(variables, 1) if node.get("causality") == "output"]
    if outputs:
        unknowns = etree.SubElement(structure, "Outputs")
        for number in outputs:
            etree.SubElement(unknowns, "Unknown", index=str(number))
    return etree.fromstring(etree.tostring(converted, pretty_print=True))  # with line numbers


def converted_variables(root: Any) -> Iterator[Any]:
    """Yield the variables of FMI 2.0.

    Left out: a negated alias, which has the opposite sign of its variable, since FMI 2.0 cannot say so; a name that is there twice.
    """
    names: set[str | None] = set()
    types = {node.get("name"): node[0] for node in root.iterfind("TypeDefinitions/Type") if len(node)}
    for node in root.iterfind("ModelVariables/ScalarVariable"):
        typed = next((child for child in node if child.tag in ZERO), None)
        if typed is None or node.get("alias") == "negatedAlias" or node.get("name") in names:
            continue
        names.add(node.get("name"))
        causality, variability = attributes(node, typed)
        variable = etree.Element(
            "ScalarVariable",
            name=node.get("name", ""),
            valueReference=node.get("valueReference", ""),
            causality=causality,
            variability=variability,
        )
        if node.get("description"):
            variable.set("description", node.get("description"))
        declared = types.get(typed.get("declaredType"))
        values = {key: typed.get(key) for key in FIELDS if key in typed.attrib and key != "declaredType"}
        if declared is not None:
            values = {key: declared.get(key) for key in FIELDS if key in declared.attrib} | values
        if typed.tag != "Real":
            values = {key: value for key, value in values.items() if key in ("min", "max", "start")}
        if causality == "input":
            values.setdefault("start", ZERO[typed.tag])
        elif causality != "parameter" and variability != "constant":
            variable.set("initial", "exact" if "start" in values else "calculated")
        tag = "Integer" if typed.tag == "Enumeration" else typed.tag
        etree.SubElement(variable, tag, values)
        yield variable


def attributes(node: Any, typed: Any) -> tuple[str, str]:
    """Return causality and variability in the terms of FMI 2.0."""
    causality = {"input": "input", "output": "output"}.get(node.get("causality", "internal"), "local")
    variability = node.get("variability", "continuous")
    if variability == "parameter":
        is_settable = causality == "local" and "start" in typed.attrib
        return ("parameter", "tunable") if is_settable else (causality, "discrete")
    if variability == "constant":
        return ("local" if causality == "input" else causality), "constant" if "start" in typed.attrib else "discrete"
    return causality, variability if typed.tag == "Real" else "discrete"
