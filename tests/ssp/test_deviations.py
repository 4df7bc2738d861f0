"""Files of other tools that break a rule of SSP but have one sensible reading: read with a note, refused by `--strict`."""

import logging
import re
import shutil
import zipfile

import pytest

from tests.ssp.parts import bindings, component, connection, connector, description, system
from twin.errors import ScenarioError
from twin.scenario import lint, load_scenario, ssp_reader

RAMP, SPRING = (f"resources/{name}.fmu" for name in ("ramp", "spring"))
DRIVE = component("drive", RAMP, connector("y", "output"))
WALL = component("wall", SPRING, connector("u", "input"), connector("f", "output"))
WIRE = connection("drive.y", "wall.u")
MAPPING = (
    '<ssd:ParameterMapping><ssm:ParameterMapping version="1.0"><ssm:MappingEntry source="" target="speed"/>'
    '<ssm:MappingEntry source="v" target="speed"/></ssm:ParameterMapping></ssd:ParameterMapping>'
)
OUT = '<ssd:Connectors><ssd:Connector name="out" kind="output"><ssc:Real/></ssd:Connector></ssd:Connectors>'
OSP = (
    '<ssd:DefaultExperiment stopTime="0.1"><ssd:Annotations><ssc:Annotation type="x"><osp:Algorithm>'
    '<osp:FixedStepAlgorithm baseStepSize="0.02"/></osp:Algorithm></ssc:Annotation></ssd:Annotations>'
    "</ssd:DefaultExperiment>"
)


def strict_problems(path):
    """The problems of a file where deviations are problems."""
    token = ssp_reader.STRICT.set(True)
    try:
        return lint(path)[1]
    except ScenarioError as error:
        return error.problems
    finally:
        ssp_reader.STRICT.reset(token)


def notes(caplog, path):
    """What is logged while a file is read without problems; with STRICT, the same are problems."""
    caplog.clear()
    with caplog.at_level(logging.WARNING, "twin"):
        assert lint(path)[1] == []
    logged = [record.getMessage().removeprefix("note: ") for record in caplog.records]
    assert set(logged) <= set(strict_problems(path))
    return "\n".join(logged)


@pytest.mark.slow_repetitions
@pytest.mark.parametrize(
    ("text", "note", "speed", "step_ns"),
    [
        (description(system(component("drive", RAMP, connector("y", "output", "flubs")))), "unit 'flubs' is not known", 3.0, 0),
        (description(system(component("drive", RAMP, more=bindings("speed=1", "speed=2")))), "two values in one set", 2.0, 0),
        (description(system(component("drive", RAMP, more=bindings("v=5", mapping=MAPPING)))), "empty source", 5.0, 0),
        (description(system(DRIVE, before=OUT, connections='<ssd:Connection startElement="drive" startConnector="y" '
                            'endElement="" endConnector="out"/>')), 'endElement="" is read as the system', 3.0, 0),
        (description(system(DRIVE), OSP), "the prefix osp is used without xmlns:osp", 3.0, 20_000_000),
    ],
)  # fmt: skip
def test_read_with_a_note(bench, caplog, text, note, speed, step_ns):
    path = bench.ssp(text)
    assert note in notes(caplog, path)
    (case,) = load_scenario(path).variants
    assert case.members["drive"].parameters.get("speed", 3.0) == speed
    assert not step_ns or case.step_ns == step_ns


def draft(text):
    """The same in the draft of 2017, in which transformations of a mapping have the mapping's namespace."""
    text = re.sub(r"http://ssp-standard.org/SSP1/(\w+)", r"http://www.pmsf.net/xsd/\1Draft", text)
    return text.replace('version="1.0" name="p"', 'version="Draft20170606" name="p"').replace(
        'version="1.0">', 'version="Draft20170606">'
    )


LINEAR = 'target="speed"><ssm:LinearTransformation factor="2" offset="1"/></ssm:MappingEntry>'
TRANSFORMED = MAPPING.replace('source="v" target="speed"/>', f'source="v" {LINEAR}')
FMIGO = '<ssd:Annotations><ssc:Annotation type="x"><f:{} xmlns:f="http://umit.math.umu.se/FmiGo.xsd"{}/></ssc:Annotation></ssd:Annotations>'


def test_a_draft_is_read_as_ssp_1(bench, caplog):
    driven = component("drive", RAMP, connector("y", "output"), more=bindings("v=5", mapping=TRANSFORMED))
    arguments = FMIGO.format("MasterArguments", ' timestep="0.02"')
    path = bench.ssp(draft(description(system(driven + WALL, WIRE), arguments)))
    assert "SystemStructure.ssd:2: Draft20170606 of SSP is read as 1.0" in notes(caplog, path)
    (case,) = load_scenario(path, ["stop_time=0.1 s"]).variants
    assert (case.members["drive"].parameters["speed"], case.step_ns) == (11.0, 20_000_000)
    recorded = bench.run(path, "stop_time=0.1 s")
    assert recorded["drive.y"][-1] == pytest.approx(11.0 * 0.1)
    assert recorded["wall.f"][-1] != 0.0


def test_constraints_of_fmigo_are_refused(bench):
    path = bench.ssp(draft(description(system(DRIVE), FMIGO.format("KinematicConstraints", ""))))
    with pytest.raises(ScenarioError, match=r"SystemStructure.ssd:11: <KinematicConstraints> of FMIGo cannot be read"):
        load_scenario(path)


def test_a_spare_description_that_cannot_be_read_is_left_out(bench, caplog):
    path = bench.ssp(description(system(DRIVE)))
    with zipfile.ZipFile(path, "a") as archive:
        archive.writestr("Spare.ssd", description(system(component("drive", "resources/none.fmu"))))
        archive.writestr("Text.ssd", "no XML")
    logged = notes(caplog, path)
    assert "Spare.ssd is left out" in logged
    assert "Text.ssd is left out" in logged
    assert len(load_scenario(path).variants) == 1


def test_messages_of_an_unpacked_description_start_with_its_path(bench):
    file = bench.folder / "SystemStructure.ssd"
    file.write_text(description(system("")))
    with pytest.raises(ScenarioError, match=rf"^{re.escape(str(file))}:\d+: the system has no FMU"):
        load_scenario(file)


@pytest.mark.slow
def test_a_folder_runs_like_its_archive(bench, caplog):
    path = bench.ssp(description(system(DRIVE + WALL, WIRE)))
    archived = bench.run(path)
    with zipfile.ZipFile(path) as archive:
        archive.extractall(bench.folder / "unpacked")
    for given in (bench.folder / "unpacked", bench.folder / "unpacked" / "SystemStructure.ssd"):
        assert not notes(caplog, given)
        assert (bench.run(given)["wall.f"] == archived["wall.f"]).all()
    shutil.move(bench.folder / "unpacked" / "resources", bench.folder / "resources")
    outside = bench.folder / "unpacked" / "SystemStructure.ssd"
    outside.write_text(outside.read_text().replace('source="resources', 'source="../resources'))
    assert "is outside the folder" in notes(caplog, outside)


OSP_STRUCTURE = """<?xml version="1.0"?>
<OspSystemStructure xmlns="http://opensimulationplatform.com/MSMI/OSPSystemStructure" version="0.1">
  <EndTime>0.1</EndTime><BaseStepSize>1e-3</BaseStepSize><Algorithm>fixedStep</Algorithm>
  <Simulators>
    <Simulator name="drive" source="ramp.fmu" stepSize="0.0021"><InitialValues>
      <InitialValue variable="speed"><Real value="{speed}"/></InitialValue></InitialValues></Simulator>
    <Simulator name="wall" source="{source}"/>
  </Simulators>
  <Functions><LinearTransformation name="half" factor="0.5" offset="1"/></Functions>
  <Connections>{connections}</Connections>
</OspSystemStructure>"""
THROUGH = (
    '<SignalConnection><Variable simulator="drive" name="y"/><Signal function="half" name="in"/></SignalConnection>'
    '<SignalConnection><Signal function="half" name="out"/><Variable simulator="wall" name="u"/></SignalConnection>'
)
GROUPS = (
    '<VariableGroupConnection><VariableGroup simulator="drive" name="out"/>'
    '<VariableGroup simulator="wall" name="in"/></VariableGroupConnection>'
)
MODEL = '<OspModelDescription><VariableGroups><Generic name="{}"><Variable ref="{}"/></Generic></VariableGroups></OspModelDescription>'


def osp(bench, connections, speed="4", source="spring.fmu"):
    """An OspSystemStructure beside two FMUs and their model descriptions."""
    for name in ("ramp", "spring"):
        shutil.copy(bench.fmus[f"resources/{name}.fmu"], bench.folder / f"{name}.fmu")
    (bench.folder / "ramp_OspModelDescription.xml").write_text(MODEL.format("out", "y"))
    (bench.folder / "Spring_OspModelDescription.xml").write_text(MODEL.format("in", "u"))
    path = bench.folder / "OspSystemStructure.xml"
    path.write_text(OSP_STRUCTURE.format(connections=connections, speed=speed, source=source))
    return path


@pytest.mark.slow
def test_a_system_structure_of_the_osp(bench, caplog):
    """As libcosim runs it: base step, steps of simulators, start values, groups; no conversion of units."""
    for connections, factor, offset in ((GROUPS, 1.0, 0.0), (THROUGH, 0.5, 1.0)):
        path = osp(bench, connections)
        assert not notes(caplog, path)
        (case,) = load_scenario(path).variants
        assert case.step_ns == 1_000_000
        assert case.members["drive"].communication_ns == 2_000_000
        recorded = bench.run(path)
        assert recorded["drive.y"][-1] == pytest.approx(4.0 * 0.1)
        assert recorded["wall.f"][-1] == pytest.approx(100.0 * (factor * recorded["drive.y"][-2] + offset))


@pytest.mark.slow_repetitions
@pytest.mark.parametrize(
    ("changes", "expected"),
    [
        ({"speed": "fast"}, "`fast` is not a finite number"),
        ({"source": "none.fmu"}, "`none.fmu` is not there"),
        ({"connections": GROUPS.replace('"in"', '"inn"')}, "has no group `inn`. Did you mean `in`?"),
        ({"connections": GROUPS.replace('"wall"', '"wal"')}, "there is no simulator `wal`. Did you mean `wall`?"),
        ({"connections": THROUGH.replace('"u"', '"v"')}, "has no connector `v`"),
    ],
)
def test_what_is_wrong_with_it(bench, changes, expected):
    path = osp(bench, **{"connections": GROUPS, **changes})
    assert any(expected in problem for problem in lint(path)[1])


def test_another_xml_file_is_refused(bench):
    path = bench.folder / "other.xml"
    path.write_text("<a/>")
    with pytest.raises(ScenarioError, match="is no OspSystemStructure"):
        load_scenario(path)
