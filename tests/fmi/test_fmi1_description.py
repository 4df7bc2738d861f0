"""Model descriptions of FMI 1.0 as those of FMI 2.0: every attribute of every kind of variable."""

import pytest
from lxml import etree

from tests.every_case import every_case
from twin.fmi.importing import fmi1

HEAD = (
    '<fmiModelDescription fmiVersion="{version}" modelName="Old model" modelIdentifier="Old" guid="{{g}}" {more}>'
    "{before}<ModelVariables>{variables}</ModelVariables>"
    "<Implementation><CoSimulation_StandAlone>{capabilities}</CoSimulation_StandAlone></Implementation>"
    "</fmiModelDescription>"
)


def old(variables="", before="", capabilities="", more="", version="1.0"):
    """The root of a description of FMI 1.0."""
    text = HEAD.format(variables=variables, before=before, capabilities=capabilities, more=more, version=version)
    return etree.fromstring(text)


def scalar(typed, name="x", **attributes):
    """A variable of FMI 1.0."""
    given = "".join(f' {key}="{value}"' for key, value in attributes.items())
    return f'<ScalarVariable name="{name}" valueReference="7"{given}>{typed}</ScalarVariable>'


def tree(node):
    """An element as (tag, attributes, children)."""
    return node.tag, dict(node.attrib), [tree(child) for child in node]


@pytest.mark.parametrize(("version", "expected"), [("1.0", True), ("2.0", False), ("3.0", False)])
def test_only_version_1_is_converted(version, expected):
    assert fmi1.is_fmi1(old(version=version)) is expected
    assert not fmi1.is_fmi1(etree.fromstring(f'<other fmiVersion="{version}"/>'))


OUTPUT = {"valueReference": "7", "causality": "output", "variability": "continuous", "initial": "calculated"}
INPUT = {"name": "u", "valueReference": "7", "causality": "input", "variability": "continuous", "description": "force"}


def test_the_frame_of_a_description():
    """Attributes, capabilities, units without duplicates, experiment, and outputs by their number counted from 1."""
    converted = fmi1.convert(
        "old.fmu",
        old(
            scalar('<Real unit="m"/>', "y", causality="output")
            + scalar('<Real unit="N"/>', "u", causality="input", description="force")
            + scalar('<Real unit="m"/>', "z", causality="output"),
            '<TypeDefinitions><Type name="T"><RealType unit="A"/></Type></TypeDefinitions>'
            '<DefaultExperiment startTime="1" stopTime="2" tolerance="1e-4"/>',
            '<Capabilities canHandleVariableCommunicationStepSize="true" canHandleEvents="true" canInterpolateInputs="false"/>',
            'author="A" version="3" description="D" generationTool="G" numberOfContinuousStates="4"',
        ),
    )
    assert tree(converted) == (
        "fmiModelDescription",
        {
            "fmiVersion": "2.0",
            "modelName": "Old model",
            "guid": "{g}",
            "description": "D",
            "author": "A",
            "version": "3",
            "generationTool": "G",
        },
        [
            (
                "CoSimulation",
                {
                    "modelIdentifier": "Old",
                    "canHandleVariableCommunicationStepSize": "true",
                    "canInterpolateInputs": "false",
                },
                [],
            ),
            ("UnitDefinitions", {}, [("Unit", {"name": name}, []) for name in ("A", "N", "m")]),
            ("DefaultExperiment", {"startTime": "1", "stopTime": "2", "tolerance": "1e-4"}, []),
            (
                "ModelVariables",
                {},
                [
                    ("ScalarVariable", OUTPUT | {"name": "y"}, [("Real", {"unit": "m"}, [])]),
                    ("ScalarVariable", INPUT, [("Real", {"unit": "N", "start": "0"}, [])]),
                    ("ScalarVariable", OUTPUT | {"name": "z"}, [("Real", {"unit": "m"}, [])]),
                ],
            ),
            (
                "ModelStructure",
                {},
                [("Outputs", {}, [("Unknown", {"index": "1"}, []), ("Unknown", {"index": "3"}, [])])],
            ),
        ],
    )
    assert all(node.sourceline > 1 for node in converted.iter("Unit", "Real"))  # messages name lines


def test_what_a_description_leaves_out_stays_out():
    converted = fmi1.convert("old.fmu", old(scalar("<Integer/>")))
    assert [node.tag for node in converted] == ["CoSimulation", "ModelVariables", "ModelStructure"]
    assert len(converted.find("ModelStructure")) == 0


@every_case(
    ("typed", "attributes", "expected"),
    [
        # causality: internal and none are local variables
        ("<Real/>", {}, ("local", "continuous", "calculated", {})),
        ("<Real/>", {"causality": "internal"}, ("local", "continuous", "calculated", {})),
        ("<Real/>", {"causality": "none"}, ("local", "continuous", "calculated", {})),
        ("<Real/>", {"causality": "output"}, ("output", "continuous", "calculated", {})),
        ('<Real start="2"/>', {"causality": "output"}, ("output", "continuous", "exact", {"start": "2"})),
        ('<Real start="2"/>', {}, ("local", "continuous", "exact", {"start": "2"})),
        # only real numbers are continuous
        ("<Real/>", {"variability": "discrete"}, ("local", "discrete", "calculated", {})),
        ("<Integer/>", {}, ("local", "discrete", "calculated", {})),
        ("<Boolean/>", {"causality": "output"}, ("output", "discrete", "calculated", {})),
        # an input has a start value
        ("<Real/>", {"causality": "input"}, ("input", "continuous", None, {"start": "0"})),
        ('<Real start="3"/>', {"causality": "input"}, ("input", "continuous", None, {"start": "3"})),
        ("<Integer/>", {"causality": "input"}, ("input", "discrete", None, {"start": "0"})),
        ("<Boolean/>", {"causality": "input"}, ("input", "discrete", None, {"start": "false"})),
        ("<String/>", {"causality": "input"}, ("input", "discrete", None, {"start": ""})),
        ("<Enumeration/>", {"causality": "input"}, ("input", "discrete", None, {"start": "1"})),
        # a parameter can be set if it has a start value and nobody else sets it
        ('<Real start="4"/>', {"variability": "parameter"}, ("parameter", "tunable", None, {"start": "4"})),
        ("<Real/>", {"variability": "parameter"}, ("local", "discrete", "calculated", {})),
        (
            '<Real start="4"/>',
            {"variability": "parameter", "causality": "output"},
            ("output", "discrete", "exact", {"start": "4"}),
        ),
        (
            '<Real start="4"/>',
            {"variability": "parameter", "causality": "input"},
            ("input", "discrete", None, {"start": "4"}),
        ),
        # a constant has its value; FMI 2.0 has no constant input
        ('<Real start="5"/>', {"variability": "constant"}, ("local", "constant", None, {"start": "5"})),
        (
            '<Real start="5"/>',
            {"variability": "constant", "causality": "output"},
            ("output", "constant", None, {"start": "5"}),
        ),
        (
            '<Real start="5"/>',
            {"variability": "constant", "causality": "input"},
            ("local", "constant", None, {"start": "5"}),
        ),
        ("<Real/>", {"variability": "constant"}, ("local", "discrete", "calculated", {})),
        # what a type declares holds unless the variable says something else; only numbers have units
        (
            '<Real declaredType="T" max="3"/>',
            {},
            ("local", "continuous", "calculated", {"unit": "m", "min": "1", "max": "3"}),
        ),
        ('<Real declaredType="none" quantity="Q"/>', {}, ("local", "continuous", "calculated", {"quantity": "Q"})),
        ('<Integer declaredType="N"/>', {}, ("local", "discrete", "calculated", {"min": "-1"})),
        (
            '<Integer declaredType="N" min="0" max="9" start="5"/>',
            {},
            ("local", "discrete", "exact", {"min": "0", "max": "9", "start": "5"}),
        ),
    ],
)
def test_variables(typed, attributes, expected):
    types = (
        '<TypeDefinitions><Type name="T"><RealType unit="m" min="1" max="2"/></Type><Type name="empty"/>'
        '<Type name="N"><IntegerType min="-1" quantity="count"/></Type></TypeDefinitions>'
    )
    (variable,) = fmi1.converted_variables(old(scalar(typed, **attributes), types))
    (inner,) = variable
    found = *(variable.get(key) for key in ("causality", "variability", "initial")), dict(inner.attrib)
    assert found == expected
    assert (variable.get("name"), variable.get("valueReference"), variable.get("description")) == ("x", "7", None)
    assert inner.tag == etree.fromstring(typed).tag.replace("Enumeration", "Integer")


def test_what_version_2_cannot_express_is_left_out():
    """A negated alias, a second variable of a name, a variable without a type; another alias stays."""
    variables = (
        scalar("<Real/>", "a")
        + scalar('<Real start="1"/>', "a")
        + scalar("<Real/>", "minus_a", alias="negatedAlias")
        + scalar("<Real/>", "too", alias="alias")
        + scalar("<DirectDependency/>", "empty")
        + scalar("<DirectDependency/><Real/>", "depends")
    )
    found = [(node.get("name"), node[0].get("start")) for node in fmi1.converted_variables(old(variables))]
    assert found == [("a", None), ("too", None), ("depends", None)]
