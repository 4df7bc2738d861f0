"""What FMI 3.0 allows and few FMUs have: fractions, arrays sized by structural parameters, odd enumerations, clocked strings."""

from pathlib import Path

import numpy as np
import pyarrow.parquet as pq
import pytest

from tests.fmi.clock_parts import clock, number
from tests.fmi.test_simulate import rows, run
from tests.fmi.third_party import archive, native_library
from twin.run import RunOptions, run_scenario
from twin.scenario import load_scenario

COUNT = '<Dimension valueReference="10"/>'
XML = f"""<?xml version="1.0" encoding="UTF-8"?>
<fmiModelDescription fmiVersion="3.0" modelName="Odd" instantiationToken="odd">
<CoSimulation modelIdentifier="Odd" hasEventMode="true" canHandleVariableCommunicationStepSize="true"/>
<TypeDefinitions><EnumerationType name="Gear"><Item name="reverse gear" value="-5"/><Item name="first" value="7"/>
<Item name="huge" value="{2**40}"/></EnumerationType></TypeDefinitions>
<ModelVariables>
<Float64 name="time" valueReference="99" causality="independent" variability="continuous"/>
{clock("third", 1, "fixed", more='supportsFraction="true"')}
{clock("fast", 2, "constant", more='intervalCounter="64" resolution="1024" shiftCounter="3"')}
{clock("trigger", 3)}
{clock("second", 4, causality="output")}
{clock("down", 5, "countdown", more='supportsFraction="true"')}
<UInt64 name="count" valueReference="10" causality="structuralParameter" variability="fixed" start="3" min="1" max="8"/>
<Float32 name="given" valueReference="11" causality="input" variability="discrete" start="2.5 2.5 2.5">{COUNT}</Float32>
<Float32 name="sum" valueReference="12" causality="output" variability="discrete" clocks="1">{COUNT}</Float32>
<Float64 name="shown" valueReference="17" causality="output">{COUNT}<Dimension start="2"/></Float64>
<Enumeration name="gear" valueReference="13" causality="input" declaredType="Gear" start="-5"/>
<Enumeration name="gear_out" valueReference="14" causality="output" declaredType="Gear"/>
<String name="word" valueReference="15" causality="input" clocks="3"><Start value="nothing"/></String>
<String name="said" valueReference="16" causality="output"/>
{number("UInt64", "large", 19, more='variability="discrete"')}
{
    "".join(
        number("Int32", f"{name}_ticks", 21 + i, more='variability="discrete"')
        for i, name in enumerate(("third", "fast", "trigger", "second", "down"))
    )
}
</ModelVariables>
<ModelStructure><Output valueReference="12"/><Output valueReference="17"/><Output valueReference="14"/></ModelStructure>
</fmiModelDescription>"""
SCENARIO = """
stop_time: 2 s
step: 250 ms
members:
  a: {{component: odd.fmu, parameters: {{count: 2, gear: huge}}}}
  b: {{component: odd.fmu, parameters: {{count: 2}}, isolate: {isolate}}}
connections:
  - a.second -> b.trigger
  - a.sum -> b.given
  - a.gear_out -> b.gear
  - a.said -> b.word
"""


@pytest.fixture(scope="module")
def odd(tmp_path_factory):
    folder = tmp_path_factory.mktemp("odd")
    library = native_library(Path(__file__).with_name("odd.c").read_text())
    return archive(folder / "odd.fmu", {"modelDescription.xml": XML.encode(), "binaries/x86_64-linux/Odd.so": library})


def columns(path):
    header, lines = rows(path)
    return {name: [line[i] for line in lines] for i, name in enumerate(header)}


@pytest.mark.slow
def test_fractions_are_exact(odd, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert run(odd, "--stop-time", 2, "--step-size", 0.25, "-o", "a.csv").exit_code == 0
    found = columns("a.csv")
    times = np.array([float(one) for one in found["time"]])
    thirds = 1 / 7 + np.arange(7) / 3
    for name, ticks in {
        "third": thirds,
        "down": thirds + 0.1,
        "second": thirds[1::2],
        "fast": (3 + 64 * np.arange(40)) / 1024,
    }.items():
        assert [int(one) for one in found[f"{name}_ticks"]] == np.searchsorted(ticks, times + 1e-9).tolist(), name


def test_sizes_and_names(odd, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert (
        run(odd, "-s", "count=2", "-s", "gear=first", "--stop-time", 1, "--step-size", 0.5, "-o", "a.csv").exit_code
        == 0
    )
    found = columns("a.csv")
    assert [found[f"sum[{i}]"][-1] for i in (1, 2)] == ["7.5", "7.5"]
    assert "sum[3]" not in found
    assert [found[f"shown[{i},{j}]"][-1] for i in (1, 2) for j in (1, 2)] == ["1.0", "2.0", "3.0", "4.0"]
    assert found["gear_out"][-1] == "7"
    assert "Choose from reverse gear (-5), first (7)" in str(run(odd, "-s", "gear=second").exception)


def test_ticks_and_words_of_a_table(odd, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    Path("in.csv").write_text("time,trigger,word,gear\n0,1,hello,first\n0.4,0,none,huge\n1.1,1,bye,reverse gear\n")
    run(odd, "-i", "in.csv", "--stop-time", 1.5, "--step-size", 0.5, "-r", "said", "-r", "gear_out", "-o", "a.csv")
    assert columns("a.csv")["said"] == ["hello", "hello", "hello", "bye"]
    assert columns("a.csv")["gear_out"] == ["7", str(2**40), str(2**40), "-5"]


@pytest.mark.slow_repetitions
@pytest.mark.parametrize("isolate", ["false", "true"])
def test_in_a_scenario(odd, isolate, build):
    path = odd.with_name(f"odd_{isolate}.yaml")
    path.write_text(SCENARIO.format(isolate=isolate))
    folder = run_scenario(load_scenario(path), RunOptions(root=odd.parent / "runs", build=build, report=False)).folder
    found = pq.read_table(folder / "signals.parquet").to_pydict()
    assert found["b.trigger_ticks"][-1] == 3
    assert found["b.sum[1]"][-1] == found["b.sum[2]"][-1] > found["a.sum[1]"][-1] == 15.0
    assert found["b.gear_out"][-1] == 2**40
    assert found["b.large"][-1] == 2**64 - 1, "whole numbers without sign keep all bits"
