"""What fmi2SetupExperiment gets and does: a tolerance, and FMUs that reset their parameters in it, as those of 20-sim do."""

import pytest

from tests.fmi.third_party import archive, native_library
from twin.fmi import FMUMember
from twin.fmi import member as make

XML = b"""<?xml version="1.0" encoding="UTF-8"?>
<fmiModelDescription fmiVersion="2.0" modelName="Reset" guid="reset">
<CoSimulation modelIdentifier="Reset" canHandleVariableCommunicationStepSize="true"/>
<DefaultExperiment tolerance="1e-5"/>
<ModelVariables>
  <ScalarVariable name="mass" valueReference="0" causality="parameter" variability="tunable" initial="exact"><Real start="1"/></ScalarVariable>
  <ScalarVariable name="y" valueReference="1" causality="output"><Real/></ScalarVariable>
  <ScalarVariable name="tolerance" valueReference="2" causality="local"><Real/></ScalarVariable>
</ModelVariables>
<ModelStructure><Outputs><Unknown index="2"/></Outputs><InitialUnknowns><Unknown index="2"/></InitialUnknowns></ModelStructure>
</fmiModelDescription>
"""
C = """
static double mass = 1.0, tolerance;
void *fmi2Instantiate(const char *n, int k, const char *g, const char *r, const void *c, int v, int l) { return &mass; }
void fmi2FreeInstance(void *m) {}
int fmi2SetupExperiment(void *m, int a, double b, double c, int d, double e) { mass = 1.0; tolerance = a ? b : 0.0; return 0; }
int fmi2EnterInitializationMode(void *m) { return 0; }
int fmi2ExitInitializationMode(void *m) { if (mass > 100.0) mass = 100.0; return 0; }
int fmi2Terminate(void *m) { return 0; }
int fmi2SetReal(void *m, const unsigned r[], unsigned long n, const double v[]) { mass = v[0]; return 0; }
int fmi2GetReal(void *m, const unsigned r[], unsigned long n, double v[]) { v[0] = r[0] == 2 ? tolerance : r[0] ? 2.0 * mass : mass; return 0; }
int fmi2DoStep(void *m, double t, double h, int keep) { return 0; }
"""


@pytest.fixture(scope="module")
def fmu(tmp_path_factory):
    files = {"modelDescription.xml": XML, "binaries/linux64/Reset.so": native_library(C)}
    return archive(tmp_path_factory.mktemp("reset") / "reset.fmu", files)


@pytest.mark.parametrize(
    ("given", "held", "log"),
    [
        (69.0, 69.0, []),
        (690.0, 100.0, ["mass is 100.0 after initialization, not its start value 690.0: the FMU changed it"]),
    ],
)
def test_start_values_are_set_after_the_experiment(fmu, given, held, log):
    member = FMUMember("a", fmu, {"mass": given})
    try:
        member.instantiate()
        member.enter_initialization(0.0, 1.0)
        member.exit_initialization()
        assert member.get("mass") == held
        assert member.log == log
    finally:
        member.close()


@pytest.mark.parametrize(("given", "held"), [(None, 1e-5), (1e-7, 1e-7)])
def test_the_tolerance_is_that_of_the_default_experiment_or_the_one_given(fmu, given, held):
    member = make("a", fmu, tolerance=given)
    try:
        member.instantiate()
        member.enter_initialization(0.0, 1.0)
        member.exit_initialization()
        assert member.get("tolerance") == held
    finally:
        member.close()
