"""Two directions of sliding in one dry contact: force and torque share an ellipse of limits."""

from math import sqrt

ITERATIONS = 30  # of Newton's method; five are usual
CLOSE = 1e-14  # excess over the ellipse that is rounding


def multiplier(a: float, b: float, p: float, q: float) -> float:
    """Least m for which (a / (1 + m p))^2 + (b / (1 + m q))^2 <= 1, by Newton's method from a lower bound.

    `a`, `b`: loads over their limits without slip, not negative. `p`, `q`: how much each rigidity counts, positive.
    0 within the ellipse. The loads that are left, a / (1 + m p) and b / (1 + m q), are the nearest point in energy.
    """
    if a * a + b * b <= 1.0:
        return 0.0
    m = (sqrt(a * a + b * b) - 1.0) / max(p, q)
    if a > 1.0:
        m = max(m, (a - 1.0) / p)
    if b > 1.0:
        m = max(m, (b - 1.0) / q)
    for _ in range(ITERATIONS):
        along, about = a / (1.0 + m * p), b / (1.0 + m * q)
        excess = along * along + about * about - 1.0
        if excess <= CLOSE:
            break
        m += 0.5 * excess / (along * along * p / (1.0 + m * p) + about * about * q / (1.0 + m * q))
    return m
