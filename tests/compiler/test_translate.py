"""Construct by construct: what C computes is what Python computes, to the bit."""

import ctypes
import struct
from math import (
    acos,
    acosh,
    asin,
    asinh,
    atan,
    atan2,
    atanh,
    cbrt,
    ceil,
    copysign,
    cos,
    cosh,
    degrees,
    erf,
    erfc,
    exp,
    exp2,
    expm1,
    fabs,
    floor,
    fmod,
    hypot,
    inf,
    isfinite,
    isinf,
    isnan,
    log,
    log1p,
    log2,
    log10,
    nan,
    pi,
    radians,
    sin,
    sinh,
    sqrt,
    tan,
    tanh,
    trunc,
)

import numpy as np
import pytest
from hypothesis import assume, example, given, settings
from hypothesis import strategies as st

from twin import compiler
from twin.component import Boolean, Component, Int32, Int64, input, local, output, parameter

START = ctypes.CFUNCTYPE(ctypes.c_int32, ctypes.c_void_p, ctypes.c_double)
STEP = ctypes.CFUNCTYPE(ctypes.c_int32, ctypes.c_void_p, ctypes.c_double, ctypes.c_double)

FACTORS = (0.5, -2.0, 3.25)
ROWS = ((1, 2, 3), (4, 5, 6), (-7, 8, 0))
LIMIT = 3
MODES = (2, 5)

reals = st.floats(width=64)
finite = st.floats(-1e6, 1e6)
whole = st.integers(-(2**31), 2**31 - 1)


def bits(value):
    """A value so that two are equal only if they are the same, with one NaN."""
    if isinstance(value, float | np.floating):
        return "NaN" if value != value else struct.pack("d", value)
    return int(value)


def outputs(part):
    return {
        v.name: [bits(one.item()) for one in np.ravel(part.views[v.name])] for v in part.variables if v.role == "output"
    }


def both(cls, build, **values):
    """Outputs of a component after one step, interpreted and compiled."""
    start, step = compiler.load_component(cls, build / "tests")
    plain, native = cls(**values), cls(**values)
    with np.errstate(all="ignore"):
        plain.start()
        plain.advance(0.0, 0.25)
    START(start)(native.record.ctypes.data, 0.0)
    STEP(step)(native.record.ctypes.data, 0.0, 0.25)
    return outputs(plain), outputs(native)


def same(cls, build, **values):
    interpreted, native = both(cls, build, **values)
    assert native == interpreted


# ----------------------------------------------------------------------------------------------------------- integers


class Integers(Component):
    """What whole numbers can do."""

    a = input("", "a", type=Int64)
    b = input("", "b", type=Int64)
    s = input("", "shift", type=Int64)
    c = input("", "an Int32", type=Int32)
    few = input("", "Int32", type=Int32, shape=(2,))
    flag = input("", "a Boolean", type=Boolean)
    r = output("", "results", type=Int64, shape=(36,))
    quotient = output("", "a / b")
    small = output("", "an Int32", type=Int32)
    truth = output("", "comparisons", type=Boolean, shape=(8,))

    def step(self, t, h):
        a, b, s = self.a, self.b, self.s
        self.r[0] = a % b
        self.r[1] = a // b
        self.r[2] = a % 7
        self.r[3] = a // 7
        self.r[4] = a % -7
        self.r[5] = a // -7
        self.r[6] = a << s
        self.r[7] = a >> s
        self.r[8] = 1 << 40
        self.r[9] = a & b
        self.r[10] = a | b
        self.r[11] = a ^ b
        self.r[12] = ~a
        self.r[13] = -a
        self.r[14] = abs(a)
        self.r[15] = min(a, b, LIMIT)
        self.r[16] = max(a, b, -LIMIT)
        self.r[17] = (a % 1000) ** 3
        self.r[18] = a * 1000003 + b * 8191 - 4294967087
        self.r[19] = +self.flag + True
        self.r[20] = -self.flag
        self.r[21] = int(self.flag) * 5 - (not self.flag)
        self.r[22] = a if self.flag else b
        self.r[23] = (a and b) - (a or b)
        self.r[24] = ROWS[a % 3][b % 3] + ROWS[-1][1]
        self.r[25] = 2000000000 * 2000000000
        self.r[26] = self.c * int(self.few[0])
        self.r[27] = self.c * 1073741824 + int(self.few[1])
        self.r[28] = -self.c
        self.r[29] = self.c + int(self.few[0]) + int(self.few[1])
        self.r[30] = (self.c if self.flag else int(self.few[0])) * 65536 * 16384
        self.r[31] = self.c - 2147483647 - 5
        self.r[32] = abs(self.c) + self.flag * self.c
        self.r[33] = self.c % 7 + self.c // 7 * 1000000000
        self.r[34] = ~self.c * self.c
        total = self.c
        total *= int(self.few[1])
        self.r[35] = total
        self.quotient = a / b
        self.small = a % 30000
        self.truth[0] = a < b <= LIMIT
        self.truth[1] = a in MODES
        self.truth[2] = a not in (1, 2, b)
        self.truth[3] = not a
        self.truth[4] = self.flag and a == b
        self.truth[5] = self.flag or a != b
        self.truth[6] = self.flag ^ (a > b)
        self.truth[7] = bool(a & 1)


@settings(deadline=None)
@given(a=whole, b=whole.filter(bool), s=st.integers(0, 20), flag=st.booleans())
@example(a=-7, b=2, s=3, flag=True)
@example(a=7, b=-2, s=0, flag=False)
@example(a=-(2**31), b=-1, s=20, flag=True)
@example(a=0, b=5, s=1, flag=False)
@example(a=5, b=5, s=1, flag=True)
def test_integers(build, a, b, s, flag):
    same(Integers, build, a=a, b=b, s=s, flag=flag, c=b, few=(a, b // 3))


class Division(Component):
    """Division of whole numbers by nothing must not end the process."""

    a = input("", "a", type=Int64)
    b = input("", "b", type=Int64)
    r = output("", "results", type=Int64, shape=(2,))

    def step(self, t, h):
        self.r[0] = self.a % self.b
        self.r[1] = self.a // self.b


@pytest.mark.parametrize(("a", "b", "wanted"), [(5, 0, [0, 0]), (-(2**63), -1, [0, -(2**63)]), (-(2**63), 0, [0, 0])])
def test_what_a_processor_traps_ends_nothing(build, a, b, wanted):
    _, step = compiler.load_component(Division, build / "tests")
    part = Division(a=a, b=b)
    STEP(step)(part.record.ctypes.data, 0.0, 0.1)
    assert part.r.tolist() == wanted


# -------------------------------------------------------------------------------------------------------------- reals


class Reals(Component):
    """What real numbers can do."""

    x = input("", "x")
    y = input("", "y")
    r = output("", "results", shape=(22,))
    i = output("", "whole results", type=Int64, shape=(6,))
    truth = output("", "comparisons", type=Boolean, shape=(9,))

    def step(self, t, h):
        x, y = self.x, self.y
        self.r[0] = x + y
        self.r[1] = x - y - 1.5
        self.r[2] = x * y / 3.0
        self.r[3] = x % y
        self.r[4] = x // y
        self.r[5] = min(x, y)
        self.r[6] = max(x, y)
        self.r[7] = min(x, y, 0.0)
        self.r[8] = max(0.0, x, -y)
        self.r[9] = abs(x)
        self.r[10] = -x
        self.r[11] = x if x > y else -y
        self.r[12] = hypot(x, y)
        self.r[13] = copysign(x, y)
        self.r[14] = atan2(y, x)
        self.r[15] = fabs(y) * h + t
        self.r[16] = x**2
        self.r[17] = x**2.0 + 2 * x - 1
        self.r[18] = (x and y) + (x or y)
        self.r[19] = float(x > y) + (y != 0)
        self.r[20] = sqrt(abs(x)) * 1e-300
        self.r[21] = inf if y > x else -nan
        clipped = min(max(x, -1e15), 1e15) if x == x else 0.0
        self.i[0] = round(clipped)
        self.i[1] = floor(clipped)
        self.i[2] = ceil(clipped)
        self.i[3] = trunc(clipped)
        self.i[4] = int(clipped)
        self.i[5] = int(clipped) // 3 + floor(clipped / 7.0) % 5
        self.truth[0] = x < y
        self.truth[1] = x <= y
        self.truth[2] = x == y
        self.truth[3] = x != y
        self.truth[4] = not x
        self.truth[5] = isnan(x)
        self.truth[6] = isfinite(x)
        self.truth[7] = isinf(x)
        self.truth[8] = 0 < x < y < 10 or not (x or y)


special = st.sampled_from([0.0, -0.0, 0.5, 1.5, 2.5, -0.5, -2.5, 1e-320, 1e308, inf, -inf, nan, 3.0, -7.0])


@settings(deadline=None)
@given(x=reals | special, y=reals | special)
@example(x=2.5, y=-0.0)
@example(x=-0.0, y=0.0)
@example(x=nan, y=1.0)
@example(x=1.0, y=nan)
@example(x=-7.0, y=2.0)
@example(x=7.0, y=-2.0)
@example(x=1e308, y=1e-308)
def test_reals(build, x, y):
    same(Reals, build, x=x, y=y)


class Functions(Component):
    """The mathematical functions, each where it is defined."""

    x = input("", "x")
    u = input("", "from -1 to 1")
    r = output("", "results", shape=(32,))

    def step(self, t, h):
        x, u, p = self.x, self.u, abs(self.x) + 1e-3
        self.r[0] = sin(x)
        self.r[1] = cos(x)
        self.r[2] = tan(x)
        self.r[3] = asin(u)
        self.r[4] = acos(u)
        self.r[5] = atan(x)
        self.r[6] = sinh(u)
        self.r[7] = cosh(u)
        self.r[8] = tanh(u)
        self.r[9] = asinh(x)
        self.r[10] = acosh(1.0 + p)
        self.r[11] = atanh(0.999 * u)
        self.r[12] = exp(u * 10.0)
        self.r[13] = exp2(u)
        self.r[14] = expm1(u)
        self.r[15] = log(p)
        self.r[16] = log2(p)
        self.r[17] = log10(p)
        self.r[18] = log1p(p)
        self.r[19] = sqrt(p)
        self.r[20] = cbrt(x)
        self.r[21] = erf(u)
        self.r[22] = erfc(u)
        self.r[23] = fmod(x, 0.7)
        self.r[24] = degrees(x) + radians(x)
        self.r[25] = p**u
        self.r[26] = p**-0.5 + p**3
        self.r[27] = 2.0**u + 10.0**u
        self.r[28] = sin(0.7) * cos(pi / 5.0)
        self.r[29] = np.sqrt(p) + np.minimum(x, u) + np.maximum(x, u)
        self.r[30] = sin(u) * cos(u)
        self.r[31] = hypot(x, 1e-3)


@settings(deadline=None)
@given(x=finite, u=st.floats(-1.0, 1.0))
def test_functions(build, x, u):
    same(Functions, build, x=x, u=u)


# ------------------------------------------------------------------------------------- calls, arrays, order, control


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


@settings(deadline=None)
@given(x=st.floats(-10.0, 10.0), n=st.integers(0, 12), k=st.integers(-4, 3))
@example(x=1.0, n=0, k=-1)
def test_programs(build, x, n, k):
    same(Programs, build, x=x, n=n, k=k)


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
