"""FMUs with clocks that were not made by this project's exporter: from C, strict about the calling sequence of FMI 3.0."""

from functools import cache
from pathlib import Path

from tests.fmi.third_party import archive, native_library

SOURCE = Path(__file__).with_name("clocks.c")
MODELS = {"Kinds": 0, "Follower": 1, "Partitions": 2, "Node": 3}
INTERFACES = {
    "Kinds": '<ModelExchange modelIdentifier="Kinds" canGetAndSetFMUState="true"/>'
    '<CoSimulation modelIdentifier="Kinds" hasEventMode="true" canHandleVariableCommunicationStepSize="true"'
    ' mightReturnEarlyFromDoStep="true" canGetAndSetFMUState="true"/>',
    "Follower": '<CoSimulation modelIdentifier="Follower" hasEventMode="true"'
    ' canHandleVariableCommunicationStepSize="true" canGetAndSetFMUState="true"/>',
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

# ticks until 2 s; a constant clock every 0.2 s from 0.1 s on, and so on as clock_parts.py declares them
TICKS = {
    "constant": [0.1, 0.3, 0.5, 0.7, 0.9, 1.1, 1.3, 1.5, 1.7, 1.9],
    "fixed": [0.05, 0.3, 0.55, 0.8, 1.05, 1.3, 1.55, 1.8],  # told with its shift in Initialization Mode
    "tunable": [0.0, 0.5, 1.0, 1.5, 2.0],
    "paced": [0.0, 0.4, 0.8, 1.2, 1.6, 2.0],  # by a tunable parameter
    "changing": [0.1, 0.3, 0.6, 1.0, 1.5],  # each interval is 0.1 s longer
    "countdown": [0.8, 1.4, 2.0],  # 0.3 s after every third tick of the constant clock
    "triggered": [],
    "every_second": [0.3, 0.7, 1.1, 1.5, 1.9],  # of the constant clock, as an output
    "alarm": [],
}

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
        number("Float64", "signalled", 45),
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
        number("Float64", "bias", 15, "parameter", 'variability="fixed" start="0"'),
    ],
    "Node": [
        clock("send", 1, "changing", more='supportsFraction="true"'),
        clock("sent", 2, causality="output"),
        clock("take", 3),
        number("Binary", "message", 11, more='clocks="2"'),
        '<Binary name="taken" valueReference="12" causality="input" clocks="3"><Start value="00"/></Binary>',
        number("Int32", "heard", 13, more='clocks="3"'),
        number("Int32", "word", 14, more='clocks="3"'),
        number("Int32", "address", 20, "parameter", 'variability="fixed" start="1"'),
        number("Float64", "last", 21, "parameter", 'variability="fixed" start="0"'),
        number("Float64", "announced", 45),
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
def library():
    """One for all models."""
    return native_library(SOURCE.read_text())


def described(model):
    """modelDescription.xml."""
    variables = "\n".join(VARIABLES[model])
    outputs = [line.split('valueReference="')[1].split('"')[0] for line in VARIABLES[model] if '"output"' in line]
    structure = "".join(f'<Output valueReference="{one}"/>' for one in outputs)
    return (
        '<?xml version="1.0" encoding="UTF-8"?>\n'
        f'<fmiModelDescription fmiVersion="3.0" modelName="{model}" instantiationToken="clocks{MODELS[model]}">{INTERFACES[model]}'
        '<DefaultExperiment startTime="0" stopTime="2" stepSize="0.05"/>\n<ModelVariables>'
        '<Float64 name="time" valueReference="99" causality="independent" variability="continuous"/>'
        f"{variables}</ModelVariables><ModelStructure>{structure}</ModelStructure></fmiModelDescription>"
    )


def clocks_fmu(folder, model):
    """An FMU with clocks."""
    return archive(
        folder / f"{model}.fmu",
        {"modelDescription.xml": described(model).encode(), f"binaries/x86_64-linux/{model}.so": library()},
    )
