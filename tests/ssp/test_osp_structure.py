"""What is read from an OspSystemStructure.xml: simulators, steps, start values, connections, groups, and what is wrong with it."""

import pytest

from twin.ssp.model import End, Linear, Messages
from twin.ssp.osp import OspReader

MODEL = '<OspModelDescription xmlns="http://opensimulationplatform.com/MSMI/OSPModelDescription"><VariableGroups>{}</VariableGroups></OspModelDescription>'
GROUPS_A = (
    '<Force name="push"><Variable ref="f1"/><Variable ref="f2"/></Force>'
    '<Torsion name="turn"><AngularVelocity name="w"><Variable ref="w"/></AngularVelocity>'
    '<Variable ref="own"/><AngularDisplacement name="d"><Variable ref="d"/></AngularDisplacement></Torsion>'
)
GROUPS_B = (
    '<Force name="in"><Variable ref="x"/><Variable ref="y"/></Force><Force name="one"><Variable ref="x"/></Force>'
    '<Torsion name="turned"><AngularDisplacement name="q"><Variable ref="angle"/></AngularDisplacement><Variable ref="first"/>'
    '<AngularVelocity name="w"><Variable ref="speed"/></AngularVelocity></Torsion>'
)


@pytest.fixture
def read(tmp_path):
    """Reads a structure beside a.fmu and fmus/b.fmu."""
    (tmp_path / "fmus").mkdir()
    for file, groups in (("a", GROUPS_A), ("fmus/B", GROUPS_B)):
        (tmp_path / f"{file.lower()}.fmu").write_bytes(b"")
        (tmp_path / f"{file}_OspModelDescription.xml").write_text(MODEL.format(groups))

    def reader(simulators="", functions="", connections="", head=""):
        path = tmp_path / "S.xml"
        path.write_text(
            f'<OspSystemStructure xmlns="http://opensimulationplatform.com/MSMI/OSPSystemStructure" version="0.1">{head}\n'
            '<Simulators><Simulator name="a" source="a.fmu"/><Simulator name="b" source="fmus/b.fmu"/>'
            f"{simulators}</Simulators>\n<Functions>{functions}</Functions>\n<Connections>{connections}</Connections>\n"
            "</OspSystemStructure>"
        )
        return OspReader(path, "S.xml", Messages())

    return reader


def variables(kind, *ends):
    """A connection of variables or groups, `simulator.name`."""
    inside = "".join('<{} simulator="{}" name="{}"/>'.format(kind, *end.split(".")) for end in ends)
    return f"<{kind}Connection>{inside}</{kind}Connection>"


def signal(function, name, end, before=True):
    """A connection of a variable and a function."""
    parts = (
        '<Variable simulator="{}" name="{}"/>'.format(*end.split(".")),
        f'<Signal function="{function}" name="{name}"/>',
    )
    return f"<SignalConnection>{''.join(parts if before else parts[::-1])}</SignalConnection>"


def test_the_system_and_its_files(read, tmp_path):
    reader = read(
        '<Simulator name="c d" source="fmus/%62.fmu"/>', head="<BaseStepSize>0.5</BaseStepSize>\n<EndTime>-2</EndTime>"
    )
    system = reader.system()
    assert (system.kind, system.name, system.where) == ("system", "S", "S.xml:1")
    assert [(one.kind, one.name, one.where, one.fmu, one.communication_step) for one in system.elements] == [
        ("component", "a", "S.xml:3", str(tmp_path / "a.fmu"), None),
        ("component", "b", "S.xml:3", str(tmp_path / "fmus/b.fmu"), None),
        ("component", "c d", "S.xml:3", str(tmp_path / "fmus/b.fmu"), None),
    ]
    assert [reader.time(tag) for tag in ("BaseStepSize", "EndTime", "StartTime")] == [0.5, -2.0, None]
    assert (reader.messages.problems, reader.messages.deviations, reader.messages.notes) == ([], [], [])


@pytest.mark.parametrize(
    ("base", "step", "expected"),
    [
        ("0.1", "0.24", 2 * 0.1),  # as libcosim: the nearest multiple of the base step, one at least
        ("0.1", "0.26", 3 * 0.1),
        ("0.1", "0.01", 0.1),
        ("0.1", "0", None),
        ("0.1", "-1", None),
        (None, "0.2", None),
        ("0", "0.2", 0.0),  # refused later, for it is no step
    ],
)
def test_steps_of_simulators(read, base, step, expected):
    reader = read(
        f'<Simulator name="c" source="a.fmu" stepSize="{step}"/>',
        head=f"<BaseStepSize>{base}</BaseStepSize>" if base else "",
    )
    assert reader.system().elements[2].communication_step == expected


def test_start_values_have_the_types_they_are_written_with(read):
    values = '<Real value="1e3"/>', '<Integer value="-4"/>', '<Boolean value="true"/>', '<String value=" a "/>'
    inside = "".join(f'<InitialValue variable="v{i}">{text}</InitialValue>' for i, text in enumerate(values))
    reader = read(f'<Simulator name="c" source="a.fmu"><InitialValues>\n{inside}</InitialValues></Simulator>')
    (binding,) = reader.system().elements[2].bindings
    assert (binding.mapping, binding.where) == (None, "S.xml:2")
    assert [(one.name, one.value, one.unit, one.where) for one in binding.parameters] == [
        ("v0", 1000.0, None, "S.xml:3"),
        ("v1", -4, None, "S.xml:3"),
        ("v2", True, None, "S.xml:3"),
        ("v3", " a ", None, "S.xml:3"),
    ]
    assert reader.messages.problems == []


def test_a_proxy_is_run_here(read, tmp_path):
    reader = read('<Simulator name="c" source="proxyfmu://host:99?file=fmus/b.fmu"/>')
    assert reader.system().elements[2].fmu == str(tmp_path / "fmus/b.fmu")
    assert reader.messages.deviations == ["S.xml:2: `c` is run here, not by a proxy at host:99."]
    assert reader.messages.problems == []


def shown(connections):
    """`source -> target` of each, with its transformation."""
    return [(one.text, one.change, one.suppress) for one in connections]


def test_connections_and_transformations(read):
    functions = (
        '<LinearTransformation name="half" factor="0.5" offset="1"/><LinearTransformation name="same"/>'
        '<LinearTransformation name="idle" factor="3"/>'
    )
    wires = (
        variables("Variable", "a.y", "b.u")
        + signal("half", "in", "a.x", before=False)
        + signal("same", "in", "a.x")
        + signal("half", "out", "b.v")
        + signal("half", "out", "b.w", before=False)
        + signal("same", "out", "b.z")
    )
    reader = read(functions=functions, connections=wires)
    found = reader.system().connections
    assert shown(found) == [
        ("a.y -> b.u", None, True),
        ("a.x -> b.v", Linear(0.5, 1.0), True),
        ("a.x -> b.w", Linear(0.5, 1.0), True),
        ("a.x -> b.z", Linear(), True),
    ]
    assert (found[0].start, found[0].end, found[0].where) == (End("a", "y"), End("b", "u"), "S.xml:4")
    assert reader.functions == {"half": Linear(0.5, 1.0), "same": Linear(1.0, 0.0), "idle": Linear(3.0, 0.0)}
    assert reader.messages.problems == []


def test_groups_are_connected_variable_by_variable(read):
    """Own variables first, then those of inner groups in the order of their kinds, whatever the order in the files."""
    groups = variables("VariableGroup", "a.push", "b.in") + variables("VariableGroup", "a.turn", "b.turned")
    reader = read(connections=groups)
    assert shown(reader.system().connections) == [
        ("a.f1 -> b.x", None, True),
        ("a.f2 -> b.y", None, True),
        ("a.own -> b.first", None, True),
        ("a.d -> b.angle", None, True),
        ("a.w -> b.speed", None, True),
    ]
    assert reader.messages.problems == []


@pytest.mark.parametrize(
    ("parts", "expected"),
    [
        (
            {"connections": variables("VariableGroup", "a.push", "b.one")},
            "S.xml:4: `push` has 2 variables, `one` 1. Connect variables instead.",
        ),
        (
            {"connections": variables("VariableGroup", "a.push", "b.inn")},
            "S.xml:4: B_OspModelDescription.xml has no group `inn`. Did you mean `in`?",
        ),
        (
            {"connections": variables("VariableGroup", "aa.push", "b.in")},
            "S.xml:4: there is no simulator `aa`. Did you mean `a`?",
        ),
        (
            {
                "simulators": '<Simulator name="c" source="fmus/c.fmu"/>',
                "connections": variables("VariableGroup", "c.x", "b.in"),
            },
            "S.xml:4: there is no c_OspModelDescription.xml for the group `x`. Add it.",
        ),
        ({"simulators": '<Simulator name="c" source="c.fmu"/>'}, "S.xml:2: `c.fmu` is not there. Correct the path."),
        (
            {"simulators": '<Simulator name="c" source="http://h/a.fmu"/>'},
            "S.xml:2: `http://h/a.fmu` is no path. Name a file.",
        ),
        (
            {"connections": variables("Variable", "a.y")},
            "S.xml:4: a VariableConnection cannot be read. Connect variables instead.",
        ),
        ({"connections": variables("Variable", "a.y", "b.u", "b.v")}, "S.xml:4: a VariableConnection cannot be read."),
        ({"connections": variables("VariableGroup", "a.push")}, "S.xml:4: a VariableGroupConnection cannot be read."),
        ({"connections": "<SignalGroupConnection/>"}, "S.xml:4: a SignalGroupConnection cannot be read."),
        (
            {"connections": '<SignalConnection><Variable simulator="a" name="y"/></SignalConnection>'},
            "S.xml:4: a connection has one Variable and one Signal.",
        ),
        (
            {"functions": '<LinearTransformation name="half" factor="big"/>'},
            "S.xml:3: factor: `big` is not a finite number.",
        ),
        (
            {"functions": '<Sum name="s"/>'},
            "S.xml:3: Sum `s` cannot be computed here. Put a component that adds in its place.",
        ),
        ({"functions": '<VectorSum name="v"/>'}, "S.xml:3: VectorSum `v` cannot be computed here."),
        ({"head": "<BaseStepSize>short</BaseStepSize>"}, "S.xml:1: BaseStepSize: `short` is not a finite number."),
        (
            {"simulators": '<Simulator name="c" source="a.fmu" stepSize="x"/>'},
            "S.xml:2: stepSize: `x` is not a finite number.",
        ),
    ],
)
def test_what_is_wrong(read, parts, expected):
    reader = read(**parts)
    reader.system()
    assert any(problem.startswith(expected) for problem in reader.messages.problems), reader.messages.problems


def test_a_wrong_start_value_is_left_out(read):
    inside = '<InitialValue variable="v"><Real value="x"/></InitialValue><InitialValue variable="w"><Odd value="1"/></InitialValue>'
    reader = read(f'<Simulator name="c" source="a.fmu"><InitialValues>{inside}</InitialValues></Simulator>')
    assert reader.system().elements[2].bindings[0].parameters == []
    assert reader.messages.problems == [
        "S.xml:2: v: `x` is not a finite number. Correct it.",
        "S.xml:2: w: a value of type `Odd` cannot be read. Use Real, Integer, Boolean or String.",
    ]


@pytest.mark.parametrize(
    ("text", "has_note"), [("fixedStep", False), (" fixedStep\n", False), ("", False), ("ecco", True)]
)
def test_algorithms(read, text, has_note):
    reader = read(head=f"<Algorithm>{text}</Algorithm>")
    reader.system()
    note = f"S.xml:1: the algorithm {text} is not read: name one with --set algorithm=..."
    assert reader.messages.notes == ([note] if has_note else [])
