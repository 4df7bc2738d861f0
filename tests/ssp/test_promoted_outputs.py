"""Local variables that become outputs of an exported FMU: only the model description changes, sorted by number."""

import io
import zipfile

import pytest
from lxml import etree

from twin.ssp import promote_locals_to_outputs

DESCRIPTION_2 = """<fmiModelDescription fmiVersion="2.0"><ModelVariables>
<ScalarVariable name="x" causality="local" initial="exact"><Real/></ScalarVariable>
<ScalarVariable name="der(x)" causality="local"><Real derivative="1"/></ScalarVariable>
<ScalarVariable name="a" causality="local" initial="calculated"><Real/></ScalarVariable>
<ScalarVariable name="u" causality="input"><Real/></ScalarVariable>
<ScalarVariable name="y" causality="output"><Real/></ScalarVariable>
<ScalarVariable name="b" causality="local" initial="exact"><Real/></ScalarVariable>
<ScalarVariable name="c" causality="local" initial="approx"><Real/></ScalarVariable>
<ScalarVariable name="v" causality="input"><Real/></ScalarVariable>
</ModelVariables><ModelStructure>{outputs}<Derivatives><Unknown index="2"/></Derivatives>{initial}</ModelStructure>
</fmiModelDescription>"""
OUTPUT_Y = '<Outputs><Unknown index="5" dependencies="4"/></Outputs>'
DESCRIPTION_3 = """<fmiModelDescription fmiVersion="3.0"><ModelVariables>
<Float64 name="x" valueReference="10" causality="local" initial="exact"/>
<Float64 name="der(x)" valueReference="11" causality="local" derivative="10"/>
<Float64 name="a" valueReference="2" causality="local" initial="calculated"/>
<Float64 name="u" valueReference="3" causality="input"/>
<Float64 name="y" valueReference="5" causality="output"/>
<Float64 name="b" valueReference="20" causality="local" initial="exact"/>
</ModelVariables><ModelStructure>{outputs}</ModelStructure></fmiModelDescription>"""


def promoted(text, names):
    """The root of the changed description, and its other file."""
    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, "w") as archive:
        archive.writestr("modelDescription.xml", text)
        archive.writestr("binaries/a.so", b"library")
    with zipfile.ZipFile(io.BytesIO(promote_locals_to_outputs(buffer.getvalue(), names))) as archive:
        assert archive.read("binaries/a.so") == b"library"
        return etree.fromstring(archive.read("modelDescription.xml"))


def entries(parent):
    """(tag, number, dependencies) of each entry."""
    return [(node.tag, node.get("index") or node.get("valueReference"), node.get("dependencies")) for node in parent]


def causalities(root):
    """Causality by name."""
    return {node.get("name"): node.get("causality") for node in root.find("ModelVariables")}


def test_version_2_counts_variables_from_1():
    """`a` depends on u, v and the state x, `b` on nothing but the state, what `c` depends on is not known."""
    text = DESCRIPTION_2.format(outputs=OUTPUT_Y, initial='<InitialUnknowns><Unknown index="5"/></InitialUnknowns>')
    root = promoted(text, {"c": None, "a": ("v", "u"), "b": (), "y": ("u",), "u": None})
    assert causalities(root) == {
        "x": "local",
        "der(x)": "local",
        "u": "input",
        "v": "input",
        **dict.fromkeys("aybc", "output"),
    }
    structure = root.find("ModelStructure")
    assert [node.tag for node in structure] == ["Outputs", "Derivatives", "InitialUnknowns"]
    assert entries(structure[0]) == [
        ("Unknown", "3", "1 4 8"),
        ("Unknown", "5", "4"),
        ("Unknown", "6", "1"),
        ("Unknown", "7", None),
    ]
    # initial values of `calculated` and `approx` are unknown
    assert entries(structure[2]) == [("Unknown", "3", None), ("Unknown", "5", None), ("Unknown", "7", None)]


def test_version_2_without_outputs_before():
    structure = promoted(DESCRIPTION_2.format(outputs="", initial=""), {"a": ("u",), "b": None}).find("ModelStructure")
    assert [node.tag for node in structure] == ["Outputs", "Derivatives", "InitialUnknowns"]
    assert [entries(structure[0]), entries(structure[2])] == [
        [("Unknown", "3", "1 4"), ("Unknown", "6", None)],
        [("Unknown", "3", None)],
    ]


@pytest.mark.parametrize(
    ("before", "expected"),
    [
        ("", ["Output 2", "Output 20", "InitialUnknown 2"]),
        ('<Output valueReference="5"/>', ["Output 2", "Output 5", "Output 20", "InitialUnknown 2"]),
        (
            '<Output valueReference="2"/><ContinuousStateDerivative valueReference="11"/><InitialUnknown valueReference="3"/>',
            ["Output 2", "Output 20", "ContinuousStateDerivative 11", "InitialUnknown 2", "InitialUnknown 3"],
        ),
    ],
)
def test_version_3_counts_by_value_references(before, expected):
    root = promoted(DESCRIPTION_3.format(outputs=before), {"b": None, "a": ("u",)})
    found = entries(root.find("ModelStructure"))
    assert [f"{tag} {number}" for tag, number, _ in found] == expected
    dependencies = {tag + number: text for tag, number, text in found}
    assert dependencies["Output20"] is dependencies["InitialUnknown2"] is None
    assert dependencies["Output2"] == (None if "2" in before.partition("/>")[0] else "3 10")


def test_nothing_to_promote_changes_nothing():
    text = DESCRIPTION_2.format(outputs=OUTPUT_Y, initial="")
    assert etree.tostring(promoted(text, {})) == etree.tostring(etree.fromstring(text))
    assert etree.tostring(promoted(text, {"y": None, "u": ("y",)})) == etree.tostring(etree.fromstring(text))
