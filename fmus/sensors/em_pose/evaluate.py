"""Evaluation of tracked poses as in the paper: average of 16 samples, then the sum of the motion between samples.

Al-Ahmad et al. (RACS), sections III.C and III.D. Two things to know about the numbers that come out:
- the average is late by 7.5 samples (187.5 ms): against an unfiltered reference that is an error of 13.5 deg at 72 deg/s and
  of 7.5 mm at 40 mm/s, while something moves;
- a sum of distances cannot fall: noise of standard deviation s per axis adds about s^2 / 128 over the true distance to each
  sample (2.6 mm in 500 at 5 mm/s and 0.1 mm), and at rest it grows on (0.6 mm/s). A sum of signed angles has no bias.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

RATE = 40.0  # samples of the tracker [Hz]
WINDOW = 16  # samples of the average, 400 ms at 40 Hz
STANDING = 20e-6  # less motion than this is rest: two increments of the motors' Hall sensors [m]
SETTLED = 8  # further samples for which the reference must have rested, so that nothing of the motion is averaged
STILL = np.radians(
    0.5
)  # reference moves less than this: it rests; a drive at rest corrects itself by some 0.1 deg [rad]


def averaged(samples: NDArray[np.float64], window: int = WINDOW) -> NDArray[np.float64]:
    """Mean of the last `window` samples along the first axis; at the beginning of those that there are."""
    total = np.cumsum(samples, axis=0)
    total[window:] = total[window:] - total[:-window]
    count = np.minimum(np.arange(1, len(samples) + 1), window)
    return total / count.reshape(-1, *([1] * (samples.ndim - 1)))


def travelled_distance(positions: NDArray[np.float64]) -> NDArray[np.float64]:
    """Cumulative distance [m] of positions (samples, 3) [m]."""
    moves = np.linalg.norm(np.diff(averaged(positions), axis=0), axis=1)
    return np.concatenate(((0.0,), np.cumsum(moves)))


def travelled_angle(angles: NDArray[np.float64]) -> NDArray[np.float64]:
    """Unwrapped cumulative angle [rad] of roll angles; less than half a turn between samples."""
    changes = np.diff(angles)
    turns = np.concatenate(((0.0,), np.cumsum(changes - 2.0 * np.pi * np.round(changes / (2.0 * np.pi)))))
    filtered = averaged(turns)
    return filtered - filtered[0]


def resting(reference: NDArray[np.float64]) -> NDArray[np.bool_]:
    """Samples at which the reference has moved once and rests for long enough that the average has settled."""
    count = WINDOW + SETTLED
    spread = np.full(len(reference), np.inf)
    if len(reference) >= count:
        windows = np.lib.stride_tricks.sliding_window_view(reference, count)
        spread[count - 1 :] = np.ptp(windows, axis=1)
    moved = np.maximum.accumulate(np.abs(reference - reference[0])) > STILL
    return np.asarray((spread < STILL) & moved)


def loop_width(reference: NDArray[np.float64], tip: NDArray[np.float64]) -> float:
    """Mean width of the loop of tip over reference [rad], along the reference, in the middle half of the range."""
    low, high = np.quantile(reference, (0.0, 1.0))
    middle = np.abs(reference - 0.5 * (low + high)) < 0.25 * (high - low)
    change = np.gradient(reference)
    speed = np.max(np.abs(change))
    forth, back = middle & (change > 0.3 * speed), middle & (change < -0.3 * speed)
    if not forth.any() or not back.any():
        return float("nan")
    return float(np.mean((reference - tip)[forth]) - np.mean((reference - tip)[back]))


def rotation(angle: NDArray[np.float64], reference: NDArray[np.float64]) -> dict[str, float | NDArray[np.float64]]:
    """Rotation of section III.D, for a scenario: `error` while at rest, and loops against both readings of the reference."""
    start = reference - reference[0]
    tip = travelled_angle(angle)
    aligned = averaged(start)
    rest = resting(start)
    at_rest = np.where(rest, start - tip, 0.0)
    return {
        "angle": tip,
        "reference": start,
        "aligned_reference": aligned,
        "error": start - tip,
        "aligned_error": aligned - tip,
        "rest_error": float(np.mean(np.abs(at_rest[rest]))) if rest.any() else float("nan"),
        "rest_error_max": float(np.max(np.abs(at_rest))) if rest.any() else float("nan"),
        "loop_width": loop_width(aligned, tip),
        "raw_loop_width": loop_width(start, tip),
    }


rotation.outputs = dict.fromkeys(  # type: ignore[attr-defined]
    (
        "angle",
        "reference",
        "aligned_reference",
        "error",
        "aligned_error",
        "rest_error",
        "rest_error_max",
        "loop_width",
        "raw_loop_width",
    ),
    "rad",
)


def strokes(reference: NDArray[np.float64]) -> list[slice]:
    """The ways out and back: from where the reference begins to move to where it ends, up to its farthest point and on."""
    away = np.abs(reference - reference[0])
    turn = int(np.argmax(away > away.max() - STANDING))
    slices = []
    for first, last in ((0, turn), (turn, len(reference) - 1)):
        moving = np.abs(reference - reference[first]) > STANDING
        rest = np.abs(reference - reference[last]) > STANDING
        begin = first + int(np.argmax(moving[first : last + 1]))
        end = last - int(np.argmax(rest[first : last + 1][::-1]))
        slices.append(slice(max(begin - 1, 0), end + 2))
    return slices


def distance(
    x: NDArray[np.float64], y: NDArray[np.float64], z: NDArray[np.float64], reference: NDArray[np.float64]
) -> dict[str, float | NDArray[np.float64]]:
    """Travel of section III.C, for a scenario: cumulative distance of the tip against that of the reference.

    Each way counts from its own beginning: what is summed up while the rig rests is noise. The paper tells that the tip is
    filtered, and nothing of the rig: `error` is against the rig as it is, `aligned_error` against the rig filtered alike.
    """
    positions = averaged(np.column_stack((x, y, z)))
    averaged_reference = averaged(reference)
    tip, wanted, aligned, speed = (np.full(len(reference), np.nan) for _ in range(4))
    largest, largest_aligned, lowest = [], [], []
    for stroke in strokes(reference):
        moves = np.linalg.norm(np.diff(positions[stroke], axis=0), axis=1)
        tip[stroke] = np.concatenate(((0.0,), np.cumsum(moves)))
        wanted[stroke] = np.abs(reference[stroke] - reference[stroke][0])
        aligned[stroke] = np.abs(averaged_reference[stroke] - averaged_reference[stroke][0])
        speed[stroke] = np.gradient(tip[stroke]) * RATE
        largest.append(float(np.max(np.abs(wanted[stroke] - tip[stroke]))))
        largest_aligned.append(float(np.max(np.abs(aligned[stroke] - tip[stroke]))))

        # steady motion: from where the tip has begun to follow to where the rig slows down, each with the average's length
        start = int(np.argmax(speed[stroke] > 0.8 * np.median(speed[stroke])))
        steady = speed[stroke][start + WINDOW : -2 * WINDOW]
        lowest.append(float(np.min(steady) / np.median(steady)) if len(steady) else float("nan"))
    return {
        "distance": tip,
        "reference": wanted,
        "speed": speed,
        "error": wanted - tip,
        "error_out": largest[0],
        "error_back": largest[1],
        "error_max": 0.5 * (largest[0] + largest[1]),
        "aligned_reference": aligned,
        "aligned_error": aligned - tip,
        "aligned_error_max": 0.5 * (largest_aligned[0] + largest_aligned[1]),
        "speed_lowest": min(lowest),
    }


distance.outputs = {  # type: ignore[attr-defined]
    **dict.fromkeys(
        (
            "distance",
            "reference",
            "error",
            "error_out",
            "error_back",
            "error_max",
            "aligned_reference",
            "aligned_error",
            "aligned_error_max",
        ),
        "m",
    ),
    "speed": "m/s",
    "speed_lowest": "",
}
rotation.row_interval = 1.0 / RATE  # type: ignore[attr-defined]
distance.row_interval = 1.0 / RATE  # type: ignore[attr-defined]
