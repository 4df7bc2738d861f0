"""Tangents against eighth-order differences of the same functions, interpreted and compiled; what cannot be followed."""

import ctypes
import functools
import math
import sys
from math import (
    acos,
    acosh,
    asin,
    asinh,
    atan,
    atan2,
    atanh,
    copysign,
    cos,
    cosh,
    erf,
    erfc,
    exp,
    expm1,
    fabs,
    floor,
    hypot,
    log,
    log1p,
    log10,
    sin,
    sinh,
    sqrt,
    tan,
    tanh,
)

import numpy as np
import pytest

from twin import compiler
from twin.compiler import autodiff
from twin.compiler.autodiff import derivative_rules
from twin.component import Component, Int64, Role, catalog, input, local, output, parameter, state

TABLE = (0.3, -0.7, 1.1)
DIFFERENCES = ((4 / 5, 1), (-1 / 5, 2), (4 / 105, 3), (-1 / 280, 4))


def scaled(value, factor):
    return value * factor


def both(a, b):
    """Returns two values, from two places."""
    if a > b:
        return a - b, a * b
    return b - a, 2.0


def fill(me, values, n):
    """Writes an array it is given, and a field of the component."""
    for i in range(n):
        values[i] = me.u * (i + 1)
    me.y = values[0]


class Unary(Component):
    """Every function of one operand, in its domain."""

    u = input("", "operand", start=0.4)
    y = output("", "values", shape=(27,))

    def derivatives(self, t):
        y, u = self.y, self.u
        y[0] = sin(u)
        y[1] = cos(u)
        y[2] = tan(u)
        y[3] = asin(u)
        y[4] = acos(u)
        y[5] = atan(u)
        y[6] = sinh(u)
        y[7] = cosh(u)
        y[8] = tanh(u)
        y[9] = asinh(u)
        y[10] = acosh(u + 2.0)
        y[11] = atanh(u)
        y[12] = exp(u)
        y[13] = expm1(u)
        y[14] = log(u + 1.5)
        y[15] = log1p(u)
        y[16] = log10(u + 1.5)
        y[17] = sqrt(u + 1.5)
        y[18] = erf(u)
        y[19] = erfc(u)
        y[20] = fabs(u)
        y[21] = abs(-u)
        y[22] = math.radians(u)
        y[23] = math.atan(u) + math.exp(float(u))
        y[24] = floor(u) + int(u) + 0.5
        y[25] = math.degrees(u)
        y[26] = math.log2(u + 1.5)


class Binary(Component):
    """Every operator and function of two operands."""

    a = input("", "first operand", start=0.4)
    b = input("", "second operand", start=1.3)
    y = output("", "values", shape=(18,))

    def derivatives(self, t):
        a, b = self.a, self.b
        self.y[0] = a + b - t
        self.y[1] = a * b * t
        self.y[2] = a / b
        self.y[3] = 3.0 / b - a / 2.0
        self.y[4] = abs(a) ** b
        self.y[5] = a**2 + b**2 + abs(b) ** 2.5
        self.y[6] = pow(2.0, a)
        self.y[7] = a % b
        self.y[8] = np.fmod(a, b)
        self.y[9] = a // b
        self.y[10] = min(a, b)
        self.y[11] = max(a, b, 0.1)
        self.y[12] = max(0, a)
        self.y[13] = atan2(a, b)
        self.y[14] = hypot(a, b)
        self.y[15] = copysign(a, b)
        self.y[16] = np.minimum(a, b) - +b
        self.y[17] = -(a - b) * (a if b > 0.0 else b * b)


class Flow(Component):
    """Statements: helpers, branches, loops, several results, arrays under other names."""

    u = input("", "input", start=0.8)
    n = parameter(3, "", "count", type=Int64)
    y = output("", "output")
    z = output("", "outputs", shape=(3,))
    on = output("", "whether it is on", start=False)
    x = state((0.3, 0.5, 0.2), "", "states")
    memory = local(0.0, "", "memory", shape=(3,))

    def initialize(self):
        for i in range(3):
            self.x[i] = self.u * self.u * i

    def derivatives(self, t):
        fill(self, self.memory, 3)
        total = 0
        for i in range(self.n):
            if i == 2:
                break
            total += scaled(self.x[i], TABLE[i])
        far, product = both(self.x[0], total)
        far, product = product, far
        count = 0
        while count < 2:
            total = total * self.x[1]
            count += 1
        x = self.x
        for i in range(3):
            self.der_x[i] = -x[i] + self.memory[i] * (total if i == 0 else 1.0)
            self.z[i] = far + product * scaled(i, self.u) + sin(t)
        self.on = self.u > 0.0 and total < 1.0
        if self.u < 0.0:
            self.y += t
            return
        self.y += self.z[int(self.on)] * exp(-self.u)


def points(cls, count, seed=5):
    """Components in random places around their nominal values."""
    random = np.random.default_rng(seed)
    for _ in range(count):
        part = cls()
        for variable in cls.variables:
            if variable.role in (Role.input, Role.state):
                spread = (variable.nominal or 0.9) * random.uniform(-1.0, 1.0, variable.shape)
                part.views[variable.name][...] = spread if variable.type == "Float64" else variable.start
        yield part, random.uniform(0.0, 0.9)


def unknowns(part):
    roles = (Role.output, Role.derivative)
    views = [part.views[v.name].ravel() for v in part.variables if v.role in roles and v.type == "Float64"]
    return np.concatenate(views) if views else np.zeros(0)


def evaluated(part, t, move=None):
    copy = type(part)()
    copy.record[...] = part.record
    if move:
        name, index, change = move
        if name == "t":
            t += change
        else:
            copy.views[name][index] += change
    copy.derivatives(t)
    return unknowns(copy)


def direction(cls, name, index):
    dot = cls()
    dot.record[...] = np.zeros(1, dot.record.dtype)
    if name != "t":
        dot.views[name][index] = 1.0
    return dot, float(name == "t")


def knowns(cls):
    yield "t", (), 1.0
    for variable in cls.variables:
        if variable.role in (Role.input, Role.state) and variable.type == "Float64":
            for index in np.ndindex(variable.shape):
                yield variable.name, index, variable.nominal or 1.0


CLASSES = [Unary, Binary, Flow, *(catalog.component(n) for n in ("sheath", "wall", "heart", "chirp"))]


@pytest.mark.slow
@pytest.mark.parametrize("cls", CLASSES)
def test_tangents_are_the_limits_of_differences(cls, build):
    compare(cls, compiled_tangent(cls, build), 12)


@pytest.mark.parametrize("cls", [Unary, Binary, Flow])
def test_tangents_in_python_are_those_limits_too(cls):
    def tangent(part, dot, dot_t, t):
        autodiff.tangents(cls).at(part, dot, t, dot_t)
        return unknowns(dot)

    compare(cls, tangent, 2)


def compare(cls, tangent, count):
    """Compare tangents along each input, state and time with differences, at some points."""
    for part, t in points(cls, count):
        for name, index, nominal in knowns(cls):
            at, dot_record = type(part)(), direction(cls, name, index)
            at.record[...] = part.record
            found = tangent(at, *dot_record, t)
            size = np.abs(evaluated(part, t)) / nominal + np.abs(found) + 1e-3
            wanted = [differences(part, t, name, index, h * nominal) for h in (2e-3, 2e-4, 2e-5)]
            error = np.min([np.abs(found - one) for one in wanted], axis=0)  # a long step may reach over a kink
            assert np.all(error <= 1e-9 * size), (name, index, found, wanted)
            assert unknowns(at).tobytes() == evaluated(part, t).tobytes()  # values as before, to the bit


def differences(part, t, name, index, h):
    """Central differences of eighth order with step h."""
    total = 0.0
    for weight, k in DIFFERENCES:
        total += weight * (evaluated(part, t, (name, index, k * h)) - evaluated(part, t, (name, index, -k * h)))
    return total / h


def compiled_tangent(cls, build):
    """The native tangent, which is compared with the interpreted one on its way."""
    name = compiler.model_name(cls)
    (address,) = compiler.load_symbols(compiler.sources(cls, name, build), build, (f"{name}_tangent",))
    call = ctypes.CFUNCTYPE(ctypes.c_int32, ctypes.c_void_p, ctypes.c_void_p, ctypes.c_double, ctypes.c_double)(address)

    def native(part, dot, dot_t, t):
        plain, along = cls(), cls()
        plain.record[...], along.record[...] = part.record, dot.record
        autodiff.tangents(cls).at(plain, along, t, dot_t)
        assert call(part.record.ctypes.data, dot.record.ctypes.data, t, dot_t) == 0
        np.testing.assert_allclose(unknowns(along), unknowns(dot), rtol=1e-14, atol=0)
        return unknowns(dot)

    return native


def test_initialization_has_tangents_too():
    part, (dot, _) = Flow(u=0.6), direction(Flow, "u", ())
    autodiff.tangents(Flow).first(part, dot, 0.0, 0.0)
    assert dot.x.tolist() == [0.0, 1.2, 2.4]


def test_every_rule_is_tried():
    import inspect

    source = inspect.getsource(Unary) + inspect.getsource(Binary)
    names = {name for name in {*derivative_rules.UNARY, *derivative_rules.BINARY} if name.isidentifier()}
    assert {name for name in names if f"{name}(" not in source} == set()


def doubled(function):
    @functools.wraps(function)
    def twice(a):
        return 2.0 * function(a)

    return twice


@doubled
def squared(a):
    return a * a


class Shape:
    """A class as a place for functions."""

    @staticmethod
    def cubed(a):
        return a * a * a


def test_helpers_may_be_decorated_or_stand_in_a_class():
    class Helped(Component):
        """Calls both."""

        u = input("", "input", start=3.0)
        y = output("", "outputs", shape=(2,))

        def derivatives(self, t):
            self.y[0] = squared(self.u)
            self.y[1] = Shape.cubed(self.u)

    part, (dot, _) = Helped(), direction(Helped, "u", ())
    autodiff.tangents(Helped).at(part, dot, 0.0, 0.0)
    assert part.y.tolist() == [18.0, 27.0]
    assert dot.y.tolist() == [12.0, 27.0]


def refused(function):
    class Refused(Component):
        """Cannot be followed."""

        u = input("", "input", shape=(2,))
        y = output("", "output")
        whole = output("", "whole number", start=0, type=Int64)
        derivatives = function

    reason = autodiff.tangents(Refused)
    assert isinstance(reason, str)
    return reason


def again(u):
    return again(u - 1.0) if u > 0.0 else u


def test_what_is_not_understood_is_a_reason():
    def no_rule(self, t):
        self.y = math.gamma(self.u[0])

    def loops_over_values(self, t):
        for u in self.u:
            self.y = u

    def calls_itself(self, t):
        self.y = again(self.u[0])

    def stores_in_a_whole_number(self, t):
        self.whole = self.u[0]

    assert "`math.gamma(self.u[0])`" in refused(no_rule)
    assert "no rule" in refused(no_rule)
    assert "loop" in refused(loops_over_values)
    assert "calls itself" in refused(calls_itself)
    assert "Float64" in refused(stores_in_a_whole_number)


RATE = 1.25


class Rated(Component):
    """Its derivative uses a value of the module."""

    x = state(0.5, "m", "position")

    def derivatives(self, t):
        self.der_x = RATE * self.x * self.x


def test_a_value_that_changes_in_memory_changes_the_tangent(monkeypatch):
    before = compiler.translate(Rated, "Rated").source
    monkeypatch.setattr(sys.modules[__name__], "RATE", 2.75)
    assert compiler.translate(Rated, "Rated").source == before.replace("1.25", "2.75")
