"""Exports with the sample period as a clock: Scheduled Execution gives the values of Co-Simulation, to the bit."""

import ctypes

import pytest
from fmpy import extract, read_model_description
from fmpy.fmi1 import FMICallException
from fmpy.fmi3 import FMU3ScheduledExecution, FMU3Slave
from fmpy.validation import validate_fmu

from tests.fmi.parts import Masses, Sampler
from twin import compiler
from twin.coupling import Connection, CoSimulation, CoupledSystem
from twin.errors import BuildError
from twin.fmi import fmu_info, member
from twin.fmi.exporting import exporter

PERIOD = Sampler.period
MS = 1_000_000
OUTPUTS = [variable.name for variable in Sampler.variables if variable.role == "output"]


@pytest.fixture(scope="module")
def clocked(build, tmp_path_factory):
    """An FMU with a clock, unpacked, and the value references of its variables."""
    folder = tmp_path_factory.mktemp("clocked")
    path = exporter.export(Sampler, "3.0", folder / "sampler.fmu", build, has_clock=True)
    extract(str(path), str(folder / "it"))
    description = read_model_description(str(path))
    return path, folder / "it", description, {v.name: v.valueReference for v in description.modelVariables}


def instance(clocked, kind=FMU3ScheduledExecution, **options):
    _, folder, description, _ = clocked
    log = []
    fmu = kind(
        guid=description.guid, unzipDirectory=str(folder), modelIdentifier=Sampler.__name__, instanceName="sampler"
    )
    fmu.instantiate(logMessage=lambda _, *line: log.append(line), **options)
    fmu.enterInitializationMode()
    fmu.exitInitializationMode()
    return fmu, log


def test_the_description_is_to_the_standard(clocked):
    path, _, description, _ = clocked
    assert validate_fmu(str(path)) == []
    assert description.scheduledExecution.modelIdentifier == Sampler.__name__
    clock = fmu_info.outline(path).clocks["sample_clock"]
    assert (clock.causality, clock.variability, clock.interval) == ("input", "constant", Sampler.period_ns)
    assert [v.name for v in description.modelVariables if v.clocks] == [
        variable.name for variable in Sampler.variables if variable.role in ("input", "output")
    ]


def test_partitions_publish_the_values_of_steps(clocked):
    references = clocked[-1]
    stepped, _ = instance(clocked, FMU3Slave)
    scheduled, _ = instance(clocked)
    for n in range(12):
        for fmu in (stepped, scheduled):
            fmu.setFloat64([references["u"]], [0.1 * n])
            fmu.setBoolean([references["enable"]], [n % 3 > 0])
        scheduled.activateModelPartition(references["sample_clock"], n * PERIOD)
        values = [[fmu.getFloat64([references[name]])[0] for name in ("y",)] for fmu in (stepped, scheduled)]
        counts = [fmu.getInt64([references["wide"]])[0] for fmu in (stepped, scheduled)]
        assert (values[0], counts[0]) == (values[1], counts[1])
        stepped.doStep(n * PERIOD, PERIOD)


def test_a_clock_that_is_not_due_and_other_references_are_refused(clocked):
    references = clocked[-1]
    fmu, log = instance(clocked)
    clock = references["sample_clock"]
    fmu.activateModelPartition(clock, 0.0)
    for reference, t, text in (
        (clock, 0.5 * PERIOD, b"the clock was due at 0, not at 0.005"),
        (clock, 2.0 * PERIOD, b"the clock was due at 0.01, not at 0.02"),
        (references["u"], PERIOD, b"u (value reference 1) has another type"),
    ):
        with pytest.raises(FMICallException):
            fmu.activateModelPartition(reference, t)
        assert text in log[-1][-1]
    fmu.activateModelPartition(clock, PERIOD)
    assert function_status(fmu, "fmi3DoStep", ctypes.c_double(PERIOD), ctypes.c_double(PERIOD), *[None] * 5) == 3
    assert b"not for Scheduled Execution" in log[-1][-1]
    fmu.terminate()


def function_status(fmu, name, *arguments):
    called = fmu.dll[name]
    called.restype = ctypes.c_int
    return called(ctypes.c_void_p(fmu.component), *arguments)


def test_an_importer_that_ticks_the_clock_in_event_mode_changes_nothing(clocked):
    references = clocked[-1]
    plain, _ = instance(clocked, FMU3Slave)
    fmu, log = instance(clocked, FMU3Slave, eventModeUsed=True, earlyReturnAllowed=True)
    for n in range(5):
        for one in (plain, fmu):
            one.setFloat64([references["u"]], [0.3 * n])
        fmu.setClock([references["sample_clock"]], [True])
        fmu.updateDiscreteStates()
        fmu.enterStepMode()
        plain.doStep(n * PERIOD, PERIOD)
        fmu.doStep(n * PERIOD, PERIOD)
        fmu.enterEventMode()
        assert fmu.getFloat64([references["y"]]) == plain.getFloat64([references["y"]])
    fmu.updateDiscreteStates()
    fmu.enterStepMode()
    fmu.doStep(5 * PERIOD, 0.5 * PERIOD)
    fmu.enterEventMode()
    with pytest.raises(FMICallException):
        fmu.setClock([references["sample_clock"]], [True])
    assert b"the clock does not tick now" in log[-1][-1]


@pytest.mark.parametrize("interface", ["co_simulation", "scheduled_execution"])
def test_a_scenario_has_the_same_values_by_each_interface(clocked, interface, build):
    def outputs(chosen):
        parts = {"source": member("source", clocked[0], {"u": 0.5}), "it": member("it", clocked[0], interface=chosen)}
        links = CoupledSystem({n: p.variables for n, p in parts.items()}, [Connection("source.y", "it.u")]).links()
        simulation = CoSimulation(parts, links, 5 * MS, build=build)
        simulation.initialize(0, 200 * MS)
        simulation.advance(200 * MS)
        signals = simulation.recording().signals
        simulation.terminate()
        return {name: signals[f"it.{name}"].tolist() for name in OUTPUTS}

    assert outputs(interface) == outputs("co_simulation")


def test_components_without_a_period_and_fmi_2_have_no_clock():
    no_c = compiler.Sources("Masses", "", "")
    with pytest.raises(BuildError, match="Masses: is not sampled, so it has no clock"):
        exporter.plan(Masses, "3.0", no_c, has_clock=True)
    with pytest.raises(BuildError, match=r"FMI 2\.0 has no clocks"):
        exporter.plan(Sampler, "2.0", no_c, has_clock=True)
