"""Filters: estimates of states and parameters from points that a model has moved, and from measurements.

All filters ask for points at the begin of an interval (`spread`), get them back as the model has moved them with what the
model would have measured, and correct the estimate (`update`). Process noise enters at the begin of an interval.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np
from scipy.linalg.lapack import dgeqrf

Array = np.ndarray[Any, Any]

CENTER = 1.0  # kappa of the unscented transform: all weights are positive


@dataclass(frozen=True)
class Update:
    """Result of a measurement. `innovation`: measured minus `predicted`, `deviation` its standard deviation, each (m,).

    `nis`: normalized innovation squared, chi-square distributed with m degrees of freedom if the filter is consistent.
    `root`: lower square root of the covariance of the innovation, (m, m); `gain`: of the normalized innovation, (n, m).
    """

    predicted: Array
    innovation: Array
    deviation: Array
    nis: float
    root: Array
    gain: Array


class BoundedPoints:
    """Points of a filter, projected onto the bounds where the model needs them.

    `excess`: what the projection has taken away, (count, n). The statistics of the estimate count it, else the spread of an
    estimate at its bound would shrink to zero without any information, and the estimate could not leave the bound.
    """

    excess: Array | float = 0.0
    low: Array
    high: Array

    def project(self, points: Array) -> Array:
        """Return the points within the bounds, (count, n)."""
        projected = np.asarray(points.clip(self.low, self.high))
        self.excess = points - projected
        return projected


class SquareRootFilter(BoundedPoints):
    """Filter of a mean and a square root of its covariance. Estimate and points are projected onto the bounds.

    Joint deviations of measurement and state are triangularized by one QR decomposition, as in Arasaratnam and Haykin, IEEE
    Trans. Autom. Control 54(6), 2009: no covariance is subtracted, so that it stays positive.
    """

    shares_memory: ClassVar[bool] = True  # All other memory of a model is that of the central point.
    count: int  # number of points

    def __init__(self, mean: Array, deviation: Array, low: Array, high: Array) -> None:
        self.mean, self.low, self.high = mean.copy(), low, high
        self.root = np.diag(deviation)  # lower or any square root of the covariance

    @property
    def deviation(self) -> Array:
        """Standard deviations of the estimate, (n,)."""
        return np.asarray(np.sqrt((self.root**2).sum(axis=1)))

    @property
    def covariance(self) -> Array:
        """Covariance of the estimate, (n, n)."""
        return np.asarray(self.root @ self.root.T)

    def moved_root(self, noise: Array) -> Array:
        """Return a square root of the covariance with process noise of standard deviations `noise`, (n,)."""
        return triangle(with_noise(self.root.T, noise)) if noise.any() else self.root

    def draw(self, random: np.random.Generator, count: int) -> Array:
        """Return draws of the estimate, (count, n)."""
        draws = self.mean + random.standard_normal((count, self.root.shape[1])) @ self.root.T
        return np.asarray(np.clip(draws, self.low, self.high))

    def spread(self, noise: Array) -> Array:
        """Return the points, (count, n). `noise`: standard deviations of the process noise in the interval, (n,)."""
        raise NotImplementedError

    def center(self, points: Array) -> Array:
        """Return the mean of points of the filter, (k,) of (count, k)."""
        raise NotImplementedError

    def deviations(self, points: Array) -> Array:
        """Return weighted deviations of points from their mean, whose products are the covariance, (rows, k)."""
        raise NotImplementedError

    def past_deviations(self, points: Array) -> Array:
        """Return the part of the deviations of spread `points` that is not process noise, (rows, n); before the estimate is corrected.

        Their products with the deviations of moved points are the covariance of the estimate with the predicted one.
        """
        spread = self.deviations(points + self.excess)
        scale = np.linalg.norm(spread, axis=0)
        scale[scale == 0.0] = 1.0
        past = np.linalg.lstsq(
            (spread.T @ spread) / np.outer(scale, scale), self.covariance / scale[:, None], rcond=None
        )[0]
        return np.asarray((spread / scale) @ past)

    def update(self, points: Array, outputs: Array, measured: Array, noise: Array) -> Update:
        """Correct the estimate. `outputs`: of the model at its points, (count, m); `noise`: standard deviations, (m,)."""
        m, points = outputs.shape[1], points + self.excess
        mean, predicted = self.center(points), self.center(outputs)
        joint = np.hstack([self.deviations(outputs), self.deviations(points)])
        root = triangle(with_noise(joint, noise))
        innovation = measured - predicted
        normalized = substitute(root[:m, :m], innovation)
        self.mean = np.clip(mean + root[m:, :m] @ normalized, self.low, self.high)
        self.root = root[m:, m:]
        deviation = np.sqrt((root[:m, :m] ** 2).sum(axis=1))
        return Update(predicted, innovation, deviation, float(normalized @ normalized), root[:m, :m], root[m:, :m])


class Unscented(SquareRootFilter):
    """Square-root unscented Kalman filter with 2 n + 1 points and positive weights.

    Julier and Uhlmann, Proc. IEEE 92(3), 2004; bounds as in Kandepu, Foss and Imsland, J. Process Control 18, 2008.
    """

    def __init__(self, mean: Array, deviation: Array, low: Array, high: Array) -> None:
        super().__init__(mean, deviation, low, high)
        n = len(mean)
        self.count = 2 * n + 1
        self._weights = np.full(self.count, 0.5 / (n + CENTER))
        self._weights[0] = CENTER / (n + CENTER)

    def spread(self, noise: Array) -> Array:
        """Return the points, (2 n + 1, n)."""
        steps = np.sqrt(len(self.mean) + CENTER) * self.moved_root(noise).T
        return self.project(np.vstack([self.mean, self.mean + steps, self.mean - steps]))

    def center(self, points: Array) -> Array:
        """Return the weighted mean."""
        return np.asarray(self._weights @ points)

    def deviations(self, points: Array) -> Array:
        """Return deviations by the square roots of their weights, (2 n + 1, k)."""
        return np.asarray((points - self._weights @ points) * np.sqrt(self._weights)[:, None])


class Extended(SquareRootFilter):
    """Square-root extended Kalman filter: n + 1 points, the estimate and the estimate plus each column of the square root.

    The model moves the first point, and its tangents the differences to it (`tangents.TangentBatch`). Anderson and Moore,
    Optimal Filtering, 1979, chapter 8.
    """

    def __init__(self, mean: Array, deviation: Array, low: Array, high: Array) -> None:
        super().__init__(mean, deviation, low, high)
        self.count = len(mean) + 1

    def spread(self, noise: Array) -> Array:
        """Return the points, (n + 1, n); the directions of the tangents have no bounds."""
        return np.vstack([self.mean, self.mean + self.moved_root(noise).T])

    def center(self, points: Array) -> Array:
        """Return the first point."""
        return np.asarray(points[0])

    def deviations(self, points: Array) -> Array:
        """Return the differences to the first point, (n, k)."""
        return np.asarray(points[1:] - points[0])


class Ensemble(BoundedPoints):
    """Ensemble Kalman filter with perturbed measurements (Burgers, van Leeuwen and Evensen, Mon. Weather Rev. 126, 1998).

    Each point keeps all memory of its own model, so that hidden states such as stick or slip stay consistent.
    """

    shares_memory: ClassVar[bool] = False

    def __init__(self, mean: Array, deviation: Array, low: Array, high: Array, size: int, seed: int) -> None:
        self.low, self.high, self.count = low, high, size
        self._random = np.random.default_rng(seed)
        self.points = mean + deviation * self._random.standard_normal((size, len(mean)))
        self._past = self.points  # before the last process noise

    @property
    def mean(self) -> Array:
        """Estimate, (n,)."""
        return np.asarray(np.clip(self.points.mean(axis=0), self.low, self.high))  # rounding may cross a bound

    @property
    def deviation(self) -> Array:
        """Standard deviations of the estimate, (n,)."""
        return np.asarray(self.points.std(axis=0, ddof=1))

    @property
    def covariance(self) -> Array:
        """Covariance of the estimate, (n, n)."""
        return np.atleast_2d(np.cov(self.points.T))

    def spread(self, noise: Array) -> Array:
        """Return the points with process noise, (size, n)."""
        self._past = self.points
        self.points = self.points + noise * self._random.standard_normal(self.points.shape)
        return self.project(self.points)

    def center(self, points: Array) -> Array:
        """Return the mean of points, (k,) of (size, k)."""
        return np.asarray(points.mean(axis=0))

    def deviations(self, points: Array) -> Array:
        """Return deviations from the mean, whose products are the covariance, (size, k)."""
        return np.asarray((points - points.mean(axis=0)) / np.sqrt(self.count - 1))

    def past_deviations(self, points: Array) -> Array:  # noqa: ARG002 - the draws are known
        """Return the deviations before the process noise, (size, n)."""
        return self.deviations(self._past)

    def draw(self, random: np.random.Generator, count: int) -> Array:  # noqa: ARG002 - the points are draws
        """Return draws of the estimate, (count, n): the points, repeated where there are fewer."""
        return np.asarray(self.points[np.arange(count) % self.count].clip(self.low, self.high))

    def update(self, points: Array, outputs: Array, measured: Array, noise: Array) -> Update:
        """Correct the points; arguments as of `SquareRootFilter.update`."""
        points, predicted = points + self.excess, outputs.mean(axis=0)
        deviations, scale = outputs - predicted, self.count - 1
        covariance = deviations.T @ deviations / scale + np.diag(noise**2)
        cross = (points - points.mean(axis=0)).T @ deviations / scale
        innovation = measured - predicted
        perturbed = measured + noise * self._random.standard_normal(outputs.shape)
        corrected = points + np.linalg.solve(covariance, (perturbed - outputs).T).T @ cross.T
        mean = corrected.mean(axis=0)
        self.points = corrected + (mean.clip(self.low, self.high) - mean)
        root = np.linalg.cholesky(covariance)
        gain, normalized = substitute(root, cross.T).T, substitute(root, innovation)
        deviation = np.sqrt(np.diag(covariance))
        return Update(predicted, innovation, deviation, float(normalized @ normalized), root, gain)


def with_noise(deviations: Array, noise: Array) -> Array:
    """Return deviations, (rows, n), with a row below for each standard deviation of a noise, (m,), of the first m columns."""
    rows, m = len(deviations), len(noise)
    result = np.zeros((rows + m, deviations.shape[1]))
    result[:rows] = deviations
    np.fill_diagonal(result[rows:], noise)
    return result


def triangle(matrix: Array) -> Array:
    """Return the lower triangular L with L L' = A' A; A has at least as many rows as columns."""
    factors, *_ = dgeqrf(matrix, overwrite_a=False)  # a tenth of the time of numpy.linalg.qr for small matrices
    return np.tril(factors[: matrix.shape[1]].T)


def substitute(root: Array, values: Array) -> Array:
    """Return the solution of L x = b for few rows, and many columns of b: without the threads of a library."""
    result = np.empty_like(values)
    for i in range(len(root)):
        result[i] = (values[i] - root[i, :i] @ result[:i]) / root[i, i]
    return result
