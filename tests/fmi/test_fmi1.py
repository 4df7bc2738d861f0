"""FMUs of FMI 1.0 run through the wrapper of FMI 2.0; FMUs that have only sources are compiled."""

import shutil
import zipfile

import pytest

from tests.fmi.parts import PARTS
from tests.fmi.third_party import archive, native_library
from twin.errors import FMUError
from twin.fmi import FMUMember
from twin.fmi.exporting import exporter
from twin.fmi.simulation import plan, simulate

XML = """<?xml version="1.0" encoding="UTF-8"?>
<fmiModelDescription fmiVersion="1.0" modelName="Old" modelIdentifier="Old" guid="{g}" numberOfContinuousStates="0" numberOfEventIndicators="0">
<TypeDefinitions><Type name="Length"><RealType unit="m" max="50"/></Type></TypeDefinitions>
<ModelVariables>
  <ScalarVariable name="gain" valueReference="0" variability="parameter" causality="internal"><Real start="2"/></ScalarVariable>
  <ScalarVariable name="u" valueReference="1" causality="input"><Real declaredType="Length"/></ScalarVariable>
  <ScalarVariable name="y" valueReference="2" causality="output"><Real unit="m"/></ScalarVariable>
  <ScalarVariable name="minus_y" valueReference="2" causality="output" alias="negatedAlias"><Real unit="m"/></ScalarVariable>
  <ScalarVariable name="y" valueReference="1" causality="output"><Real unit="m"/></ScalarVariable>
  <ScalarVariable name="on" valueReference="0" variability="discrete" causality="input"><Boolean start="true"/></ScalarVariable>
  <ScalarVariable name="was_on" valueReference="1" variability="discrete" causality="output"><Boolean/></ScalarVariable>
  <ScalarVariable name="steps" valueReference="0" variability="discrete" causality="output"><Integer/></ScalarVariable>
</ModelVariables>
<Implementation><CoSimulation_StandAlone><Capabilities canHandleVariableCommunicationStepSize="true"/></CoSimulation_StandAlone></Implementation>
</fmiModelDescription>
"""
C = """
typedef unsigned long size_t;
typedef struct { void (*log)(void *, const char *, int, const char *, const char *, ...);
                 void *(*allocate)(size_t, size_t); void (*release)(void *); void (*finished)(void *, int); } Callbacks;
typedef struct { double values[3]; char flags[2]; int steps; Callbacks callbacks; } Model;
void *Old_fmiInstantiateSlave(const char *n, const char *g, const char *l, const char *m, double t, char v, char i, Callbacks c, char o) {
    Model *a = c.allocate(1, sizeof(Model));
    a->callbacks = c;
    a->values[0] = 2.0;
    c.log(a, n, 1, "x", "made of %s", g);
    return a;
}
void Old_fmiFreeSlaveInstance(void *m) { ((Model *)m)->callbacks.release(m); }
int Old_fmiInitializeSlave(void *m, double t, char s, double e) { Model *a = m; a->values[2] = a->values[0] * a->values[1]; return 0; }
int Old_fmiTerminateSlave(void *m) { return 0; }
int Old_fmiSetReal(void *m, const unsigned r[], size_t n, const double v[]) { while (n--) ((Model *)m)->values[r[n]] = v[n]; return 0; }
int Old_fmiGetReal(void *m, const unsigned r[], size_t n, double v[]) { while (n--) v[n] = ((Model *)m)->values[r[n]]; return 0; }
int Old_fmiSetBoolean(void *m, const unsigned r[], size_t n, const char v[]) { while (n--) ((Model *)m)->flags[r[n]] = v[n]; return 0; }
int Old_fmiGetBoolean(void *m, const unsigned r[], size_t n, char v[]) { while (n--) v[n] = ((Model *)m)->flags[r[n]]; return 0; }
int Old_fmiGetInteger(void *m, const unsigned r[], size_t n, int v[]) { while (n--) v[n] = ((Model *)m)->steps; return 0; }
int Old_fmiDoStep(void *m, double t, double h, char next) {
    Model *a = m;
    a->values[2] = a->values[0] * a->values[1] + t + h;
    a->flags[1] = a->flags[0];
    a->steps++;
    return t > 1.0 ? 3 : 0;
}
"""


@pytest.fixture(scope="module")
def old(tmp_path_factory):
    files = {"modelDescription.xml": XML.encode(), "binaries/linux64/Old.so": native_library(C)}
    return archive(tmp_path_factory.mktemp("old") / "old.fmu", files)


@pytest.fixture(autouse=True)
def build_folder(build, monkeypatch):
    """The store of all tests, so that each library is compiled once."""
    monkeypatch.setattr("twin.fmi.importing.foreign_sources.BUILD", build)


def column(outcome, name):
    """The values of one variable."""
    return next(values for key, _, values in outcome.results.columns() if key == name)


@pytest.mark.slow
def test_it_runs(old):
    """Start values, Booleans of one byte, initialization as FMI 1.0 has it, messages, a failed step."""
    member = FMUMember("a", old, {"gain": 3.0, "u": 2.0})
    try:
        assert "FMI 1.0" in " ".join(member.notes)
        assert set(member.variables) == {"gain", "u", "y", "on", "was_on", "steps"}
        assert (member.variables["u"].unit, member.variables["gain"].causality) == ("m", "parameter")
        member.instantiate()
        member.enter_initialization(0.0, 2.0)
        member.exit_initialization()
        assert member.log == ["WARNING: made of {g}"]
        assert member.get("y") == 6.0
    finally:
        member.close()
    outcome = simulate(
        member := FMUMember("a", old, {"gain": 3.0, "u": 2.0, "on": True}), plan(member, stop=2.0, step=0.5)
    )
    assert column(outcome, "y").tolist() == [6.0, 6.5, 7.0, 7.5]
    assert column(outcome, "was_on").tolist() == [0, 1, 1, 1]
    assert column(outcome, "steps").tolist() == [0, 1, 2, 3]
    assert "doStep returned ERROR" in outcome.failure


@pytest.mark.parametrize(
    ("before", "after", "words"),
    [
        ("<Implementation>", "<!-- <Implementation>", "is of FMI 1.0 and for Model Exchange only"),
        ("CoSimulation_StandAlone", "CoSimulation_Tool", "is of FMI 1.0 and coupled to its tool"),
    ],
)
def test_other_kinds_are_refused(tmp_path, before, after, words):
    text = XML.replace(before, after)
    if "<!--" in after:
        text = text.replace("</Implementation>", "</Implementation> -->")
    with pytest.raises(FMUError, match=words):
        FMUMember("a", archive(tmp_path / "old.fmu", {"modelDescription.xml": text.encode()}))


def without_libraries(path, target):
    """A copy of an FMU without its libraries."""
    with zipfile.ZipFile(path) as source, zipfile.ZipFile(target, "w") as copy:
        for info in source.infolist():
            if not info.filename.startswith("binaries/"):
                copy.writestr(info, source.read(info))
    return target


@pytest.mark.slow
@pytest.mark.parametrize("version", ["2.0", "3.0"])
def test_sources_are_compiled(build, tmp_path, version):
    """An FMU that has lost its libraries gives what it gave with them."""
    whole = exporter.export(PARTS[0], version, tmp_path / "a.fmu", build / "tests", sources=True)
    results = []
    for path in (whole, without_libraries(whole, tmp_path / "b.fmu")):
        member = FMUMember("a", path)
        assert ("C sources were compiled" in " ".join(member.notes)) == (path != whole)
        results.append(simulate(member, plan(member, stop=0.1, step=0.01)).results)
    first, second = ([(name, values.tobytes()) for name, _, values in result.columns()] for result in results)
    assert first == second


@pytest.mark.slow
def test_sources_that_cannot_be_compiled(build, tmp_path):
    whole = exporter.export(PARTS[0], "2.0", tmp_path / "a.fmu", build / "tests", sources=True)
    broken = without_libraries(whole, tmp_path / "b.fmu")
    shutil.copy(broken, tmp_path / "c.fmu")
    with zipfile.ZipFile(broken) as source, zipfile.ZipFile(tmp_path / "c.fmu", "w") as copy:
        for info in source.infolist():
            if not info.filename.endswith("model.c"):
                copy.writestr(info, source.read(info))
    with pytest.raises(FMUError, match=r"sources/model.c is listed, but not in the FMU"):
        FMUMember("a", tmp_path / "c.fmu")
    with zipfile.ZipFile(tmp_path / "c.fmu", "a") as copy:
        copy.writestr("sources/model.c", "int x = ;")
    with pytest.raises(FMUError, match=r"its sources cannot be compiled .*expected expression"):
        FMUMember("a", tmp_path / "c.fmu")
