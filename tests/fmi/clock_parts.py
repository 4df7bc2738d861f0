"""FMUs with clocks that were not made by this project's exporter: from C, strict about the calling sequence of FMI 3.0."""

from functools import cache
from pathlib import Path

from tests.fmi.third_party import archive, native_library

SOURCE = Path(__file__).with_name("clocks.c")
MODELS = {"Kinds": 0, "Follower": 1, "Partitions": 2, "Node": 3}
INTERFACES = {
    "Kinds": '<CoSimulation modelIdentifier="Kinds" hasEventMode="true" canHandleVariableCommunicationStepSize="true"/>',
    "Follower": '<CoSimulation modelIdentifier="Follower" hasEventMode="true"'
    ' canHandleVariableCommunicationStepSize="true"/>',
    "Node": '<CoSimulation modelIdentifier="Node" hasEventMode="true" canHandleVariableCommunicationStepSize="true"/>',
    "Partitions": '<ScheduledExecution modelIdentifier="Partitions"/>',
}


def clock(name, reference, kind="triggered", causality="input", more=""):
    return f'<Clock name="{name}" valueReference="{reference}" causality="{causality}" intervalVariability="{kind}" {more}/>'


def number(kind, name, reference, causality="output", more=""):
    return f'<{kind} name="{name}" valueReference="{reference}" causality="{causality}" {more}/>'


def count(name, reference):
    """How often the clock ticked whose reference is smaller by 10."""
    return number("Int32", name, reference, more=f'variability="discrete" clocks="{reference - 10}"')


KINDS = ("constant", "fixed", "tunable", "paced", "changing", "countdown", "triggered", "every_second", "alarm")
VARIABLES = {
    "Kinds": [
        clock("constant", 1, "constant", more='intervalDecimal="0.2" shiftDecimal="0.1"'),
        clock("fixed", 2, "fixed"),
        clock("tunable", 3, "tunable", more='intervalDecimal="0.5"'),
        clock("paced", 4, "tunable"),
        clock("changing", 5, "changing"),
        clock("countdown", 6, "countdown"),
        clock("triggered", 7),
        clock("every_second", 8, causality="output"),
        clock("alarm", 9, causality="output"),
        *(count(f"{kind}_count", 10 + i) for i, kind in enumerate(KINDS, 1)),
        number("Float64", "latest", 20, more='variability="discrete" clocks="6"'),
        number("Float64", "period", 30, "parameter", 'variability="fixed" start="0.25"'),
        number("Float64", "pace", 31, "parameter", 'variability="tunable" start="0.4"'),
        number("Float64", "signal_at", 32, "parameter", 'variability="fixed" start="1e9"'),
        number("Float64", "wait", 33, "parameter", 'variability="tunable" start="0.3"'),
        number("Float64", "x", 40),
        number("Float64", "u", 41, "input", 'start="0"'),
        number("Int32", "d", 42, "input", 'start="0"'),
        number("Int32", "seen", 43),
    ],
    "Follower": [
        clock("tick", 1),
        clock("half", 2, causality="output"),
        number("Float64", "u", 11, "input", 'variability="discrete" clocks="1" start="0"'),
        number("Float64", "sum", 12, more='variability="discrete" clocks="1"'),
        number("Int32", "n", 13, more='clocks="1"'),
        number("Float64", "held", 14, more='variability="discrete"'),
    ],
    "Node": [
        clock("send", 1, "changing", more='supportsFraction="true"'),
        clock("sent", 2, causality="output"),
        clock("take", 3),
        number("Binary", "message", 11, more='clocks="2"'),
        number("Binary", "taken", 12, "input", 'clocks="3"'),
        number("Int32", "heard", 13, more='clocks="3"'),
        number("Int32", "word", 14, more='clocks="3"'),
        number("Int32", "address", 20, "parameter", 'variability="fixed" start="1"'),
        number("Float64", "last", 21, "parameter", 'variability="fixed" start="0"'),
        number("Int32", "announced", 22),
    ],
    "Partitions": [
        clock("first", 1, "constant", more='intervalDecimal="1.0" priority="1"'),
        clock("second", 2, more='priority="0"'),
        clock("third", 3, "countdown", more='priority="2" clocks="1"'),
        clock("fifth", 4, causality="output", more='clocks="1 2 3"'),
        *(count(f"{name}_ticks", 10 + i) for i, name in enumerate(("first", "second", "third"), 1)),
        number("Int32", "total", 14),
        number("Int32", "result", 15, more='clocks="2"'),
        number("Int32", "given", 16, "input", 'clocks="2" start="0"'),
        number("Int32", "made", 17, more='clocks="3"'),
        number("Float64", "order", 44, more='variability="discrete"'),
    ],
}


@cache
def library(model):
    return native_library(f"#define MODEL {MODELS[model]}\n{SOURCE.read_text()}")


def described(model):
    """modelDescription.xml."""
    variables = "\n".join(VARIABLES[model])
    outputs = [line.split('valueReference="')[1].split('"')[0] for line in VARIABLES[model] if '"output"' in line]
    structure = "".join(f'<Output valueReference="{one}"/>' for one in outputs)
    return (
        '<?xml version="1.0" encoding="UTF-8"?>\n'
        f'<fmiModelDescription fmiVersion="3.0" modelName="{model}" instantiationToken="clocks">{INTERFACES[model]}'
        '<DefaultExperiment startTime="0" stopTime="2" stepSize="0.05"/>\n<ModelVariables>'
        '<Float64 name="time" valueReference="99" causality="independent" variability="continuous"/>'
        f"{variables}</ModelVariables><ModelStructure>{structure}</ModelStructure></fmiModelDescription>"
    )


def clocks_fmu(folder, model):
    """An FMU with clocks."""
    return archive(
        folder / f"{model}.fmu",
        {"modelDescription.xml": described(model).encode(), f"binaries/x86_64-linux/{model}.so": library(model)},
    )
