"""What is wrong with an SSP is told all at once, a line each with its place; nothing of it can do harm."""

import zipfile

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from tests.ssp.parts import bindings, component, connection, connector, description, packed, system
from twin.errors import ScenarioError
from twin.scenario import lint, load_scenario, ssp_reader
from twin.ssp.document import parse_root

RAMP, SPRING, BARE = (f"resources/{name}.fmu" for name in ("ramp", "spring", "bare"))
DRIVE = component("drive", RAMP, connector("y", "output"))
WALL = component("wall", SPRING, connector("u", "input"), connector("f", "output"))
WIRE = connection("drive.y", "wall.u")


def problems(bench, text, files=None):
    """What is wrong, without the archive's name."""
    path = bench.ssp(text, files)
    try:
        found = lint(path)[1]
    except ScenarioError as error:
        found = error.problems
    return [one.replace(f"{path}/", "").replace(str(path), "s.ssp") for one in found]


MAPPED = (
    '<ssd:ParameterMapping><ssm:ParameterMapping version="1.0"><ssm:MappingEntry source="{}" target="{}"/>'
    "</ssm:ParameterMapping></ssd:ParameterMapping>"
)


@pytest.mark.parametrize(
    ("root", "expected"),
    [
        (system(DRIVE + WALL, connection("drive.y", "wal.u")),
         "SystemStructure.ssd:6: drive.y -> wal.u: there is no element `wal`. Did you mean `wall`?"),
        (system(DRIVE + WALL, connection("drive.yy", "wall.u")),
         "SystemStructure.ssd:6: drive.yy -> wall.u: `drive` has no connector `yy`."),
        (system(DRIVE + WALL, connection("drive.y", "wall.f")),
         "SystemStructure.ssd:6: drive.y -> wall.f: output of the element and output of the element cannot be connected."),
        (system(DRIVE + WALL, WIRE + connection("wall.f", "wall.u")),
         "SystemStructure.ssd:7: wall.f -> wall.u: it has another source already, drive.y -> wall.u (SystemStructure.ssd:6)"),
        (system(DRIVE + WALL, WIRE + WIRE), "SystemStructure.ssd:7: drive.y -> wall.u: it has another source already"),
        (system(DRIVE + DRIVE), "SystemStructure.ssd:5: there are two elements `drive` here. Rename one."),
        (system(component("drive", RAMP, connector("y", "input"))),
         "SystemStructure.ssd:4: `drive` has the connector `y` as input, but it is output in the FMU. Correct the kind."),
        (system(component("drive", RAMP, connector("z", "output"))),
         "SystemStructure.ssd:4: `drive` has the connector `z`, but its FMU has no such variable."),
        (system(component("drive", RAMP, connector("y", "output", "m"))),
         "SystemStructure.ssd:4: `drive` has the connector `y` in m, but it is in mm in the FMU. Correct the unit."),
        (system(component("drive", RAMP, connector("y", "output", "parsec/h"))),
         "SystemStructure.ssd:4: `drive` has the connector `y` in parsec/h"),
        (system(component("drive", RAMP, connector("y", "output")) + component("wall", SPRING, connector("bias", "input")),
                connection("drive.y", "wall.bias")),
         "SystemStructure.ssd:6: drive.y -> wall.bias: mm does not convert to N."),
        (system(component("drive", "resources/none.fmu")),
         "SystemStructure.ssd:4: `resources/none.fmu` is not in the archive."),
        (system(component("drive", "../ramp.fmu")), "SystemStructure.ssd:4: `../ramp.fmu` leads out of the archive."),
        (system(component("drive", "https://a.b/ramp.fmu")),
         "SystemStructure.ssd:4: `https://a.b/ramp.fmu` is no path inside the archive."),
        (system(component("drive", RAMP, more=bindings("speed=fast"))), "SystemStructure.ssd:4: `fast` is not a finite number."),
        (system(component("drive", RAMP, more=bindings("speed=1 N"))), "SystemStructure.ssd:4: speed: N does not convert to mm/s."),
        (system(component("drive", RAMP, more=bindings("y=1"))), "SystemStructure.ssd:4: drive.y is an output."),
        (system(component("drive", RAMP, more=bindings("v=1", mapping=MAPPED.format("v", "sped")))),
         "SystemStructure.ssd:5: nothing is called `sped` in drive. Did you mean `speed`?"),
        (system(component("drive", RAMP, more=bindings("v=1", mapping=MAPPED.format("w", "speed")))),
         "SystemStructure.ssd:5: the parameter set has no `w`."),
        (system(DRIVE + WALL, connection("drive.y", "wall.u", inside='<ssc:BooleanMappingTransformation>'
                '<ssc:MapEntry source="true" target="false"/></ssc:BooleanMappingTransformation>')),
         "SystemStructure.ssd:6: drive.y -> wall.u: maps single values, which only a component can do."),
        (system(""), "SystemStructure.ssd:2: the system has no FMU. Add a component."),
        (system('<ssd:Component name="a" source="resources/x.mo" type="text/x-modelica"/>'),
         "SystemStructure.ssd:4: component `a` is `text/x-modelica`. Give it as an FMU."),
        (system('<ssd:Component name="a" source="#there" type="application/x-ssp-definition"/>'),
         "SystemStructure.ssd:4: there is no system with the id `there` here."),
    ],
)  # fmt: skip
def test_one_mistake(bench, root, expected):
    found = problems(bench, description(root))
    assert any(one.startswith(expected) for one in found), found


def test_all_mistakes_at_once(bench):
    drive = component("drive", RAMP, connector("y", "outputt"), more=bindings("speed=fast"))
    wires = connection("drive.y", "wal.u") + connection("drive.x", "wall.u")
    found = problems(bench, description(system(drive + WALL + component("lost", "resources/lost.fmu"), wires)))
    assert len(found) >= 5
    assert all(one.startswith("SystemStructure.ssd:") for one in found)
    lines = [int(one.split(":")[1]) for one in found]
    assert lines == sorted(lines)


def test_values_for_nobody_are_left_out_with_a_note(bench):
    path = bench.ssp(
        description(system(DRIVE, before=bindings("drive.sped=1", "speed=7", *(f"n.k{i}=2" for i in range(9)))))
    )
    assert lint(path)[1] == []
    first, second, *_, more, step = ssp_reader.notes(path, "s.ssp")
    assert first == (
        "s.ssp/SystemStructure.ssd:3: nothing is called `drive.sped` in the system: its value is left out. "
        "Did you mean `drive.speed`?"
    )
    assert "nothing is called `speed` in the system: its value is left out." in second
    assert more.endswith("6 more values fit nothing and are left out.")
    assert "says no communication step" in step


@pytest.mark.parametrize(
    ("experiment", "expected"),
    [
        ("", "ok"),  # the FMUs suggest 1 s
        (
            '<ssd:DefaultExperiment stopTime="never"/>',
            "SystemStructure.ssd:11: stopTime is `never`, expected a number.",
        ),
        (
            '<ssd:DefaultExperiment stopTime="-1"/>',
            "SystemStructure.ssd:2: stop_time -1 s is not after start_time 0 s.",
        ),
    ],
)
def test_times(bench, experiment, expected):
    found = problems(bench, description(system(DRIVE), experiment))
    assert any(one.startswith(expected) for one in found or ["ok"]), found


@pytest.mark.parametrize(
    ("name", "expected"),
    [("../evil.ssv", "leads out of its folder"), ("/evil", "is an absolute path"), ("a\\b", "has a backslash")],
)
def test_paths_that_lead_out_are_refused(bench, name, expected):
    with pytest.raises(ScenarioError, match=expected) as caught:
        load_scenario(bench.ssp(description(system(DRIVE)), {name: "x"}))
    assert "FMU" not in str(caught.value).replace(str(bench.folder), "")
    assert not (bench.folder / "evil.ssv").exists()


def test_entities_are_refused(bench):
    bomb = '<!DOCTYPE a [<!ENTITY b "bbbbbbbbbb"><!ENTITY c "&b;&b;&b;&b;">]>'
    text = description(system(DRIVE)).replace("?>\n", f"?>\n{bomb}\n")
    assert problems(bench, text)[0].startswith("SystemStructure.ssd has a document type declaration. SSP needs none")


def test_systems_that_are_parts_of_themselves_are_refused(bench):
    inner = (
        '<ssd:System name="a" id="a"><ssd:Elements>'
        + "".join(f'<ssd:Component name="{n}" source="#a" type="application/x-ssp-definition"/>' for n in "xyz")
        + "</ssd:Elements></ssd:System>"
    )
    (line,) = problems(bench, description(system(inner)))
    assert "systems are nested more than" in line


def test_no_description_and_no_archive(bench):
    path = bench.folder / "s.ssp"
    with zipfile.ZipFile(path, "w") as archive:
        archive.writestr("Other.ssd", "x")
    with pytest.raises(ScenarioError, match=r"has no SystemStructure.ssd at its top. It has Other.ssd: rename one."):
        load_scenario(path)
    with pytest.raises(ScenarioError, match="cannot be read"):
        load_scenario(bench.folder / "none.ssp")


@settings(max_examples=15, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(st.data())
def test_broken_descriptions_end_in_lines(bench, data):
    text = description(
        system(DRIVE + WALL + component("b", BARE, connector("u", "input")), WIRE, before=bindings("drive.speed=1 N"))
    )
    for _ in range(data.draw(st.integers(1, 3))):
        begin = data.draw(st.integers(0, len(text)))
        end = data.draw(st.integers(begin, min(len(text), begin + 30)))
        text = text[:begin] + data.draw(st.sampled_from(["", '"', "<", "0", "ssd:", "&x;", "name=", "/>"])) + text[end:]
    path = packed(bench.folder / "s.ssp", text, bench.fmus)
    try:
        found = lint(path)[1]
    except ScenarioError as error:
        found = error.problems
    assert all(isinstance(one, str) and "\n" not in one and len(one) < 2000 for one in found)


def test_files_that_a_document_type_names_are_not_read(tmp_path):
    """Only then is the undeclared prefix all that is wrong with this one."""
    (tmp_path / "broken.dtd").write_text("<!ELEMENT")
    deviations: list[str] = []
    with pytest.raises(ScenarioError, match="document type declaration"):
        parse_root(f'<!DOCTYPE a SYSTEM "{tmp_path}/broken.dtd"><a><osp:b/></a>'.encode(), "a.ssd", deviations)
    assert [text.partition(" is used")[0] for text in deviations] == ["a.ssd:1: the prefix osp"]
