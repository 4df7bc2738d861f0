"""Gain and phase margins of the force loop, measured on the parts themselves.

    python -m benchmarks.margins         prints `name: value` lines

The loop is opened at the controller: a sine is commanded with the controller's timing, and the first harmonic of what the
force sensor shows then is the loop without its controller. Friction and play make it depend on the amplitude.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from itertools import product
from math import cos, pi, sin
from typing import Any, NamedTuple

import numpy as np

import twin
from twin.component import Component, output, parameter

Array = np.ndarray[Any, Any]

FREQUENCIES = np.geomspace(0.1, 20.0, 14)  # Hz
PER_PERIOD = 3.0  # periods of the controller that a sine has at least
HEARTBEAT = (
    5e-3  # amplitude of the gripper when it follows the heart [m]; below 2 mm nothing gets through friction and play
)
SMALL = 2e-3  # amplitude where nothing depends on it [m]
FASTEST = 0.3  # speed of the sine above which drive and wall would be at their limits [m/s]
SETTLED, SEEN = 1, 2  # periods before and while one listens
LEAST_SETTLED = 0.5  # s
GAIN_MARGIN, PHASE_MARGIN = 6.0, 45.0  # dB, deg: what is asked for
SLIDES = {  # friction that keeps its sign adds nothing to a small deviation, play that is taken up neither
    "sheath.friction": (0.0, 0.0, 0.0),
    "sheath.play": (0.0, 0.0, 0.0),
    "sheath.friction_coefficient": 0.0,
    "servomotor.friction_coulomb": 0.0,
}


class VelocitySine(Component):
    """Velocity demand whose integral is a sine, published a period after it was computed, as a controller's is."""

    period = 5e-3

    target_velocity = output("m/s", "velocity demand")
    amplitude = parameter(1e-3, "m", "of its integral", source="assumed")
    frequency = parameter(1.0, "Hz", "frequency", source="assumed")

    def initialize(self) -> None:
        self.target_velocity = 0.0

    def step(self, t: float, h: float) -> None:
        omega = 2.0 * pi * self.frequency
        self.target_velocity = self.amplitude * omega * cos(omega * t)


class SetpointSine(Component):
    """Setpoint with a sine on it, for a loop that stays closed."""

    period = 5e-3

    setpoint = output("N", "setpoint")
    amplitude = parameter(0.02, "N", "amplitude", source="assumed")
    frequency = parameter(1.0, "Hz", "frequency", source="assumed")

    def initialize(self) -> None:
        self.setpoint = 0.2

    def step(self, t: float, h: float) -> None:
        self.setpoint = 0.2 + self.amplitude * sin(2.0 * pi * self.frequency * t)


@dataclass(frozen=True)
class Plant:
    """Parts of the loop: parameters that differ, period of controller and sensor [s], component in the wall's place."""

    values: dict[str, Any] = field(default_factory=dict)
    period: float = 5e-3
    wall: str = "wall"
    small: float = SMALL

    def changed(self, **values: float) -> Plant:
        """With factors on stiffness, play and drag, and a delay more [s]."""
        own = dict(self.values)
        own["wall.bending_stiffness"] = 4.3e-4 * values.get("stiffness", 1.0)
        own["sheath.play"] = tuple(values.get("play", 1.0) * one for one in (0.0, 0.3e-3, 0.3e-3))
        own["sheath.drag"] = tuple(values.get("drag", 1.0) * one for one in (6.0, 3.0, 3.0))
        own["sensor.latency"] = self.values.get("sensor.latency", 0.0) + values.get("delay", 0.0)
        return replace(self, values=own)

    def sliding(self) -> Plant:
        """As small deviations see it while drive and sheath move on."""
        return replace(self, values=self.values | SLIDES)

    def system(self) -> twin.System:
        """From the velocity demand to the sensor; nothing commands yet."""
        parts: dict[str, dict[str, Any]] = {"sensor": {"noise": 0.0, "resolution": 1e-9}}
        for name, value in self.values.items():
            member, own = name.split(".", 1)
            parts.setdefault(member, {})[own] = value
        system = twin.System()
        for name, component in (("servomotor", "servomotor"), ("sheath", "sheath"), ("wall", self.wall)):
            system.add(name, component, **parts.get(name, {}))
        system.add("sensor", "force_sensor", period=self.period, **parts["sensor"])
        system.connect("servomotor.position", "sheath.gripper_position")
        system.connect("sheath.reaction_force", "servomotor.load_force")
        system.connect("sheath.tip_position", "wall.tip_position")
        system.connect("wall.force", "sheath.contact_force", "sensor.force")
        return system


def harmonic(plant: Plant, frequency: float, amplitude: float) -> complex:
    """Force per velocity demand [N s/m]: first harmonic of what a sine of this amplitude [m] leaves at the sensor."""
    system = plant.system()
    system.add("sine", VelocitySine, period=plant.period, amplitude=amplitude, frequency=frequency)
    system.connect("sine.target_velocity", "servomotor.target_velocity")
    begin = max(SETTLED / frequency, LEAST_SETTLED)
    with system.simulate(step="1 ms", record=["sensor.measured_force"], every=plant.period) as running:
        running.advance(f"{1e3 * (begin + SEEN / frequency):.0f} ms")
        found = running.results
    return first(found, "sensor.measured_force", frequency, begin) / (amplitude * 2.0 * pi * frequency)


def first(found: Any, name: str, frequency: float, begin: float) -> complex:
    """First harmonic of a signal, of a cosine's phase, beside a mean and a drift."""
    late = found["time"].to_numpy() >= begin
    time, values = found["time"].to_numpy()[late], found[name].to_numpy()[late]
    angle = 2.0 * pi * frequency * time
    waves = np.column_stack((np.cos(angle), np.sin(angle), np.ones(late.sum()), time))
    (a, b, *_), *_ = np.linalg.lstsq(waves, values, rcond=None)
    return complex(a, -b)


def at_work(plant: Plant, control: str, gain: float, frequency: float, amplitude: float = 0.02) -> complex:
    """The loop with a controller at work on a beating heart that it is told: force over force error, from a sine on the setpoint.

    The frequency [Hz] must be no harmonic of the beat, and a multiple of 0.1 Hz.
    """
    system = plant.system()
    system.add("heart", "heart", blend_in=0.0)
    system.add("control", control, proportional=gain, period=plant.period)
    system.add("sine", SetpointSine, period=plant.period, amplitude=amplitude, frequency=frequency)
    system.connect("heart.position", "wall.heart_position", "control.heart_position")
    system.connect("sensor.measured_force", "control.force")
    system.connect("sine.setpoint", "control.setpoint")
    system.connect("control.target_velocity", "servomotor.target_velocity")
    with system.simulate(step="1 ms", record=["sensor.measured_force", "sine.setpoint"], every=plant.period) as running:
        running.advance("22 s")
        found = running.results[:-1]  # whole tenths of a hertz in the 20 s that are seen
    force, setpoint = (first(found, name, frequency, 2.0) for name in ("sensor.measured_force", "sine.setpoint"))
    return force / (setpoint - force)


def response(plant: Plant, amplitude: float, frequencies: Array = FREQUENCIES) -> tuple[Array, Array]:
    """Frequencies [Hz] that this amplitude allows, and the loop without its controller there [N s/m]."""
    possible = frequencies[2.0 * pi * frequencies * amplitude <= FASTEST]
    possible = possible[possible * PER_PERIOD * plant.period <= 1.0]
    return possible, np.array([harmonic(plant, float(one), amplitude) for one in possible])


class Margins(NamedTuple):
    """Gain margin [dB], phase margin [deg] and the crossover that belongs to it [Hz].

    The gain margin is infinite where -180 deg are not reached; the rest is not a number where no crossover is seen.
    """

    gain: float
    phase: float
    crossover: float

    @property
    def enough(self) -> bool:
        """Whether it is what is asked for."""
        return self.gain >= GAIN_MARGIN and self.phase >= PHASE_MARGIN


def margins(frequencies: Array, loop: Array) -> Margins:
    """Margins of a loop's frequency response, its magnitude and phase on lines between the points over log frequency."""
    fine = np.geomspace(frequencies[0], frequencies[-1], 4000)
    place = np.log(fine), np.log(frequencies)
    decibels = np.interp(*place, 20.0 * np.log10(np.abs(loop)))
    phase = np.interp(*place, np.degrees(np.unwrap(np.angle(loop))))
    phase -= 360.0 * np.round((phase[0] + 90.0) / 360.0)  # an integrating loop begins near -90 deg
    turned = np.flatnonzero(phase <= -180.0)
    crossed = np.flatnonzero((decibels[:-1] > 0.0) & (decibels[1:] <= 0.0))
    gain = float(-decibels[turned[0]]) if turned.size else np.inf
    if decibels[-1] > 0.0 or not crossed.size:
        return Margins(gain, np.nan, np.nan)
    worst = crossed[np.argmin(phase[crossed])]
    return Margins(gain, float(180.0 + phase[worst]), float(fine[worst]))


def controller(frequencies: Array, proportional: float, integral: float = 0.0, period: float = 5e-3) -> Array:
    """PI law at these frequencies [m/(s N)]; its integral as the components sum it up."""
    z = np.exp(2j * pi * frequencies * period)
    return proportional + integral * period * z / (z - 1.0)


def allowed(responses: list[tuple[Array, Array]], ratio: float = 0.0, period: float = 5e-3) -> float:
    """Largest proportional gain [m/(s N)] with which all responses keep the margins; ratio: integral over proportional [1/s]."""
    gains = np.geomspace(0.05, 20.0, 600)
    for gain in gains[::-1]:
        if all(margins(f, gain * controller(f, 1.0, ratio, period) * loop).enough for f, loop in responses):
            return float(gain)
    return 0.0


def responses(plant: Plant) -> list[tuple[Array, Array]]:
    """What margins are judged by: small deviations of a sheath that slides, and a gripper that moves as far as the heart."""
    return [response(plant.sliding(), plant.small), response(plant, HEARTBEAT)]


CORNERS = [
    {"stiffness": stiffness, "play": play, "drag": drag, "delay": delay}
    for stiffness, play, drag, delay in product((1.2, 0.8), (0.8, 1.2), (0.8, 1.2), (0.0, 5e-3))
]


def corner_responses() -> list[tuple[Array, Array]]:
    """Responses in the corners with the stiffer contact: a softer one lowers the loop and nothing else."""
    stiffer = [one for one in CORNERS if one["stiffness"] > 1.0]
    return [one for corner in stiffer for one in responses(Plant().changed(**corner))]


def main() -> None:
    """Print the largest gains that keep the margins."""
    small, large = responses(Plant())
    print(f"small_deviations: {1e3 * allowed([small]):.0f} mm/(s N)")
    print(f"heartbeat: {1e3 * allowed([large]):.0f} mm/(s N)")
    print(f"all_corners: {1e3 * allowed(corner_responses()):.0f} mm/(s N)")


if __name__ == "__main__":
    main()
