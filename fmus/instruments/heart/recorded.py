"""A recorded motion of a heart wall, from CSV with units, to rate, amplitudes and phases of `heart` as a parameter set.

    python -m fmus.heart.recorded mine.csv > mine.yaml

Columns `time` and `position`, each with its unit, as in `time [s],position [mm]`. Seven harmonics of one rate and one sine
of respiration are fitted together, by least squares. Beats of unequal length blur the higher harmonics: the residual says
how much is not explained; ten to thirty beats at a steady rate do best.
"""

from __future__ import annotations

import csv
import re
import sys
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from fmus.heart.model import HARMONICS
from scipy.optimize import minimize

from twin.component import unit
from twin.errors import CouplingError

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Array = NDArray[np.float64]

UNITS = {"time": "s", "position": "m"}
COLUMN = re.compile(r"\s*(\w+)\s*\[\s*(.+?)\s*\]\s*")
RATES = (0.5, 3.5)  # where the beat is looked for [Hz]
BREATHS = (0.1, 0.45)  # where respiration is looked for [Hz]; below the slowest beat
BEATS = 5  # fewest in a recording
EXPLAINED = 0.5  # part of the motion's variance that a beat explains at least
SAME = 0.01  # part of the variance by which the multiple of a rate may be worse: half the rate always fits as well


def read(path: Path) -> tuple[Array, Array]:
    """Instants [s] from the first on and positions [m], checked."""
    if not path.is_file():
        raise ValueError(f"{path}: no such file. Expected a recording, .csv.")
    try:
        rows = [row for row in csv.reader(path.read_text(encoding="utf-8-sig").splitlines()) if any(row)]
    except (UnicodeDecodeError, csv.Error) as error:
        raise ValueError(f"{path}: {error}. Expected a text file, .csv.") from None
    columns = {}
    for index, text in enumerate(rows[0] if rows else []):
        matched = COLUMN.fullmatch(text)
        if matched and matched[1] in UNITS and matched[1] not in columns:
            try:
                columns[matched[1]] = (index, unit.conversion(matched[2], UNITS[matched[1]], "")[0])
            except CouplingError:
                raise ValueError(
                    f"{path}: `{text.strip()}` does not convert to {UNITS[matched[1]]}. Correct the unit."
                ) from None
    if set(columns) != set(UNITS):
        raise ValueError(f"{path}: expected two columns with units, `time [s]` and `position [mm]`, once each.")
    values = {}
    for name, (index, factor) in columns.items():
        try:
            values[name] = factor * np.array([float(row[index]) for row in rows[1:]])
        except (ValueError, IndexError):
            line = next(n for n, row in enumerate(rows[1:], 2) if not is_number(row, index))
            raise ValueError(
                f"{path}: row {line}: `{name}` is not a number. Correct it, or leave the row out."
            ) from None
    time, position = values["time"], values["position"]
    if not (np.isfinite(time).all() and np.isfinite(position).all() and (np.diff(time) > 0.0).all()):
        raise ValueError(f"{path}: times must rise, and all values be finite. Correct the file.")
    if len(time) < 3 or time[-1] - time[0] < BEATS / RATES[0]:
        raise ValueError(f"{path}: {len(time)} samples. Expected {BEATS / RATES[0]:g} s or more, for the slowest beat.")
    return time - time[0], position


def is_number(row: list[str], index: int) -> bool:
    """Whether a row has a number there."""
    try:
        float(row[index])
    except (ValueError, IndexError):
        return False
    return True


def fitted(time: Array, position: Array, rate: float, breath: float) -> tuple[Array, float]:
    """Coefficients of offset, breath and harmonics (sine, cosine each), and the variance that is left."""
    waves = [2.0 * np.pi * f * time for f in (breath, *(rate * np.arange(1, HARMONICS + 1)))]
    columns = [np.ones_like(time), *(part(wave) for wave in waves for part in (np.sin, np.cos))]
    matrix = np.stack(columns, axis=1)
    # normal equations: their size does not grow with the recording, and the search solves thousands
    coefficients = np.linalg.lstsq(matrix.T @ matrix, matrix.T @ position, rcond=None)[0]
    return coefficients, float(np.mean((position - matrix @ coefficients) ** 2))


def beat(time: Array, position: Array) -> tuple[float, float]:
    """Rates of beat and respiration [Hz]: of all that fit as well, the fastest beat; a slower one with its multiples fits too."""
    duration = time[-1]
    step = 0.5 / duration / HARMONICS  # the highest harmonic turns by half a turn
    rates = np.arange(RATES[0], RATES[1], step)
    slow = np.arange(BREATHS[0], BREATHS[1], 0.25 / duration)
    breath = float(slow[np.argmin([fitted(time, position, 0.5 * sum(RATES), f)[1] for f in slow])])
    left = np.array([fitted(time, position, rate, breath)[1] for rate in rates])
    allowed = left.min() + SAME * float(np.var(position))
    start = rates[np.flatnonzero(left <= allowed)[-1]]
    near = rates[np.abs(rates - start) < 2.0 / duration]
    start = near[np.argmin([fitted(time, position, rate, breath)[1] for rate in near])]
    optimum = minimize(lambda x: fitted(time, position, *x)[1], (start, breath), method="Nelder-Mead",
                     options={"initial_simplex": [(start, breath), (start + step, breath), (start, breath + 0.1 / duration)],
                              "xatol": 1e-6, "fatol": 1e-16})  # fmt: skip
    return float(optimum.x[0]), float(abs(optimum.x[1]))


def parameter_set(path: Path) -> str:
    """The parameters as YAML."""
    time, position = read(path)
    spacing = float(np.diff(time).max())
    rate, breath = beat(time, position)
    coefficients, left = fitted(time, position, rate, breath)
    variance = float(np.var(position))
    if not left < (1.0 - EXPLAINED) * variance:
        raise ValueError(
            f"{path}: no beat from {RATES[0]:g} to {RATES[1]:g} Hz explains half of it. Give one with steady beats."
        )
    if spacing > 0.5 / rate / HARMONICS:
        raise ValueError(
            f"{path}: samples {1e3 * spacing:.0f} ms apart do not show {HARMONICS} harmonics of {rate:.2f} Hz. "
            f"Give one every {500.0 / rate / HARMONICS:.0f} ms or more often."
        )
    sine, cosine = coefficients[1::2], coefficients[2::2]
    size, angle = np.hypot(sine, cosine), np.arctan2(cosine, sine) % (2.0 * np.pi)
    values = ", ".join(f"{1e3 * length:.5g} mm" for length in size[1:])
    angles = ", ".join(f"{component:.5g}" for component in angle[1:])
    return (
        f"# {path.name}: {rate * time[-1]:.1f} beats in {time[-1]:g} s; {1e3 * np.sqrt(left):.3g} mm rms of "
        f"{1e3 * np.sqrt(variance):.3g} mm are not explained\n"
        f"# respiration begins at 0 in `heart`; in the recording at {angle[0]:.3g} rad\n"
        "heart:\n"
        f"  rate: {rate:.6g} Hz\n"
        f"  amplitude: [{values}]\n"
        f"  phase: [{angles}]\n"
        f"  offset: {1e3 * coefficients[0]:.5g} mm\n"
        f"  respiration: {1e3 * size[0]:.5g} mm\n"
        f"  respiration_rate: {breath:.5g} Hz\n"
    )


if __name__ == "__main__":
    try:
        sys.stdout.write(parameter_set(Path(sys.argv[1])))
    except (ValueError, IndexError) as error:
        sys.exit(str(error) if len(sys.argv) > 1 else "recorded: no file named. Expected one .csv.")
