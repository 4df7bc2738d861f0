"""Random numbers a component can draw: the same stream interpreted, compiled and in an FMU.

MRG32k3a, L'Ecuyer, Operations Research 47(1), 1999: two recursions modulo primes near 2^32, period 2^191. All
products stay below 2^53, so 64-bit integers never overflow. The state is an Int64 array of 6 in the component.
"""

from math import cos, log, pi, sqrt
from typing import Any

M1, M2 = 4294967087, 4294944443


def seed_stream(stream: Any, seed: int) -> None:
    """Fill a stream's state [6] from a seed; near seeds give unrelated streams (a multiplicative scramble)."""
    mixed = (int(seed) % 2147483647 + 2147483647) % 2147483647 + 1
    for i in range(6):
        for _ in range(8):
            mixed = (mixed * 48271 + 11 * i + 7) % 2147483647
        stream[i] = mixed + 1


def uniform(stream: Any) -> float:
    """Next number of the stream, uniform in (0, 1)."""
    p1 = (1403580 * stream[1] - 810728 * stream[0]) % M1
    stream[0] = stream[1]
    stream[1] = stream[2]
    stream[2] = p1
    p2 = (527612 * stream[5] - 1370589 * stream[3]) % M2
    stream[3] = stream[4]
    stream[4] = stream[5]
    stream[5] = p2
    return float(((p1 - p2) % M1 + 1) / 4294967088.0)


def normal(stream: Any) -> float:
    """Next number of the stream, normal with mean 0 and variance 1 (Box and Muller, one of the pair)."""
    first = uniform(stream)
    second = uniform(stream)
    return sqrt(-2.0 * log(first)) * cos(2.0 * pi * second)
