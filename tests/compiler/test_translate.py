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
from hypothesis import example, given, settings
from hypothesis import strategies as st

from twin import compiler
from twin.component import Boolean, Component, Int32, Int64, input, output

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


@pytest.mark.slow
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


@pytest.mark.slow
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


@pytest.mark.slow
@settings(deadline=None)
@given(x=finite, u=st.floats(-1.0, 1.0))
def test_functions(build, x, u):
    same(Functions, build, x=x, u=u)
