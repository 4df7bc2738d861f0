"""Fault isolation: what residuals of a window indicate, as a table."""

from __future__ import annotations

from itertools import pairwise
from math import copysign
from operator import mul
from typing import TYPE_CHECKING, NamedTuple

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from hw_bridge.hardware import ShadowKeys

FEW = 0.1  # share of a window that has to be in one direction to say anything about it


class Sample(NamedTuple):
    """Residuals of one cycle, with the twin's speed and the load on it."""

    position: float  # [m or rad]
    velocity: float  # [m/s or rad/s]
    current: float  # [A]
    speed: float
    load: float  # [N or N*m]
    gap: bool  # whether samples before it are missing


class Figures(NamedTuple):
    """Residual figures of a window of samples, each over its band: 1 is the limit."""

    jump: float  # largest step of the position residual from one cycle to the next that the speed does not explain
    drift: float  # position residual now minus that at its beginning
    lag: float  # mean of the velocity residual, positive: slower than the twin
    ahead: float  # mean current residual while moving to positive positions
    back: float  # the same to negative positions
    both: bool  # whether it moved both ways
    relieved: float  # mean current residual in the direction of the load, positive: as if it were gone
    by_load: bool  # whether the load explains the current residual better than the direction of motion


class Symptom(NamedTuple):
    """A row of the table: symptom and indicated part. The first match counts."""

    shows: Callable[[Figures], bool]
    text: str
    part: str
    at_once: bool = False  # without waiting for a window in which nothing else is seen


SYMPTOMS = (
    Symptom(lambda f: f.jump > 1, "position jumps, velocity does not",
            "the encoder, its scale or its mounting", at_once=True),
    Symptom(lambda f: f.lag > 1 and max(f.ahead, -f.back) > 1, "slower than its twin, with more current",
            "something holds it: a collision, a jam, a guide"),
    Symptom(lambda f: f.lag > 1, "slower than its twin, without more current",
            "the drive: gains, current or speed limit, supply"),
    Symptom(lambda f: f.relieved > 1 and f.by_load, "current as if the load were gone",
            "the grip: sleeve slipping, or air low"),
    Symptom(lambda f: f.both and f.ahead > 1 and f.back < -1, "more current, with the sign of the velocity",
            "friction: guide rail, bearings, sleeve bearing"),
    Symptom(lambda f: f.both and f.ahead < -1 and f.back > 1, "less current, against the sign of the velocity",
            "friction has fallen: a guide or seal is worn or loose"),
    Symptom(lambda f: max(abs(f.ahead), abs(f.back)) > 1, "more current to one side",
            "the load: a force that the twin does not know, or friction"),
    Symptom(lambda f: abs(f.drift) > 1, "goes another way than its twin",
            "scaling, or steps that are lost"),
)  # fmt: skip


def figures_of(samples: list[Sample], bands: ShadowKeys, cycle: float) -> Figures:
    """Compute the figures of a window of samples; `cycle` [s] between them."""
    position, velocity, current, speed, load, _ = zip(*samples, strict=True)
    steps = (b.position - a.position - b.velocity * cycle for a, b in pairwise(samples) if not b.gap)
    jump = max(map(abs, steps), default=0.0)
    signs = [direction(value, bands.moving) for value in speed]
    ahead = [value for value, sign in zip(current, signs, strict=True) if sign > 0.0]
    back = [value for value, sign in zip(current, signs, strict=True) if sign < 0.0]
    enough = FEW * len(samples)
    return Figures(
        jump / bands.position,
        (position[-1] - position[0]) / bands.position,
        -mean([value * sign for value, sign in zip(velocity, signs, strict=True) if sign]) / bands.velocity,
        (mean(ahead) if len(ahead) > enough else 0.0) / bands.current,
        (mean(back) if len(back) > enough else 0.0) / bands.current,
        min(len(ahead), len(back)) > enough,
        mean([value * copysign(1.0, force) for value, force in zip(current, load, strict=True) if force])
        / bands.current,
        explained(current, load) > explained(current, signs),
    )


def direction(speed: float, moving: float) -> float:
    """1 or -1 where a speed is above `moving`, else 0."""
    return copysign(1.0, speed) if abs(speed) > moving else 0.0


def mean(values: list[float]) -> float:
    """The mean; 0 of nothing."""
    return sum(values) / len(values) if values else 0.0


def explained(values: Sequence[float], cause: Sequence[float]) -> float:
    """Share of the squares of `values` that a multiple of `cause` accounts for."""
    product = sum(map(mul, values, cause))
    squares = sum(map(mul, values, values)) * sum(map(mul, cause, cause))
    return product * product / squares if squares else 0.0
