"""SSPs of two or three small FMUs: what they say is what runs."""

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from tests.coupling.parts import Lag
from tests.ssp.parts import (
    UNITS,
    Pair,
    bindings,
    component,
    connection,
    connector,
    description,
    fmu,
    packed,
    system,
)
from twin.errors import ScenarioError
from twin.scenario import lint, load_scenario
from twin.ssp import element_name, member_name

RAMP, SPRING, BARE = (f"resources/{name}.fmu" for name in ("ramp", "spring", "bare"))
DRIVE = component("drive", RAMP, connector("y", "output"))
WALL = component("wall", SPRING, connector("u", "input"), connector("f", "output"))
WIRE = connection("drive.y", "wall.u")


def last(recorded, name):
    return recorded[name][-1]


def test_units_are_those_of_the_fmus(bench):
    recorded = bench.run(bench.ssp(description(system(DRIVE + WALL, WIRE))))
    assert last(recorded, "drive.y") == pytest.approx(3.0 * 0.1, rel=1e-12)  # [mm]
    assert recorded["wall.f"][-1] == 100.0 * (recorded["drive.y"][-2] * 1e-3)  # one step later


def test_a_transformation_comes_after_the_units_or_instead_of_them(bench):
    change = '<ssc:LinearTransformation factor="2" offset="0.5"/>'
    gain = component("gain", BARE, connector("u", "input", "m"), connector("y", "output"))
    for more, factor in (("", 1e-3), ('suppressUnitConversion="true"', 1.0)):
        text = description(system(DRIVE + gain, connection("drive.y", "gain.u", more, change)))
        recorded = bench.run(bench.ssp(text))
        assert recorded["gain.y"][-1] == pytest.approx(2.0 * factor * recorded["drive.y"][-2] + 0.5, rel=1e-12)


def test_ends_in_either_order(bench):
    recorded = bench.run(bench.ssp(description(system(DRIVE + WALL, connection("wall.u", "drive.y")))))
    assert last(recorded, "wall.f") > 0


def test_values_are_converted_and_outer_ones_win(bench):
    drive = component("drive", RAMP, connector("y", "output"), more=bindings("speed=1", "offset=0.004 m"))
    text = description(system(drive + WALL, WIRE, before=bindings("drive.speed=7", "wall.stiffness=2", "x.y=3")))
    scenario = load_scenario(bench.ssp(text))
    members = scenario.variants[0].members
    assert members["drive"].parameters == {"speed": 7.0, "offset": 4.0}
    assert members["wall"].parameters == {"stiffness": 2.0}
    assert members["drive"].locations["speed"].startswith(str(bench.folder / "s.ssp/SystemStructure.ssd:"))


def test_mapped_values_from_files(bench):
    values = '<ssv:ParameterSet xmlns:ssv="http://ssp-standard.org/SSP1/SystemStructureParameterValues" ' + (
        'xmlns:ssc="http://ssp-standard.org/SSP1/SystemStructureCommon" version="1.0" name="p"><ssv:Parameters>'
        '<ssv:Parameter name="k"><ssv:Real value="5" unit="N"/></ssv:Parameter>'
        f'<ssv:Parameter name="lost"><ssv:Real value="1"/></ssv:Parameter></ssv:Parameters>{UNITS}</ssv:ParameterSet>'
    ).replace("ssd:", "ssv:")
    mapping = (
        '<ssm:ParameterMapping xmlns:ssm="http://ssp-standard.org/SSP1/SystemStructureParameterMapping" '
        'xmlns:ssc="http://ssp-standard.org/SSP1/SystemStructureCommon" version="1.0">'
        '<ssm:MappingEntry source="k" target="wall.stiffness" suppressUnitConversion="true">'
        '<ssc:LinearTransformation factor="3" offset="1"/></ssm:MappingEntry>'
        '<ssm:MappingEntry source="k" target="wall.bias"/></ssm:ParameterMapping>'
    )
    bound = (
        '<ssd:ParameterBindings><ssd:ParameterBinding source="resources/p.ssv">'
        '<ssd:ParameterMapping source="resources/p.ssm"/></ssd:ParameterBinding></ssd:ParameterBindings>'
    )
    text = description(system(DRIVE + WALL, WIRE, before=bound))
    scenario = load_scenario(bench.ssp(text, {"resources/p.ssv": values, "resources/p.ssm": mapping}))
    assert scenario.variants[0].members["wall"].parameters == {"stiffness": 16.0, "bias": 5.0}


def test_nested_systems_are_flat(bench):
    inner = system(
        component("gain 1", BARE, connector("u", "input"), connector("y", "output"), connector("k", "parameter")),
        connection("in", "gain 1.u") + connection("gain 1.y", "out") + connection("factor", "gain 1.k"),
        name="rig",
        before="<ssd:Connectors>"
        + connector("in", "input", "m")
        + connector("out", "output")
        + connector("factor", "parameter")
        + "</ssd:Connectors>",
    )
    wires = connection("drive.y", "rig.in") + connection("rig.out", "wall.u")
    text = description(system(DRIVE + WALL + inner, wires, before=bindings("rig.factor=2")))
    scenario = load_scenario(bench.ssp(text))
    assert list(scenario.variants[0].members) == ["drive", "wall", "rig__gain_x20_1"]
    assert scenario.variants[0].members["rig__gain_x20_1"].parameters == {"k": 2.0}
    recorded = bench.run(bench.folder / "s.ssp")
    assert recorded["rig__gain_x20_1.y"][-1] == pytest.approx(2.0 * 1e-3 * recorded["drive.y"][-2], rel=1e-12)


def test_a_package_inside_a_package_and_a_system_used_twice(bench):
    inner = system(
        component("gain", BARE, connector("u", "input"), connector("y", "output")),
        connection("u", "gain.u") + connection("gain.y", "y"),
        before=f"<ssd:Connectors>{connector('u', 'input')}{connector('y', 'output')}</ssd:Connectors>"
        + bindings("gain.k=3"),
    )
    small = packed(bench.folder / "small.ssp", description(inner), {BARE: bench.fmus[BARE]})
    ends = f"<ssd:Connectors>{connector('u', 'input')}{connector('y', 'output')}</ssd:Connectors>"
    parts = "".join(
        f'<ssd:Component name="{name}" type="application/x-ssp-package" source="resources/small.ssp">{ends}{more}'
        "</ssd:Component>"
        for name, more in (("a", ""), ("b", bindings("gain.k=5")))
    )
    text = description(system(DRIVE + parts, connection("drive.y", "a.u") + connection("a.y", "b.u")))
    scenario = load_scenario(bench.ssp(text, {"resources/small.ssp": small}))
    members = scenario.variants[0].members
    assert {name: one.parameters for name, one in members.items()} == {
        "drive": {},
        "a__gain": {"k": 3.0},
        "b__gain": {"k": 5.0},
    }
    assert [(c.source, c.target) for c in scenario.variants[0].connections] == [
        ("drive.y", "a__gain.u"),
        ("a__gain.y", "b__gain.u"),
    ]


def test_a_signal_dictionary_is_a_bus(bench):
    dictionary = (
        '<ssd:SignalDictionaries><ssd:SignalDictionary name="bus"><ssb:SignalDictionary version="1.0">'
        '<ssb:DictionaryEntry name="position"><ssc:Real/></ssb:DictionaryEntry>'
        "</ssb:SignalDictionary></ssd:SignalDictionary></ssd:SignalDictionaries>"
    )
    plug = (
        f'<ssd:SignalDictionaryReference name="plug" dictionary="bus">'
        f"<ssd:Connectors>{connector('position', 'inout')}</ssd:Connectors></ssd:SignalDictionaryReference>"
    )
    wires = connection("drive.y", "plug.position") + connection("plug.position", "wall.u")
    recorded = bench.run(bench.ssp(description(system(DRIVE + WALL + plug, wires, after=dictionary))))
    assert recorded["wall.f"][-1] == 100.0 * (recorded["drive.y"][-2] * 1e-3)


def test_variants_and_times(bench):
    slow = description(
        system(component("drive", RAMP, connector("y", "output"), more=bindings("speed=1"))),
        '<ssd:DefaultExperiment stopTime="0.2"/>',
        "slow",
    )
    step = (
        '<ssd:DefaultExperiment stopTime="0.1"><ssd:Annotations><ssc:Annotation type="com.opensimulationplatform">'
        '<osp:Algorithm xmlns:osp="http://opensimulationplatform.com/SSP/OSPAnnotations">'
        '<osp:FixedStepAlgorithm baseStepSize="1e-2"/></osp:Algorithm></ssc:Annotation></ssd:Annotations>'
        "</ssd:DefaultExperiment>"
    )
    path = bench.ssp(description(system(DRIVE), step, "fast"), {"Other.ssd": slow})
    scenario = load_scenario(path)
    assert [(c.variant, c.stop_ns, c.step_ns) for c in scenario.variants] == [
        ("fast", 100_000_000, 10_000_000),
        ("slow", 200_000_000, 1_000_000),
    ]
    assert last(bench.run(path, variant="slow"), "drive.y") == pytest.approx(0.2)
    assert load_scenario(path, ["step=5 ms"]).variants[0].step_ns == 5_000_000


def test_the_interface_of_fmi(bench, build):
    text = description(
        system(component("lag", "resources/lag.fmu").replace("source=", 'implementation="ModelExchange" source='))
    )
    path = bench.ssp(text, {"resources/lag.fmu": fmu(Lag, build)})
    assert load_scenario(path).variants[0].members["lag"].exchange.interface == "model_exchange"
    assert np.isfinite(last(bench.run(path, "lag.u=1 m"), "lag.y"))


def test_a_prefix_and_values_that_are_mapped_by_value(bench):
    mapping = (
        '<ssd:ParameterMapping><ssm:ParameterMapping version="1.0"><ssm:MappingEntry source="wall.kind" target="'
        'wall.stiffness"><ssc:IntegerMappingTransformation><ssc:MapEntry source="1" target="7"/>'
        "</ssc:IntegerMappingTransformation></ssm:MappingEntry></ssm:ParameterMapping></ssd:ParameterMapping>"
    )
    bound = bindings("kind=1", more='prefix="wall."', mapping=mapping).replace('Real value="1"', 'Integer value="1"')
    text = description(system(DRIVE + WALL, WIRE, before=bound))
    assert load_scenario(bench.ssp(text)).variants[0].members["wall"].parameters == {"stiffness": 7}
    plain = description(system(DRIVE + WALL, WIRE, before=bindings("speed=4", more='prefix="drive."')))
    assert load_scenario(bench.ssp(plain)).variants[0].members["drive"].parameters == {"speed": 4.0}


def test_an_input_of_the_system_that_has_a_value(bench):
    ends = f"<ssd:Connectors>{connector('push', 'input', 'mm')}</ssd:Connectors>"
    text = description(system(WALL, connection("push", "wall.u"), before=ends + bindings("push=0.5 m")))
    assert load_scenario(bench.ssp(text)).variants[0].members["wall"].parameters == {"u": 0.5}
    assert last(bench.run(bench.folder / "s.ssp"), "wall.f") == 50.0


def test_overrides(bench):
    path = bench.ssp(description(system(DRIVE + WALL, WIRE)))
    assert last(bench.run(path, "drive.speed=1 m/s", "stop_time=10 ms"), "drive.y") == pytest.approx(10.0)


def test_a_scenario_over_an_ssp(bench):
    bench.ssp(description(system(DRIVE + WALL, WIRE)))
    own = bench.folder / "own.yaml"
    own.write_text("extends: s.ssp\nevents: [{at: 50 ms, set: {drive.speed: 0 mm/s}}]\n")
    assert last(bench.run(own), "drive.y") == 0.0


def test_the_schema_is_asked_with_lines(bench):
    bad = description(system(DRIVE.replace('kind="output"', 'kind="outputt"') + WALL, WIRE))
    _, problems = lint(bench.ssp(bad))
    (line,) = problems
    assert line.startswith(f"{bench.folder}/s.ssp/SystemStructure.ssd:4: against the schema of SSP 1.0: ")
    assert "'outputt'" in line


def test_elements_of_arrays_and_values_of_arrays(bench, build):
    parts_ = {"resources/pair.fmu": fmu(Pair, build, "3.0")}
    values = (
        '<ssd:ParameterBindings><ssd:ParameterBinding><ssd:ParameterValues><ssv:ParameterSet version="2.0" name="p">'
        '<ssv:Parameters><ssv:Parameter name="gain"><ssv:Float64 value="2 5"/><ssc:Dimension size="2"/></ssv:Parameter>'
        "</ssv:Parameters></ssv:ParameterSet></ssd:ParameterValues></ssd:ParameterBinding></ssd:ParameterBindings>"
    )
    array = '<ssd:Connector name="{}" kind="{}"><ssc:Float64/><ssc:Dimension size="2"/></ssd:Connector>'
    connectors = array.format("u", "input"), array.format("y", "output")
    pairs = component("a", "resources/pair.fmu", *connectors, more=values) + component(
        "b", "resources/pair.fmu", *connectors
    )
    wires = connection("drive.y", "a.u", 'endIndices="2" suppressUnitConversion="true"') + connection("a.y", "b.u")
    recorded = bench.run(bench.ssp(description(system(DRIVE + pairs, wires), version="2.0"), parts_))
    assert recorded["a.y"][-1, 0] == 0.0
    assert recorded["a.y"][-1, 1] == 5.0 * recorded["drive.y"][-2]
    np.testing.assert_array_equal(recorded["b.y"][-1], recorded["a.y"][-2])


def test_an_outer_array_overrides_an_inner_element(bench, build):
    """The component says 1 2 and then 5 for the first element, the system around it 7 8."""

    def gains(name, *values):
        texts = "".join(
            f'<ssv:Parameter name="{name}{index}"><ssv:Float64 value="{text}"/>{more}</ssv:Parameter>'
            for index, text, more in values
        )
        inside = f'<ssv:ParameterSet version="2.0" name="p"><ssv:Parameters>{texts}</ssv:Parameters></ssv:ParameterSet>'
        return (
            f"<ssd:ParameterBindings><ssd:ParameterBinding><ssd:ParameterValues>{inside}</ssd:ParameterValues>"
            "</ssd:ParameterBinding></ssd:ParameterBindings>"
        )

    size = '<ssc:Dimension size="2"/>'
    inner = gains("gain", ("", "1 2", size), ("[1]", "5", ""))
    text = description(
        system(component("a", "resources/pair.fmu", more=inner), before=gains("a.gain", ("", "7 8", size))),
        version="2.0",
    )
    path = bench.ssp(text, {"resources/pair.fmu": fmu(Pair, build, "3.0")})
    assert bench.run(path, "a.u=[1, 1]")["a.y"][-1].tolist() == [7.0, 8.0]


@given(st.lists(st.text(min_size=1, max_size=8).filter(lambda one: "." not in one), min_size=1, max_size=4))
@example(["0_:"])
@example(["a_xf:"])
@example(["a_xf", "b"])
def test_names_can_be_told_back(path):
    element = ".".join(path)
    member = member_name(element)
    assert element_name(member) == element
    assert member.isascii()
    assert member.replace("_", "a").isalnum()


def test_usual_names_stay():
    assert member_name("wall_1") == "wall_1"
    assert member_name("rig.arm") == "rig__arm"
    assert np.unique([member_name(one) for one in ("a b", "a_x20_b", "a__b", "a.b", "_a")]).size == 5


def test_not_an_ssp(bench):
    file = bench.folder / "a.ssp"
    file.write_bytes(b"PK\x03\x04nothing")
    with pytest.raises(ScenarioError, match="is not a zip archive, or cut off"):
        load_scenario(file)


@pytest.mark.parametrize("name", ["SystemStructure.ssd", "Other.ssd"])
def test_what_is_unpacked_is_unpacked_anew_after_a_change(bench, name):
    path = bench.ssp(description(system(DRIVE + WALL, WIRE)))
    load_scenario(path)
    (unpacked,) = (bench.folder / "build/ssp").iterdir()
    text = (unpacked / "SystemStructure.ssd").read_bytes()
    (unpacked / name).write_bytes(text.replace(b'"drive', b'"drove'))  # as long as before
    assert "drive" in load_scenario(path).variants[0].members
    assert (unpacked / "SystemStructure.ssd").read_bytes() == text
    assert len(list(unpacked.glob("*.ssd"))) == 1
