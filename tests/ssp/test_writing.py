"""A scenario as an SSP: it reads back as the same system, and others read it."""

import io
import zipfile

import fmpy.ssp.ssd
import fmpy.validation
import numpy as np
import pytest
from fmpy.ssp.simulation import simulate_ssp
from lxml import etree

from tests.ssp.parts import bindings, component, connection, connector, description, system
from twin.errors import ScenarioError
from twin.scenario import load_scenario, members, pack
from twin.ssp import promote_locals_to_outputs
from twin.ssp.document import violations

SCENARIO = """\
title: A ramp on a spring
stop_time: 40 ms
step: 1 ms
seeds: [3, 4]
members:
  drive: {component: 'tests.ssp.parts:Ramp', parameters: {speed: 2 mm/s}}
  wall: {component: 'tests.ssp.parts:Spring', parameters: {stiffness: 0.2 N/mm}}
  memory: {component: 'tests.ssp.parts:Memory'}
  gain: {component: 'tests.ssp.parts:Bare'}
  pair: {component: 'tests.ssp.parts:Pair', parameters: {gain: [2, 3]}}
connections:
  - drive.y -> wall.u
  - {from: wall.f, to: memory.u, factor: 2, offset: 0.25}
  - memory.mean -> gain.u
  - memory.last -> pair.u
events: [{at: 20 ms, set: {drive.speed: 5 mm/s}}]
record: [wall.f, memory.mean, gain.y, pair.y, drive.*]
metrics:
  most: {signal: wall.f, reduce: max, unit: N}
  one: {signal: 'pair.y[2]', reduce: max}
expect:
  - {metric: most, at_most: 1 N}
"""


@pytest.fixture(scope="module")
def scenario_file(tmp_path_factory):
    path = tmp_path_factory.mktemp("scenario") / "ramp.yaml"
    path.write_text(SCENARIO)
    return path


def packed_as(bench, path, version, **options):
    target = bench.folder / f"ramp{version}.ssp"
    return target, pack(load_scenario(path), target, bench.build, version=version, **options)


@pytest.mark.slow
@pytest.mark.parametrize("version", ["2.0", "3.0"])
def test_it_reads_back_as_what_it_was(bench, scenario_file, version):
    path, notes = packed_as(bench, scenario_file, version)
    ours, theirs = bench.run(scenario_file), bench.run(path)
    for name in ("wall.f", "memory.mean", "gain.y"):
        np.testing.assert_array_equal(ours[name], theirs[name])
    pairs = theirs["pair.y"] if version == "3.0" else np.stack([theirs["pair.y[1]"], theirs["pair.y[2]"]], axis=1)
    np.testing.assert_array_equal(ours["pair.y"], pairs)
    assert any("1 event: kept" in one for one in notes)
    assert any("memory communicates every 2 ms" in one for one in notes)
    assert any("`one` needs an array" in one for one in notes) == (version == "2.0")
    again = load_scenario(path)
    assert set(again.metrics) == {"most"} | ({"one"} if version == "3.0" else set())
    assert again.expectations[0].metric == "most"


@pytest.mark.slow
def test_others_read_it(bench, scenario_file):
    path, _ = packed_as(bench, scenario_file, "2.0")
    found = fmpy.ssp.ssd.read_ssd(str(path))
    assert [one.name for one in found.system.elements] == ["drive", "wall", "memory", "gain", "pair"]
    with zipfile.ZipFile(path) as archive:
        text = etree.fromstring(archive.read("SystemStructure.ssd"))
        changed = text.findall(".//{*}LinearTransformation")
        assert [(one.get("factor"), one.get("offset")) for one in changed] == [("0.001", "0.0"), ("2.0", "0.25")]
        memory = bench.folder / "memory.fmu"
        memory.write_bytes(archive.read("resources/memory.fmu"))
    assert fmpy.validation.validate_fmu(str(memory)) == []
    shown = {v.name for v in fmpy.read_model_description(str(memory)).modelVariables if v.causality == "output"}
    assert shown == {"mean", "last[1]", "last[2]"}


@pytest.mark.slow
def test_the_same_system_gives_the_same_archive(bench, scenario_file):
    first, second = (packed_as(bench, scenario_file, "2.0")[0].read_bytes() for _ in range(2))
    assert first == second


@pytest.mark.parametrize(
    ("variants", "name"), [("", "ramp"), ("one: {}", "ramp"), ("one: {}, two: {title: second}", "ramp_one")]
)
def test_a_system_has_the_name_of_its_variant_if_there_are_several(bench, variants, name):
    path = bench.folder / "ramp.yaml"
    path.write_text(
        f"stop_time: 2 ms\nmembers: {{drive: {{component: 'tests.ssp.parts:Ramp'}}}}\nvariants: {{{variants}}}\n"
    )
    target, _ = packed_as(bench, path, "2.0")
    root = etree.fromstring(zipfile.ZipFile(target).read("SystemStructure.ssd"))
    assert root.get("name") == name


@pytest.mark.slow
def test_fmpy_gets_the_same_values(bench):
    own = bench.folder / "plain.yaml"
    own.write_text(
        "stop_time: 20 ms\nmembers:\n"
        "  a: {component: 'tests.ssp.parts:Bare'}\n  b: {component: 'tests.ssp.parts:Ramp'}\n"
        "connections: [{from: b.y, to: a.u, convert: false}]\n"
    )
    path = bench.folder / "plain.ssp"
    pack(load_scenario(own), path, bench.build)
    ours, theirs = bench.run(path), simulate_ssp(str(path), stop_time=0.02, step_size=1e-3)
    np.testing.assert_allclose(theirs["a.y"][:20], ours["a.y"][1:], rtol=1e-12)  # its time adds up


@pytest.mark.slow
def test_annotations_of_others_are_kept(bench):
    note = '<ssd:Annotations><ssc:Annotation type="org.example"><x:note xmlns:x="urn:x">kept</x:note></ssc:Annotation></ssd:Annotations>'
    wire_note = note.replace("kept", "wire")
    drive = component("drive 1", "resources/ramp.fmu", connector("y", "output"), more=bindings("speed=1") + note)
    bare = component("rig.gain", "resources/bare.fmu", connector("u", "input"), connector("y", "output"))
    experiment = f'<ssd:DefaultExperiment stopTime="0.1">{note}</ssd:DefaultExperiment>{note}'
    text = description(system(drive + bare, connection("drive 1.y", "rig.gain.u", inside=wire_note)), experiment)
    path = bench.folder / "again.ssp"
    pack(load_scenario(bench.ssp(text)), path, bench.build)
    with zipfile.ZipFile(path) as archive:
        written = archive.read("SystemStructure.ssd").decode()
    assert written.count(">kept<") == 3
    assert written.count(">wire<") == 1
    assert 'name="drive 1"' in written
    assert 'name="rig.gain"' in written
    np.testing.assert_array_equal(bench.run(path)["rig__gain.y"], bench.run(bench.folder / "s.ssp")["rig__gain.y"])


OWN = """\
stop_time: 1/5 s
step: 1/150 s
algorithm: {name: iterative, order: 1, agreement: 1e-9, scales: {slow.u: 20 mm, b.y: 3}}
members:
  a: {component: 'tests.ssp.parts:Bare', parameters: {k: 0.5}}
  b: {component: 'tests.ssp.parts:Bare', parameters: {k: -0.25}, isolate: true}
  drive: {component: 'tests.ssp.parts:Ramp'}
  slow: {component: 'tests.ssp.parts:Spring', communication_step: 1/50 s, finite: false}
connections:
  - {from: b.y, to: a.u, bond: rod}
  - {from: a.y, to: b.u, bond: rod, hold: true}
  - {from: drive.y, to: slow.u, hold: true, factor: 2}
"""


@pytest.mark.slow
def test_what_ssp_has_no_words_for_is_in_annotations(bench):
    own = bench.folder / "own.yaml"
    own.write_text(OWN)
    path = bench.folder / "own.ssp"
    notes = pack(load_scenario(own), path, bench.build)
    assert any("algorithm {" in one and "an annotation, others have their own" in one for one in notes)
    bare = without_extra(path, bench.folder / "bare.ssp")  # as a tool would leave it that drops what it does not know
    again = bench.folder / "again.ssp"
    pack(load_scenario(bare), again, bench.build)
    expected = load_scenario(own).variants[0]
    for found in (load_scenario(one).variants[0] for one in (path, bare, again)):
        assert found.algorithm == expected.algorithm
        assert found.step_ns == expected.step_ns
        assert [(one.bond, one.hold) for one in found.connections] == [("rod", False), ("rod", True), ("", True)]
        assert [found.members[name].isolate for name in "ab"] == [False, True]
        assert members.communication(found.members["slow"]) == members.communication(expected.members["slow"])
        assert not found.members["slow"].finite
    ours = bench.run(own)
    for one in (path, bare, again):
        theirs = bench.run(one)
        for name, values in ours.items():
            np.testing.assert_array_equal(values, theirs[name], err_msg=name)


def without_extra(path, target):
    """The archive without what only this project reads."""
    with zipfile.ZipFile(path) as archive, zipfile.ZipFile(target, "w") as left:
        for name in archive.namelist():
            if not name.startswith("extra/"):
                left.writestr(name, archive.read(name))
    return target


@pytest.mark.slow
def test_annotations_are_valid_and_written_once(bench):
    own = bench.folder / "own.yaml"
    own.write_text(OWN)
    first, second = bench.folder / "first.ssp", bench.folder / "second.ssp"
    pack(load_scenario(own), first, bench.build)
    pack(load_scenario(first), second, bench.build)
    for path in (first, second):
        root = etree.fromstring(zipfile.ZipFile(path).read("SystemStructure.ssd"))
        assert violations(root, "s") == []
        assert len(root.findall(".//{*}Annotation[@type='local.catheter-twin']")) == 1 + 2 + 3


def test_a_component_in_python_is_no_fmu_for_others(bench):
    own = bench.folder / "python.yaml"
    own.write_text("stop_time: 20 ms\nmembers: {a: {component: 'benchmarks.parts:WallClock'}}\n")
    with pytest.raises(ScenarioError, match=r"python.yaml:2: member `a`: WallClock: is Python-side"):
        pack(load_scenario(own), bench.folder / "a.ssp", bench.build)


def test_a_component_in_python_needs_python_there(bench):
    """With `--needs-python` its FMU is written, here of FMI 2.0."""
    own, target = bench.folder / "pymunk.yaml", bench.folder / "pymunk.ssp"
    own.write_text("stop_time: 20 ms\nmembers: {a: {component: 'tests.run.pymunk_parts:Puck'}}\n")
    pack(load_scenario(own), target, bench.build, needs_python=True)
    with zipfile.ZipFile(target) as archive:
        assert b"needsExecutionTool" in zipfile.ZipFile(io.BytesIO(archive.read("resources/a.fmu"))).read(
            "modelDescription.xml"
        )


@pytest.mark.parametrize("needs_python", [False, True])
def test_a_csv_file_is_no_fmu(bench, needs_python):
    """The advice is not to change the class of a component, which there is none of."""
    (bench.folder / "table.csv").write_text("time,y\n0,0\n1,1\n")
    own = bench.folder / "csv.yaml"
    own.write_text("stop_time: 20 ms\nmembers: {a: {component: table.csv}}\n")
    with pytest.raises(
        ScenarioError, match=r"csv.yaml:2: member `a`: .*table.csv is a CSV file, which FMUs cannot contain. Remove"
    ):
        pack(load_scenario(own), bench.folder / "csv.ssp", bench.build, needs_python=needs_python)


@pytest.mark.slow
def test_bonds_and_control_characters(bench):
    own = bench.folder / "bond.yaml"
    text = (
        'description: "{}"\nstop_time: 20 ms\nmembers:\n'
        "  a: {{component: 'tests.ssp.parts:Bare'}}\n  b: {{component: 'tests.ssp.parts:Bare'}}\n"
        "connections: [{{from: b.y, to: a.u, bond: rod}}, {{from: a.y, to: b.u, bond: rod}}]\n"
    )
    own.write_text(text.format("plain"))
    path = bench.folder / "bond.ssp"
    pack(load_scenario(own), path, bench.build)
    assert [one.bond for one in load_scenario(path).variants[0].connections] == ["rod", "rod"]
    own.write_text(text.format("a\\x01b"))
    with pytest.raises(ScenarioError, match="cannot stand in XML"):
        pack(load_scenario(own), path, bench.build)


def test_outputs_are_added_in_order(bench, part_fmus):
    content = part_fmus["resources/bare.fmu"].read_bytes()
    with zipfile.ZipFile(io.BytesIO(promote_locals_to_outputs(content, {}))) as archive:
        assert b'causality="output"' in archive.read("modelDescription.xml")
