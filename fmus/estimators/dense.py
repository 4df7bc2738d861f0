"""Small dense kernels of fixed size that compile: Cholesky, a solver by it, eigenvectors of a symmetric matrix.

Arrays come from the component that calls; `n` is how much of them is used. Golub and Van Loan, Matrix Computations,
4.2 and 8.5.
"""

from __future__ import annotations

from math import sqrt
from typing import Any

SWEEPS = 8  # of Jacobi rotations: quadratic convergence, 4 are enough for 3x3
NOTHING = 1e-18  # part of the diagonal by which a rotation changes no digit of it


def cholesky(matrix: Any, lower: Any, n: int) -> bool:
    """Lower triangle L with L L' = matrix; False if that is not positive definite. Zeros above are written too."""
    for j in range(n):
        pivot = matrix[j, j]
        for k in range(j):
            pivot -= lower[j, k] * lower[j, k]
        if not pivot > 0.0:
            return False
        root = sqrt(pivot)
        lower[j, j] = root
        for i in range(j + 1, n):
            part = matrix[i, j]
            for k in range(j):
                part -= lower[i, k] * lower[j, k]
            lower[i, j] = part / root
            lower[j, i] = 0.0
    return True


def solve(lower: Any, x: Any, n: int) -> None:
    """Replace the right side in `x` by the solution of L L' x = right side."""
    for i in range(n):
        for k in range(i):
            x[i] -= lower[i, k] * x[k]
        x[i] /= lower[i, i]
    for j in range(n):
        i = n - 1 - j
        for k in range(i + 1, n):
            x[i] -= lower[k, i] * x[k]
        x[i] /= lower[i, i]


def eigenvectors(matrix: Any, vectors: Any, n: int) -> None:
    """Diagonalize a symmetric matrix in place by cyclic Jacobi rotations; column j belongs to matrix[j, j]."""
    for i in range(n):
        for j in range(n):
            vectors[i, j] = 1.0 if i == j else 0.0
    for _ in range(SWEEPS):
        for p in range(n - 1):
            for q in range(p + 1, n):
                if abs(matrix[p, q]) > NOTHING * (abs(matrix[p, p]) + abs(matrix[q, q])):
                    rotate(matrix, vectors, p, q, n)


def rotate(matrix: Any, vectors: Any, p: int, q: int, n: int) -> None:
    """One rotation that makes the elements p, q vanish."""
    half = 0.5 * (matrix[q, q] - matrix[p, p])
    size = sqrt(half * half + matrix[p, q] * matrix[p, q])
    tangent = matrix[p, q] / (half + size) if half >= 0.0 else matrix[p, q] / (half - size)
    c = 1.0 / sqrt(1.0 + tangent * tangent)
    s = tangent * c
    for k in range(n):
        first = matrix[k, p]
        second = matrix[k, q]
        matrix[k, p] = c * first - s * second
        matrix[k, q] = s * first + c * second
    for k in range(n):
        first = matrix[p, k]
        second = matrix[q, k]
        matrix[p, k] = c * first - s * second
        matrix[q, k] = s * first + c * second
    for k in range(n):
        first = vectors[k, p]
        second = vectors[k, q]
        vectors[k, p] = c * first - s * second
        vectors[k, q] = s * first + c * second
