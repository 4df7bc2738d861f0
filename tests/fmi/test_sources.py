"""The C files of FMUs: no compiler complains, and an FMU built from its sources gives the values of its binary."""

import shutil
import subprocess
import zipfile

import numpy as np
import pytest
from fmpy import read_model_description, simulate_fmu
from fmpy.build import build_platform_binary
from fmpy.model_description import read_build_description
from fmpy.validation import validate_fmu

from tests.c_compilers import CLANG
from tests.fmi.loaded import VERSIONS
from tests.fmi.parts import PARTS
from twin import compiler
from twin.component import Component, Int32, input, output, parameter
from twin.errors import BuildError
from twin.fmi.exporting import exporter, model_c_writer
from twin.fmi.exporting.sources import FOLDER

WARNINGS = ("-Wall", "-Wextra", "-Wconversion", "-Wmissing-prototypes", "-Wfloat-equal", "-pedantic")
CLEAN = (*WARNINGS, "-std=c11", "-Werror", "-O2")
COMPILERS = {"gcc": ["gcc"], "clang": CLANG}
GCC = pytest.mark.skipif(not shutil.which("gcc"), reason="gcc is missing")
CMAKE = pytest.mark.skipif(not (shutil.which("gcc") and shutil.which("cmake")), reason="gcc or cmake is missing")


class Follower(Component):
    """Goes a part of the way to what it follows, and counts."""

    u = input("m", "what is followed /* ??/ \u00b5")
    enable = input("", "whether it moves", start=True)
    y = output("m", "where it is")
    count = output("", "number of steps", start=0, type=Int32)
    gain = parameter(0.3, "1/s", "part of the way", source="test")

    def initialize(self):
        self.y = self.gain * self.u

    def step(self, t, h):
        if self.enable:
            self.y += self.gain * (self.u - self.y) * h + 0.1 * t
        self.count += 1


class Leader(Follower):
    """Goes where it wants."""

    def step(self, t, h):
        self.y = self.gain * t + h


def exported(part, version, build, folder):
    """Archive with sources, and the folder it is unpacked in."""
    path = exporter.export(part, version, folder / f"{part.__name__}.fmu", build / "tests", sources=True)
    with zipfile.ZipFile(path) as archive:
        archive.extractall(folder / part.__name__)
    return path, folder / part.__name__


def run(*command, folder):
    done = subprocess.run([str(word) for word in command], cwd=folder, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout


# ------------------------------------------------------------------------------------------------------------ the text


ONCE = ["3.0", pytest.param("2.0", marks=pytest.mark.slow)]  # what compiles all that again


@pytest.mark.slow
@pytest.mark.parametrize("tool", COMPILERS)
@pytest.mark.parametrize("version", ONCE)
def test_no_compiler_complains(version, tool, build, tmp_path):
    command = COMPILERS[tool]
    if not shutil.which(command[0]):
        pytest.skip(f"{command[0]} is missing")
    files = [FOLDER / f"fmi{version[0]}.c"]
    for part in PARTS:
        files.append(tmp_path / f"{part.__name__}_model.c")
        files[-1].write_text(exporter.plan(part, version).model, encoding="utf-8")
        made = compiler.translate(part, part.__name__)
        (tmp_path / f"{made.name}.h").write_text(made.header, encoding="utf-8")
    _, folder = exported(Follower, version, build, tmp_path)
    files += (folder / "sources").glob("[!f]*.c")
    assert len(files) > len(PARTS) + 2
    run(*command, *CLEAN, f"-I{FOLDER}", f"-I{tmp_path}", "-c", *files, folder=tmp_path)


def test_texts_stay_in_their_strings_and_comments():
    assert model_c_writer.string('a"b\\??/\n') == r'"a\"b\\\?\?/\012"'
    assert model_c_writer.string("\u00b5") == r'"\302\265"'
    assert model_c_writer.comment("a */ b /* c\n  d") == "/* a * / b / * c d */"
    assert model_c_writer.comment("*/*") == "/* * / * */"


@pytest.mark.slow
def test_the_state_machine_is_compiled_once_for_all_components(build, tmp_path):
    places = tmp_path / "cache"
    for part in (Follower, Leader):
        exporter.build(part, "3.0", tmp_path)
        kept = {path.parent.name: path.stat().st_mtime_ns for path in places.glob("*/object.o")}
        if part is Follower:
            first = kept
    machine = exporter.state_machine("x86_64-linux", "fmi3.c", tmp_path)
    same = [name for name in kept if (places / name / "object.o").read_bytes() == machine]
    assert len(same) == 1
    assert kept[same[0]] == first[same[0]]


# --------------------------------------------------------------------------------------------------------- the archive


@pytest.mark.slow_repetitions
@pytest.mark.parametrize("version", VERSIONS)
def test_sources_are_complete_listed_and_reproducible(version, build, tmp_path):
    path, folder = exported(Follower, version, build, tmp_path)
    assert validate_fmu(str(path)) == []
    own = {"model.c", "Follower.c", f"fmi{version[0]}.c"}
    assert {file.name for file in (folder / "sources").glob("*.c")} == own
    configurations = read_model_description(str(path)).buildConfigurations
    assert all(set(c.sourceFileSets[0].sourceFiles) == own for c in configurations)
    assert all(c.modelIdentifier == "Follower" for c in configurations)
    if version == "3.0":
        assert configurations[0].sourceFileSets[0].language == "C11"
        assert len(read_build_description(str(path))) == len(configurations) == 5
    again = exporter.export(Follower, version, tmp_path / "again.fmu", build / "tests", sources=True)
    assert again.read_bytes() == path.read_bytes()


def test_both_interfaces_of_fmi_2_list_the_sources(build, tmp_path):
    part = PARTS[0]
    path = exporter.export(part, "2.0", tmp_path / "a.fmu", build / "tests", sources=True)
    assert validate_fmu(str(path)) == []
    with zipfile.ZipFile(path) as archive:
        assert archive.read("modelDescription.xml").count(b'<File name="fmi2.c"/>') == 2


def test_the_token_is_that_without_sources(build, tmp_path):
    path, _ = exported(Follower, "3.0", build, tmp_path)
    assert read_model_description(str(path)).guid == exporter.plan(Follower, "3.0").token


@pytest.mark.slow
def test_files_of_the_state_machine_are_not_replaced(build, tmp_path):
    for name in ("run", "model"):
        part = type(name, (Follower,), {"__doc__": "Has the name of a file."})
        with pytest.raises(BuildError, match=rf"^{name}: .*Rename the component\.$"):
            exporter.export(part, "3.0", tmp_path / "a.fmu", build / "tests", sources=True)


# ----------------------------------------------------------------------------------------------------------- the build


def simulated(folder):
    """All outputs of a run, as bytes."""
    t = np.arange(0.0, 1.0, 0.01)
    signals = np.array(
        list(zip(t, np.sin(9 * t), t < 0.7, strict=True)), [("time", "f8"), ("u", "f8"), ("enable", "?")]
    )
    result = simulate_fmu(
        str(folder),
        stop_time=1.0,
        output_interval=0.01,
        input=signals,
        output=["y", "count"],
        start_values={"gain": 0.7},
    )
    assert result["count"][-1] > 90
    return result.tobytes()


@pytest.mark.slow
@CMAKE
@pytest.mark.parametrize("version", ONCE)
def test_fmpy_builds_the_sources_and_values_are_equal_to_the_bit(version, build, tmp_path):
    _, folder = exported(Follower, version, build, tmp_path)
    before = simulated(folder)
    shutil.rmtree(folder / "binaries")
    (tmp_path / "cmake").mkdir()
    build_platform_binary(folder, tmp_path / "cmake")
    assert list((folder / "binaries").rglob("Follower.so"))
    assert simulated(folder) == before


@pytest.mark.slow
@GCC
@pytest.mark.parametrize("version", ONCE)
def test_a_plain_gcc_builds_the_sources_and_values_are_equal_to_the_bit(version, build, tmp_path):
    _, folder = exported(Follower, version, build, tmp_path)
    before = simulated(folder)
    library = next((folder / "binaries").rglob("Follower.so"))
    library.unlink()
    files = sorted((folder / "sources").glob("*.c"))
    run("gcc", "-O3", "-Wall", "-Wextra", "-Werror", "-shared", "-fPIC", *files, "-o", library, "-lm", folder=tmp_path)
    assert simulated(folder) == before


PROGRAM = """
#include <stdbool.h>
#include <stddef.h>
#include <stdio.h>
typedef const char *Text;
#define USE(Name)                                                                                                  \\
    void *Name##_fmi3InstantiateCoSimulation(Text, Text, Text, bool, bool, bool, bool, void *, size_t, void *,     \\
                                             void (*)(void *, int, Text, Text), void *);                           \\
    int Name##_fmi3EnterInitializationMode(void *, bool, double, double, bool, double);                            \\
    int Name##_fmi3ExitInitializationMode(void *);                                                                 \\
    int Name##_fmi3DoStep(void *, double, double, bool, bool *, bool *, bool *, double *);                         \\
    int Name##_fmi3GetFloat64(void *, const unsigned *, size_t, double *, size_t);                                 \\
    static double run_##Name(Text token)                                                                           \\
    {                                                                                                              \\
        double y = -1.0;                                                                                           \\
        void *it = Name##_fmi3InstantiateCoSimulation("a", token, "", 0, 0, 0, 0, NULL, 0, NULL, NULL, NULL);      \\
        Name##_fmi3EnterInitializationMode(it, 0, 0.0, 0.0, 0, 0.0);                                               \\
        Name##_fmi3ExitInitializationMode(it);                                                                     \\
        Name##_fmi3DoStep(it, 0.0, 0.5, 0, NULL, NULL, NULL, NULL);                                                \\
        Name##_fmi3DoStep(it, 0.5, 0.5, 0, NULL, NULL, NULL, NULL);                                                \\
        return Name##_fmi3GetFloat64(it, (const unsigned[]){3}, 1, &y, 1) ? -2.0 : y;                              \\
    }
USE(Follower)
USE(Leader)
int main(int count, char **tokens)
{
    return count != 3 || !printf("%.17g %.17g", run_Follower(tokens[1]), run_Leader(tokens[2]));
}
"""


@pytest.mark.slow
@GCC
def test_sources_of_several_fmus_in_one_program(build, tmp_path):
    objects, tokens = [], []
    for part in (Follower, Leader):
        _, folder = exported(part, "3.0", build, tmp_path)
        for source in sorted((folder / "sources").glob("*.c")):
            objects.append(tmp_path / f"{part.__name__}_{source.stem}.o")
            prefix = f"-DFMI3_FUNCTION_PREFIX={part.__name__}_"
            run("gcc", *CLEAN, "-O0", prefix, "-c", source, "-o", objects[-1], folder=tmp_path)
        tokens.append(exporter.plan(part, "3.0").token)
    symbols = run("nm", "-g", "--defined-only", *objects, folder=tmp_path).split()
    assert not [symbol for symbol in symbols if symbol == "model" or symbol.startswith("fmi3Get")]
    (tmp_path / "main.c").write_text(PROGRAM)
    run("gcc", "-std=c11", "-Wall", "main.c", *objects, "-o", "program", "-lm", folder=tmp_path)
    found = [float(word) for word in run(tmp_path / "program", *tokens, folder=tmp_path).split()]
    for value, part in zip(found, (Follower, Leader), strict=True):
        reference = part()
        reference.start(0.0)
        reference.advance(0.0, 0.5)
        reference.advance(0.5, 0.5)
        assert value == reference.y


@pytest.mark.slow
@GCC
def test_sources_of_fmi_2_take_a_prefix(build, tmp_path):
    _, folder = exported(Follower, "2.0", build, tmp_path)
    files = [folder / "sources" / name for name in ("fmi2.c", "model.c")]
    run("gcc", *CLEAN, "-O0", "-DFMI2_FUNCTION_PREFIX=it_", "-c", *files, folder=tmp_path)
    lines = run("nm", "-g", "--defined-only", "fmi2.o", "model.o", folder=tmp_path).splitlines()
    defined = [line.split()[-1] for line in lines if len(line.split()) == 3]
    assert len(defined) > 40
    assert all(symbol.startswith("it_") for symbol in defined)
