"""Every capability that modelDescription.xml declares, or does not declare, is tried on the binary.

The attributes are read from the standard's schema, so that none is forgotten. A probe returns what it found, and that
must be what the attribute says, or its default where it is absent.
"""

import ctypes
import zipfile
from pathlib import Path

import fmpy
import pytest
from lxml import etree

from tests.fmi.loaded import VERSIONS, Fmu, function, symbols
from tests.fmi.parts import PARTS
from twin import compiler

SCHEMA = Path(fmpy.__file__).parent / "schema"
FILES = {"2.0": SCHEMA / "fmi2" / "fmi2ModelDescription.xsd", "3.0": SCHEMA / "fmi3" / "fmi3InterfaceType.xsd"}
ELEMENTS = {"CS": "CoSimulation", "ME": "ModelExchange"}
XS = "{http://www.w3.org/2001/XMLSchema}"
NAMES = {"modelIdentifier", "recommendedIntermediateInputSmoothness"}  # a name, and advice that nothing can refute

H = 0.01  # period of the sampled part [s]


class Case:
    """One interface of one FMU, and fresh instances of it."""

    def __init__(self, fmus, part, version, kind):
        self.fmus, self.part, self.version, self.kind = fmus, part, version, kind

    def new(self, **options):
        """An instance, or nothing if the FMU refuses to make it."""
        try:
            return Fmu(self.fmus, self.part, self.version, kind=self.kind, **options)
        except Exception as error:  # FMPy's own kind is plain Exception
            if "instantiate" not in str(error):
                raise
            return None

    def begun(self, **options):
        fmu = self.new(**options)
        return fmu and fmu.begin()

    def started(self):
        """An instance that computes, with a way to go on: by a step, or by setting time and states."""
        fmu = self.begun()
        if self.kind == "ME":
            self.leave_event(fmu)
        return fmu

    def leave_event(self, fmu):
        getattr(fmu.slave, "newDiscreteStates" if self.version == "2.0" else "updateDiscreteStates")()
        fmu.slave.enterContinuousTimeMode()

    def go_on(self, fmu, t, h=H):
        if self.kind == "CS":
            fmu.step(t, h)
            return
        size = sum(v.size for v in self.part.variables if v.role == "state")
        fmu.slave.setTime(t + h)
        if not size:
            fmu.slave.enterEventMode()
            self.leave_event(fmu)
            return
        fmu.slave.setContinuousStates((ctypes.c_double * size)(*[t + h] * size), size)

    def answers(self, name, *arguments):
        """Whether a call in the state in which it would be legal succeeds."""
        fmu = self.started()
        return function(fmu, name)(ctypes.c_void_p(fmu.slave.component), *arguments) == 0


NOTHING = (None, ctypes.c_size_t(0)) * 4


def needs_a_tool(case):
    library = next(case.fmus[case.part, case.version][1].glob("binaries/*/*.so"))
    return not symbols(library)[1] <= compiler.LIBM


def is_alone(case):
    one, other = case.started(), case.started()
    case.go_on(one, 0.0)
    return other.outputs() == one.outputs()


def saves(case, through=lambda fmu, state: state):
    word = "FMUstate" if case.version == "2.0" else "FMUState"
    fmu = case.started()
    case.go_on(fmu, 0.0)
    state = through(fmu, getattr(fmu.slave, f"get{word}")())
    case.go_on(fmu, H)
    first = fmu.outputs()
    getattr(fmu.slave, f"set{word}")(state)
    before = fmu.outputs()
    case.go_on(fmu, H)
    return before != first == fmu.outputs()


def serializes(case):
    pack, unpack = (
        ("serializeFMUstate", "deSerializeFMUstate")
        if case.version == "2.0"
        else ("serializeFMUState", "deserializeFMUState")
    )
    return saves(case, lambda fmu, state: getattr(fmu.slave, unpack)(getattr(fmu.slave, pack)(state)))


def takes_any_step(case):
    fmu, t = case.started(), 0.0
    for h in (H, 0.3 * H, 2.5 * H):
        fmu.step(t, h)
        t += h
    return True


def internal_step(case):
    """The time [s] at which outputs change first, in quarters of the sampled part's period; none if at once."""
    fmu = case.started()
    before = fmu.outputs()
    for n in range(1, 9):
        fmu.step((n - 1) * H / 4, H / 4)
        if fmu.outputs() != before:
            return None if n == 1 else n * H / 4
    raise AssertionError("outputs never change")


def uses_no_allocation(case):
    fmu = case.started()  # its callbacks hold no function to allocate or free memory
    assert not fmu.callbacks.allocateMemory
    return saves(case)


def bears_silence_after_steps(case):
    """Whether values are right although nobody ever calls CompletedIntegratorStep."""
    told, untold = case.started(), case.started()
    for n in range(3):
        for fmu in (told, untold):
            case.go_on(fmu, n * H)
        told.slave.completedIntegratorStep()
    return told.outputs() == untold.outputs()


def has_event_mode(case):
    fmu = case.begun(eventModeUsed=True)
    if fmu is None:
        return False
    defined, instant = fmu.slave.updateDiscreteStates()[4:]
    fmu.slave.enterStepMode()
    return (defined, instant) == (True, H)


def returns_early_by_itself(case):
    fmu = case.begun(earlyReturnAllowed=True, eventModeUsed=has_event_mode(case))
    if has_event_mode(case):
        fmu.slave.updateDiscreteStates()
        fmu.slave.enterStepMode()
    return fmu.slave.doStep(0.0, 3.0 * H)[2]


def updates(case, request=False):
    """Calls of the importer within a step, and whether the step ended early if that was asked for."""
    calls = []

    def update(*arguments):
        calls.append(arguments[1])
        if request:
            arguments[-2][0], arguments[-1][0] = True, arguments[1]

    fmu = case.begun(earlyReturnAllowed=True, intermediateUpdate=update)
    return len(calls), fmu.slave.doStep(0.0, 3.0 * H)[2], len(calls)


def asks_the_importer(case):
    before, _, after = updates(case)
    return after > before == 0


def order_of_output_derivatives(case):
    order = (ctypes.c_int * 1)(1)
    number = (ctypes.c_uint * 1)(1)
    value = (ctypes.c_double * 1)()
    name = "GetRealOutputDerivatives" if case.version == "2.0" else "GetOutputDerivatives"
    arguments = (number, ctypes.c_size_t(1), order, value, ctypes.c_size_t(1))
    return int(case.answers(name, *arguments))


def derives(case):
    return case.answers("GetDirectionalDerivative", *NOTHING)


SHARED = {
    "needsExecutionTool": needs_a_tool,
    "canBeInstantiatedOnlyOncePerProcess": is_alone,
}
PROBES = {
    "2.0": SHARED
    | {
        "canNotUseMemoryManagementFunctions": uses_no_allocation,
        "canGetAndSetFMUstate": saves,
        "canSerializeFMUstate": serializes,
        "providesDirectionalDerivative": derives,
        "canHandleVariableCommunicationStepSize": takes_any_step,
        "canInterpolateInputs": lambda case: case.answers("SetRealInputDerivatives", *NOTHING),
        "maxOutputDerivativeOrder": order_of_output_derivatives,
        "canRunAsynchronuously": lambda case: case.answers("CancelStep"),
        "completedIntegratorStepNotNeeded": bears_silence_after_steps,
    },
    "3.0": SHARED
    | {
        "canGetAndSetFMUState": saves,
        "canSerializeFMUState": serializes,
        "providesDirectionalDerivatives": derives,
        "providesAdjointDerivatives": lambda case: case.answers("GetAdjointDerivative", *NOTHING),
        "providesPerElementDependencies": lambda case: case.answers("GetNumberOfVariableDependencies", *NOTHING),
        "canHandleVariableCommunicationStepSize": takes_any_step,
        "fixedInternalStepSize": internal_step,
        "maxOutputDerivativeOrder": order_of_output_derivatives,
        "providesIntermediateUpdate": asks_the_importer,
        "mightReturnEarlyFromDoStep": returns_early_by_itself,
        "canReturnEarlyAfterIntermediateUpdate": lambda case: updates(case, request=True)[1],
        "hasEventMode": has_event_mode,
        "providesEvaluateDiscreteStates": lambda case: case.answers("EvaluateDiscreteStates"),
        "needsCompletedIntegratorStep": lambda case: not bears_silence_after_steps(case),
    },
}


def attributes(version, kind):
    """Type and default of the attributes of an interface, by the schema."""
    root = etree.parse(FILES[version])
    word = ELEMENTS[kind]
    if version == "2.0":
        found = root.findall(f".//{XS}element[@name='{word}']/{XS}complexType/{XS}attribute")
    else:
        kinds = ("fmi3InterfaceType", f"fmi3{word}")
        found = [a for name in kinds for a in root.find(f"{XS}complexType[@name='{name}']").iter(f"{XS}attribute")]
    return {a.get("name"): (a.get("type"), a.get("default")) for a in found if a.get("name") not in NAMES}


def value(kind, text):
    if text is None or kind == "xs:double":
        return None if text is None else float(text)
    return text == "true" if kind == "xs:boolean" else int(text)


@pytest.mark.parametrize("version", VERSIONS)
@pytest.mark.parametrize("part", PARTS)
def test_what_is_declared_is_what_the_binary_does(fmus, part, version):
    root = etree.fromstring(zipfile.ZipFile(fmus[part, version][0]).read("modelDescription.xml"))
    offered = [kind for kind, word in ELEMENTS.items() if root.find(word) is not None]
    assert offered[0] == "CS"
    for kind in offered:
        case = Case(fmus, part, version, kind)
        element = root.find(ELEMENTS[kind])
        known = attributes(version, kind)
        assert set(element.keys()) <= set(known) | {"modelIdentifier"}
        declared = {name: value(xs, element.get(name, default)) for name, (xs, default) in known.items()}
        assert {name: PROBES[version][name](case) for name in known} == declared


@pytest.mark.parametrize("version", VERSIONS)
def test_an_interface_that_is_not_declared_is_refused(fmus, version):
    for part in PARTS:
        root = etree.fromstring(zipfile.ZipFile(fmus[part, version][0]).read("modelDescription.xml"))
        if root.find("ModelExchange") is None:
            assert Case(fmus, part, version, "ME").new() is None
        assert root.find("ScheduledExecution") is None


def test_variables_say_truly_whether_they_can_be_required_for_intermediate_updates(fmus):
    for part in PARTS:
        root = etree.fromstring(zipfile.ZipFile(fmus[part, "3.0"][0]).read("modelDescription.xml"))
        for variable in root.find("ModelVariables"):
            number = int(variable.get("valueReference"))
            accepted = Case(fmus, part, "3.0", "CS").new(requiredIntermediateVariables=[number]) is not None
            assert accepted == (variable.get("intermediateUpdate") == "true"), variable.get("name")
