"""Multicore fiber with Bragg gratings, and its interrogator."""

from math import cos, log, pi, sin, sqrt

from fmus.gratings import CORES, GRATINGS, TURN, nominal
from fmus.noisy import Noisy, noise_seed
from twin.component import (
    Boolean,
    Int32,
    Int64,
    input,
    local,
    normal,
    output,
    parameter,
    seed_stream,
    terminal,
    uniform,
)


class Fiber(Noisy):
    """Gratings in one central and three outer cores: strain and temperature shift the wavelength each reflects.

    FBGS fiber and FBG-Scan 908-EP of Al-Ahmad et al. (RACS); equations of Jackle et al. (2019). Twist strains no straight
    core: it turns the bending under the cores, unseen.
    """

    period = 4e-3

    curvature = input("1/m", "curvature at each grating along both directions across the fiber, mean over its length",
                      shape=(GRATINGS, 2), nominal=20.0)
    temperature = input("K", "temperature of the fiber", start=293.15, nominal=10.0)
    axial_strain = input("", "strain of the fiber's axis, positive stretched", nominal=1e-4)
    twist = input("rad/m", "angle that torsion has turned the fiber by, per length from its base", nominal=1.0)

    wavelength = output("m", "wavelength that each grating of each core reflects; 0: no peak", shape=(CORES, GRATINGS),
                        display_unit="nm")
    grating_count = output("", "gratings that the interrogator lists", type=Int32)
    age = output("s", "age of the sample when it was published", display_unit="ms")

    bending = terminal("the body it lies in", curvature=curvature)
    light = terminal("its interrogator", wavelength=wavelength, grating_count=grating_count, age=age)

    count = parameter(38, "", "gratings per core", type=Int32, fixed=True, minimum=4, maximum=GRATINGS,
                      source="recalled: 36 to 38 on a core; every 10 mm they reach over the 38 cm of Jackle's")
    pitch = parameter(10e-3, "m", "distance of gratings; the first is half of it from the base", display_unit="mm",
                      minimum=1e-3, source="paper, section VI: every 10 mm")
    first_wavelength = parameter(1512e-9, "m", "of the first grating, unstrained at 20 degC", display_unit="nm",
                                 source="recalled: interrogators for 1510 to 1590 nm")
    wavelength_spacing = parameter(2e-9, "m", "to the next grating", display_unit="nm",
                                   source="38 gratings in 80 nm")
    wavelength_range = parameter(2e-9, "m", "largest shift that is read; beyond, it stays there", display_unit="nm",
                                 minimum=0.0, source="estimate: the next grating's place, a bend of 22 to 23 mm radius")
    core_radius = parameter(37.5e-6, "m", "of the outer cores from the axis", display_unit="um", minimum=1e-6,
                            source="recalled: 35 to 37.5 um")
    photoelastic = parameter(0.22, "", "part of the strain that the refractive index takes back", source="recalled: silica")
    temperature_sensitivity = parameter(6.5e-6, "1/K", "relative shift per temperature, expansion and index",
                                        source="recalled: 10 pm/K at 1550 nm")
    noise = parameter(0.5e-12, "m", "standard deviation of a wavelength", display_unit="pm", minimum=0.0,
                      source="recalled: 0.3 to 1 pm")
    reference_error = parameter(2e-12, "m", "standard deviation of what each grating is off when straight",
                                display_unit="pm", minimum=0.0,
                                source="estimate: a groove straight to a radius of 20 m when it was read")
    angle_error = parameter(0.017453292519943295, "rad", "standard deviation of each outer core's angle", display_unit="deg",
                            minimum=0.0, source="estimate: 1 deg")
    radius_error = parameter(0.01, "", "standard deviation of each outer core's radius, relative", minimum=0.0,
                             source="estimate: 0.4 um")
    broken_core = parameter(0, "", "0 none, 1 the central one, 2 to 4 outer ones", type=Int32, minimum=0, maximum=CORES,
                            source="0: whole; a fault, set by an event")
    break_location = parameter(0.0, "m", "distance from the base where it is broken: no peaks from there on",
                               display_unit="mm", minimum=0.0, source="chosen: at its base")
    loss = parameter(0.0, "", "part of the samples that are lost", minimum=0.0, maximum=1.0, source="0: a bench")
    stopped = parameter(False, "", "whether the interrogator has stopped", type=Boolean,
                        source="false: a fault, set by an event")
    seed = noise_seed(11, "errors and noise")

    cosine = local(0.0, "m", "of each core's angle, times its radius", shape=(CORES,))
    sine = local(0.0, "m", "of each core's angle, times its radius", shape=(CORES,))
    offset = local(0.0, "m", "error of each grating's reference", shape=(CORES, GRATINGS), display_unit="pm")
    reading = local(0.0, "m", "wavelengths of the last sample that was not lost", shape=(CORES, GRATINGS), display_unit="nm")
    missed = local(0, "", "samples lost in a row", type=Int64)
    used = local(4, "", "gratings in use: count, as far as there is room", type=Int32)

    def initialize(self) -> None:
        self.used = max(min(self.count, GRATINGS), 4)
        seed_stream(self.stream, self.seed)
        self.cosine[0] = 0.0
        self.sine[0] = 0.0
        for core in range(1, CORES):
            angle = (core - 1) * TURN + self.angle_error * normal(self.stream)
            radius = self.core_radius * (1.0 + self.radius_error * normal(self.stream))
            self.cosine[core] = radius * cos(angle)
            self.sine[core] = radius * sin(angle)
        for core in range(CORES):
            for i in range(GRATINGS):
                self.offset[core, i] = self.reference_error * normal(self.stream)
                self.reading[core, i] = 0.0
        self.missed = 0
        interrogate(self)
        publish(self)
        self.age = 0.0

    def step(self, t: float, h: float) -> None:
        lost = uniform(self.stream) < self.loss
        if lost or self.stopped:
            self.missed += 1
        else:
            self.missed = 0
            interrogate(self)
        publish(self)
        self.age = (self.missed + 1) * h


def interrogate(self: Fiber) -> None:
    """Read all gratings of all cores."""
    relative = self.temperature_sensitivity * (self.temperature - 293.15)
    for i in range(self.used):
        location = (i + 0.5) * self.pitch
        turned = self.twist * location
        along = cos(turned)
        across = sin(turned)

        # the body's bending in the directions that the twisted cores have here
        k1 = along * self.curvature[i, 0] + across * self.curvature[i, 1]
        k2 = along * self.curvature[i, 1] - across * self.curvature[i, 0]
        chance = next_chance = 0.0
        unstrained = nominal(self.first_wavelength, self.wavelength_spacing, i)
        for core in range(CORES):
            if core % 2 == 0:
                chance, next_chance = two_normal(self)
            else:
                chance = next_chance
            strain = self.axial_strain - k1 * self.cosine[core] - k2 * self.sine[core]
            shift = unstrained * ((1.0 - self.photoelastic) * strain + relative)
            shift += self.offset[core, i] + self.noise * chance
            shift = min(max(shift, -self.wavelength_range), self.wavelength_range)
            self.reading[core, i] = unstrained + shift
            if core + 1 == self.broken_core and location >= self.break_location:
                self.reading[core, i] = 0.0


def two_normal(self: Fiber) -> tuple[float, float]:
    """Two normal numbers at the price of one: both of Box and Muller's pair."""
    size = sqrt(-2.0 * log(uniform(self.stream)))
    angle = 2.0 * pi * uniform(self.stream)
    return size * cos(angle), size * sin(angle)


def publish(self: Fiber) -> None:
    """The last reading."""
    for core in range(CORES):
        for i in range(GRATINGS):
            self.wavelength[core, i] = self.reading[core, i]
    self.grating_count = self.used
