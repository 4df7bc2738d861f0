"""Fits of a set's parameters to its data, and the correction of offset or slack with the first third of a run."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from twin.errors import SimulationError
from twin.identify import (
    IdentifyKeys,
    Output,
    Problem,
    Residuals,
    Unknown,
    estimate_uncertainty,
    multistart_search,
)
from twin.scenario import number

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping, Sequence

    from twin.arrays import Array
    from twin.validation.data import Data
    from twin.validation.model import ValidationSet

    Progress = Callable[[str, float, str], object]

THIRD = 1 / 3  # part of a run with which offset or slack may be corrected
CORRECTION_SEARCHES = 3  # starts of that search: frozen values, and the middle of each half of the bounds


@dataclass(frozen=True)
class SetProblem(Problem):
    """A problem whose outputs are columns of a set's data."""

    columns: tuple[Output, ...] = ()

    @property
    def outputs(self) -> tuple[Output, ...]:
        """What is compared."""
        return self.columns


class SetPredictor:
    """Predictions of a set for a search: rows in `rows` of the data are compared; `fixed`: parameters that stay."""

    def __init__(
        self, own: ValidationSet, data: Data, unknowns: Sequence[Unknown], rows: Array, fixed: Mapping[str, float]
    ) -> None:
        columns = []
        for i, (column, keys) in enumerate(own.keys.outputs.items()):
            symbol = own.units[keys.signal]
            noise = None if keys.noise is None else number(keys.noise, symbol, column, is_difference=True)
            values = data.measured[rows, i]
            columns.append(Output(column, "", keys.signal, symbol, "", data.time[rows], values, 0.0, 0.0, noise=noise))
        self.problem: Problem = SetProblem(
            Path(), IdentifyKeys.model_validate({}), (), tuple(unknowns), columns=tuple(columns)
        )
        self.refused, self.compared, self.used, self.count = "", False, False, 0
        self.derivatives = "differences"
        self._own, self._data, self._rows, self._fixed = own, data, rows, fixed

    def predicted(self, positions: Array) -> list[Array]:
        """Predict the measurements of each output; SimulationError if this fails."""
        self.count += 1
        return list(self._own.predict(self._data, self._fixed, self.problem.values(positions))[self._rows].T)

    def slopes(self, _positions: Array) -> None:
        """There are no directional derivatives along a roll-out."""
        return


def fit(
    own: ValidationSet, data: Data, rows: Array, *, starts: int, seed: int, progress: Progress
) -> dict[str, dict[str, Any]]:
    """Fit the set's parameters to some rows of its data; return value, unit and interval (95 %) by name, in the variables' units."""
    unknowns = own.unknowns("fit")
    if not unknowns:
        return {}
    predictor = SetPredictor(own, data, unknowns, fitted_rows(own, data, rows), {})
    best = multistart_search(predictor, starts, seed, progress)
    knowledge = estimate_uncertainty(predictor, best, "jacobian", seed, lambda *_: None)
    ends = np.clip([knowledge.low, knowledge.high], 0.0, 1.0).T
    return {
        unknown.name: {
            "value": unknown.value(float(position)),
            "unit": unknown.unit,
            "interval": [unknown.value(float(end)) for end in interval],
        }
        for unknown, position, interval in zip(unknowns, best.positions, ends, strict=True)
    }


def refit(own: ValidationSet, data: Data, rows: Array, begin: Mapping[str, float]) -> dict[str, float]:
    """Fit to some rows with one search that begins at given values, as for a fold of a cross-validation."""
    unknowns = own.unknowns("fit")
    if not unknowns:
        return {}
    predictor = SetPredictor(own, data, unknowns, fitted_rows(own, data, rows), {})
    position = predictor.problem.positions(begin)
    return predictor.problem.values(weighted_residuals(predictor, position).search(position)[0])


def fitted_rows(own: ValidationSet, data: Data, rows: Array) -> Array:
    """Rows that count in a fit: all, or with `equal_files` as many of each file as the shortest has, evenly spaced.

    Errors within a run hang together, so that a long run is no more evidence than a short one.
    """
    if not own.keys.equal_files:
        return rows
    files = [np.flatnonzero(rows & (data.file_index == k)) for k in np.unique(data.file_index[rows])]
    count = min(len(each) for each in files)
    mask = np.zeros(len(rows), bool)
    for each in files:
        mask[each[np.linspace(0, len(each) - 1, count).astype(int)]] = True
    return mask


def weighted_residuals(predictor: SetPredictor, position: Array) -> Residuals:
    """Residuals weighted by the noise that they have at a position."""
    predicted = predictor.predicted(position)
    sigmas = [
        output.noise or float(np.sqrt(np.mean((y - output.values) ** 2))) or 1.0
        for output, y in zip(predictor.problem.outputs, predicted, strict=True)
    ]
    return Residuals(predictor, sigmas)


def first_third(data: Data) -> Array:
    """Rows of the first third of each file."""
    rows = np.zeros(len(data.time), bool)
    for number_of_file in range(len(data.files)):
        own = np.flatnonzero(data.file_index == number_of_file)
        rows[own[: max(1, int(len(own) * THIRD))]] = True
    return rows


def correction(own: ValidationSet, data: Data, values: Mapping[str, float]) -> dict[str, float]:
    """Values of the parameters in `rezero`, fitted to the first third of a run; nothing if there are none."""
    unknowns = own.unknowns("rezero")
    if not unknowns:
        return {}
    begin = {
        unknown.name: float(np.clip(values.get(unknown.name, unknown.start), unknown.low, unknown.high))
        for unknown in unknowns
    }
    predictor = SetPredictor(own, data, unknowns, first_third(data), values)
    positions = [predictor.problem.positions(begin)]
    residuals = weighted_residuals(predictor, positions[0])
    positions += [np.full(len(unknowns), share) for share in (0.25, 0.75)][: CORRECTION_SEARCHES - 1]
    ends = [residuals.search(position) for position in positions]
    return predictor.problem.values(min(ends, key=lambda end: end[1])[0])


def rezeroed(own: ValidationSet, data: Data, values: Mapping[str, float]) -> tuple[Array, dict[str, float]]:
    """Predict a run whose offset or slack is corrected with its first third; also the corrected values.

    Without parameters in `rezero`, the mean error of the first third is taken off each output.
    """
    corrected = correction(own, data, values)
    try:
        predicted = own.predict(data, values, corrected)
    except SimulationError:
        predicted, corrected = own.predict(data, values), {}
    if corrected:
        return predicted, corrected
    rows = first_third(data)
    return predicted - np.mean(predicted[rows] - data.measured[rows], axis=0), {}
