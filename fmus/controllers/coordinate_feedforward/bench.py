"""Analyses of the virtual bench: signals of a calibration run to the same fits as recorded readings get."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from fmus.camera_tracker.model import CameraTracker
from fmus.coordinate_feedforward import calibrate
from fmus.coordinate_feedforward.statistics import ends

from fmus import injection
from fmus.injection import MILLIMETER

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

    Values = NDArray[np.float64]

STEPS_PER_MILLIMETER = 1600.0 / 7.7  # eq. (1)
STEPS_PER_REVOLUTION = 1600.0


def slide(steps: Values) -> Values:
    """Slide position [mm] according to the step counter."""
    return steps / STEPS_PER_MILLIMETER


def spread(values: Values, at: Values, count: int) -> Values:
    """Values at their samples, not a number elsewhere: a signal."""
    column = np.full(count, np.nan)
    column[at.astype(int)] = values
    return column


def lengths(values: Values, at: Values, count: int) -> Values:
    """The signal [m] of lengths [mm]."""
    return spread(MILLIMETER * values, at, count)


def outputs(**units: str) -> Callable[[Callable[..., Any]], Callable[..., Any]]:
    """Declare the outputs of an analysis."""

    def mark(function: Callable[..., Any]) -> Callable[..., Any]:
        function.outputs = units  # type: ignore[attr-defined]
        return function

    return mark


@outputs(
    lead="m",
    lead_deviation="m",
    repeat_deviation_min="m",
    repeat_deviation_max="m",
    speed_maximum="Hz",
    programmed="Hz",
    actual="Hz",
    distance="m",
)
def steppers(number: Values, steps: Values, rate: Values, z: Values) -> dict[str, Any]:
    """Fig. 5: travel per revolution, and the speed between a quarter and three quarters of it."""
    at = ends(number)
    time = CameraTracker.period * np.arange(len(number))  # recorded at every frame
    position = z[at] / MILLIMETER
    distance = np.diff(position, prepend=z[0] / MILLIMETER)
    moved = np.diff(steps[at], prepend=0.0)
    fit = calibrate.fit_steppers({"steps": moved, "distance_mm": distance})["lead"]
    begins = np.concatenate(([0], at[:-1]))
    actual = np.array(
        [
            steps_per_second(time[a : b + 1], z[a : b + 1] / MILLIMETER, fit.coefficients[0])
            for a, b in zip(begins, at, strict=True)
        ]
    )
    deviations = [np.std(np.abs(distance[rate[at] == level]), ddof=1) for level in np.unique(rate[at])]
    return {
        "lead": MILLIMETER * fit.coefficients[0],
        "lead_deviation": MILLIMETER * fit.residual,
        "repeat_deviation_min": MILLIMETER * min(deviations),
        "repeat_deviation_max": MILLIMETER * max(deviations),
        "speed_maximum": float(actual[rate[at] == rate[at].max()].mean()),
        "programmed": spread(rate[at], at, len(number)),
        "actual": spread(actual, at, len(number)),
        "distance": lengths(np.abs(distance), at, len(number)),
    }


steppers.row_interval = CameraTracker.period  # type: ignore[attr-defined]


def steps_per_second(time: Values, z: Values, lead: float) -> float:
    """Speed in the middle half of a move, from frames between which the slide moved evenly."""
    part = (z - z[0]) / (z[-1] - z[0])
    rising = np.maximum.accumulate(part)
    rising += 1e-9 * np.arange(len(part))
    first, last = np.interp((0.25, 0.75), rising, time)
    return float(0.5 * abs(z[-1] - z[0]) / lead * STEPS_PER_REVOLUTION / (last - first))


@outputs(
    slope_reversal="",
    slope_same="",
    offset="m",
    r2_reversal="",
    r2_same="",
    residual_reversal="m",
    residual_same="m",
    way="m",
    reversal="m",
    reversal_fit="m",
    same="m",
    same_fit="m",
    rate="Hz",
    difference="m",
)
def linear(number: Values, steps: Values, rate: Values, z: Values) -> dict[str, Any]:
    """Fig. 6: tip travel minus handle travel, over the handle travel and over its speed."""
    at = ends(number)
    table = {"handle_mm": slide(steps[at]), "tip_mm": z[at] / MILLIMETER}
    fits = calibrate.fit_linear(table)
    change, same = fits["reversal"], fits["same_direction"]
    distance = np.abs(np.diff(table["handle_mm"], prepend=0.0))
    difference = np.abs(np.diff(table["tip_mm"], prepend=0.0)) - distance
    count = len(number)
    return {
        "slope_reversal": change.coefficients[0],
        "offset": MILLIMETER * change.coefficients[1],
        "slope_same": same.coefficients[0],
        "r2_reversal": change.r_squared,
        "r2_same": same.r_squared,
        "residual_reversal": MILLIMETER * change.residual,
        "residual_same": MILLIMETER * same.residual,
        "way": lengths(distance, at, count),
        "reversal": spread(-MILLIMETER * difference[change.used], at[change.used], count),
        "reversal_fit": lengths(change.predicted, at[change.used], count),
        "same": lengths(difference[same.used], at[same.used], count),
        "same_fit": lengths(same.predicted, at[same.used], count),
        "rate": spread(rate[at], at, count),
        "difference": lengths(difference, at, count),
    }


@outputs(
    y3="",
    y2="",
    y1="",
    z3="",
    z2="",
    z1="",
    z0="",
    r2_y="",
    r2_z="",
    residual_y="m",
    residual_z="m",
    dead_band="m",
    distance_y="m",
    distance_z="m",
    pull="m",
    y="m",
    z="m",
    y_fit="m",
    z_fit="m",
)
def deflection(number: Values, steps: Values, y: Values, z: Values) -> dict[str, Any]:
    """Fig. 7: tip over the pull. `distance`: largest difference of the fitted and the paper's curve, 2 to 9 mm."""
    at = ends(number)
    table = {"pull_mm": slide(steps[at]), "y_mm": y[at] / MILLIMETER, "z_mm": z[at] / MILLIMETER}
    fits = calibrate.fit_deflection(table)
    bend_y, bend_z, count = fits["bend_y"], fits["bend_z"], len(number)
    a = np.linspace(2.0, 9.0, 71)
    distances = [
        float(np.max(np.abs(calibrate.polynomial(fit.coefficients, a) - calibrate.polynomial(paper, a))))
        for fit, paper in ((bend_y, injection.BEND_Y), (bend_z, injection.BEND_Z))
    ]
    rest = np.flatnonzero(table["pull_mm"] == 0.0)
    return {
        **{f"y{k}": bend_y.coefficients[k] for k in (1, 2, 3)},
        **{f"z{k}": bend_z.coefficients[k] for k in range(4)},
        "r2_y": bend_y.r_squared,
        "r2_z": bend_z.r_squared,
        "residual_y": MILLIMETER * bend_y.residual,
        "residual_z": MILLIMETER * bend_z.residual,
        "dead_band": MILLIMETER * fits["dead_band"].coefficients[0],
        "distance_y": MILLIMETER * distances[0],
        "distance_z": MILLIMETER * distances[1],
        "pull": lengths(table["pull_mm"], at, count),
        "y": spread(y[at] - y[at][rest].mean(), at, count),
        "z": spread(z[at][rest].mean() - z[at], at, count),
        "y_fit": lengths(bend_y.predicted, at[bend_y.used], count),
        "z_fit": lengths(bend_z.predicted, at[bend_z.used], count),
    }


@outputs(
    r2_compression="",
    r2_tension="",
    residual_compression="m",
    residual_tension="m",
    distance_compression="m",
    distance_tension="m",
    advance="m",
    compression="m",
    compression_fit="m",
    tension="m",
    tension_fit="m",
)
def coupling(number: Values, wire: Values, handle: Values, y: Values, z: Values) -> dict[str, Any]:
    """Fig. 8, with the paper's eqs. (2), (4), (5). `distance`: RMS of the fitted less the paper's surface."""
    at = ends(number)
    pull = slide(wire[at])
    table = {"pull_mm": pull, "handle_mm": slide(handle[at]), "y_mm": y[at] / MILLIMETER, "z_mm": z[at] / MILLIMETER}
    bends = {
        name: calibrate.Fit(c, 1.0, 0.0, at, y[at], y[at], (0.0,) * len(c), len(at), float(np.ptp(y[at])))
        for name, c in (
            ("bend_y", injection.BEND_Y),
            ("bend_z", injection.BEND_Z),
            ("dead_band", (injection.DEAD_BAND,)),
        )
    }
    fits = calibrate.fit_coupling(table, bends, injection.REVERSAL_OFFSET)
    advance = np.clip(table["z_mm"] + calibrate.polynomial(injection.BEND_Z, pull), 0.0, injection.COUPLING_TRAVEL)
    shift = table["y_mm"] - calibrate.polynomial(injection.BEND_Y, pull)
    count = len(number)
    result: dict[str, Any] = {"advance": lengths(advance, at, count)}
    for name, degree, paper in (("compression", 5, injection.COMPRESSION), ("tension", 3, injection.TENSION)):
        fit = fits[name]
        terms = calibrate.two_variables(degree, pull[fit.used], advance[fit.used])
        difference = fit.predicted - np.column_stack(terms) @ np.array(paper)
        result |= {
            f"r2_{name}": fit.r_squared,
            f"residual_{name}": MILLIMETER * fit.residual,
            f"distance_{name}": MILLIMETER * float(np.sqrt(np.mean(difference**2))),
            name: lengths(shift[fit.used], at[fit.used], count),
            f"{name}_fit": lengths(fit.predicted, at[fit.used], count),
        }
    return result


@outputs(
    slope="",
    offset="m",
    per_pull="",
    r2_forward="",
    r2_per_pull="",
    r2_retraction="",
    residual_forward="m",
    residual_per_pull="m",
    residual_retraction="m",
    distance_retraction="m",
    slide="m",
    forward="m",
    forward_fit="m",
    pull="m",
    added="m",
    added_fit="m",
    decrease="m",
    back="m",
    back_fit="m",
)
def needle(number: Values, wire: Values, steps: Values, length: Values) -> dict[str, Any]:
    """Fig. 9: needle extension, effect of a pull, and retraction. `distance`: RMS of the fit minus eq. (9)."""
    at = ends(number)
    pull, slide_position, out = slide(wire[at]), slide(steps[at]), length[at] / MILLIMETER
    fits = calibrate.fit_needle({"pull_mm": pull, "needle_mm": slide_position, "length_mm": out})
    forward, per_pull, back = fits["forward"], fits["per_pull"], fits["retraction"]
    line = calibrate.polynomial((forward.coefficients[1], forward.coefficients[0]), slide_position)
    turn = forward.coefficients[1] + forward.coefficients[0] * fits["turn"].coefficients[0]
    shorter = turn + per_pull.coefficients[0] * pull - out
    terms = calibrate.two_variables(2, shorter[back.used], pull[back.used])
    difference = back.predicted - np.column_stack(terms) @ np.array(injection.RETRACTION)
    count = len(number)
    return {
        "slope": forward.coefficients[0],
        "offset": MILLIMETER * forward.coefficients[1],
        "per_pull": per_pull.coefficients[0],
        "r2_forward": forward.r_squared,
        "r2_per_pull": per_pull.r_squared,
        "r2_retraction": back.r_squared,
        "residual_forward": MILLIMETER * forward.residual,
        "residual_per_pull": MILLIMETER * per_pull.residual,
        "residual_retraction": MILLIMETER * back.residual,
        "distance_retraction": MILLIMETER * float(np.sqrt(np.mean(difference**2))),
        "slide": lengths(slide_position, at, count),
        "pull": lengths(pull, at, count),
        "forward": lengths(out[forward.used], at[forward.used], count),
        "forward_fit": lengths(forward.predicted, at[forward.used], count),
        "added": lengths((out - line)[per_pull.used], at[per_pull.used], count),
        "added_fit": lengths(per_pull.predicted, at[per_pull.used], count),
        "decrease": lengths(shorter[back.used], at[back.used], count),
        "back": lengths(slide_position[back.used], at[back.used], count),
        "back_fit": lengths(back.predicted, at[back.used], count),
    }
