"""Steps that an FMU does not make in whole, in FMI's own words: refused, discarded, ended early, ended for good.

The FMU is native and made for this (ends.c); what is expected of each with each kind of algorithm is in the table.
"""

from pathlib import Path

import pytest

from tests.coupling.parts import Lag, couple
from tests.fmi.third_party import archive, native_library
from twin.coupling import Algorithm, Connection, CoSimulation, CoupledSystem
from twin.errors import SimulationError
from twin.fmi import FMUMember

MS = 1_000_000
REFUSES, DISCARDS, RETURNS, TERMINATES, DIES = range(1, 6)

XML = {
    "2.0": """<fmiModelDescription fmiVersion="2.0" modelName="Ends" guid="ends">
<CoSimulation modelIdentifier="Ends" canHandleVariableCommunicationStepSize="true" canGetAndSetFMUstate="true"/>
<ModelVariables>
<ScalarVariable name="u" valueReference="0" causality="input"><Real start="0"/></ScalarVariable>
<ScalarVariable name="y" valueReference="1" causality="output"><Real/></ScalarVariable>
<ScalarVariable name="t" valueReference="2" causality="output"><Real/></ScalarVariable>
<ScalarVariable name="at" valueReference="3" causality="parameter" variability="fixed"><Real start="0"/></ScalarVariable>
<ScalarVariable name="steps" valueReference="4" causality="output"><Real/></ScalarVariable>
<ScalarVariable name="what" valueReference="5" causality="parameter" variability="fixed"><Integer start="0"/></ScalarVariable>
</ModelVariables>
<ModelStructure><Outputs><Unknown index="2"/><Unknown index="3"/><Unknown index="5"/></Outputs></ModelStructure>
</fmiModelDescription>""",
    "3.0": """<fmiModelDescription fmiVersion="3.0" modelName="Ends" instantiationToken="ends">
<CoSimulation modelIdentifier="Ends" canHandleVariableCommunicationStepSize="true" canGetAndSetFMUState="true"
 canReturnEarlyAfterIntermediateUpdate="true" mightReturnEarlyFromDoStep="true"/>
<ModelVariables>
<Float64 name="time" valueReference="9" causality="independent" variability="continuous"/>
<Float64 name="u" valueReference="0" causality="input" start="0"/>
<Float64 name="y" valueReference="1" causality="output"/>
<Float64 name="t" valueReference="2" causality="output"/>
<Float64 name="at" valueReference="3" causality="parameter" variability="fixed" start="0"/>
<Float64 name="steps" valueReference="4" causality="output"/>
<Int32 name="what" valueReference="5" causality="parameter" variability="fixed" start="0"/>
</ModelVariables>
<ModelStructure><Output valueReference="1"/><Output valueReference="2"/><Output valueReference="4"/></ModelStructure>
</fmiModelDescription>""",
}
PLACES = {"2.0": "binaries/linux64/Ends.so", "3.0": "binaries/x86_64-linux/Ends.so"}

FIXED, BACK, CHOOSING = ("jacobi", "gauss_seidel"), ("iterative",), ("step_doubling", "predictive")
FAILS, GOES_THERE, ENDS_THERE, SHORTER = "fails", "goes there", "ends there", "makes shorter steps"

# what, time [ms] of a step of 4 ms -> by kind of algorithm, how it goes on or what it says
TABLE = [
    (REFUSES, 6.5, FIXED, "b: failed with ERROR in the step from t = 4 ms"),
    (REFUSES, 6.5, BACK, "b: failed with ERROR in the step from t = 4 ms"),
    (REFUSES, 6.0, CHOOSING, SHORTER),
    (DIES, 6.5, FIXED, "b: failed with FATAL in the step from t = 4 ms"),
    (DIES, 6.5, BACK, "b: failed with FATAL in the step from t = 4 ms"),
    (DIES, 6.5001, CHOOSING, "b: failed with FATAL in the step from t = "),
    (
        DISCARDS,
        6.5,
        FIXED,
        "b: went to t = 6.5 ms only in the step from t = 4 ms, and .* makes whole steps. Use .*iter",
    ),
    (DISCARDS, 6.5, BACK, GOES_THERE),
    (DISCARDS, 6.5, CHOOSING, GOES_THERE),
    (RETURNS, 6.5, FIXED, "goes on"),  # it may come back early only where it is told so
    (RETURNS, 6.5, BACK, GOES_THERE),
    (RETURNS, 6.5, CHOOSING, GOES_THERE),
    (TERMINATES, 6.5, FIXED, ENDS_THERE),
    (TERMINATES, 6.5, BACK, ENDS_THERE),
    (TERMINATES, 6.5, CHOOSING, ENDS_THERE),
    (TERMINATES, 8.0, FIXED, ENDS_THERE),
    (TERMINATES, 8.0, BACK, ENDS_THERE),
]
CASES = [
    pytest.param(version, what, at, name, expected, id=f"{version}-{what}-{at}-{name}")
    for what, at, names, expected in TABLE
    for name in names
    for version in (XML if what != RETURNS else ("3.0",))
]


@pytest.fixture(scope="module")
def fmus(tmp_path_factory):
    """The FMU, by version."""
    folder = tmp_path_factory.mktemp("ends")
    library = native_library(Path(__file__).with_name("ends.c").read_text())
    return {
        version: archive(
            folder / f"ends{version[0]}.fmu",
            {
                "modelDescription.xml": f'<?xml version="1.0" encoding="UTF-8"?>\n{text}'.encode(),
                PLACES[version]: library,
            },
        )
        for version, text in XML.items()
    }


@pytest.mark.slow_repetitions
@pytest.mark.parametrize(("version", "what", "at", "name", "expected"), CASES)
def test_a_step_that_is_not_made_in_whole(version, what, at, name, expected, fmus, build):
    members = {
        "a": couple(build, {"a": Lag(x=1.0)}, []).members["a"],
        "b": FMUMember("b", fmus[version], {"what": what, "at": at / 1000}),
    }
    catalog = {key: one.variables for key, one in members.items()}
    wires = [Connection("a.y", "b.u", convert=False), Connection("b.y", "a.u", convert=False)]
    run = CoSimulation(members, CoupledSystem(catalog, wires).links(), 4 * MS, Algorithm(name), build=build)
    seen = {}
    try:
        run.initialize(0, 20 * MS)
        if expected.startswith("b: "):
            with pytest.raises(SimulationError, match=expected):
                run.advance(20 * MS)
            return
        run.advance(20 * MS)
        seen = {key: float(run.value(("b", key))) for key in ("t", "steps")}
    finally:
        run.terminate()
    recorded = run.recording()
    if expected == ENDS_THERE:
        assert run.finished
        assert f"b ended the simulation at {at:g} ms" in run.failure
        # FMI 2.0 says by a discarded step that it wants to end: others that iterate have not agreed with it then
        is_whole = at == 8.0 and (version == "3.0" or name in FIXED)
        assert recorded.time.tolist() == pytest.approx([0.0, 0.004, 0.008][: 2 + is_whole])
        return
    assert not run.failure
    assert recorded.time.tolist() == pytest.approx([0.0, 0.004, 0.008, 0.012, 0.016, 0.02])
    assert recorded.signals["b.t"].tolist() == pytest.approx(recorded.time.tolist())
    if name in FIXED:
        assert seen["steps"] == 5
    elif name == "iterative":
        assert seen["steps"] == 6  # one is cut in two; those that were taken back are not counted
    else:
        assert seen["steps"] > 5
