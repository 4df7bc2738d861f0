"""Experiments with known answers on the bodies: beams, a column, a belt on a drum. What tests and figures measure.

Each returns what the bodies give over what theory says.
"""

from __future__ import annotations

from dataclasses import replace
from math import exp, pi, sin, sqrt, tan

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import solve_bvp
from scipy.optimize import brentq

from fmus.bodies.rod import Rod, cut, euler_load
from fmus.bodies.world import World
from twin.scene import Environment, Wall

H = 1e-3  # communication step [s]
ROD = Rod(
    length=0.1,
    segments=20,
    diameter=2.67e-3,
    density=8e-3,
    axial_stiffness=920.0,
    bending_stiffness=4.3e-4,
    tip_bending_stiffness=4.3e-4,
    tip_length=0.0,
    tip_curvature=0.0,
    curvature=0.0,
    friction=0.0,
    relaxation=0.5e-3,
)


def make_environment(path: NDArray[np.float64], *walls: Wall) -> Environment:
    """An environment made here."""
    return Environment("experiment", "Experiment", walls, path[0], np.array([1.0, 0.0]), path)


def straight(length: float) -> NDArray[np.float64]:
    """A line along x."""
    return np.array([[0.0, 0.0], [length, 0.0]])


def arc(radius: float, angle: float, offset: float = 0.0, points: int = 400) -> NDArray[np.float64]:
    """An arc that begins at the origin along x and turns left; `offset`: farther out."""
    a = np.linspace(0.0, angle, points)
    return np.column_stack(((radius + offset) * np.sin(a), radius - (radius + offset) * np.cos(a)))


def made(rod: Rod, environment: Environment, substep: float) -> World:
    """The world of an experiment, however heavy its segments get."""
    return World(environment, rod, cut(rod, substep, 1e9, "experiment"), "experiment")


def loaded(world: World, load: NDArray[np.float64], periods: float = 2.0) -> NDArray[np.float64]:
    """Where the tip rests under a load that grows over half of some periods of the lowest bending mode.

    A drag on all bodies brakes that mode just without overshoot: the load is then quasi-static for any mass scale.
    """
    rod, cut = world.rod, world.cut
    omega = 3.516 * sqrt(rod.bending_stiffness / (rod.density * cut.mass_scale)) / rod.length**2
    world.space.damping = exp(-2.0 * omega)
    steps = round(periods * 2.0 * pi / omega / H)
    for i in range(steps):
        world.step(H, 0.0, 0.0, load * min(1.0, 2.0 * i / steps))
    return world.nodes[:, -1].copy()


def elastica(load: float, rod: Rod) -> NDArray[np.float64]:
    """Tip of a cantilever along x under a load along y, bent as far as it likes: EI a'' = -F cos a, a(0) = a'(L) = 0."""
    part = load * rod.length**2 / rod.bending_stiffness
    s = np.linspace(0.0, 1.0, 200)
    guess = np.vstack((part * (s - s * s / 2.0), part * (1.0 - s))) / (1.0 + part)
    solution = solve_bvp(
        lambda _, y: np.vstack((y[1], -part * np.cos(y[0]))), lambda a, b: np.array([a[0], b[1]]), s, guess, tol=1e-9
    )
    angle = solution.sol(s)[0]
    return rod.length * np.array([np.trapezoid(np.cos(angle), s), np.trapezoid(np.sin(angle), s)])


def cantilever(segments: int = 20, substep: float = 0.25e-3, part: float = 0.01) -> float:
    """Deflection of a clamped rod under a load across its tip, over the elastica's; part: of F L^2 / EI."""
    rod = replace(ROD, segments=segments)
    load = part * rod.bending_stiffness / rod.length**2
    tip = loaded(made(rod, make_environment(straight(rod.length)), substep), np.array([0.0, load]))
    return float(tip[1] / elastica(load, rod)[1])


def clamped_arc(segments: int = 20, substep: float = 0.25e-3, radius: float = 50e-3) -> float:
    """Give of a clamped quarter circle, load along its root, over pi R^3 / (4 EI)."""
    length = 0.5 * pi * radius
    rod = replace(ROD, length=length, segments=segments, tip_length=2.0 * length, tip_curvature=1.0 / radius)
    load = 0.01 * rod.bending_stiffness / radius**2
    tips = [
        loaded(made(rod, make_environment(arc(radius, 0.5 * pi)), substep), np.array([force, 0.0]))
        for force in (-load, load)
    ]
    return float((tips[1] - tips[0])[0] / (2.0 * load * pi * radius**3 / (4.0 * rod.bending_stiffness)))


def give(part: float) -> float:
    """Give of a clamped column under a side load at its free end, with part of Euler's load on it, over that without."""
    u = 0.5 * pi * sqrt(part)
    return 3.0 * (tan(u) - u) / u**3


def column(segments: int = 20, substep: float = 0.25e-3) -> float:
    """Buckling load of a column with one end free, over Euler's: that which explains its give to a side load."""
    rod = replace(ROD, segments=segments)
    euler = euler_load(rod.bending_stiffness, rod.length, 2.0)
    part, side = 0.5, 1e-3 * euler
    tip = loaded(made(rod, make_environment(straight(rod.length)), substep), np.array([-part * euler, side]), 8.0)
    wanted = tip[1] / (side * rod.length**3 / (3.0 * rod.bending_stiffness))
    return part / float(brentq(lambda share: give(share) - wanted, 0.1, 0.999))


def capstan(angle: float, friction: float, segments: int = 60, substep: float = 0.25e-3) -> float:
    """Pull over load of a slack rod that slides around a drum, over e^(friction angle), friction acting at its surface."""
    radius, load = 50e-3, 5.0
    rod = replace(
        ROD,
        length=radius * angle + 20e-3,
        segments=segments,
        bending_stiffness=1e-7,
        tip_bending_stiffness=1e-7,
        axial_stiffness=5000.0,
        friction=friction,
    )
    path = np.vstack(([-10e-3, 0.0], arc(radius, angle)))
    drum = Wall("drum", arc(radius, angle + 0.3, -0.5 * rod.diameter - 0.02e-3))
    world = made(rod, make_environment(path, drum), substep)
    pulls = []
    for i in range(1500):
        world.step(H, -4e-3 * i * H * min(1.0, i / 500), 0.0, load * world.end * min(1.0, i / 300))
        pulls.append(world.reaction)
    arm = 1.0 - 0.5 * rod.diameter / radius
    return float(np.mean(pulls[-300:])) / load / exp(friction * angle * arm)


def play(
    environment: Environment, rod: Rod, substep: float = 0.25e-3, stroke: float = 5e-3, rate: float = 0.5
) -> float:
    """Width of the loop of gripper and tip, at the middle of the stroke [m]; sine of `stroke` [m] and `rate` [Hz]."""
    world = made(rod, environment, substep)
    world.settle(0.3)
    count = round(1.0 / (rate * H))
    tip = []
    for i in range(2 * count + 1):
        world.step(H, stroke * sin(2.0 * pi * i / count))
        tip.append(world.tip_travel)
    return abs(tip[3 * count // 2] - tip[2 * count])
