"""Calibration of an injection catheter: readings from a bench to the parameters of `coordinate_feedforward`.

The forms are those of Cheng and Law (paper B), eqs. (1) to (9); all are fitted by linear least squares. Lengths in mm,
one reading per row, in the order in which they were taken: directions are told from it.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from fmus.injection import COUPLING_TRAVEL, DEAD_BAND, INCREMENT
from twin.errors import TwinError

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping

    from numpy.typing import NDArray

    Values = NDArray[np.float64]

# table -> column -> meaning; what `twin calibrate` reads
TABLES = {
    "steppers": {"steps": "steps sent for a move, with sign", "distance_mm": "measured way, with sign"},
    "linear": {"handle_mm": "handle's slide after each move", "tip_mm": "tip after each move"},
    "deflection": {
        "pull_mm": "pull wire's slide, rising",
        "y_mm": "tip across",
        "z_mm": "tip along, falls with the pull",
    },
    "coupling": {
        "pull_mm": "pull wire's slide",
        "handle_mm": "handle's slide, forth and back at each pull",
        "y_mm": "tip across",
        "z_mm": "tip along",
    },
    "needle": {
        "pull_mm": "pull wire's slide",
        "needle_mm": "needle's slide, out and in at each pull",
        "length_mm": "length of the needle",
    },
}

# largest value of a column on a rig like the paper's [mm]; pull and handle: its eqs. (4) and (6); needle: its Fig. 9
STROKES = {"handle_mm": COUPLING_TRAVEL, "tip_mm": COUPLING_TRAVEL, "pull_mm": 9.0, "needle_mm": 11.5}

# parameters that are not negative by the equations, and what a negative value would mean
NEGATIVE = {
    "slope": "the tip would move less than the handle",
    "reversal_offset": "after a reversal the tip would move more than the handle",
}

STILL = 0.15  # deflection [mm] that counts as none
CLEAR = 1.6  # a move is surely beyond the play if it is longer than the reversal's offset by this factor
OUTLIER = 4.0  # a move that is not used contradicts the fits from this multiple of their RMSE on
LEADS = 0.1, 100.0  # travel per revolution [mm] of lead screws that are in use
BEYOND = 1.25  # a reading is counted as beyond it, where few readings are left


@dataclass(frozen=True)
class Fit:
    """A fitted form: coefficients in the paper's order, how well they fit, and the readings that were used.

    `errors`: standard error of each coefficient, for independent errors of the readings. `span` [mm]: range of the
    motion that the form predicts. `noise` [mm]: standard deviation of repeated readings. NaN where the readings do not
    tell.
    """

    coefficients: tuple[float, ...]
    r_squared: float
    residual: float  # root mean square [mm]
    used: Values = field(repr=False)  # index of the readings
    predicted: Values = field(repr=False)  # at these readings
    measured: Values = field(repr=False)  # at these readings
    errors: tuple[float, ...]
    rows: int  # of the table
    span: float
    noise: float = float("nan")


class CalibrationError(TwinError):
    """Readings that do not determine the constants; a one-line message."""


def least_squares(terms: list[Values], values: Values, used: Values, what: str, motion: Values) -> Fit:
    """Coefficients of terms, each an array over the readings that are used. `motion`: all readings of what moves [mm]."""
    matrix = np.column_stack(terms)
    scale = np.abs(matrix).max(axis=0) if len(matrix) else np.ones(matrix.shape[1])
    if len(matrix) <= matrix.shape[1] or np.linalg.matrix_rank(matrix / np.where(scale > 0, scale, 1.0)) < len(terms):
        raise CalibrationError(
            f"{what}: {len(matrix)} usable readings do not determine {len(terms)} coefficients. Take more, at more places."
        )
    solution = np.linalg.lstsq(matrix / scale, values, rcond=None)[0] / scale
    predicted = matrix @ solution
    error = values - predicted
    spread = float(np.sum((values - values.mean()) ** 2))
    r_squared = 1.0 - float(np.sum(error**2)) / spread if spread > 0 else float("nan")
    variance = float(np.sum(error**2)) / (len(values) - len(terms))
    errors = np.sqrt(variance * np.diag(np.linalg.pinv((matrix / scale).T @ (matrix / scale)))) / scale
    return Fit(
        tuple(map(float, solution)),
        r_squared,
        float(np.sqrt(np.mean(error**2))),
        used,
        predicted,
        values,
        tuple(map(float, errors)),
        len(motion),
        float(np.ptp(motion)),
        repeat_deviation(matrix, values),
    )


def repeat_deviation(matrix: Values, values: Values) -> float:
    """Standard deviation of values with equal terms, pooled; NaN with fewer than 3 degrees of freedom."""
    _, group = np.unique(np.round(matrix, 6), axis=0, return_inverse=True)
    count = np.bincount(group.ravel())
    freedom = len(values) - len(count)
    if freedom < 3:
        return float("nan")
    means = np.bincount(group.ravel(), values) / count
    return float(np.sqrt(np.sum((values - means[group.ravel()]) ** 2) / freedom))


def two_variables(degree: int, a: Values, z: Values) -> list[Values]:
    """Terms 1, a, z, a^2, a z, z^2, ... of Table 1."""
    return [a ** (d - j) * z**j for d in range(degree + 1) for j in range(d + 1)]


def fit_steppers(table: Mapping[str, Values]) -> dict[str, Fit]:
    """Eq. (1): travel per revolution [mm], the mean over all moves as in the paper."""
    steps, distance = table["steps"], table["distance_mm"]
    used = np.flatnonzero(steps != 0)
    if len(used) < 2:
        raise CalibrationError(f"steppers: {len(used)} moves with steps. Take at least 2, in both directions.")
    per_revolution = distance[used] / steps[used] * 1600.0
    lead = float(np.mean(per_revolution))
    if not LEADS[0] <= lead <= LEADS[1]:
        raise CalibrationError(
            f"steppers: {lead:.3g} mm per revolution of 1600 steps, expected {LEADS[0]:g} to {LEADS[1]:g} mm. "
            "Check signs and units of steps and distance_mm."
        )
    deviation = float(np.std(per_revolution, ddof=1))
    predicted, error = steps[used] * lead / 1600.0, deviation / float(np.sqrt(len(used)))
    span = float(np.ptp(distance))
    return {"lead": Fit((lead,), float("nan"), deviation, used, predicted, distance[used], (error,), len(steps), span)}


def moves(table: Mapping[str, Values]) -> tuple[Any, Values, Values, Values]:
    """Rows of readings after a move of the handle, and of each move travel, direction, and tip travel minus travel."""
    rows = np.flatnonzero(np.diff(table["handle_mm"], prepend=np.nan) != 0.0)  # without readings that repeat the last
    handle, tip = (np.diff(table[column][rows]) for column in ("handle_mm", "tip_mm"))
    return rows, np.abs(handle), np.sign(handle), tip * np.sign(handle) - np.abs(handle)


def fit_linear(table: Mapping[str, Values]) -> dict[str, Fit]:
    """Fit eqs. (2) and (3): tip travel minus handle travel over the handle travel, after a reversal and without one.

    Only moves that leave the play behind count: a reversal shorter than it says nothing about the line, nor does the
    move after such a one.
    """
    rows, travel, direction, difference = moves(table)
    reversal = np.zeros(len(travel), bool)
    reversal[1:] = direction[1:] != direction[:-1]
    long = travel > 4.0
    offset = float(np.median(-difference[reversal & long])) if (reversal & long).any() else 0.0
    clear = travel > CLEAR * max(offset, 0.0)

    # before a move the play must have been used up
    ready = np.zeros(len(travel), bool)
    ready[1:] = clear[:-1]
    changed = np.flatnonzero(reversal & clear & ready)
    same = np.flatnonzero(~reversal & ready)
    motion = table["tip_mm"]
    undershoot = least_squares(
        [travel[changed], np.ones(len(changed))], -difference[changed], rows[changed + 1], "linear, reversals", motion
    )
    overshoot = least_squares([travel[same]], difference[same], rows[same + 1], "linear, same direction", motion)
    return {"reversal": undershoot, "same_direction": overshoot}


def fit_deflection(table: Mapping[str, Values]) -> dict[str, Fit]:
    """Eqs. (4) and (5), for pulls beyond the dead band; positions count from those without a pull."""
    pull = table["pull_mm"]
    rest = pull <= pull.min() + 1e-3 + 0.02 * np.ptp(pull)
    y = table["y_mm"] - table["y_mm"][rest].mean()
    z = table["z_mm"][rest].mean() - table["z_mm"]
    dead = float(pull[np.abs(y) <= STILL].max())
    if pull.min() > 0.5 * INCREMENT and not (np.abs(y[~rest]) <= STILL).any():
        raise CalibrationError(
            f"deflection: the tip moves from the first pull on, {pull.min():g} mm, so the wire was not slack. Begin at less."
        )
    if z[pull.argmax()] < -STILL:
        raise CalibrationError("deflection: z_mm rises with the pull, expected to fall. Give it the other sign.")
    used = np.flatnonzero(pull > dead + 0.5 * INCREMENT)
    a = pull[used]
    fit_y = least_squares([a, a**2, a**3], y[used], used, "deflection, y", y)
    fit_z = least_squares([np.ones(len(a)), a, a**2, a**3], z[used], used, "deflection, z", z)
    inside = np.flatnonzero(pull <= dead)
    band = Fit(
        (round(dead, 1),),
        float("nan"),
        float(np.std(y[np.abs(y) <= STILL])),
        inside,
        np.zeros(len(inside)),
        y[inside],
        (float("nan"),),
        len(y),
        float(np.ptp(y)),
    )
    padded = replace(fit_y, coefficients=(0.0, *fit_y.coefficients), errors=(0.0, *fit_y.errors))
    return {"bend_y": padded, "bend_z": fit_z, "dead_band": band}


def fit_coupling(table: Mapping[str, Values], bends: Mapping[str, Fit], offset: float) -> dict[str, Fit]:
    """Eq. (6): shift across over pull and advance, pushed and pulled, for deflections that were measured."""
    pull, handle = table["pull_mm"], table["handle_mm"]
    pushed, pulled = branches(handle, BEYOND * offset)
    dead = bends["dead_band"].coefficients[0]
    shift = table["y_mm"] - polynomial(bends["bend_y"].coefficients, pull)
    advance = np.clip(table["z_mm"] + polynomial(bends["bend_z"].coefficients, pull), 0.0, COUPLING_TRAVEL)
    deflected = pull > dead + 0.5 * INCREMENT
    result = {}
    for name, branch, degree in (("compression", pushed, 5), ("tension", pulled, 3)):
        used = np.flatnonzero(branch & deflected)
        terms = two_variables(degree, pull[used], advance[used])
        result[name] = least_squares(terms, shift[used], used, f"coupling, {name}", table["y_mm"])
    return result


def fit_needle(table: Mapping[str, Values]) -> dict[str, Fit]:
    """Fit eqs. (7), (8) and (9): straight needle extension, effect of a pull, and the slide for a retraction."""
    pull, slide, length = table["pull_mm"], table["needle_mm"], table["length_mm"]
    _, back = branches(slide, 0.0)
    out, _ = branches(slide, np.ptp(slide) / 3.0)  # the needle's play is well within a third of its stroke
    straight = np.flatnonzero(out & (pull <= pull.min() + DEAD_BAND * 0.5) & (length > 0))
    forward = least_squares(
        [slide[straight], np.ones(len(straight))], length[straight], straight, "needle, going out", length
    )
    bent = np.flatnonzero(out & (length > 0))
    added = length[bent] - polynomial((forward.coefficients[1], forward.coefficients[0]), slide[bent])
    per_pull = least_squares([pull[bent]], added, bent, "needle, with the pull", length)
    turn, stroke = float(slide.max()), float(np.ptp(slide))
    last = np.flatnonzero(slide == turn)
    longest = (
        polynomial((forward.coefficients[1], forward.coefficients[0]), np.array(turn)) + per_pull.coefficients[0] * pull
    )
    shorter = longest - length
    used = np.flatnonzero(back & (shorter > STILL) & (length > 0))
    terms = two_variables(2, shorter[used], pull[used])
    return {
        "forward": forward,
        "per_pull": per_pull,
        "retraction": least_squares(terms, slide[used], used, "needle, going in", slide),
        "turn": Fit((turn,), float("nan"), 0.0, last, slide[last], slide[last], (float("nan"),), len(slide), stroke),
    }


def branches(slide: Values, play: float) -> tuple[Any, Any]:
    """Readings that were reached by going up, and by going down, by more than a play from the last turn."""
    up, down = np.zeros(len(slide), bool), np.zeros(len(slide), bool)
    direction, turn = 1.0, slide[0] - 2.0 * play - 1.0  # a bench begins pushed in
    for k in range(len(slide)):
        change = slide[k] - slide[k - 1] if k else 0.0
        if change * direction < 0.0:
            direction, turn = -direction, slide[k - 1]
        # a reading without a move shows what another slide did inside of the play
        clear = abs(slide[k] - turn) > play and (change != 0.0 or k == 0)
        up[k], down[k] = clear and direction > 0.0, clear and direction < 0.0
    return up, down


def polynomial(c: tuple[float, ...], a: Values) -> Values:
    """c[0] + c[1] a + c[2] a^2 + ..."""
    return np.polynomial.polynomial.polyval(a, c)  # type: ignore[no-any-return]


FITS: dict[str, Callable[[Mapping[str, Values]], dict[str, Fit]]] = {
    "steppers": fit_steppers,
    "linear": fit_linear,
    "deflection": fit_deflection,
    "needle": fit_needle,
}


def calibrate(tables: Mapping[str, Mapping[str, Values]]) -> tuple[dict[str, Any], dict[str, Fit]]:
    """Parameters of `coordinate_feedforward` that the tables determine, and all fits."""
    fits: dict[str, Fit] = {}
    for name, function in FITS.items():
        if name in tables:
            fits |= function(tables[name])
    if "coupling" in tables:
        if "bend_y" not in fits or "reversal" not in fits:
            raise CalibrationError("coupling: needs the tables deflection and linear too. Give them.")
        fits |= fit_coupling(tables["coupling"], fits, fits["reversal"].coefficients[1])
    return parameters(fits), fits


def doubts(tables: Mapping[str, Mapping[str, Values]], fits: Mapping[str, Fit]) -> list[str]:
    """Return a sentence for each parameter of the wrong sign, and for moves outside of the fits that contradict them."""
    values = parameters(fits)
    texts = [
        f"{name}: {values[name]:.3g} is negative: {meaning}. Check columns and signs."
        for name, meaning in NEGATIVE.items()
        if values.get(name, 0.0) < 0.0
    ]
    if texts or "linear" not in tables:
        return texts
    linear = [fits["reversal"], fits["same_direction"]]
    rows, travel, _, difference = moves(tables["linear"])
    tolerance = max(OUTLIER * max(fit.residual for fit in linear), STILL)
    low, high = -np.minimum(values["reversal_offset"], travel), values["slope"] * travel
    outside = (difference < low - tolerance) | (difference > high + tolerance)
    outside &= ~np.isin(rows[1:], np.concatenate([fit.used for fit in linear]))
    lines = ", ".join(str(row + 1) for row in rows[1:][outside])
    return [f"linear: unused moves contradict the fits, those to row {lines}. Check them and the rows before."] * bool(
        lines
    )


def parameters(fits: Mapping[str, Fit]) -> dict[str, Any]:
    """Fitted values by the component's names and in its units."""
    result: dict[str, Any] = {}
    if "lead" in fits:
        result["lead"] = 1e-3 * fits["lead"].coefficients[0]
    if "reversal" in fits:
        # one slope for both, as the paper assumed
        slope = 0.5 * (fits["same_direction"].coefficients[0] - fits["reversal"].coefficients[0])
        result |= {"slope": slope, "reversal_offset": fits["reversal"].coefficients[1]}
    if "bend_y" in fits:
        result |= {name: list(fits[name].coefficients) for name in ("bend_y", "bend_z")}
        result["dead_band"] = fits["dead_band"].coefficients[0]
    if "compression" in fits:
        result |= {name: list(fits[name].coefficients) for name in ("compression", "tension")}
    if "forward" in fits:
        result["needle"] = [*fits["forward"].coefficients, *fits["per_pull"].coefficients]
        result["needle_back"] = list(fits["retraction"].coefficients)
        result["needle_turn"] = fits["turn"].coefficients[0]
    return result


def standard_errors(fits: Mapping[str, Fit]) -> dict[str, Any]:
    """Standard errors of `parameters`, by the same names and in the same units; NaN where the readings do not tell."""
    errors = parameters({name: replace(fit, coefficients=fit.errors) for name, fit in fits.items()})
    if "slope" in errors:  # mean of two independent slopes
        errors["slope"] = 0.5 * float(np.hypot(fits["same_direction"].errors[0], fits["reversal"].errors[0]))
    return errors
