"""Functions of FMI are called with exactly the arguments that the standard's headers declare.

Calls with more arguments than a function takes happen to work where the caller cleans up the stack; C leaves them undefined.
The headers come with FMPy, in the versions that the FMI project publishes; they are not part of this project.
"""

import ctypes
import re
from pathlib import Path

import fmpy
import numpy as np
import pytest

from tests.every_case import every_case
from twin.compiler import builtins, machine
from twin.coupling import Access
from twin.fmi.importing.c_functions import FUNCTIONS, MAKERS, Callbacks, EventInfo, Intermediate, Logger2, Logger3

HEADERS = Path(fmpy.__file__).parent / "c-code"
BASIC = {
    "fmi2Real": "double",
    "fmi2Integer": "int",
    "fmi2Boolean": "int",
    "fmi2ValueReference": "unsigned int",
    "fmi2Status": "int",
    "fmi2StatusKind": "int",
    "fmi2Type": "int",
    "fmi2Char": "char",
    "fmi2Byte": "char",
    "fmi3Float32": "float",
    "fmi3Float64": "double",
    "fmi3Boolean": "bool",
    "fmi3Clock": "bool",
    "fmi3Status": "int",
    "fmi3ValueReference": "unsigned int",
    "fmi3IntervalQualifier": "int",
    "fmi3Byte": "uint8",
    "size_t": "size_t",
    "char": "char",
    "void": "void",
    **{f"fmi3{sign}Int{size}": f"{sign.lower()}int{size}" for sign in ("", "U") for size in (8, 16, 32, 64)},
}
TYPES = {
    ctypes.c_double: "double",
    ctypes.c_float: "float",
    ctypes.c_bool: "bool",
    ctypes.c_size_t: "size_t",
    ctypes.c_int8: "int8",
    ctypes.c_uint8: "uint8",
    ctypes.c_int16: "int16",
    ctypes.c_uint16: "uint16",
    ctypes.c_int32: "int",
    ctypes.c_uint32: "unsigned int",
    ctypes.c_int64: "int64",
    ctypes.c_char_p: "*",
    ctypes.c_void_p: "*",
    Logger2: "callback",
    Logger3: "callback",
    Intermediate: "callback",
}
SAME = {"int32": "int", "uint32": "unsigned int", "uint64": "size_t"}  # on the platforms that are executed


def declared():
    """Every function type of both headers: its arguments, each as a kind of value or `*` for a pointer."""
    found = {}
    for version in (2, 3):
        text = (HEADERS / f"fmi{version}FunctionTypes.h").read_text(encoding="utf-8", errors="replace")
        text = re.sub(r"/\*.*?\*/|//[^\n]*", " ", text, flags=re.DOTALL)
        pattern = rf"typedef\s+(fmi{version}\w+|void|const char\s*\*)\s*\(?\s*\*?\s*(fmi{version}\w+?)(?:TYPE|Callback)?\)?\s*\(([^()]*)\)\s*;"
        for _, name, arguments in re.findall(pattern, text):
            pieces = [] if arguments.strip() in ("", "void") else arguments.split(",")
            found[name] = [kind(piece) for piece in pieces]
    return found


def kind(piece):
    """An argument of a header as a kind of value."""
    if "*" in piece or "[" in piece:
        return "*"
    name = piece.replace("const", " ").split()[0]
    if name in BASIC:
        return SAME.get(BASIC[name], BASIC[name])
    opaque = "Component", "Environment", "FMUstate", "Instance", "FMUState", "String", "Functions"
    return "callback" if not name.endswith(opaque) else "*"


def shown(argument):
    """An argument of ctypes in the same words."""
    if argument in TYPES:
        return SAME.get(TYPES[argument], TYPES[argument])
    return "callback" if hasattr(argument, "_argtypes_") else "*"


DECLARED = declared()


def test_both_headers_are_read():
    assert len(DECLARED) > 100
    assert DECLARED["fmi2DoStep"] == ["*", "double", "double", "int"]
    assert DECLARED["fmi3DoStep"] == ["*", "double", "double", "bool", "*", "*", "*", "*"]
    assert DECLARED["fmi3ActivateModelPartition"] == ["*", "unsigned int", "double"]


@every_case("name", [*FUNCTIONS, *MAKERS])
def test_arguments_of_a_function(name):
    instance = [] if name in MAKERS else ["*"]
    assert [*instance, *map(shown, (FUNCTIONS | MAKERS)[name])] == DECLARED[name]


@every_case(
    ("prototype", "name"),
    [
        (machine.STEP, "fmi3DoStep"),
        (machine.STEP_2, "fmi2DoStep"),
        (machine.ACCESS, "fmi3GetFloat64"),
        (machine.ACCESS, "fmi3SetBoolean"),
        (machine.ACCESS_2, "fmi2GetReal"),
        (machine.ACCESS_2, "fmi2SetInteger"),
        (machine.STATE, "fmi3GetFMUState"),
        (machine.STATE, "fmi2SetFMUstate"),
    ],
)
def test_arguments_of_what_the_loop_calls(prototype, name):
    assert [shown(one) for one in prototype._argtypes_] == DECLARED[name]
    assert prototype._restype_ is ctypes.c_int32


@pytest.mark.parametrize(
    ("word", "types"),
    [
        ("call_step", {"fmi3_t": "fmi3DoStep", "fmi2_t": "fmi2DoStep"}),
        ("call_trial", {"fmi3_t": "fmi3DoStep", "fmi2_t": "fmi2DoStep"}),
        ("call_access", {"access_t": "fmi3GetFloat64", "fmi2_access_t": "fmi2GetReal"}),
        ("call_state", {"state_t": "fmi2GetFMUstate"}),
    ],
)
def test_arguments_in_compiled_loops(word, types):
    text = builtins.MACHINE[getattr(machine, word)].text
    C = {"double": "double", "bool": "bool", "size_t": "size_t", "int32_t": "int"}
    for name, function in types.items():
        (arguments,) = re.findall(rf"\(\*{name}\)\(([^)]*)\);", text)
        found = ["*" if "*" in one else C[one.strip()] for one in arguments.split(",")]
        assert found == DECLARED[function]


@pytest.mark.parametrize("call", [machine.call_step, machine.call_trial])
def test_each_signature_gets_its_own_arguments(call):
    """The callee's prototype is what the signature says: nothing else reaches it, and the flags of others stay."""
    flags, seen = np.zeros(4, np.int64), []

    def step(*arguments):
        seen.append(arguments)
        return 0

    kept = machine.STEP(step), machine.STEP_2(step), machine.STEP_COMPONENT(step)
    address = flags.ctypes.data
    for signature, one in zip((machine.FMI3, machine.FMI2, machine.COMPONENT), kept, strict=True):
        assert call(ctypes.cast(one, ctypes.c_void_p).value, signature, 64, 0.5, 0.25, address) == 0
    final = call is machine.call_step
    assert seen[0] == (64, 0.5, 0.25, final, address, address + 8, address + 16, address + 24)
    assert seen[1:] == [(64, 0.5, 0.25, int(final)), (64, 0.5, 0.25)]


def test_values_of_fmi_2_go_without_their_number():
    seen, references = [], np.array([3, 5], np.uint32)
    kept = machine.ACCESS(lambda *a: seen.append(a) or 0), machine.ACCESS_2(lambda *a: seen.append(a) or 1)
    for one, takes_size in zip(kept, (True, False), strict=True):
        function = ctypes.cast(one, ctypes.c_void_p).value
        assert Access(function, references, 2, 6, "f", takes_size).call(8, 16) == int(not takes_size)
    assert seen == [(8, references.ctypes.data, 2, 16, 6), (8, references.ctypes.data, 2, 16)]


def test_structs():
    text = (HEADERS / "fmi2FunctionTypes.h").read_text(encoding="utf-8", errors="replace")
    for name, struct in {"fmi2CallbackFunctions": Callbacks, "fmi2EventInfo": EventInfo}.items():
        (body,) = re.findall(rf"typedef\s+struct\s*\w*\s*\{{([^}}]*)\}}\s*{name}\s*;", text)
        fields = [line.split(";")[0].split()[-1] for line in body.splitlines() if ";" in line]
        assert fields == [name for name, _ in struct._fields_]
