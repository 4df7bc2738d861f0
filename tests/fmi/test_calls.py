"""Which function may be called in which state: every pair is tried and compared with the standard, written down anew.

States by letter: i Instantiated, m Initialization Mode, s Step Mode, d step discarded, t Terminated, e after an error,
f after a fatal error; of Model Exchange c Continuous-Time Mode; of it and of Co-Simulation with events v Event Mode. A
refused call returns Error and changes nothing. Intermediate Update Mode is tried in test_steps.py.
"""

import ctypes
import subprocess

import pytest

from tests.fmi.loaded import VERSIONS, Fmu, function
from tests.fmi.parts import Failing, Masses, Sampler

# part, kind of instance, states it is brought into
INSTANCES = [(Failing, "CS", "imsdtef"), (Masses, "CS", "imset"), (Masses, "ME", "imvct"), (Sampler, "EV", "imvst")]
INSTANCES += [(Sampler, "ME", "vc")]
CASES = [
    (version, part, kind, state)
    for version in VERSIONS
    for part, kind, states in INSTANCES
    for state in states
    if (version, kind) != ("2.0", "EV")
]
GETTERS, SETTERS, KEEPERS = "msdtevc", "imsv", "imsdtevc"
TYPES = {
    "2.0": ("Real", "Integer", "Boolean", "String"),
    "3.0": (
        "Float32",
        "Float64",
        "Int8",
        "UInt8",
        "Int16",
        "UInt16",
        "Int32",
        "UInt32",
        "Int64",
        "UInt64",
        "Boolean",
        "String",
        "Binary",
        "Clock",
    ),
}
CONTINUOUS = ("Real", "Float32", "Float64")
EXPECTED = {
    "2.0": {
        "SetupExperiment": "i",
        "GetFMUstate": KEEPERS,
        "SetFMUstate": KEEPERS,
        "FreeFMUstate": KEEPERS,
        "SerializedFMUstateSize": KEEPERS,
        "SerializeFMUstate": KEEPERS,
        "DeSerializeFMUstate": KEEPERS,
        "GetStatus": "sdt",
        "GetRealStatus": "sdt",
        "GetBooleanStatus": "sdt",
    },
    "3.0": {
        "GetFMUState": KEEPERS,
        "SetFMUState": KEEPERS,
        "FreeFMUState": KEEPERS,
        "SerializedFMUStateSize": KEEPERS,
        "SerializeFMUState": KEEPERS,
        "DeserializeFMUState": KEEPERS,
    },
}
COMMON = {
    "SetDebugLogging": KEEPERS,
    "EnterInitializationMode": "i",
    "ExitInitializationMode": "m",
    "DoStep": "s",
    "Terminate": "sdvc",
    "Reset": KEEPERS,
}
for version in VERSIONS:
    EXPECTED[version].update(COMMON)
    EXPECTED[version].update({f"Get{kind}": GETTERS for kind in TYPES[version]})
    EXPECTED[version].update({f"Set{kind}": SETTERS for kind in TYPES[version]})
    EXPECTED[version].update({f"Set{kind}": SETTERS + "c" for kind in TYPES[version] if kind in CONTINUOUS})

EXPECTED["3.0"]["SetClock"] = "v"

# of an instance for Model Exchange, beside those above except the ones of Co-Simulation
STEPPING = {"DoStep", "GetStatus", "GetRealStatus", "GetBooleanStatus"}
EXCHANGE = {
    "2.0": {
        "EnterEventMode": "vc",
        "NewDiscreteStates": "v",
        "EnterContinuousTimeMode": "v",
        "CompletedIntegratorStep": "c",
        "SetTime": "vc",
        "SetContinuousStates": "c",
        "GetContinuousStates": "mvcte",
        "GetEventIndicators": "mvcte",
        "GetDerivatives": "vcte",
        "GetNominalsOfContinuousStates": "ivcte",
    },
    "3.0": {
        "EnterEventMode": "c",
        "UpdateDiscreteStates": "v",
        "EnterContinuousTimeMode": "v",
        "CompletedIntegratorStep": "c",
        "SetTime": "vc",
        "SetContinuousStates": "c",
        "GetContinuousStates": "mvcte",
        "GetEventIndicators": "mvcte",
        "GetContinuousStateDerivatives": "mvcte",
        "GetNominalsOfContinuousStates": "mvcte",
        "GetNumberOfEventIndicators": "mvcte",
        "GetNumberOfContinuousStates": "mvcte",
    },
}

# of an instance for Co-Simulation whose importer handles events, beside those above
EVENTFUL = {"EnterEventMode": "s", "EnterStepMode": "v", "UpdateDiscreteStates": "v"}


def is_legal(version, part, kind, name, state):
    """What the standard says."""
    if name == "GetDirectionalDerivative":
        return part is Masses and state in GETTERS
    if kind != "ME":
        more = EVENTFUL if kind == "EV" else {}
        return state in {**EXPECTED[version], **more}.get(name, "")
    return name not in STEPPING and state in {**EXPECTED[version], **EXCHANGE[version]}.get(name, "")


NOT_CALLED = {
    "GetVersion",
    "GetTypesPlatform",
    "Instantiate",
    "InstantiateCoSimulation",
    "InstantiateModelExchange",
    "InstantiateScheduledExecution",
    "FreeInstance",
}
NO_ANSWER = {"GetIntegerStatus", "GetStringStatus"}  # legal, but there is no such status: Discard

STEP_TO = {"d": 2, "e": 3, "f": 4}


def in_state(fmus, version, state, part=Failing, kind="CS"):
    """A new instance brought into a state; after a failed step it is still asked what it can be asked."""
    fmu = (
        Fmu(fmus, part, version, kind="CS", eventModeUsed=True) if kind == "EV" else Fmu(fmus, part, version, kind=kind)
    )
    if state == "i":
        return fmu
    if state == "m":
        fmu.enter()
        return fmu
    fmu.begin()
    if state == "c":
        fmu.slave.enterContinuousTimeMode()
    if kind == "EV" and state == "s":
        fmu.slave.enterStepMode()
    if state in STEP_TO:
        if part is Failing:
            fmu.set("status", STEP_TO[state])
        else:
            fmu.set("push", float("inf"))
        assert step(fmu) == STEP_TO[state]
    if state == "t":
        fmu.slave.terminate()
    return fmu


def step(fmu):
    flags = [ctypes.byref(ctypes.c_double()) for _ in range(4)]
    more = flags if fmu.version == "3.0" else []
    me = ctypes.c_void_p(fmu.slave.component)
    return function(fmu, "DoStep")(me, ctypes.c_double(0.0), ctypes.c_double(0.1), 1, *more)


def call(fmu, name, state, data):
    """Call a function with arguments that are all right; returns its status."""
    me, called = ctypes.c_void_p(fmu.slave.component), function(fmu, name)
    size, real, status = ctypes.c_size_t(), ctypes.c_double(), ctypes.c_int()
    no, zero, other = ctypes.c_int(0), ctypes.c_double(0.0), ctypes.c_void_p()
    no_values, vector = ctypes.c_size_t(0), (ctypes.c_double * states_of(fmu))()
    arguments = {
        "SetupExperiment": (no, zero, zero, no, zero),
        "EnterInitializationMode": (no, zero, zero, no, zero) if fmu.version == "3.0" else (),
        "getfmustate": (ctypes.byref(other),),
        "setfmustate": (state,),
        "freefmustate": (ctypes.byref(other),),
        "serializedfmustatesize": (state, ctypes.byref(size)),
        "serializefmustate": (state, data, ctypes.c_size_t(len(data))),
        "deserializefmustate": (data, ctypes.c_size_t(len(data)), ctypes.byref(other)),
        "GetStatus": (0, ctypes.byref(status)),
        "GetRealStatus": (2, ctypes.byref(real)),
        "GetBooleanStatus": (3, ctypes.byref(status)),
        "NewDiscreteStates": (ctypes.byref((ctypes.c_double * 8)()),),
        "SetTime": (zero,),
        "GetNumberOfEventIndicators": (ctypes.byref(size),),
        "GetNumberOfContinuousStates": (ctypes.byref(size),),
        "GetDirectionalDerivative": (None, no_values, None, no_values, *(None, no_values) * 2),
    }
    if name == "DoStep":
        return step(fmu)
    given = arguments.get(name, arguments.get(name.lower(), (None,) + (ctypes.c_size_t(0),) * 7))
    if name in VECTORS:
        given = (vector, ctypes.c_size_t(len(vector)))
    result = called(me, *given)
    if name.lower() in ("getfmustate", "deserializefmustate"):
        function(fmu, "FreeFMUstate" if fmu.version == "2.0" else "FreeFMUState")(me, ctypes.byref(other))
    return result


VECTORS = {
    "SetContinuousStates",
    "GetContinuousStates",
    "GetDerivatives",
    "GetContinuousStateDerivatives",
    "GetNominalsOfContinuousStates",
}


def states_of(fmu):
    return sum(v.size for v in fmu.part.variables if v.role == "state")


def kept(fmu):
    """A saved state of the instance, and its bytes."""
    me, state, size = ctypes.c_void_p(fmu.slave.component), ctypes.c_void_p(), ctypes.c_size_t()
    word = "FMUstate" if fmu.version == "2.0" else "FMUState"
    function(fmu, f"Get{word}")(me, ctypes.byref(state))
    function(fmu, f"Serialized{word}Size")(me, state, ctypes.byref(size))
    data = ctypes.create_string_buffer(size.value)
    function(fmu, f"Serialize{word}")(me, state, data, size)
    return state, data


def exported(fmus, version, part=Failing):
    library = next(fmus[part, version][1].glob("binaries/*/*.so"))
    lines = subprocess.run(["nm", "-D", "--defined-only", library], capture_output=True, text=True, check=True).stdout
    return {line.split()[-1].removeprefix(f"fmi{version[0]}") for line in lines.splitlines()}


@pytest.mark.slow_repetitions
@pytest.mark.parametrize(("version", "part", "kind", "state"), CASES)
def test_every_function_in_every_state(fmus, version, part, kind, state):
    names = exported(fmus, version, part)
    assert EXPECTED[version].keys() | EXCHANGE[version].keys() <= names
    wrong = []
    for name in sorted(names - NOT_CALLED - NO_ANSWER):
        fmu = in_state(fmus, version, state, part, kind)
        before = kept(fmu)
        status = call(fmu, name, *before)
        legal = is_legal(version, part, kind, name, state)
        if (status == 0) != legal or (not legal and status != 3):
            wrong.append(f"{name} returned {status}")
        if not legal and state != "f":
            if kept(fmu)[1].raw != before[1].raw:
                wrong.append(f"{name} was refused and changed something")
            if not fmu.log or fmu.log[-1][0] != 3 or name.encode() not in fmu.log[-1][-1]:
                wrong.append(f"{name} was refused without a message")
        fmu.slave.freeInstance()
    assert wrong == []


@pytest.mark.slow_repetitions
@pytest.mark.parametrize("version", VERSIONS)
def test_no_instance_is_an_error(fmus, version):
    other = Fmu(fmus, Failing, version)  # freeing an instance also unloads FMPy's library; this one keeps it
    fmu = Fmu(fmus, Failing, version)
    old = fmu.slave.component
    fmu.slave.freeInstance()
    for instance in (None, old, old + 8, 1 << 40):  # NULL, freed, inside another, anywhere
        for name in sorted(exported(fmus, version) - NOT_CALLED):
            assert function(fmu, name)(ctypes.c_void_p(instance), *([None] * 9)) == 3, name
        function(fmu, "FreeInstance")(ctypes.c_void_p(instance))
    other.slave.freeInstance()


@pytest.mark.parametrize("version", VERSIONS)
def test_a_saved_state_leads_back_from_an_error(fmus, version):
    fmu = in_state(fmus, version, "s")
    state, data = kept(fmu)
    fmu.set("status", 3)
    assert step(fmu) == 3
    assert call(fmu, "SetFMUstate" if version == "2.0" else "SetFMUState", state, data) == 0
    fmu.set("status", 0)
    assert step(fmu) == 0
    assert fmu.get("y")[0] == 1


def test_status_of_a_discarded_step(fmus):
    fmu = in_state(fmus, "2.0", "d")
    assert fmu.slave.getStatus(0) == 2
    assert fmu.slave.getRealStatus(2) == 0.0
    assert not fmu.slave.getBooleanStatus(3)
    assert function(fmu, "GetIntegerStatus")(ctypes.c_void_p(fmu.slave.component), 1, None) == 2


def test_modes_that_are_not_offered_give_no_instance(fmus):
    fmu = Fmu(fmus, Failing, "3.0")
    for options in (
        {"eventModeUsed": True},
        {"requiredIntermediateVariables": [1]},
        {"requiredIntermediateVariables": [0]},
    ):
        with pytest.raises(Exception, match="instantiate"):
            fmu.slave.instantiate(**options)
    for name, count in (("InstantiateModelExchange", 7), ("InstantiateScheduledExecution", 10)):
        assert function(fmu, name)(*([None] * count)) == 0
