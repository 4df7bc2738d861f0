"""Linear equations in memory at an address: LU factorization with partial pivoting, row by row."""

from __future__ import annotations

from twin.compiler import read64, read_float, write64, write_float


def factorize(matrix: int, pivots: int, n: int) -> int:
    """Factorize an n by n matrix in place; return 1 if it is singular, else 0."""
    for i in range(n):
        best = i
        for j in range(i + 1, n):
            if abs(read_float(matrix + 8 * (n * j + i))) > abs(read_float(matrix + 8 * (n * best + i))):
                best = j
        write64(pivots + 8 * i, best)
        if not (abs(read_float(matrix + 8 * (n * best + i))) > 1e-300):
            return 1
        if best != i:
            for k in range(n):
                here, there = matrix + 8 * (n * i + k), matrix + 8 * (n * best + k)
                swapped = read_float(here)
                write_float(here, read_float(there))
                write_float(there, swapped)
        pivot = read_float(matrix + 8 * (n * i + i))
        for j in range(i + 1, n):
            factor = read_float(matrix + 8 * (n * j + i)) / pivot
            write_float(matrix + 8 * (n * j + i), factor)
            for k in range(i + 1, n):
                entry = matrix + 8 * (n * j + k)
                write_float(entry, read_float(entry) - factor * read_float(matrix + 8 * (n * i + k)))
    return 0


def substitute(matrix: int, pivots: int, right: int, n: int) -> None:
    """Solve with the factors; the solution overwrites the right-hand side."""
    for i in range(n):
        best = read64(pivots + 8 * i)
        if best != i:
            swapped = read_float(right + 8 * i)
            write_float(right + 8 * i, read_float(right + 8 * best))
            write_float(right + 8 * best, swapped)
    for i in range(n):
        total = read_float(right + 8 * i)
        for k in range(i):
            total -= read_float(matrix + 8 * (n * i + k)) * read_float(right + 8 * k)
        write_float(right + 8 * i, total)
    for j in range(n):
        i = n - 1 - j
        total = read_float(right + 8 * i)
        for k in range(i + 1, n):
            total -= read_float(matrix + 8 * (n * i + k)) * read_float(right + 8 * k)
        write_float(right + 8 * i, total / read_float(matrix + 8 * (n * i + i)))
