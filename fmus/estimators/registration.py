"""The rotation between two sets of points, in a form that compiles. Arrays come from the component that calls."""

from __future__ import annotations

from typing import Any

from fmus.dense import eigenvectors


def rotate_onto(moment: Any, horn: Any, vectors: Any, rotation: Any) -> None:
    """The rotation that the singular value decomposition of `moment` gives, as a quaternion: it cannot be a reflection.

    Horn, J. Opt. Soc. Am. A 4(4), 1987: eigenvector of the largest eigenvalue of a symmetric 4x4 matrix.
    """
    horn[0, 0] = moment[0, 0] + moment[1, 1] + moment[2, 2]
    horn[1, 1] = moment[0, 0] - moment[1, 1] - moment[2, 2]
    horn[2, 2] = moment[1, 1] - moment[0, 0] - moment[2, 2]
    horn[3, 3] = moment[2, 2] - moment[0, 0] - moment[1, 1]
    horn[0, 1] = moment[1, 2] - moment[2, 1]
    horn[0, 2] = moment[2, 0] - moment[0, 2]
    horn[0, 3] = moment[0, 1] - moment[1, 0]
    horn[1, 2] = moment[0, 1] + moment[1, 0]
    horn[1, 3] = moment[2, 0] + moment[0, 2]
    horn[2, 3] = moment[1, 2] + moment[2, 1]
    for i in range(4):
        for j in range(i):
            horn[i, j] = horn[j, i]
    eigenvectors(horn, vectors, 4)
    top = 0
    for i in range(1, 4):
        if horn[i, i] > horn[top, top]:
            top = i
    w, x, y, z = vectors[0, top], vectors[1, top], vectors[2, top], vectors[3, top]
    rotation[0, 0] = w * w + x * x - y * y - z * z
    rotation[1, 1] = w * w - x * x + y * y - z * z
    rotation[2, 2] = w * w - x * x - y * y + z * z
    rotation[0, 1] = 2.0 * (x * y - w * z)
    rotation[1, 0] = 2.0 * (x * y + w * z)
    rotation[0, 2] = 2.0 * (x * z + w * y)
    rotation[2, 0] = 2.0 * (x * z - w * y)
    rotation[1, 2] = 2.0 * (y * z - w * x)
    rotation[2, 1] = 2.0 * (y * z + w * x)
