"""Declarations, memory layout, and the interpreted form."""

from itertools import pairwise

import numpy as np
import pytest

from twin.component import (
    Boolean,
    Component,
    Int32,
    Int64,
    PythonComponent,
    Role,
    input,
    local,
    output,
    parameter,
    state,
)
from twin.errors import DeclarationError


class Everything(Component):
    """Every type, shape and role."""

    flag = input("", "a Boolean", start=False)
    number = input("", "an integer", type=Int32)
    vector = input("m", "an array", shape=(3,))
    y = output("m", "sum")
    big = local(0, "", "64 bit", type=Int64)
    toggles = input("", "an array of Booleans", start=(True, False, True))
    toggled = output("", "the same, the other way", start=(False, False, False))
    matrix = parameter(((1.0, 2.0), (3.0, 4.0)), "m", "a matrix")
    on = parameter(True, "", "switch", fixed=True)
    x = state((1.0, 2.0), "m", "states", nominal=1e-3)

    def derivatives(self, t):
        total = 0.0
        for i in range(3):
            total += self.vector[i]
        self.der_x[0] = total
        self.der_x[1] = self.matrix[1, 0]
        self.y = total if self.on and not self.flag else 0.0
        self.big = 2**40 + self.number
        for i in range(3):
            self.toggled[i] = not self.toggles[i]


def test_values_types_and_start_values():
    part = Everything(number=7)
    assert (part.flag, part.on, part.big, part.number) == (False, True, 0, 7)
    assert part.matrix[1, 0] == 3.0
    assert part.x.tolist() == [1.0, 2.0]
    assert isinstance(part.y, np.float64)
    part.vector = (1.0, 2.0, 3.0)
    part.start()
    assert part.y == 6.0
    assert part.big == 2**40 + 7
    assert part.der_x.tolist() == [6.0, 3.0]


def test_declarations_are_read_from_the_class():
    assert Everything.matrix.shape == (2, 2)
    assert Everything.flag.type is Boolean
    assert Everything.matrix.elements() == ["matrix[1,1]", "matrix[1,2]", "matrix[2,1]", "matrix[2,2]"]
    assert Everything.der_x.role is Role.derivative
    assert Everything.der_x.unit == "m/s"


def test_layout_is_aligned_and_blocks_do_not_overlap():
    dtype = Everything.layout.dtype
    ends = []
    for variable in Everything.variables:
        offset = Everything.layout.offset(variable.name)
        assert offset % variable.dtype.itemsize == 0
        ends.append((offset, offset + variable.size * variable.dtype.itemsize))
    ends.sort()
    assert all(a[1] <= b[0] for a, b in pairwise(ends))
    assert dtype.itemsize % 8 == 0
    assert Everything.layout.state_size == 2


def test_instances_share_nothing():
    a, b = Everything(), Everything()
    a.vector[0] = 5.0
    assert b.vector[0] == 0.0


def test_inherited_variables_and_overridden_start():
    class Base(Component):
        """Base."""

        u = input("m", "in")
        k = parameter(1.0, "", "gain")

    class More(Base):
        """More."""

        k = parameter(2.0, "", "gain")
        y = output("m", "out")

        def step(self, t, h):
            self.y = self.k * self.u

    part = More(u=3.0)
    part.advance(0.0, 1.0)
    assert part.y == 6.0
    assert [v.name for v in More.variables] == ["u", "k", "y"]


def test_mistakes_are_named():
    with pytest.raises(DeclarationError, match=r"no variable 'vectr'\. Did you mean 'vector'"):
        Everything(vectr=1.0)
    with pytest.raises(DeclarationError, match=r"Odd\.start: this name is the engine's own"):
        type("Odd", (Component,), {"start": input("", "clash")})
    with pytest.raises(DeclarationError, match="has a state but no derivatives"):
        type("Still", (Component,), {"x": state(0.0, "", "x"), "step": lambda self, t, h: None})
    with pytest.raises(DeclarationError, match="needs either derivatives"):
        type("Empty", (Component,), {})().advance(0.0, 1.0)


def test_a_misspelled_attribute_is_no_new_one():
    class Pump(Component):
        """A pump."""

        rate = parameter(1.0, "Hz", "rate")
        y = output("", "out")

        def step(self, t, h):
            self.y = self.rate

    class Logging(PythonComponent):
        """Keeps what it likes."""

        y = output("", "out")

        def step(self, t, h):
            self.lines = [t]

    part = Pump()
    part.rate = 2.0
    assert part.rate == 2.0
    for make in (lambda: setattr(part, "rat", 3.0), lambda: Pump(rat=3.0)):
        with pytest.raises(DeclarationError, match=r"^Pump: no variable 'rat'\. Did you mean 'rate'\?$"):
            make()
    with pytest.raises(DeclarationError, match=r"no variable 'volume'\. Known: rate, y\.$"):
        Pump(volume=1.0)
    part._own = 1.0
    Logging().advance(0.0, 1.0)
