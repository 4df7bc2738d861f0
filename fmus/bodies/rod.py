"""Instrument as a rod, cut into rigid segments with elastic joints, and the stable step of the chain."""

from __future__ import annotations

from dataclasses import dataclass, fields
from math import floor, isfinite, log10, pi, sqrt

import numpy as np
from numpy.typing import NDArray

from twin.errors import SimulationError

ITERATIONS = 10  # of the solver, per substep
AXIAL_STEP = 10.0  # largest stiffness * substep^2 / mass of a joint; twice that still ran quietly
BENDING_STEP = 1.5  # the same of bending and moment of inertia; twice that still ran quietly
SHORTEST_RELAXATION = 1.0  # substeps: an explicit spring with less damping is stable up to 4 instead of 10 only
LONGEST_RELAXATION = 4.0  # substeps: dampers beyond that do not converge within the iterations
SIGNED = ("tip_curvature", "curvature")  # what may be negative
FAST = 3e-6  # what a segment costs per substep, for a message only [s]


@dataclass(frozen=True)
class Rod:
    """An elastic instrument, stiff shaft and soft tip; SI units throughout."""

    length: float  # [m]
    segments: int
    diameter: float  # [m]
    density: float  # [kg/m]
    axial_stiffness: float  # EA [N]
    bending_stiffness: float  # EI of the shaft [N*m^2]
    tip_bending_stiffness: float  # EI of the tip [N*m^2]
    tip_length: float  # [m]
    tip_curvature: float  # at rest, positive to the left [1/m]
    curvature: float  # of the shaft, likewise [1/m]
    friction: float
    relaxation: float  # damping over stiffness [s]

    def check(self, name: str) -> None:
        """Raise an error if the rod's values are not those of an instrument."""
        for field in fields(self):
            value = getattr(self, field.name)
            least = 0.0 if field.name in (*SIGNED, "tip_length", "friction", "relaxation") else 1e-12
            if not isfinite(value) or (value < least and field.name not in SIGNED):
                raise SimulationError(
                    f"{name}: {field.name} is {value:g}. Give {'more than 0' if least else '0 or more'}."
                )
        if self.segments < 2:
            raise SimulationError(f"{name}: {self.segments} segments do not bend. Use 2 or more, such as 60.")


@dataclass(frozen=True)
class Segments:
    """Constants of the bodies and joints; joint i is before segment i, joint 0 at the gripper."""

    count: int
    length: float  # [m]
    mass: float  # of one, scaled [kg]
    moment: float  # of one, scaled [kg*m^2]
    axial: float  # stiffness of a joint [N/m]
    bending: NDArray[np.float64]  # of each joint [N*m/rad]
    rest: NDArray[np.float64]  # angle of each joint at rest [rad]
    relaxation: float  # [s]
    substep: float  # [s]
    mass_scale: float  # mass over the instrument's own
    gyration: float  # radius of gyration of one segment [m]
    lowest_mode: float  # axial, one end held [Hz]


def cut(rod: Rod, substep: float, largest_mass_scale: float, name: str) -> Segments:
    """Segments of a rod for substeps of `substep` [s].

    Mass is raised until the substep is stable, since nothing here moves by its own inertia; moments of inertia as well.
    """
    rod.check(name)
    l, n, dt = rod.length / rod.segments, rod.segments, substep
    axial, real = rod.axial_stiffness / l, rod.density * l
    scale = max(1.0, axial * dt * dt / (AXIAL_STEP * real))
    if scale > largest_mass_scale * (1.0 + 1e-9):
        longest = rounded_down(dt * sqrt(largest_mass_scale / scale))
        slower = n * FAST / longest
        pace = f", which takes about {slower:.0f} s for each second" if slower > 2 else ""
        raise SimulationError(
            f"{name}: a substep of {1e3 * dt:g} ms is unstable for {n} segments, unless they weigh {scale:.3g} times what "
            f"they do. Use substep {1e3 * longest:g} ms{pace}; or fewer segments, or a larger largest_mass_scale."
        )
    mass = real * scale

    # bending acts between the middles of two segments; at the gripper over half a segment
    middle = np.arange(n) * l
    stiffness = np.where(middle < rod.length - rod.tip_length, rod.bending_stiffness, rod.tip_bending_stiffness)
    bending = stiffness / l
    bending[0] *= 2.0
    rest = l * np.where(middle < rod.length - rod.tip_length, rod.curvature, rod.tip_curvature)
    rest[0] *= 0.5
    moment = max(mass * l * l / 12.0, float(bending[1:].max()) * dt * dt / BENDING_STEP)
    relaxation = min(max(rod.relaxation, SHORTEST_RELAXATION * dt), LONGEST_RELAXATION * dt)
    lowest = sqrt(rod.axial_stiffness / (rod.density * scale)) / (4.0 * rod.length)
    return Segments(n, l, mass, moment, axial, bending, rest, relaxation, dt, scale, sqrt(moment / mass), lowest)


def rounded_down(value: float) -> float:
    """The next number below of 1, 2 and 5 times a power of ten: a part of every step that people use."""
    decade = 10.0 ** floor(log10(value))
    return float(f"{next(digit for digit in (5, 2, 1) if digit * decade <= value * (1.0 + 1e-9)) * decade:.1g}")


def euler_load(bending_stiffness: float, length: float, factor: float) -> float:
    """Buckling load [N] of a column; factor 1: both ends turn freely, 0.5: both clamped, 2: one end free."""
    return pi * pi * bending_stiffness / (factor * length) ** 2
