"""The fastest growth in a system that is known by its answers alone: what it gives, step by step, after it was moved.

Juang and Pappa, An eigensystem realization algorithm, J. Guidance 8(5), 1985: answers in a Hankel matrix, its leading
singular vectors, between them the map of one step. What nothing that is moved reaches, or nothing shows, is not found.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Callable

    Array = np.ndarray[Any, Any]

DIRECTIONS = 24  # in which values are moved, at most
ROWS = 12  # of the Hankel matrix, in steps
NOISE = 1e-7  # singular values below this part of the largest are rounding and curvature
STRIDES = (1, 8)  # steps between two looks: what grows or fades slowly shows over a longer time
NEAR = 0.02  # distance of a growth from 1 within which it is looked at over a longer time


def answered(after: Callable[[int, int, Array], Array], size: int) -> tuple[complex, Array]:
    """The eigenvalue of largest size of the map of a step, and its vector; FloatingPointError if there are no numbers.

    `after(count, stride, direction)`: what becomes of a deviation every `stride` steps, `count` times, a row each.
    """
    if size <= DIRECTIONS:
        directions = np.eye(size)
    else:
        directions = np.linalg.qr(np.random.default_rng(1).standard_normal((size, DIRECTIONS)))[0].T
    value, vector = 0j, np.zeros(size)
    for stride in STRIDES:
        answers = np.stack(
            [after(2 * ROWS, stride, direction) for direction in directions], axis=2
        )  # step, value, direction
        if not np.isfinite(answers).all():
            raise FloatingPointError
        eigenvalue, vector = realized(answers)
        value = eigenvalue if stride == 1 else abs(eigenvalue) ** (1 / stride) + 0j
        if abs(abs(value) - 1.0) > NEAR:
            break
    return value, vector


def realized(answers: Array) -> tuple[complex, Array]:
    """The eigenvalue of largest size that explains how answers follow each other, and what it shows in the values."""
    if not answers.any():
        return 0j, np.zeros(answers.shape[1])
    hankel = np.block([[answers[i + j] for j in range(ROWS)] for i in range(ROWS)])
    later = np.block([[answers[i + j + 1] for j in range(ROWS)] for i in range(ROWS)])
    left, sizes, right = np.linalg.svd(hankel, full_matrices=False)
    rank = int((sizes > NOISE * sizes[0]).sum())
    left, right, root = left[:, :rank], right[:rank], np.sqrt(sizes[:rank])
    values, vectors = np.linalg.eig((left / root).T @ later @ (right.T / root))
    index = int(np.argmax(np.abs(values)))
    shown = (left * root)[: answers.shape[1]] @ vectors[:, index]
    return complex(values[index]), shown
