"""Planar geometry: lengths, crossings, distances, curves as polylines. Points are rows of (n, 2) arrays."""

from __future__ import annotations

import math
from itertools import pairwise
from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

ROWS = 256  # of a table of distances: it fits into the processor's cache


def polyline_length(points: NDArray[Any]) -> float:
    """Return the length of a polyline."""
    return float(np.hypot(*np.diff(points, axis=0).T).sum())


def normalize(vector: NDArray[Any]) -> NDArray[Any]:
    """Scale a vector to length 1; a zero vector is returned unchanged."""
    size = math.hypot(*vector)
    return vector / size if size else vector


def cross(a: NDArray[Any], b: NDArray[Any]) -> Any:
    """Return the z component of a x b."""
    return a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0]


def bezier(points: Sequence[Sequence[float]], tolerance: float, most: int) -> NDArray[Any]:
    """Approximate a quadratic or cubic Bezier curve by a polyline within `tolerance`, without its first point.

    Chords of n equal parts deviate by less than max |B''| / (8 n^2), and |B''| is bounded by the control points'
    second differences (Sederberg, Computer Aided Geometric Design, section 10.6). At most `most` points.
    """
    control = np.asarray(points, float)
    degree = len(control) - 1
    bend = degree * (degree - 1) * float(np.hypot(*np.diff(control, 2, axis=0).T).max())
    count = min(max(math.ceil(math.sqrt(bend / (8.0 * tolerance))), 1), most)
    s = np.linspace(0.0, 1.0, count + 1)[1:, None]
    # De Casteljau's algorithm: sums and products only, since the last bit of NumPy's power depends on the processor.
    levels = [np.broadcast_to(point, (count, control.shape[1])) for point in control]
    while len(levels) > 1:
        levels = [(1.0 - s) * a + s * b for a, b in pairwise(levels)]
    return levels[0]


def intersects(a: NDArray[Any], b: NDArray[Any], c: NDArray[Any], d: NDArray[Any]) -> NDArray[Any]:
    """Return a mask of the segments c-d that a segment a-b crosses or touches."""
    first, second = b - a, d - c
    at_c, at_d = cross(first, c - a), cross(first, d - a)
    at_a, at_b = cross(second, a - c), cross(second, b - c)
    low, high = np.minimum(c, d), np.maximum(c, d)
    boxes = np.all((low <= np.maximum(a, b)) & (high >= np.minimum(a, b)), axis=-1)
    return np.asarray(boxes & (at_c * at_d <= 0.0) & (at_a * at_b <= 0.0))


def crossing_point(a: NDArray[Any], b: NDArray[Any], c: NDArray[Any], d: NDArray[Any]) -> NDArray[Any]:
    """Return the intersection of two segments that meet; a common point if they are parallel."""
    slope = float(cross(b - a, d - c))
    if slope:
        return np.asarray(a + (b - a) * (float(cross(c - a, d - c)) / slope))
    return next((point for point in (c, d) if np.all((point - a) * (point - b) <= 0.0)), a)


def self_crossing(outline: NDArray[Any]) -> NDArray[Any] | None:
    """Return the first point where a polyline crosses, touches or covers itself; its last point may be its first."""
    start, end = outline[:-1], outline[1:]
    closed = len(start) > 2 and bool(np.all(outline[0] == outline[-1]))
    step = end - start
    is_reversed = (cross(step[:-1], step[1:]) == 0.0) & (np.sum(step[:-1] * step[1:], axis=1) < 0.0)
    if is_reversed.any():
        return np.asarray(end[int(np.argmax(is_reversed))])
    for i in range(len(start) - 2):
        last = len(start) - (1 if closed and i == 0 else 0)
        crossings = intersects(start[i], end[i], start[i + 2 : last], end[i + 2 : last])
        if crossings.any():
            j = i + 2 + int(np.argmax(crossings))
            return crossing_point(start[i], end[i], start[j], end[j])
    return None


def distances_to_polyline(points: NDArray[Any], outline: NDArray[Any]) -> NDArray[Any]:
    """Return the distance of each point from a polyline."""
    start, step = outline[:-1], np.diff(outline, axis=0)
    square = np.sum(step**2, axis=1)
    distances = np.empty(len(points))
    for row in range(0, len(points), ROWS):
        offsets = points[row : row + ROWS, None] - start
        fraction = np.clip(np.sum(offsets * step, axis=2) / np.where(square > 0.0, square, 1.0), 0.0, 1.0)
        distances[row : row + ROWS] = np.hypot(*np.moveaxis(offsets - fraction[..., None] * step, 2, 0)).min(axis=1)
    return distances


def closest_approach(line: NDArray[Any], outline: NDArray[Any]) -> tuple[float, NDArray[Any]]:
    """Return the smallest distance of two polylines, 0 where they cross, and a point of closest approach."""
    for a, b in pairwise(line):
        crossings = intersects(a, b, outline[:-1], outline[1:])
        if crossings.any():
            j = int(np.argmax(crossings))
            return 0.0, crossing_point(a, b, outline[j], outline[j + 1])
    line_distances, outline_distances = distances_to_polyline(line, outline), distances_to_polyline(outline, line)
    if line_distances.min() <= outline_distances.min():
        return float(line_distances.min()), line[int(np.argmin(line_distances))]
    return float(outline_distances.min()), outline[int(np.argmin(outline_distances))]


def is_inside(point: NDArray[Any], outline: NDArray[Any]) -> bool:
    """Whether a point lies inside a closed polyline: an odd number of segments is to the right of the point."""
    a, b = outline[:-1], outline[1:]
    spans = (a[:, 1] > point[1]) != (b[:, 1] > point[1])
    rise = np.where(spans, b[:, 1] - a[:, 1], 1.0)
    x = a[:, 0] + (point[1] - a[:, 1]) / rise * (b[:, 0] - a[:, 0])
    return bool(np.sum(spans & (x > point[0])) % 2)
