"""FMUs for Model Exchange that were not made by this project's exporter: from C, and by PythonFMU3."""

import subprocess
import sys
from functools import cache
from pathlib import Path

from tests.fmi.third_party import archive, native_library
from twin.component import Component, input, output, parameter, state


class Spring(Component):
    """A stiff spring with a damper between two bodies."""

    xa = input("m", "place of one end")
    xb = input("m", "place of the other")
    va = input("m/s", "speed of one end")
    vb = input("m/s", "speed of the other")
    f = output("N", "force on the other body")
    stiffness = parameter(1e6, "N/m", "stiffness", source="test")
    damping = parameter(1e3, "N*s/m", "damping", source="test")
    work = state(0.0, "J", "work that the damper took")

    def derivatives(self, t):
        self.der_work = self.damping * (self.va - self.vb) ** 2
        self.f = self.stiffness * (self.xa - self.xb) + self.damping * (self.va - self.vb)


class Body(Component):
    """A mass."""

    f = input("N", "force")
    x = output("m", "place")
    v = output("m/s", "speed")
    mass = parameter(1.0, "kg", "mass", source="test")
    place = state(0.0, "m", "place")
    speed = state(0.0, "m/s", "speed")

    def derivatives(self, t):
        self.der_place = self.speed
        self.der_speed = self.f / self.mass
        self.x = self.place
        self.v = self.speed


class VanDerPol(Component):
    """An oscillator that is stiff for part of its period."""

    x = output("", "first state")
    mu = parameter(50.0, "", "how stiff it is", source="test")
    first = state(2.0, "", "first state")
    second = state(0.0, "", "second state")

    def derivatives(self, t):
        self.der_first = self.second
        self.der_second = self.mu * (1.0 - self.first * self.first) * self.second - self.first
        self.x = self.first


class Gain(Component):
    """An output that follows its input at once."""

    u = input("", "input")
    y = output("", "output")
    gain = parameter(0.5, "", "gain", source="test")
    offset = parameter(1.0, "", "offset", source="test")
    mean = state(0.0, "", "slow mean of the output")

    def derivatives(self, t):
        self.y = self.offset + self.gain * self.u
        self.der_mean = self.y - self.mean


SOURCE = Path(__file__).with_name("exchange.c")
MODELS = {"Ball": 0, "Stair": 1, "Relay": 2}
BASES = {"Float64": 0, "Int32": 100, "Boolean": 200}
NAMES_2 = {"Float64": "Real", "Int32": "Integer", "Boolean": "Boolean"}

# type, name, place, attributes, in the order of tests/fmi/exchange.c
VARIABLES = {
    "Ball": [
        ("Float64", "h", 0, 'causality="output" variability="continuous" initial="exact" start="1"'),
        ("Float64", "v", 1, 'causality="output" variability="continuous" initial="exact" start="0"'),
        ("Float64", "der(h)", 2, 'causality="local" variability="continuous" initial="calculated" derivative="{h}"'),
        ("Float64", "der(v)", 3, 'causality="local" variability="continuous" initial="calculated" derivative="{v}"'),
        ("Float64", "g", 4, 'causality="parameter" variability="fixed" start="-9.81"'),
        ("Float64", "e", 5, 'causality="parameter" variability="tunable" start="0.7"'),
        ("Int32", "bounces", 0, 'causality="output" variability="discrete" initial="calculated"'),
    ],
    "Stair": [("Int32", "counter", 0, 'causality="output" variability="discrete" initial="calculated"')],
    "Relay": [
        ("Float64", "x", 0, 'causality="output" variability="continuous" initial="exact" start="0"'),
        ("Float64", "der(x)", 1, 'causality="local" variability="continuous" initial="calculated" derivative="{x}"'),
        ("Float64", "u", 2, 'causality="input" variability="continuous" start="0"'),
        ("Float64", "level", 3, 'causality="parameter" variability="tunable" start="0.5"'),
        ("Float64", "T", 4, 'causality="parameter" variability="fixed" start="0.1"'),
        ("Boolean", "on", 0, 'causality="output" variability="discrete" initial="calculated"'),
    ],
}


def calculated(model: str) -> list[str]:
    """What initialization computes."""
    return [name for _, name, _, attributes in VARIABLES[model] if 'initial="calculated"' in attributes]


def described_3(model: str) -> str:
    """modelDescription.xml of FMI 3.0."""
    places = {name: BASES[kind] + place for kind, name, place, _ in VARIABLES[model]}
    variables = [
        f'<{kind} name="{name}" valueReference="{places[name]}" {attributes.format(**places)}/>'
        for kind, name, _, attributes in VARIABLES[model]
    ]
    outputs = [name for _, name, _, attributes in VARIABLES[model] if "output" in attributes]
    structure = [
        *(f'<Output valueReference="{places[name]}" dependencies=""/>' for name in outputs),
        *(f'<ContinuousStateDerivative valueReference="{places[name]}"/>' for name in places if name[:4] == "der("),
        *(f'<InitialUnknown valueReference="{places[name]}"/>' for name in calculated(model)),
        *(['<EventIndicator valueReference="0"/>'] if model == "Ball" else []),
    ]
    return page(
        f'fmiVersion="3.0" modelName="{model}" instantiationToken="exchange"',
        f'<ModelExchange modelIdentifier="{model}" needsCompletedIntegratorStep="true"/>',
        ['<Float64 name="time" valueReference="999" causality="independent" variability="continuous"/>', *variables],
        structure,
    )


def described_2(model: str) -> str:
    """modelDescription.xml of FMI 2.0, which counts variables from 1."""
    rows = VARIABLES[model]
    index = {name: i for i, (_, name, _, _) in enumerate(rows, 1)}
    variables = []
    for kind, name, place, attributes in rows:
        words = [part.split("=") for part in attributes.format(**index).split()]
        inner = " ".join(f"{key}={value}" for key, value in words if key in ("start", "derivative"))
        outer = " ".join(f"{key}={value}" for key, value in words if key not in ("start", "derivative"))
        variables.append(
            f'<ScalarVariable name="{name}" valueReference="{BASES[kind] + place}" {outer}>'
            f"<{NAMES_2[kind]} {inner}/></ScalarVariable>"
        )
    outputs = [name for _, name, _, attributes in rows if "output" in attributes]
    unknowns = {
        "Outputs": [f'<Unknown index="{index[name]}" dependencies=""/>' for name in outputs],
        "Derivatives": [f'<Unknown index="{index[name]}"/>' for name in index if name.startswith("der(")],
        "InitialUnknowns": [f'<Unknown index="{index[name]}"/>' for name in calculated(model)],
    }
    return page(
        f'fmiVersion="2.0" modelName="{model}" guid="exchange" numberOfEventIndicators="{int(model == "Ball")}"',
        f'<ModelExchange modelIdentifier="{model}"/>',
        variables,
        [f"<{tag}>{''.join(found)}</{tag}>" for tag, found in unknowns.items() if found],
    )


def page(about: str, interface: str, variables: list[str], structure: list[str]) -> str:
    """A model description."""
    return (
        f'<?xml version="1.0" encoding="UTF-8"?><fmiModelDescription {about}>{interface}'
        '<DefaultExperiment startTime="0" stopTime="3" tolerance="1e-8" stepSize="0.01"/>'
        f"<ModelVariables>{''.join(variables)}</ModelVariables>"
        f"<ModelStructure>{''.join(structure)}</ModelStructure></fmiModelDescription>"
    )


@cache
def library(model: str) -> bytes:
    """The shared library of a model, for both versions."""
    return native_library(f"#define MODEL {MODELS[model]}\n{SOURCE.read_text()}")


def exchange_fmu(folder: Path, model: str, version: str, differences: bool = False) -> Path:
    """An FMU that offers Model Exchange alone; `differences`: with directional derivatives that leave it at another point."""
    place = "linux64" if version == "2.0" else "x86_64-linux"
    described = described_2 if version == "2.0" else described_3
    text = described(model)
    if differences:
        offered = "providesDirectionalDerivative" + "s" * (version != "2.0")
        text = text.replace("<ModelExchange ", f'<ModelExchange {offered}="true" ')
    return archive(
        folder / f"{model}{version[0]}{differences or ''}.fmu",
        {"modelDescription.xml": text.encode(), f"binaries/{place}/{model}.so": library(model)},
    )


PYTHON_BALL = """
from pythonfmu3 import Fmi3Causality as C, Fmi3Initial, Fmi3SlaveBase, Fmi3Variability as V, Float64, Int32, ModelExchange
from pythonfmu3.modelexchange import Fmi3UpdateDiscreteStatesResult

class PythonBall(Fmi3SlaveBase, ModelExchange):
    def __init__(self, **kwargs):
        super().__init__(**kwargs)
        self.time, self.h, self.v, self.der_h, self.der_v, self.e, self.bounces = 0.0, 1.0, 0.0, 0.0, -9.81, 0.7, 0
        exact = dict(causality=C.output, variability=V.continuous, initial=Fmi3Initial.exact)
        self.register_variable(Float64("time", causality=C.independent, variability=V.continuous))
        self.register_variable(Float64("h", start=1, **exact), has_event_indicator=True)
        self.register_variable(Float64("v", start=0, **exact))
        self.register_variable(Float64("der_h", causality=C.local, variability=V.continuous, derivative=1))
        self.register_variable(Float64("der_v", causality=C.local, variability=V.continuous, derivative=2))
        self.register_variable(Float64("e", causality=C.parameter, variability=V.tunable))
        self.register_variable(Int32("bounces", causality=C.output, variability=V.discrete))

    def get_continuous_state_derivatives(self):
        self.der_h = self.v
        return [self.der_h, self.der_v]

    def get_event_indicators(self):
        return [self.h]

    def update_discrete_states(self):
        told = Fmi3UpdateDiscreteStatesResult()
        if self.h <= 0.0 and self.v < 0.0:
            self.h, self.v = 2.2250738585072014e-308, -self.e * self.v
            self.bounces += 1
            told.valuesOfContinuousStatesChanged = True
        return told
"""


def python_ball(folder: Path) -> Path:
    """The ball by PythonFMU3."""
    source = folder / "pythonball.py"
    source.write_text(PYTHON_BALL)
    arguments = [sys.executable, "-m", "pythonfmu3", "build", "-f", str(source), "-d", str(folder)]
    subprocess.run(arguments, check=True, capture_output=True)
    return folder / "PythonBall.fmu"
