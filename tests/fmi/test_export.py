"""Exported FMUs: valid, complete, strict about the order of calls, and equal to the component to the bit."""

import ctypes
import re
import subprocess
import threading
import zipfile
from pathlib import Path

import fmpy
import numpy as np
import pytest
from fmpy import read_model_description, simulate_fmu
from fmpy.fmi1 import FMICallException
from fmpy.validation import validate_fmu

from tests.fmi.loaded import VERSIONS, Fmu, reference_outputs, symbols
from tests.fmi.parts import PARTS, Failing, Masses, Sampler, Stiff
from twin.compiler import dependencies
from twin.component import PythonComponent
from twin.errors import BuildError
from twin.fmi.exporting import exporter
from twin.revision import UNKNOWN, revision

# ------------------------------------------------------------------------------------------------------------ archive


@pytest.mark.slow_repetitions
@pytest.mark.parametrize("version", VERSIONS)
@pytest.mark.parametrize("part", PARTS)
def test_fmpy_finds_nothing_to_complain_about(fmus, part, version):
    assert validate_fmu(str(fmus[part, version][0])) == []


@pytest.mark.slow_repetitions
@pytest.mark.parametrize("version", VERSIONS)
@pytest.mark.parametrize("part", PARTS)
def test_library_exports_fmi_functions_and_needs_libm_only(fmus, part, version):
    defined, needed = symbols(next(fmus[part, version][1].glob("binaries/*/*.so")))
    assert defined
    assert all(name.startswith(f"fmi{version[0]}") for name in defined)
    assert needed <= {"exp", "log", "sqrt", "cos", "ceil", "floor"}


@pytest.mark.parametrize("version", VERSIONS)
def test_every_function_of_the_standard_header_is_there(fmus, version):
    library = ctypes.CDLL(str(next(fmus[Stiff, version][1].glob("binaries/*/*.so"))))
    header = Path(fmpy.__file__).with_name("c-code") / f"fmi{version[0]}Functions.h"
    declared = re.findall(r"^\s*FMI\d_Export\s+\w+\s+(fmi\w+);", header.read_text(), re.MULTILINE)
    assert len(declared) > 40
    assert [name for name in declared if not hasattr(library, name)] == []


@pytest.mark.slow
def test_unchanged_components_are_left_alone_and_exports_are_equal_to_the_byte(fmus, build, tmp_path):
    path = fmus[Stiff, "3.0"][0]
    before = path.stat().st_mtime_ns
    assert exporter.build(Stiff, "3.0", build / "tests").stat().st_mtime_ns == before
    first, second = (exporter.export(Stiff, "3.0", tmp_path / f"{i}.fmu", build / "tests") for i in range(2))
    assert second.read_bytes() == first.read_bytes()


@pytest.mark.slow
def test_a_damaged_fmu_is_made_anew(tmp_path):
    path = exporter.build(Stiff, "3.0", tmp_path)
    whole = path.read_bytes()
    for damage in (whole[:-100], b"", whole[:500] + b"x" + whole[501:]):
        path.write_bytes(damage)
        assert exporter.build(Stiff, "3.0", tmp_path).read_bytes() == whole
    path.with_suffix(".hash").write_text("x")
    assert exporter.build(Stiff, "3.0", tmp_path).read_bytes() == whole


def test_an_export_says_what_it_was_made_from(fmus, build, tmp_path):
    path = exporter.export(Stiff, "3.0", tmp_path / "a.fmu", build / "tests")
    with zipfile.ZipFile(path) as archive:
        origin = archive.read("documentation/origin.txt").decode()
        description = archive.read("modelDescription.xml").decode()
    token = re.search(r'instantiationToken="(.+?)"', description)[1]
    assert f"Stiff, content {token}" in origin
    assert re.search(r"engine: twin [\d.]+, revision \S+", origin)


def test_a_revision_follows_the_folder_not_the_repository(tmp_path):
    def git(*words):
        name = ("-c", "user.name=a", "-c", "user.email=a@b.c", "-c", "commit.gpgsign=false")
        subprocess.run(["git", "-C", tmp_path, *name, *words], check=True, capture_output=True)

    assert revision(tmp_path) == UNKNOWN
    git("init")
    for folder in ("one", "other"):
        (tmp_path / folder).mkdir()
        (tmp_path / folder / "model.py").write_text("x = 1")
        git("add", ".")
        git("commit", "-m", folder)
    before = revision(tmp_path / "one")
    assert re.fullmatch(r"[0-9a-f]{12}", before)
    assert revision(tmp_path / "other") != before
    (tmp_path / "other" / "model.py").write_text("x = 2")
    assert revision(tmp_path / "one") == before
    assert revision(tmp_path / "other").endswith(" with changes")


@pytest.mark.slow
def test_one_archive_for_several_platforms(build, tmp_path):
    targets = ("x86_64-linux", "aarch64-linux")
    for version, folders in (("2.0", ("linux64", "aarch64-linux")), ("3.0", targets)):
        path = exporter.build(Stiff, version, tmp_path, targets)
        before = path.stat().st_mtime_ns
        assert exporter.build(Stiff, version, tmp_path, targets).stat().st_mtime_ns == before  # from the store
        archive = zipfile.ZipFile(path)
        machines = [archive.read(f"binaries/{folder}/Stiff.so")[18] for folder in folders]
        assert machines == [62, 183]  # EM_X86_64, EM_AARCH64
        assert validate_fmu(str(path)) == []


@pytest.mark.slow
def test_token_changes_with_the_component():
    class Stiff(PARTS[1]):  # type: ignore[valid-type, misc]
        __doc__ = PARTS[1].__doc__

        def derivatives(self, t):
            self.der_x = -self.rate * self.x
            self.y = self.x

    assert exporter.plan(Stiff, "2.0").token != exporter.plan(PARTS[1], "2.0").token


def test_python_side_component_and_unknown_names_are_refused(tmp_path):
    class Aside(PythonComponent):
        """Uses Python."""

        def step(self, t, h):
            pass

    with pytest.raises(BuildError, match="Python-side"):
        exporter.export(Aside, "2.0", tmp_path / "a.fmu", tmp_path)
    with pytest.raises(BuildError, match="version"):
        exporter.export(Stiff, "1.0", tmp_path / "a.fmu", tmp_path)
    with pytest.raises(BuildError, match="riscv"):
        exporter.export(Stiff, "2.0", tmp_path / "a.fmu", tmp_path, ["riscv"])


def test_arrays_are_native_in_fmi_3_and_flat_in_fmi_2(fmus):
    two, three = (read_model_description(str(fmus[Sampler, v][0])) for v in VERSIONS)
    assert [v.shape for v in three.modelVariables if v.name == "delay"] == [(4,)]
    assert [v.name for v in two.modelVariables if v.name.startswith("delay")] == [f"delay[{i}]" for i in range(1, 5)]
    assert "stream" in {v.name for v in three.modelVariables}
    assert not any(v.name.startswith("stream") for v in two.modelVariables)  # 64 bits do not fit an Integer
    derivative = next(
        v for v in read_model_description(str(fmus[Masses, "2.0"][0])).modelVariables if v.name == "der(v[2])"
    )
    assert derivative.derivative.name == "v[2]"
    assert (three.coSimulation.fixedInternalStepSize, two.defaultExperiment.stepSize) == ("0.01", "0.01")


def test_structure_names_what_outputs_follow(fmus):
    description = read_model_description(str(fmus[Masses, "3.0"][0]))
    follows = {u.variable.name: {d.name for d in u.dependencies} for u in description.outputs}
    assert follows == {"total": {"x"}, "acceleration": {"push", "pushes", "x"}}
    assert dependencies(Masses) == {"total": (), "acceleration": ("push", "pushes")}
    assert dependencies(Sampler)["y"] == ("u",)
    states = {v.name: v.initial for v in read_model_description(str(fmus[Stiff, "2.0"][0])).modelVariables}
    assert (states["x"], states["y"]) == ("calculated", "calculated")  # `initialize` sets x


def test_documentation_lists_every_variable(fmus):
    page = zipfile.ZipFile(fmus[Masses, "2.0"][0]).read("documentation/index.html").decode()
    assert "Two masses on springs." in page
    assert all(f"<td>{v.name}" in page for v in Masses.variables if v.role != "derivative")


# ------------------------------------------------------------------------------------------------------------- values


@pytest.mark.slow_repetitions
@pytest.mark.parametrize("version", VERSIONS)
@pytest.mark.parametrize("h", [0.01, 0.0037, 0.025])
@pytest.mark.parametrize("part", [Masses, Stiff, Sampler])
def test_trajectory_equals_the_interpreted_component_to_the_bit(fmus, part, version, h):
    fmu, reference = Fmu(fmus, part, version), part()
    reals = [v for v in part.variables if v.role == "input" and v.type == "Float64"]
    fmu.enter(0.5)
    reference.start(0.5)
    for n in range(40):
        t = 0.5 + n * h
        for variable in reals:
            value = np.full(variable.shape, np.sin(3.0 * t)) + np.arange(variable.size).reshape(variable.shape)
            fmu.set(variable.name, value)
            reference.views[variable.name][...] = value
        if part is Sampler and n == 5:
            fmu.set("enable", True)
            reference.enable = True
        if n == 0:
            fmu.slave.exitInitializationMode()
            reference.start(0.5)
            assert fmu.outputs() == reference_outputs(reference)
        fmu.step(t, h)
        reference.advance(t, h)
        if part is not Sampler or version == "3.0":
            assert fmu.outputs() == reference_outputs(reference)
        else:
            assert fmu.get("y").tobytes() == reference.views["y"].tobytes()
    fmu.slave.terminate()
    fmu.slave.freeInstance()


@pytest.mark.parametrize("version", VERSIONS)
def test_simulate_fmu_equals_the_interpreted_component(fmus, version):
    path = str(fmus[Stiff, version][0])
    result = simulate_fmu(path, stop_time=0.1, output_interval=0.005, start_values={"u": 1.5, "first": 0.25})
    reference = Stiff(u=1.5, first=0.25)
    reference.start()
    expected = [reference.y]
    for t, end in zip(result["time"][:-1], result["time"][1:], strict=True):
        reference.advance(t, end - t)
        expected.append(reference.y)
    assert result["y"].tolist() == expected


@pytest.mark.parametrize("version", VERSIONS)
def test_initialization_is_repeatable(fmus, version):
    fmu = Fmu(fmus, Stiff, version)
    fmu.enter()
    for value in (0.1, 0.7):
        fmu.set("first", value)
        fmu.set("u", 2.0)
        assert fmu.get("y")[0] == value + 1.0
    fmu.slave.exitInitializationMode()
    fmu.slave.reset()
    assert fmu.begin().get("y")[0] == 0.3


def test_wide_integers(fmus):
    for version in VERSIONS:
        fmu = Fmu(fmus, Sampler, version)
        fmu.set("enable", True)
        fmu.set("step_size", 4)
        fmu.set("seed", -3)
        fmu.begin().step(0.0, 0.01)
        if version == "3.0":
            assert fmu.get("wide")[0] == 2**32
        else:
            with pytest.raises(FMICallException):
                fmu.get("wide")
            assert b"does not fit" in fmu.log[-1][-1]


# ------------------------------------------------------------------------------------------------------- saved states


def other_token(token):
    return token.replace(token[1], "f" if token[1] != "f" else "0", 1)


@pytest.mark.parametrize("version", VERSIONS)
def test_saved_states_replay_to_the_bit(fmus, version):
    part = Masses if version == "2.0" else Sampler
    fmu = Fmu(fmus, part, version).begin()
    save = getattr(fmu.slave, "getFMUstate" if version == "2.0" else "getFMUState")
    load = getattr(fmu.slave, "setFMUstate" if version == "2.0" else "setFMUState")
    pack = getattr(fmu.slave, "serializeFMUstate" if version == "2.0" else "serializeFMUState")
    unpack = getattr(fmu.slave, "deSerializeFMUstate" if version == "2.0" else "deserializeFMUState")
    drop = getattr(fmu.slave, "freeFMUstate" if version == "2.0" else "freeFMUState")
    for n in range(3):
        fmu.step(n * 0.007, 0.007)
    state = save()
    data = pack(state)

    def replay():
        for n in range(3, 9):
            fmu.step(n * 0.007, 0.007)
        return fmu.outputs()

    first = replay()
    load(state)
    assert replay() == first
    load(unpack(data))
    assert replay() == first
    with pytest.raises(FMICallException):
        unpack(b"\0" + data[1:])
    with pytest.raises(FMICallException):
        unpack(data[:-1])
    drop(state)
    with pytest.raises(FMICallException):
        load(state)  # freed


@pytest.mark.parametrize("version", VERSIONS)
def test_instances_are_independent(fmus, version):
    one, other = Fmu(fmus, Masses, version), Fmu(fmus, Masses, version)
    one.begin()
    before = other.begin().outputs()
    one.step(0.0, 0.1)
    assert one.outputs() != before
    assert other.outputs() == before


def test_places_are_claimed_by_threads_without_clashes(fmus):
    fmu = Fmu(fmus, Stiff, "3.0")
    functions, clashes = fmu.slave.dll, []
    claim, drop = functions.fmi3GetFMUState, functions.fmi3FreeFMUState
    held: set[int] = set()

    def work():
        for _ in range(1500):
            state = ctypes.c_void_p()
            claim(ctypes.c_void_p(fmu.slave.component), ctypes.byref(state))
            if state.value in held:
                clashes.append(state.value)
            held.add(state.value)
            held.remove(state.value)
            drop(ctypes.c_void_p(fmu.slave.component), ctypes.byref(state))

    threads = [threading.Thread(target=work) for _ in range(4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert not clashes


@pytest.mark.slow
def test_exhausted_places_are_an_error_with_a_reason(fmus):
    fmu = Fmu(fmus, Failing, "2.0")
    claim, me = fmu.slave.dll.fmi2GetFMUstate, ctypes.c_void_p(fmu.slave.component)
    claim.argtypes, states, status = None, [], 0
    while status == 0:
        states.append(ctypes.c_void_p())
        status = claim(me, ctypes.byref(states[-1]))
    assert status == 3
    assert b"are in use" in fmu.log[-1][-1]
    for state in states[:-1]:
        assert fmu.slave.dll.fmi2FreeFMUstate(me, ctypes.byref(state)) == 0


# ----------------------------------------------------------------------------------------------------------- messages


@pytest.mark.parametrize("version", VERSIONS)
def test_wrong_token_gives_no_instance(fmus, version):
    token = read_model_description(str(fmus[Stiff, version][0])).guid
    with pytest.raises(Exception, match="instantiate"):
        Fmu(fmus, Stiff, version, other_token(token))


@pytest.mark.parametrize("version", VERSIONS)
def test_messages_arrive_by_category(fmus, version):
    fmu = Fmu(fmus, Failing, version)
    with pytest.raises(FMICallException):
        fmu.step(0.0, 0.1)
    name = f"fmi{version[0]}DoStep".encode()
    assert fmu.log == [
        (3, b"logStatusError", name + b" is not allowed in state Instantiated.")
    ]  # though logging is off
    fmu.begin().set("status", 1)
    fmu.step(0.0, 0.1)
    assert len(fmu.log) == 1
    fmu.slave.setDebugLogging(True, ["logStatusWarning"])
    fmu.step(0.1, 0.1)
    assert fmu.log[-1] == (1, b"logStatusWarning", b"Failing: the step from 0.1 by 0.1 did not go well.")
    fmu.slave.setDebugLogging(True, ["logCalls"])
    fmu.get("y")
    assert fmu.log[-1] == (
        0,
        b"logCalls",
        f"fmi{version[0]}Get{'Integer' if version == '2.0' else 'Int32'} in state Step Mode".encode(),
    )
    with pytest.raises(FMICallException):
        fmu.slave.setDebugLogging(True, ["logNothing"])


@pytest.mark.parametrize("version", VERSIONS)
def test_arguments_that_make_no_sense_change_nothing(fmus, version):
    fmu = Fmu(fmus, Masses, version).begin(1.0, 2.0)
    before = fmu.outputs()
    real = fmu.slave.setReal if version == "2.0" else fmu.slave.setFloat64
    for t, h in ((0.5, 0.1), (1.0, 0.0), (1.0, -0.1), (1.0, float("nan")), (1.0, 1.1), (float("nan"), 0.1)):
        with pytest.raises(FMICallException):
            fmu.step(t, h)
    for references, values in (([99], [1.0]), ([fmu.references["mass"]], [1.0])):  # no such variable; fixed parameter
        with pytest.raises(FMICallException):
            real(references, values)
    with pytest.raises(FMICallException):
        fmu.set("total", 1.0)
    assert fmu.outputs() == before
    fmu.set("stiffness", 20.0)
    fmu.step(1.0 + 1e-12, 1.0)
