"""Model Exchange: a solver outside finds the trajectory of Co-Simulation; values follow what was set, when asked for."""

import ctypes
import zipfile
from math import gamma

import numpy as np
import pytest
from fmpy import extract, read_model_description, simulate_fmu
from fmpy.fmi1 import FMICallException
from fmpy.validation import validate_fmu

from tests.fmi.loaded import VERSIONS, Fmu
from tests.fmi.parts import Failing, Masses, Sampler, Stiff
from twin import compiler
from twin.component import Component, PythonComponent, catalog, input, local, output, state
from twin.errors import DeclarationError
from twin.fmi.exporting import exporter

CONTINUOUS = [
    name
    for name in catalog.names()
    if hasattr(catalog.component(name), "derivatives") and not issubclass(catalog.component(name), PythonComponent)
]


class Gamma(Component):
    """Has no rule for its slope."""

    u = input("", "input", start=1.0)
    y = output("", "output")

    def derivatives(self, t):
        self.y = gamma(self.u)


# what makes a component move although nothing is connected
STARTS = {"sheath": {"contact_force": 5.0}, "wall": {"tip_position": 2e-3}}


def agrees(path, stop, interval, tolerance, starts):
    options = {"stop_time": stop, "output_interval": interval, "start_values": starts}
    stepped = simulate_fmu(path, **options)
    solved = simulate_fmu(path, fmi_type="ModelExchange", solver="CVode", relative_tolerance=1e-9, **options)
    assert stepped["time"].tolist() == pytest.approx(solved["time"].tolist())
    for name in stepped.dtype.names[1:]:
        scale = np.abs(stepped[name]).max()
        assert np.abs(stepped[name] - solved[name]).max() <= tolerance * scale, name
    return stepped


@pytest.mark.slow_repetitions
@pytest.mark.parametrize("version", VERSIONS)
@pytest.mark.parametrize("name", CONTINUOUS)
def test_a_solver_outside_finds_what_co_simulation_does(name, version, build):
    path = str(exporter.build(catalog.component(name), version, build))
    found = agrees(path, 1.0, 0.01, 1e-5, STARTS.get(name, {}))
    assert all(np.any(found[column]) for column in found.dtype.names)


@pytest.mark.parametrize("version", VERSIONS)
@pytest.mark.parametrize(("part", "starts"), [(Masses, {"push": 2.0}), (Stiff, {"u": 1.5, "first": 0.25})])
def test_so_it_does_for_the_parts(fmus, part, version, starts):
    agrees(str(fmus[part, version][0]), 0.5, 0.01, 1e-6, starts)


# -------------------------------------------------------------------------------------------------------------- calls


def numbers(fmu, name, size):
    values = (ctypes.c_double * size)()
    getattr(fmu.slave, name)(values, size)
    return list(values)


def derivatives(fmu, size):
    return numbers(fmu, "getDerivatives" if fmu.version == "2.0" else "getContinuousStateDerivatives", size)


@pytest.mark.parametrize("version", VERSIONS)
def test_values_follow_states_time_and_inputs(fmus, version):
    fmu = Fmu(fmus, Masses, version, kind="ME").begin()
    assert numbers(fmu, "getContinuousStates", 4) == [0.1, 0.2, 0.0, 0.0]
    assert numbers(fmu, "getNominalsOfContinuousStates", 4) == [0.1, 0.1, 1.0, 1.0]
    fmu.slave.enterContinuousTimeMode()
    fmu.slave.setTime(1.0)
    fmu.slave.setContinuousStates((ctypes.c_double * 4)(0.3, 0.4, 5.0, 6.0), 4)
    fmu.set("push", 1.0)
    reference = Masses(x=(0.3, 0.4), v=(5.0, 6.0), push=1.0)
    reference.derivatives(1.0)
    assert derivatives(fmu, 4) == [*reference.der_x, *reference.der_v]
    assert fmu.get("total")[0] == reference.total
    fmu.set("push", 2.0)
    assert fmu.get("acceleration").tolist() == [(2.0 - 3.0) / 0.5, (2.0 - 4.0) / 0.5]
    with pytest.raises(FMICallException):
        fmu.set("stiffness", 20.0)  # a parameter is tunable at an event only
    fmu.slave.enterEventMode()
    fmu.set("stiffness", 20.0)
    assert derivatives(fmu, 4)[2] == (2.0 - 6.0) / 0.5
    fmu.slave.terminate()
    assert fmu.get("total")[0] == reference.total


@pytest.mark.parametrize("version", VERSIONS)
def test_a_state_belongs_to_the_kind_of_instance_it_was_saved_in(fmus, version):
    other, fmu = (Fmu(fmus, Masses, version, kind=kind).begin() for kind in ("CS", "ME"))
    save, load = (f"{verb}FMU{'state' if version == '2.0' else 'State'}" for verb in ("get", "set"))
    state = getattr(fmu.slave, save)()
    fmu.set("push", 3.0)
    getattr(fmu.slave, load)(state)
    assert fmu.get("acceleration")[0] == -2.0
    with pytest.raises(FMICallException):
        getattr(other.slave, load)(state)
    assert b"Model Exchange" in other.log[-1][-1]


@pytest.mark.parametrize("version", VERSIONS)
def test_arguments_that_do_not_fit_are_refused(fmus, version):
    fmu = Fmu(fmus, Masses, version, kind="ME").begin()
    with pytest.raises(FMICallException):
        fmu.slave.setTime(float("nan"))
    fmu.slave.enterContinuousTimeMode()
    for call in (lambda: numbers(fmu, "getContinuousStates", 3), lambda: numbers(fmu, "getEventIndicators", 1)):
        with pytest.raises(FMICallException):
            call()


@pytest.mark.parametrize("version", VERSIONS)
def test_a_component_of_the_communication_step_does_not_offer_it(fmus, version):
    assert read_model_description(str(fmus[Failing, version][0])).modelExchange is None
    with pytest.raises(Exception, match="instantiate"):
        Fmu(fmus, Failing, version, kind="ME")


@pytest.mark.parametrize("version", VERSIONS)
def test_ticks_of_a_sampled_component_are_time_events(fmus, version):
    path, starts = str(fmus[Sampler, version][0]), {"u": 0.7, "enable": True}
    names = ["y", "count", "active"]
    options = {"stop_time": 0.1, "output_interval": 0.0025, "start_values": starts, "output": names}
    stepped = simulate_fmu(path, **options)
    solved = simulate_fmu(path, fmi_type="ModelExchange", **options)
    last = np.append(np.diff(solved["time"]) > 1e-9, True)  # after the event, where there is one
    assert np.count_nonzero(~last) >= 9
    for name in names:
        assert solved[name][last].tolist() == stepped[name].tolist()


# --------------------------------------------------------------------------------------------------- event indicators


class Turning(Component):
    """Runs up to a limit and back."""

    switches = ("over", "gaps")

    y = output("m", "distance from one")
    over = local(0.0, "m", "how far beyond one")
    gaps = output("m", "two more", shape=(2,))
    x = state(0.0, "m", "place")

    def derivatives(self, t):
        self.over = self.x - 1.0
        self.gaps[0] = self.x + 5.0
        self.gaps[1] = self.x - 5.0
        self.y = abs(self.over)
        self.der_x = 2.0 if self.over < 0.0 else 1.0


@pytest.mark.slow
@pytest.mark.parametrize("version", VERSIONS)
def test_events_are_found_where_a_switching_function_is_zero(version, build, tmp_path):
    path = exporter.build(Turning, version, build / "tests")
    assert validate_fmu(str(path)) == []
    assert int(read_model_description(str(path)).numberOfEventIndicators) == 3
    extract(str(path), str(tmp_path))
    fmu = Fmu({(Turning, version): (path, tmp_path)}, Turning, version, kind="ME").begin()
    assert numbers(fmu, "getEventIndicators", 3) == [-1.0, 5.0, -5.0]
    fmu.slave.enterContinuousTimeMode()
    fmu.slave.setContinuousStates((ctypes.c_double * 1)(4.0), 1)
    assert numbers(fmu, "getEventIndicators", 3) == [3.0, 9.0, -1.0]
    fmu.slave.freeInstance()
    found = simulate_fmu(
        str(path), fmi_type="ModelExchange", stop_time=1.0, output_interval=0.3, relative_tolerance=1e-9
    )
    events = found["time"][1:][np.diff(found["time"]) == 0.0]
    assert events == pytest.approx([0.5], abs=1e-6)
    assert found["y"][-1] == pytest.approx(0.5, abs=1e-6)


@pytest.mark.slow
@pytest.mark.parametrize("version", VERSIONS)
def test_the_wall_is_touched_and_lost_at_events(version, build):
    wall = catalog.component("wall")
    t = np.linspace(0.0, 2.0, 2001)
    columns = [("time", float), ("tip_position", float), ("heart_position", float)]
    signal = np.zeros(len(t), columns)
    signal["time"] = t
    signal["tip_position"] = wall.surface_position.start - 1e-3 + 5e-3 * np.sin(2.0 * np.pi * t)
    found = simulate_fmu(
        str(exporter.build(wall, version, build)),
        fmi_type="ModelExchange",
        stop_time=2.0,
        output_interval=1e-3,
        input=signal,
        output=["force", "load", "indentation"],
    )
    events = found[1:][np.diff(found["time"]) == 0.0]
    touched = np.arcsin(0.2) / (2.0 * np.pi)
    for begin in (0.0, 1.0):
        assert np.abs(events["time"] - begin - touched).min() < 1e-6
    for event in events:
        assert min(abs(event["load"]), abs(event["indentation"])) < 1e-12
    assert 6 <= len(events) <= 8


def test_switches_that_are_no_quantities_are_refused():
    with pytest.raises(DeclarationError, match="'z'"):

        class _Wrong(Component):
            """Names what is not there."""

            switches = ("z",)
            y = output("", "output")

            def derivatives(self, t):
                self.y = t


# --------------------------------------------------------------------------------------------- directional derivatives


def directional(fmu, unknown, known, seed):
    """Tangents of an unknown along one element, or all, of a known, by the component's names."""
    variable, references, _ = fmu.access(unknown, "get")
    _, places, _ = fmu.access(known, "get")
    seeds = np.atleast_1d(seed).tolist()
    sizes = (variable.size,) if fmu.version == "3.0" else ()
    return np.array(fmu.slave.getDirectionalDerivative(references, places, seeds, *sizes))


@pytest.mark.parametrize("kind", ["ME", "CS"])
@pytest.mark.parametrize("version", VERSIONS)
def test_directional_derivatives_change_nothing(fmus, version, kind):
    fmu = Fmu(fmus, Stiff, version, kind=kind).begin()
    fmu.set("u", 2.0)
    before = fmu.get("y")
    x = fmu.get("x")[0]
    gain = np.exp(-x * x)
    assert directional(fmu, "y", "u", 3.0).tolist() == [1.5]
    assert directional(fmu, "der_x", "u", 1.0)[0] == pytest.approx(5000.0 * gain, rel=1e-15)
    assert directional(fmu, "der_x", "x", 1.0)[0] == pytest.approx(5000.0 * (-2.0 * x * gain * 2.0 - 1.0), rel=1e-15)
    assert directional(fmu, "der_x", "rate", 1.0)[0] == pytest.approx(gain * 2.0 - x, rel=1e-14)
    assert fmu.get("y") == before


@pytest.mark.parametrize("version", VERSIONS)
def test_directional_derivatives_of_arrays(fmus, version):
    fmu = Fmu(fmus, Masses, version, kind="ME").begin()
    fmu.slave.enterContinuousTimeMode()
    assert directional(fmu, "acceleration", "x", [1.0, 3.0]).tolist() == [-20.0, -60.0]
    assert directional(fmu, "der_v", "push", 1.0).tolist() == [2.0, 2.0]
    assert directional(fmu, "der_x", "v", [0.5, 0.25]).tolist() == [0.5, 0.25]


@pytest.mark.parametrize("version", VERSIONS)
def test_initialization_has_its_own_directional_derivatives(fmus, version):
    fmu = Fmu(fmus, Stiff, version)
    fmu.enter()
    assert directional(fmu, "x", "first", 1.0).tolist() == [1.0]
    assert directional(fmu, "y", "first", 1.0).tolist() == [1.0]
    for unknown, known in (("y", "x"), ("x", "y")):  # computed by initialization, so not known
        with pytest.raises(FMICallException):
            directional(fmu, unknown, known, 1.0)
    assert b"not known" in fmu.log[-1][-1]


def test_directional_derivative_along_time(build, tmp_path):
    path = exporter.build(catalog.component("heart"), "3.0", build)
    extract(str(path), str(tmp_path))
    heart = catalog.component("heart")
    fmu = Fmu({(heart, "3.0"): (path, tmp_path)}, heart, "3.0", kind="ME").begin(2.2)
    rate = fmu.slave.getDirectionalDerivative([fmu.references["position"]], [0], [1.0], 1)[0]
    assert rate == pytest.approx(fmu.get("velocity")[0], rel=1e-12)
    fmu.slave.freeInstance()


@pytest.mark.parametrize("version", VERSIONS)
def test_flags_and_documentation_say_what_is_offered(fmus, version):
    word = "Derivative" if version == "2.0" else "Derivatives"
    texts = [
        zipfile.ZipFile(fmus[part, version][0]).read("modelDescription.xml").decode() for part in (Masses, Sampler)
    ]
    assert [text.count(f'providesDirectional{word}="true"') for text in texts] == [2, 0]
    no_c = compiler.Sources("Gamma", "", "")  # it has a function that cannot become C
    refused = exporter.plan(Gamma, version, no_c).files
    assert b"<ModelExchange" in refused["modelDescription.xml"]
    assert b"Directional" not in refused["modelDescription.xml"]
    assert "not offered: `gamma(self.u)`" in refused["documentation/index.html"].decode()
