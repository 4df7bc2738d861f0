"""Somebody else's FMUs as members: every type, every failure, and what the loop needs by address."""

import ctypes
import os
import shutil
import zipfile
from contextlib import closing
from fractions import Fraction
from pathlib import Path
from typing import Self

import numpy as np
import pytest

from tests.fmi.third_party import FMI2, FMI3, NATIVE, NATIVE_XML, archive, native_fmu, python_fmu
from twin.compiler import machine
from twin.errors import CouplingError, FMUError, SimulationError
from twin.fmi import FMUMember
from twin.fmi.importing import binary

REFERENCE = Path(os.environ.get("REFERENCE_FMUS", "reference-fmus"), "fmus")  # see CONTRIBUTING.md


@pytest.fixture(scope="session")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("fmus")


@pytest.fixture(scope="session")
def all_types_2(folder: Path) -> Path:
    return python_fmu(folder, FMI2, "AllTypes2")


@pytest.fixture(scope="session")
def all_types_3(folder: Path) -> Path:
    return python_fmu(folder, FMI3, "AllTypes3")


@pytest.fixture(scope="session")
def native(folder: Path) -> Path:
    return native_fmu(folder)


class Run:
    """A member in step mode, stepped by address as the loop does it."""

    def __init__(self, path: Path, **start_values: object) -> None:
        self.member = FMUMember("part", path, start_values)
        self.flags = np.zeros(5, np.int64)

    def __enter__(self) -> Self:
        self.member.instantiate()
        self.member.enter_initialization(0.0, 1.0)
        self.member.exit_initialization()
        return self

    def __exit__(self, *_: object) -> None:
        self.member.close()

    def step(self, t: float, h: float) -> int:
        member = self.member
        flags = self.flags.ctypes.data
        return machine.call_step(member.step_function, member.step_signature, member.instance, t, h, flags)


def move(member: FMUMember, names: list[str], write: bool, values: np.ndarray) -> int:
    access = member.access(names, write)
    assert access.size == values.size
    return access.call(member.instance, values.ctypes.data)


@pytest.mark.slow
def test_all_types_fmi2(all_types_2: Path) -> None:
    with Run(all_types_2, k="3", label="a") as run:
        member = run.member
        assert (member.variables["b"].type, member.variables["b"].dtype) == ("Boolean", np.int32)
        assert (member.variables["u"].type, member.variables["n"].type) == ("Float64", "Int32")
        assert not member.variables["s"].connectable
        for name, value in (("u", 1.5), ("n", 41), ("b", False), ("s", "b")):
            member.set(name, value)
        assert run.step(0.0, 0.1) == 0
        assert [member.get(name) for name in ("y", "m", "c", "r")] == [4.5, 42, True, "ab"]
        assert move(member, ["u", "k"], True, np.array([2.0, 5.0])) == 0
        assert move(member, ["b"], True, np.array([1], np.int32)) == 0
        assert run.step(0.1, 0.1) == 0
        values = np.zeros(2)
        assert move(member, ["y", "k"], False, values) == 0
        assert values.tolist() == [10.0, 5.0]
        assert not member.get("c")
        assert member.identity["fmi"] == "2.0"
        assert len(member.identity["sha256"]) == 64


@pytest.mark.slow
def test_all_types_fmi3(all_types_3: Path) -> None:
    with Run(all_types_3, k=3) as run:
        member = run.member
        assert member.variables["y"].shape == (3,)
        assert len(member.variables["y"].references) == 1
        big = 2**63 - 2
        for name, value in (("u", 1), ("i", 41), ("j", big), ("l", 2**63), ("b", "true"), ("s", "b")):
            member.set(name, value)
        assert run.step(0.0, 0.1) == 0
        assert member.get("y").tolist() == [3.0, 6.0, 9.0]
        assert [member.get(name) for name in ("p", "q", "o", "c", "r")] == [42, big + 1, 2**63 + 1, False, "b"]
        values = np.zeros(4)
        assert move(member, ["y", "k"], False, values) == 0
        assert values.tolist() == [3.0, 6.0, 9.0, 3.0]


@pytest.mark.slow
@pytest.mark.parametrize(("template", "number"), [(FMI2, 2), (FMI3, 3)])
def test_failing_steps(folder: Path, template: str, number: int) -> None:
    broken = python_fmu(folder, template, f"Raises{number}", "raise RuntimeError('bearing seized')")
    with Run(broken) as run:
        status = run.step(0.0, 0.1)
        assert status in (3, 4)
        assert not run.member.finish_reason()
        with pytest.raises(SimulationError, match=r"part: doStep returned (ERROR|FATAL)"):
            run.member.check(status, "doStep")
    refuses = python_fmu(folder, template, f"Refuses{number}", "return False")
    with Run(refuses) as run:
        assert run.step(0.0, 0.1) == 2

        # PythonFMU answers fmi2Terminated with true then; FMI 3.0 has a flag for this, and DISCARD is a failure
        assert run.member.finish_reason() == ("it set fmi2Terminated." if number == 2 else "")


def test_several_instances(all_types_2: Path, native: Path) -> None:
    for path, name, value in ((all_types_2, "k", 1.0), (native, "limit", 5.0)):
        with Run(path, **{name: value}) as a, Run(path, **{name: 2 * value}) as b:
            assert a.member.instance != b.member.instance
            assert a.member.step_function == b.member.step_function  # one library
            assert a.step(0.0, 0.1) == b.step(0.0, 0.1) == 0
            if name == "k":
                assert (a.member.get(name), b.member.get(name)) == (value, 2 * value)


def test_log_lines_of_two_instances(native: Path) -> None:
    with Run(native) as a, Run(native) as b:
        a.member.set("mode", 3)
        assert a.step(0.0, 0.1) == 3
        assert a.member.log == ["ERROR: mode is set"]
        assert b.member.log == []
        with pytest.raises(SimulationError, match=r"ERROR\. It logged: ERROR: mode is set"):
            a.member.check(3, "fmi3DoStep")


def test_structural_parameters(native: Path) -> None:
    with Run(native, n="3", x="1 2 3") as run:
        assert run.member.variables["y"].shape == (3,)
        assert run.step(0.0, 0.5) == 0
        assert run.member.get("y").tolist() == [0.5, 1.0, 1.5]
        assert run.member.get("y_seen").tolist() == [0.5, 1.0, 1.5]
        assert run.member.get("n") == 3
    with Run(native, **{"x[2]": 7}) as run:
        assert run.member.variables["x"].start.tolist() == [1.0, 7.0]
        assert run.step(0.0, 0.5) == 0
        assert run.member.get("y").tolist() == [0.5, 3.5]


def test_binary(native: Path) -> None:
    with Run(native, data="00ff") as run:
        assert run.member.get("echo") == b"\x00\xff"
        for data in (b"", b"\x01\x02\x03"):
            run.member.set("data", data)
            assert run.member.get("echo") == data
        with pytest.raises(CouplingError, match="cannot be moved"):
            run.member.access(["data"], write=True)


def test_terminate_flag(native: Path) -> None:
    with Run(native, limit=0.25) as run:
        assert run.step(0.0, 0.2) == 0
        assert machine.read8(run.flags.ctypes.data + 8) == 0
        assert run.step(0.2, 0.2) == 0
        assert machine.read8(run.flags.ctypes.data + 8) == 1
        assert run.member.last_successful_time(machine.read_float(run.flags.ctypes.data + 24)) == 0.25


@pytest.mark.parametrize(
    ("values", "words"),
    [
        ({"lmit": 1}, "no variable 'lmit'. Did you mean 'limit'"),
        ({"y": [1, 2]}, r"y cannot be set \(output, continuous, initial calculated\)"),
        ({"time": 1}, "time cannot be set"),
        ({"limit": "fast"}, "limit is a number, not 'fast'"),
        ({"limit": True}, "limit is a number, not True"),
        ({"x": [1, 2, 3]}, "x has 3 values, expected 2"),
        ({"x": 1}, "x has 1 values, expected 2"),
        ({"x": "[1, 2"}, "is not a list"),
        ({"x": [[1, 2]]}, "expected 2"),
        ({"x[3]": 1}, r"outside of x\[2\]"),
        ({"x[0]": 1}, r"outside of x\[2\]"),
        ({"x[1,1]": 1}, r"outside of x\[2\]"),
        ({"n": 3, "x[1]": 1}, "Give all of it"),
        ({"n": -1}, "out of range"),
        ({"n": 1.5}, "whole number"),
        ({"n": 10**9}, "1000000000 elements"),
        ({"mode": 2**31}, "out of range"),
        ({"mode": "3.5"}, "whole number"),
        ({"data": "0g"}, "Binary"),
    ],
)
def test_start_values_refused(native: Path, values: dict[str, object], words: str) -> None:
    with pytest.raises(FMUError, match=words):
        FMUMember("part", native, values)


def test_call_failures(native: Path) -> None:
    member = FMUMember("part", native, {"n": 9, "x": [0] * 9})
    with pytest.raises(SimulationError, match=r"part: fmi3SetUInt64 returned ERROR"):
        member.instantiate()
    member.close()
    member.close()
    with pytest.raises(SimulationError, match="not instantiated"):
        member.get("limit")


def test_wrong_token(tmp_path: Path) -> None:
    member = FMUMember("part", native_fmu(tmp_path, NATIVE_XML.replace('"native"', '"other"')))
    with pytest.raises(FMUError, match=r"refuses to be instantiated\. It logged: ERROR: wrong token"):
        member.instantiate()
    member.close()


def test_one_instance_per_process(tmp_path: Path) -> None:
    flag = 'modelIdentifier="Native" canBeInstantiatedOnlyOncePerProcess="true"'
    path = native_fmu(tmp_path, NATIVE_XML.replace('modelIdentifier="Native"', flag))
    with Run(path):
        second = FMUMember("second", path)
        with pytest.raises(FMUError, match="one instance per process; 'part' is there"):
            second.instantiate()
        second.close()
    with Run(path):
        pass


def test_missing_functions(tmp_path: Path) -> None:
    path = native_fmu(tmp_path, source=NATIVE.replace("fmi3DoStep", "fmi3Dostep"))
    here = Path.cwd()
    member = FMUMember("part", path)
    with pytest.raises(FMUError, match="lacks the function fmi3DoStep"):
        member.instantiate()
    member.close()
    assert Path.cwd() == here


def test_wrong_library(native: Path, tmp_path: Path) -> None:
    path = tmp_path / "Native.fmu"
    with zipfile.ZipFile(native) as old, zipfile.ZipFile(path, "w") as new:
        new.writestr("modelDescription.xml", old.read("modelDescription.xml"))
        new.writestr("binaries/x86_64-linux/Native.so", b"\x7fELF" + old.read("binaries/x86_64-linux/Native.so")[4:400])
    here = Path.cwd()
    member = FMUMember("part", path)
    with pytest.raises(FMUError, match=r"Native\.so is cut off") as caught:
        member.instantiate()
    member.close()
    assert "twin-fmu" not in str(caught.value)
    assert Path.cwd() == here


def test_fixed_step(tmp_path: Path) -> None:
    fixed = NATIVE_XML.replace('Size="true"', 'Size="false" fixedInternalStepSize="0.002"')
    member = FMUMember("part", native_fmu(tmp_path, fixed))
    member.close()
    assert member.period_ns == 2_000_000
    assert not member.capabilities["canHandleVariableCommunicationStepSize"]


def test_folder_is_gone(native: Path) -> None:
    with Run(native) as run:
        folder = run.member._unpacked.folder
        assert folder.is_dir()
    assert not folder.parent.exists()


@pytest.mark.skipif(not REFERENCE.is_dir(), reason="REFERENCE_FMUS names no folder")
@pytest.mark.parametrize("version", ["2.0", "3.0"])
@pytest.mark.parametrize("name", ["BouncingBall", "Dahlquist", "Feedthrough", "Resource", "Stair", "VanDerPol"])
def test_reference_fmus(name: str, version: str, tmp_path: Path) -> None:
    path = shutil.copy(REFERENCE / version / f"{name}.fmu", tmp_path)
    with Run(Path(path)) as run:
        assert run.step(0.0, 0.1) == 0
        for variable in run.member.variables.values():
            if variable.causality == "output":
                value = np.asarray(run.member.get(variable.name))
                assert value.shape == variable.shape


def test_twins_by_name_alone(tmp_path: Path) -> None:
    flag = 'modelIdentifier="Native" canBeInstantiatedOnlyOncePerProcess="true"'
    path = native_fmu(tmp_path, NATIVE_XML.replace('modelIdentifier="Native"', flag))
    with Run(path):
        for _ in range(2):
            second = FMUMember("part", path)
            with pytest.raises(FMUError, match="one instance per process"):
                second.instantiate()
            second.close()


def test_no_fmu_functions_at_all(tmp_path: Path) -> None:
    path = native_fmu(tmp_path, source="int add(int a, int b) { return a + b; }")
    member = FMUMember("part", path)
    with pytest.raises(FMUError, match=r"Native\.fmu: its library lacks the function fmi3InstantiateCoSimulation"):
        member.instantiate()
    member.close()


@pytest.mark.parametrize(("size", "expected"), [("0.3333333333333333", Fraction(10**9, 3)), ("-1", "negative")])
def test_odd_fixed_step(tmp_path: Path, size: str, expected: object) -> None:
    path = native_fmu(tmp_path, NATIVE_XML.replace('Size="true"', f'Size="false" fixedInternalStepSize="{size}"'))
    if isinstance(expected, str):
        with pytest.raises(FMUError, match=expected):
            FMUMember("part", path)
        return
    with closing(FMUMember("part", path)) as member:
        assert member.period_ns == expected


@pytest.mark.parametrize("status", [3, 4])
def test_close_after_failure(tmp_path: Path, status: int) -> None:
    trap = "int fmi3Terminate(void *c) { __builtin_trap(); }"  # not allowed after an error
    free = "void fmi3FreeInstance(void *c) { if (((Instance *)c)->mode == 4) __builtin_trap(); free(c); }"
    source = NATIVE.replace("int fmi3Terminate(void *c) { return 0; }", trap)
    source = source.replace("void fmi3FreeInstance(void *c) { free(c); }", free)
    with Run(native_fmu(tmp_path, source=source)) as run:
        run.member.set("mode", status)
        assert run.step(0.0, 0.1) == status
        with pytest.raises(SimulationError):
            run.member.check(status, "fmi3DoStep")
    assert not run.member._unpacked.folder.exists()
    run.member.close()


def test_feedthrough_by_name_where_references_repeat(tmp_path: Path) -> None:
    """In FMI 2.0 value references count per type: a Real and an Integer may share one."""
    text = """<fmiModelDescription fmiVersion="2.0" modelName="Native" guid="g"><CoSimulation modelIdentifier="Native"/>
    <ModelVariables>
    <ScalarVariable name="u" valueReference="0" causality="input"><Real start="0" unit="mm"/></ScalarVariable>
    <ScalarVariable name="y" valueReference="1" causality="output"><Real/></ScalarVariable>
    <ScalarVariable name="n" valueReference="1" causality="output" variability="discrete"><Integer/></ScalarVariable>
    </ModelVariables><ModelStructure><Outputs><Unknown index="2" dependencies="1"/><Unknown index="3" dependencies=""/>
    </Outputs></ModelStructure></fmiModelDescription>"""
    files = {"modelDescription.xml": text.encode(), "binaries/linux64/Native.so": b""}
    member = FMUMember("part", archive(tmp_path / "a.fmu", files))
    member.close()
    assert member.variables["y"].dependencies == ("u",)
    assert member.variables["n"].dependencies == ()
    assert member.variables["u"].unit == "mm"
    assert member.period_ns == 0


@pytest.mark.parametrize("mode", [0, 4])
def test_what_pythonfmu_shares_is_dropped_before_the_process_ends(mode: int, tmp_path: Path) -> None:
    """Its library would do so itself, in memory that the C library has freed by then; also after a fatal failure."""
    source = NATIVE + "int dropped; void finalizePythonInterpreter(void) { dropped++; }"
    member = FMUMember("part", native_fmu(tmp_path, source=source))
    member.instantiate()
    library = ctypes.CDLL(str(member._unpacked.binary))
    if mode:
        member.failed(mode)
    member.close()
    assert ctypes.c_int.in_dll(library, "dropped").value == 1


@pytest.mark.parametrize(
    ("reason", "unlimited", "limited"),
    [
        ("a.so: cannot open shared object file: Cannot allocate memory", True, True),
        ("a.so: failed to map segment from shared object", False, True),  # of another file system without `exec`, too
        ("a.so: undefined symbol: f", False, False),
    ],
)
def test_what_the_loader_says_where_memory_lacks(monkeypatch, reason, unlimited, limited):
    for is_limited, lacks in ((False, unlimited), (True, limited)):
        monkeypatch.setattr(binary, "memory_is_limited", lambda is_limited=is_limited: is_limited)
        assert binary.lacks_memory(reason) is lacks
