"""Calls, arrays, order and control: what C computes is what Python computes, to the bit."""

import numpy as np
import pytest
from hypothesis import assume, example, given, settings
from hypothesis import strategies as st

from tests.compiler.test_translate import FACTORS, ROWS, bits, both, same
from twin.component import Component, Int64, input, local, output, parameter


def turned(x, y):
    """Two results."""
    return -y, x


def limited(x, low=-1.0, high=1.0):
    """Early returns and default values."""
    if x < low:
        return low
    if x > high:
        return high
    return x


def sorted_two(a, b):
    """Results that are whole in one case and real in the other."""
    if a > b:
        return b, a
    return 0, 1


def chosen(x):
    """Several results of one of two functions, and a pair that changes its kinds."""
    pair = (1, x)
    if x > 1.0:
        pair = (x, 2)
    if x > 0.0:
        return turned(pair[0], pair[1])
    return sorted_two(1.0, x)


def applied(function, x):
    """A function as an argument."""
    return function(x, -0.25)


def rotated(values, count):
    """Change an array, and tell what went out."""
    first = values[0]
    for i in range(count - 1):
        values[i] = values[i + 1]
    values[count - 1] = first
    return first


def added(values, amount):
    """Change all elements through an alias."""
    same_array = values
    for i in range(len(values)):
        same_array[i] += amount


def scaled(c, x):
    """A table of a module, or an array of the component."""
    return c[0] + x * (c[1] + x * c[-1])


def counter(self):
    """An effect, and a result."""
    self.count += 1
    return self.count


def looped(self):
    """Loops that go down, skip, leave, run not at all, over tables, rows and arrays, and until something holds."""
    total = 0.0
    for i in range(10, self.n, -3):
        total += i
    for i in range(self.n):
        if i == 3:
            continue
        if i > 6:
            break
        total += 0.5 * i
    self.r[7] = total
    last = -1
    for last in range(self.n):  # noqa: B007
        pass
    self.r[8] = last
    for factor in FACTORS:
        total -= factor
    for left, middle, right in ROWS:
        total += left * middle - right
    for value in self.gains:
        total *= value
    self.r[9] = total
    rest, steps = self.n, 0
    while rest > 0 and steps < 50:
        rest = rest // 2 if rest % 2 == 0 else 3 * rest - 1 if rest < 5 else rest - 3
        steps += 1
    self.r[10] = steps


class Programs(Component):
    """Calls, effects, loops."""

    x = input("", "x")
    n = input("", "how often", type=Int64)
    k = input("", "an index that may count from the end", type=Int64)
    r = output("", "results", shape=(24,))
    count = local(0, "", "calls so far", type=Int64)
    line = local((1.0, 2.0, 3.0, 4.0), "", "values", shape=(4,))
    matrix = local(0.0, "", "rows", shape=(3, 2))
    gains = parameter((1.0, 2.0, 3.0), "", "gains", source="assumed")

    def initialize(self):
        self.count = 0
        for i in range(4):
            self.line[i] = i + 1.0
        for i in range(3):
            for j in range(2):
                self.matrix[i, j] = 10.0 * i + j

    def step(self, t, h):
        x = self.x
        a, b = turned(x, 2.0)
        a, b = b, a
        self.r[0], self.r[1] = a, b
        pair = turned(a, b)
        self.r[2] = pair[0] - pair[self.n % 2]
        self.r[3] = limited(x) + limited(x, high=0.5) + limited(x, -0.25, 0.25)
        # effects happen from left to right
        self.r[4] = self.count + counter(self) * 10 + self.count * 100 + counter(self) * 1000
        self.r[5] = rotated(self.line, 4) - 2.0 * rotated(self.line, 4)
        added(self.line, x)
        self.r[6] = self.line[self.k] + self.line[-1]
        looped(self)
        self.r[11] = scaled(FACTORS, x) - scaled(self.gains, x)
        if (x > 0.0 and counter(self) > 0) or counter(self) > 100:
            self.r[12] = self.count
        else:
            self.r[12] = -self.count
        if x < -1.0:
            z = 1
        elif counter(self) % 2 == 0:
            z = 2
        else:
            z = 2.5
        self.r[13] = z
        self.r[14] = counter(self) if x > 0.0 else -counter(self) * 0.5
        for i in range(3):
            row = self.matrix[i]
            row[1] += x
            self.matrix[i, 0] -= self.matrix[i, -1]
        self.r[15] = self.matrix[self.k % 3, 1] - self.matrix[2][0]
        while counter(self) % 5 != 0:
            self.r[16] = self.count
        self.r[17] = len(self.line) + self.matrix.shape[0] * self.gains.size
        self.r[18] = max(counter(self), counter(self)) - min(2, self.count)
        u = v = x * 2.0
        self.r[19] = u + v
        self.r[20], self.r[21] = chosen(x)
        self.r[22] = applied(limited, x) + applied(max, x)
        index = counter(self) % 3
        self.matrix[index, 1] //= 2.0
        self.r[23] = self.matrix[index, 1]


@pytest.mark.slow
@settings(deadline=None)
@given(x=st.floats(-10.0, 10.0), n=st.integers(0, 12), k=st.integers(-4, 3))
@example(x=1.0, n=0, k=-1)
def test_programs(build, x, n, k):
    same(Programs, build, x=x, n=n, k=k)


@pytest.mark.slow
@settings(deadline=None)
@given(x=st.floats(-10.0, 10.0), n=st.integers(0, 12))
def test_a_test_can_fail(build, x, n):
    """The comparison of this file notices what differs by a bit, and the sign of zero."""
    interpreted, native = both(Programs, build, x=x, n=n, k=0)
    assume(interpreted["r"][0] != interpreted["r"][1])
    native["r"][0] = native["r"][1]
    assert native != interpreted
    assert bits(0.0) != bits(-0.0)
    assert bits(1.0) != bits(np.nextafter(1.0, 2.0))
