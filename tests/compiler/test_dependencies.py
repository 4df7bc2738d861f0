"""What an output follows: exact on plain code, and never less than the truth."""

from math import exp

from twin.compiler import dependencies, flow
from twin.component import (
    Component,
    Int64,
    PythonComponent,
    input,
    local,
    normal,
    output,
    parameter,
    seed_stream,
    state,
)


def shift(buffer, value):
    for i in range(2):
        buffer[i + 1] = buffer[i]
    buffer[0] = value


def both(a, b):
    c = a
    shift(c, b)


def saturate(x, limit):
    return limit if x > limit else x  # noqa: FURB136 - a branch is what is tested


def test_a_state_stands_between_input_and_output():
    class Lag(Component):
        u = input("", "u")
        limit = input("", "limit")
        y = output("", "y")
        z = output("", "z")
        x = state(0.0, "", "x")

        def derivatives(self, t):
            self.der_x = self.u - self.x
            self.y = exp(self.x)
            gain = saturate(self.x, self.limit)
            self.z = gain * 2.0

    assert dependencies(Lag) == {"y": (), "z": ("limit",)}
    assert flow(Lag, ("derivatives",))["y"] == {"x"}


def test_conditions_early_returns_and_loops_count():
    class Branches(Component):
        a = input("", "a")
        b = input("", "b")
        c = input("", "c")
        y = output("", "y")
        z = output("", "z")

        def initialize(self):
            if self.a > 0.0:
                self.y = 1.0
            for i in range(3):
                self.z += self.b
                if self.c > i:
                    break

        def step(self, t, h):
            pass

    assert dependencies(Branches) == {"y": ("a", "c"), "z": ("b", "c")}  # order is ignored: a break hangs over all


def test_arrays_are_followed_through_other_names_and_helpers():
    class Buffers(Component):
        u = input("", "u")
        v = input("", "v", shape=(3,))
        seed = parameter(1, "", "seed", type=Int64)
        y = output("", "y")
        z = output("", "z")
        n = output("", "n")
        line = local(0.0, "", "line", shape=(3,))
        other = local(0.0, "", "other", shape=(3,))
        stream = local((0,) * 6, "", "stream", type=Int64)

        def initialize(self):
            both(self.line, self.u)
            alias, w = self.other, self.v
            alias[1] = w[0]
            self.y = self.line[2]
            self.z = self.other[1]
            seed_stream(self.stream, self.seed)
            self.n = normal(self.stream)

        def step(self, t, h):
            pass

    assert dependencies(Buffers) == {"y": ("u",), "z": ("v",), "n": ()}
    written = flow(Buffers, ("initialize",))
    assert written["n"] == {"seed", "stream"}
    assert written.keys() == {"y", "z", "n", "line", "other", "stream"}


def test_what_cannot_be_followed_depends_on_everything():
    def opaque(component):
        component.y = component.u

    class Opaque(PythonComponent):
        u = input("", "u")
        y = output("", "y")

        def initialize(self):
            opaque(self)

        def step(self, t, h):
            pass

    assert dependencies(Opaque) == {"y": ("u",)}


def publish(*components):
    components[0].y = 1.0


def test_a_helper_that_takes_any_number_of_arguments_cannot_be_followed():
    class Starred(PythonComponent):
        u = input("", "u")
        y = output("", "y")

        def initialize(self):
            publish(self)

        def step(self, t, h):
            pass

    assert dependencies(Starred) == {"y": ("u",)}


def test_a_file_that_was_broken_since_it_was_imported_cannot_be_followed(tmp_path):
    path = tmp_path / "changed.py"
    path.write_text("def initialize(self:\n")
    scope = {}
    exec(compile("def initialize(self):\n    self.y = 1.0\n", str(path), "exec"), scope)

    class Changed(PythonComponent):
        u = input("", "u")
        y = output("", "y")
        initialize = scope["initialize"]

        def step(self, t, h):
            pass

    assert dependencies(Changed) == {"y": ("u",)}
