"""Lines of a component with their tangents: values first, then slopes by the rules of calculus, in Python's order."""

from math import atan2, cos, floor, gamma, hypot, sin  # noqa: F401 - names of the cases

import pytest

from tests.every_case import every_case
from twin.compiler.autodiff.component import _Library, composed
from twin.compiler.autodiff.function import ACTIVE, RECORD, UnknownError
from twin.compiler.resolve import source_of
from twin.component import define


def scaled(value, factor):
    """Two arguments."""
    return value * factor


def fill(values, a):
    """An array that is written."""
    values[0] = a


def rewritten(body):
    """The lines that compute the same with tangents; real variables are x, y, z, and arrays v and k."""
    lines = "\n".join(f"    {line}" for line in body.split("\n"))
    function = define("derivatives", f"def derivatives(self, t):\n{lines}\n", dict(globals()), "cases")
    made, _ = _Library(frozenset("xyzvk")).rewrite(function, (RECORD, ACTIVE))
    return "\n".join(line[4:] for line in source_of(made).file.text.rstrip("\n").split("\n")[1:-1])


LINES = """
self.y = self.x + 2.0 * self.z - t
=>
_v1 = self.x
_d1 = dot_self.x
_v2 = self.z
_d2 = dot_self.z
_v3 = 2.0 * _v2
_d3 = 2.0 * _d2
_v4 = _v1 + _v3
_d4 = _d1 + _d3
_v5 = _v4 - t
_d5 = _d4 + (-dot_t)
self.y = _v5
dot_self.y = _d5

self.y = self.x * self.z
=>
_v1 = self.x
_d1 = dot_self.x
_v2 = self.z
_d2 = dot_self.z
_v3 = _v1 * _v2
_d3 = _d1 * _v2 + _v1 * _d2
self.y = _v3
dot_self.y = _d3

self.y = self.x / self.z
=>
_v1 = self.x
_d1 = dot_self.x
_v2 = self.z
_d2 = dot_self.z
_v3 = _v1 / _v2
_d3 = _d1 / _v2 + (-_v3 * _d2 / _v2)
self.y = _v3
dot_self.y = _d3

self.y = 1.0 / self.x
=>
_v1 = self.x
_d1 = dot_self.x
_v2 = 1.0 / _v1
_d2 = (-_v2 * _d1 / _v1)
self.y = _v2
dot_self.y = _d2

self.y = self.x ** 2
=>
_v1 = self.x
_d1 = dot_self.x
_v2 = _v1 ** 2
_d2 = _slope_power(_v1, 2) * _d1
self.y = _v2
dot_self.y = _d2

self.y = 2.0 ** self.x
=>
_v1 = self.x
_d1 = dot_self.x
_v2 = 2.0 ** _v1
_d2 = _slope_exponent(2.0, _v2) * _d1
self.y = _v2
dot_self.y = _d2

self.y = self.x ** self.z
=>
_v1 = self.x
_d1 = dot_self.x
_v2 = self.z
_d2 = dot_self.z
_v3 = _v1 ** _v2
_d3 = _slope_power(_v1, _v2) * _d1 + _slope_exponent(_v1, _v3) * _d2
self.y = _v3
dot_self.y = _d3

self.y = self.x % self.z
=>
_v1 = self.x
_d1 = dot_self.x
_v2 = self.z
_d2 = dot_self.z
_v3 = _v1 % _v2
_d3 = _d1 + (-_slope_floor(_v1 / _v2) * _d2)
self.y = _v3
dot_self.y = _d3

self.y = sin(self.x) + cos(self.z)
=>
_v1 = self.x
_d1 = dot_self.x
_v2 = sin(_v1)
_d2 = _slope_cos(_v1) * _d1
_v3 = self.z
_d3 = dot_self.z
_v4 = cos(_v3)
_d4 = -_slope_sin(_v3) * _d3
_v5 = _v2 + _v4
_d5 = _d2 + _d4
self.y = _v5
dot_self.y = _d5

self.y = atan2(self.x, self.z)
=>
_v1 = self.x
_d1 = dot_self.x
_v2 = self.z
_d2 = dot_self.z
_v3 = atan2(_v1, _v2)
_d3 = _v2 / (_v1 * _v1 + _v2 * _v2) * _d1 + (-_v1 / (_v1 * _v1 + _v2 * _v2) * _d2)
self.y = _v3
dot_self.y = _d3

self.y = min(self.x, 1.0)
=>
_v1 = self.x
_d1 = dot_self.x
_v2 = min(_v1, 1.0)
_d2 = _slope_first(1.0 >= _v1) * _d1
self.y = _v2
dot_self.y = _d2

self.y = max(self.x, self.z, 0.0)
=>
_v1 = self.x
_d1 = dot_self.x
_v2 = self.z
_d2 = dot_self.z
_v3 = max(_v1, _v2)
_d3 = _slope_first(_v2 <= _v1) * _d1 + _slope_first(_v2 > _v1) * _d2
_v4 = max(_v3, 0.0)
_d4 = _slope_first(0.0 <= _v3) * _d3
self.y = _v4
dot_self.y = _d4

self.y = abs(self.x)
=>
_v1 = self.x
_d1 = dot_self.x
_v2 = abs(_v1)
_d2 = _slope_sign(_v1) * _d1
self.y = _v2
dot_self.y = _d2

self.y = floor(self.x) + self.n
=>
_v1 = (floor(self.x))
_v2 = self.n
_v3 = _v1 + _v2
self.y = _v3
dot_self.y = 0.0

self.y = float(self.x) + float(self.n)
=>
_v1 = self.x
_d1 = dot_self.x
_v2 = float(_v1)
_d2 = _d1
_v3 = (float(self.n))
_v4 = _v2 + _v3
_d4 = _d2
self.y = _v4
dot_self.y = _d4

self.y = self.x if self.z > 0.0 else 2.0
=>
if self.z > 0.0:
    _v1 = self.x
    _d1 = dot_self.x
else:
    _v1 = 2.0
    _d1 = 0.0
self.y = _v1
dot_self.y = _d1

self.n = 3
=>
self.n = 3

self.y = self.n * 2.0
=>
self.y = (self.n * 2.0)
dot_self.y = 0.0

self.v[0] = self.x
self.y = self.v[0]
=>
self.v[0] = self.x
dot_self.v[0] = dot_self.x
self.y = self.v[0]
dot_self.y = dot_self.v[0]

w = self.x * 2.0
self.y = w + 1.0
=>
_v1 = self.x
_d1 = dot_self.x
_v2 = _v1 * 2.0
_d2 = _d1 * 2.0
w = _v2
dot_w = _d2
_v3 = w + 1.0
_d3 = dot_w
self.y = _v3
dot_self.y = _d3

w = 1.0
self.y = w * self.x
=>
w = 1.0
_v1 = self.x
_d1 = dot_self.x
_v2 = w * _v1
_d2 = w * _d1
self.y = _v2
dot_self.y = _d2

w = 1.0
if self.x > 0.0:
    w = self.x
self.y = w
=>
w = 1.0
dot_w = 0.0
if self.x > 0.0:
    w = self.x
    dot_w = dot_self.x
    pass
self.y = w
dot_self.y = dot_w

self.y *= self.x
=>
_v1 = self.y
_d1 = dot_self.y
_v2 = self.x
_d2 = dot_self.x
_v3 = _v1 * _v2
_d3 = _d1 * _v2 + _v1 * _d2
self.y = _v3
dot_self.y = _d3

a, b = self.x, 2.0
self.y = a * b
=>
_v1 = self.x
_d1 = dot_self.x
_v2 = 2.0
a = _v1
dot_a = _d1
b = _v2
_v3 = a * b
_d3 = dot_a * b
self.y = _v3
dot_self.y = _d3

for i in range(2):
    self.v[i] = self.x * i
=>
for i in range(2):
    _v1 = self.x
    _d1 = dot_self.x
    _v2 = _v1 * i
    _d2 = _d1 * i
    self.v[i] = _v2
    dot_self.v[i] = _d2
    pass

while self.n > 0:
    self.y = self.x
    self.n -= 1
=>
while self.n > 0:
    self.y = self.x
    dot_self.y = dot_self.x
    self.n = (self.n - 1)
    pass

if self.x > 1.0:
    self.y = self.x
elif self.x > 0.5:
    self.y = 2.0
else:
    return
=>
if self.x > 1.0:
    self.y = self.x
    dot_self.y = dot_self.x
    pass
else:
    if self.x > 0.5:
        self.y = 2.0
        dot_self.y = 0.0
        pass
    else:
        return
        pass
    pass

self.y = scaled(self.x, self.z)
=>
_v1, _d1 = _scaled_active_active(self.x, self.z, dot_self.x, dot_self.z)
self.y = _v1
dot_self.y = _d1

self.y = scaled(2.0, self.n)
=>
self.y = (scaled(2.0, self.n))
dot_self.y = 0.0

fill(self.v, self.x)
=>
_fill_active_active(self.v, self.x, dot_self.v, dot_self.x)

values = self.v
self.y = values[0]
=>
values = self.v
dot_values = dot_self.v
self.y = values[0]
dot_self.y = dot_values[0]

self.y = (self.x > 0.0) * self.z
=>
_v1 = (self.x > 0.0)
_v2 = self.z
_d2 = dot_self.z
_v3 = _v1 * _v2
_d3 = _v1 * _d2
self.y = _v3
dot_self.y = _d3
"""


@every_case("case", LINES.strip().split("\n\n"))
def test_lines_with_tangents(case):
    python, expected = case.split("\n=>\n")
    assert rewritten(python) == expected


@pytest.mark.parametrize(
    ("body", "reason"),
    [
        ("a = b = self.x\nself.y = a * b", "`a = b = self.x` (derivatives, line 2) assigns twice"),
        ("self.y = scaled(self.x)", "`scaled` is called with 1 of 2 arguments"),
        ("self.y = gamma(self.x)", "`gamma(self.x)` (derivatives, line 2) has no rule"),
        ("self.y = self.x and self.z", "`self.x and self.z` (derivatives, line 2) is a number made by `and` or `or`"),
    ],
)
def test_what_cannot_be_followed(body, reason):
    with pytest.raises(UnknownError) as caught:
        rewritten(body)
    assert str(caught.value) == reason


@pytest.mark.parametrize(("has_start", "expected"), [(True, ["start", "at"]), (False, ["at"])])
def test_what_native_code_calls(has_start, expected):
    """At a point the derivatives; first of all the initialization; the status is OK."""
    calls = []
    start = (lambda *given: calls.append(("start", *given))) if has_start else None
    at, first = composed(lambda *given: calls.append(("at", *given)), start)
    assert at("self", "dot", 1.0, 2.0) == 0
    assert calls == [("at", "self", 1.0, "dot", 2.0)]
    calls.clear()
    assert first("self", "dot", 1.0, 2.0) == 0
    assert [call[0] for call in calls] == expected
    assert calls[-1] == ("at", "self", 1.0, "dot", 2.0)
    assert calls[0] == (("start", "self", "dot") if has_start else calls[-1])
