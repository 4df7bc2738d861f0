"""Fastest growth of a system with hidden states, identified from its responses to perturbations.

Juang and Pappa, An eigensystem realization algorithm, J. Guidance 8(5), 1985: responses in a Hankel matrix, its leading
singular vectors, and the map of one step between them. Modes that are not controllable or not observable are not found.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Callable

    Array = np.ndarray[Any, Any]

DIRECTIONS = 24  # largest number of directions of perturbation
ROWS = 12  # of the Hankel matrix, in steps
NOISE = 1e-7  # singular values below, relative to the largest, are rounding and curvature
STRIDES = (1, 8)  # steps between two samples: the longer one resolves slow growth and decay
NEAR = 0.02  # distance of the growth from 1 within which the longer stride is used


def growth_of_responses(after: Callable[[int, int, Array], Array], size: int) -> tuple[complex, Array]:
    """Return the eigenvalue of largest modulus of the map of a step, and its vector; FloatingPointError if not finite.

    `after(count, stride, direction)`: response to a deviation every `stride` steps, `count` times, a row each.
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
        eigenvalue, vector = realize(answers)
        value = eigenvalue if stride == 1 else abs(eigenvalue) ** (1 / stride) + 0j
        if abs(abs(value) - 1.0) > NEAR:
            break
    return value, vector


def realize(answers: Array) -> tuple[complex, Array]:
    """Return the eigenvalue of largest modulus of the realization of responses, and its mode shape in the values."""
    if not answers.any():
        return 0j, np.zeros(answers.shape[1])
    hankel = np.block([[answers[i + j] for j in range(ROWS)] for i in range(ROWS)])
    later = np.block([[answers[i + j + 1] for j in range(ROWS)] for i in range(ROWS)])
    left, sizes, right = np.linalg.svd(hankel, full_matrices=False)
    rank = int((sizes > NOISE * sizes[0]).sum())
    left, right, root = left[:, :rank], right[:rank], np.sqrt(sizes[:rank])
    values, vectors = np.linalg.eig((left / root).T @ later @ (right.T / root))
    index = int(np.argmax(np.abs(values)))
    shape = (left * root)[: answers.shape[1]] @ vectors[:, index]
    return complex(values[index]), shape
