"""What cannot become C is told in one line: component, file, line, construct, reason, remedy; nothing foreign shows."""

import math  # noqa: F401 - the names of the cases

import numpy as np  # noqa: F401
import pytest

from twin import compiler
from twin.component import Component, Int64, define, input, local, output, parameter
from twin.errors import BuildError

TABLE = (1.0, 2.0)
RAGGED = ((1.0,), (2.0, 3.0))


def recursive(n):
    return recursive(n - 1) if n > 0 else 0


def sometimes(x):  # noqa: RET503
    if x > 0.0:
        return 1.0


def keyword(x, *, y):
    return x + y


BIG = 2**64


def effect(self):
    self.y = 1.0
    return 1


def helper(x):
    return x


def raises(x):
    raise ValueError


def changed(table):
    table[0] = 1.0


def renamed(z):
    z = 1.0  # noqa: F841
    return 0.0


def nothing():
    pass


def either(x):
    if x > 0.0:
        return 1.0
    return 1.0, 2.0


def ping(x):
    return pong(x)


def pong(x):
    return ping(x)


CASES = {
    "a, *b = TABLE": ("takes what is left over", "Give each value a name"),
    "first, *rest = (1.0, 2.0, 3.0)": ("has not as many values as names", "Give each name one value"),
    "w = [1.0, 2.0]": ("has no form in C", "Declare an array with shape"),
    "w = {}": ("has no form in C", "Declare variables instead"),
    "w = (x for x in TABLE)": ("has no form in C", "Write the loop"),
    "w = lambda: 1.0": ("has no form in C", "Write a function in the module"),
    "w = f'{t}'": ("has no form in C", "Publish a number instead"),
    "if (w := t) > 1.0:\n    self.y = w": ("has no form in C", "Assign it in a line of its own"),
    "with t:\n    pass": ("has no form in C", "Components do no I/O"),
    "match t:\n    case 1.0:\n        self.y = t": ("has no form in C", "Use if and elif"),
    "del t": ("has no form in C", "Drop it"),
    "def inner():\n    return 1.0": ("has no form in C", "Write the function in the module"),
    "for i in range(2):\n    pass\nelse:\n    self.y = t": ("has an `else`", "Use a variable for it"),
    "for i, v in enumerate(TABLE):\n    self.y = v": ("cannot be called from C", "Write `for i in range(n)`"),
    "self.y = sum(TABLE)": ("cannot be called from C", "Write `for i in range(n)`"),
    "self.y = max(self.z)": ("looks through an array", "Write `for i in range(n)`"),
    "for i in range(t):\n    self.y = t": ("is a real number, not a whole one", "Use int(...)"),
    "for i in range(0, 9, self.n):\n    self.y = t": ("step that is not known beforehand", "Use a constant"),
    "self.y = self.z": ("is a number, but gets an array [3]", "Give it a number"),
    "self.y = self.z + 1.0": ("is an array [3], not a number", "Loop over its elements"),
    "self.z = 1.0": ("is an array [3] and takes no whole", "Loop over its elements"),
    "self.y = self.z[0:2]": ("is a slice", "Loop over the elements"),
    "self.y = self.z[3]": ("is outside of its array, whose indices end at 2", "Correct it"),
    "self.y = self.z[0, 1]": ("has more indices than an array [3]", "Drop some"),
    "self.y = self.z[t]": ("is a real number, not a whole one", "Use int(...)"),
    "self.y = RAGGED[self.n][0]": ("is found in no table of numbers", "Use a tuple of numbers of one length"),
    "self.y = self.z.sum()": ("asks an array [3] for `sum`", "Write a loop over the elements"),
    "self.y = self.missing": ("is not declared", "Declare it as a variable"),
    "self.y = missing": ("is not defined", "Import or define it"),
    "self.y = k": ("is not defined", "Write `self.k`"),
    "self.y = unset": (
        "is used before it has a value",
        "Set it first",
        "while self.n > 5:\n    other = unset\n    unset = other",
    ),
    "w = None": ("gets None", "Use a number that cannot occur"),
    "self.y = recursive(self.n)": ("calls itself", "Write a loop with known bounds"),
    "self.y = sometimes(t)": ("may end without a result", "End it with `return`"),
    "self.y = keyword(t, y=1.0)": ("takes arguments in a way that C lacks", "Use plain arguments"),
    "self.y = helper(t, 1.0)": ("does not fit `helper`", "Correct the arguments"),
    "self.y = helper(*TABLE)": ("gives arguments by *", "Give each by itself"),
    "self.y = raises(t)": ("has no form in C", "Return a status"),
    "self.y = np.random.normal()": ("cannot be called from C", "Use functions of `math`"),
    "self.y = np.tanh(t)": ("cannot be called from C", "Use tanh of `math`"),
    "self.y = math.gamma(t)": ("cannot be called from C", "Use functions of `math`"),
    "self.y = math.sin(t, t)": ("needs 1 arguments", "Give them in their order"),
    "self.y = 1j": ("is no number of C", "Use real numbers"),
    "self.y = 2 ** self.n": ("is whole or real, depending on the exponent", "float(...)"),
    "self.y = t & 1": ("works on the bits of a real number", "Use whole numbers"),
    "self.y = t @ t": ("multiplies matrices", "Write the loops"),
    "self.y = self.n is 5": ("asks for the same object", "Compare with =="),
    "TABLE[0] = t": ("is a constant and cannot be changed", "Use a local()"),
    "w = 1.0\nw = TABLE": ("is a real number here and an array [2] there", "Use two names"),
    "t + 1.0": ("computes what nobody takes", "Assign it, or drop it"),
    "w = print": ("gets no number", "Call functions by their own names"),
    "self.y = t if self.z else 0.0": ("is an array [3] and neither true nor false", "Compare numbers"),
    "self.y = BIG": ("has more than 64 bits", "Use a smaller number, or a real one"),
    "self.y = 18446744073709551616": ("has more than 64 bits", "Use a smaller number"),
    "self.z[effect(self)] %= 2.0": ("calls a function for the place it changes", "Give the index a name first"),
    "self.y = '1'": ("is a number, but gets no number", "Give it a number"),
    "self.y = (t)(1.0)": ("calls what is no function", "Call functions by their names"),
    "w = (1.0, t)\nself.y = w[self.n, 0]": ("picks one of several values", "Unpack them"),
    "w = (1.0, t)\nself.y = w[2]": ("picks none of 2 values", "Correct the index"),
    "w = (1.0, t)\nself.y = w[-3]": ("picks none of 2 values", "Correct the index"),
    "w = (1.0, t)\nself.y = w[0, 0]": ("picks none of 2 values", "Correct the index"),
    "self.y = t[0]": ("indexes a real number", "Index arrays and tuples only"),
    "self.y = self.z[0][0]": ("indexes a real number", "Index arrays and tuples only"),
    "self.y = self.z[-4]": ("is outside of its array", "Correct it"),
    "for i in t:\n    self.y = t": ("cannot be looped over", "Write `for i in range(n)`"),
    "for i, j in range(3):\n    self.y = t": ("counts nothing", "Give the loop one name"),
    "for i in range():\n    self.y = t": ("has no bounds that C has", "Give one to three numbers"),
    "for i in range(0, 9, 1, 1):\n    self.y = t": ("has no bounds that C has", "Give one to three numbers"),
    "for i in range(0, 9, 0):\n    self.y = t": ("is no step", "Use a number that is not 0"),
    "for i in range(0, t):\n    self.y = t": ("is a real number, not a whole one", "Use int(...)"),
    "w = range(3)": ("stands outside of a `for`", "Write `for i in range(n):`"),
    "self.y = len(t)": ("measures what has no length", "Give an array"),
    "self.y = len(self.z, self.z)": ("measures what has no length", "Give an array"),
    "self.y = float(t, t)": ("needs one argument", "Give one number"),
    "self.y = abs()": ("needs one argument", "Give one number"),
    "self.y = pow(t, t, t)": ("needs two arguments", "Write a**b"),
    "self.y = math.sin(x=t)": ("gives arguments by name or by *", "Give them in their order"),
    "self.y = 1.0 if 0.0 < effect(self) < 2.0 else 0.0": (
        "compares the result of a function twice",
        "Give it a name first",
    ),
    "self.y = 1.0 if t in self.n else 0.0": ("where one looks for a value", "Use a tuple of numbers"),
    "w = (1.0, print)": ("holds more than numbers", "Use numbers"),
    "w, v = t": ("unpacks a real number", "Return a tuple of numbers"),
    "w, v = (1.0, 2.0, 3.0)": ("has not as many values as names", "Give each name one value"),
    "changed(TABLE)": ("is a constant and cannot be changed", "Use a local() of the component"),
    "self.y = renamed(self.z)": ("is an argument that holds an array", "Use another name"),
    "w = nothing()": ("returns nothing", "Call it as a statement"),
    "self.y = either(t)": ("returns another kind than before", "Return the same everywhere"),
    "self.y = ping(t)": ("calls itself, through pong", "Write a loop with known bounds"),
}


def component(statement, before=""):
    """A component whose step is this text."""
    body = "\n".join(f"    {line}" for part in (before, statement) for line in part.split("\n") if line)
    scope = dict(globals())
    step = define("step", f"def step(self, t, h):\n    self.y = t\n{body}\n", scope, "test")
    fields = {
        "n": input("", "whole", type=Int64),
        "y": output("", "out"),
        "z": local((0.0,) * 3, "", "array"),
        "k": parameter(1.0, "", "k"),
        "step": step,
        "__doc__": "A test.",
    }
    return type("Part", (Component,), fields)


@pytest.mark.filterwarnings("ignore:.*is. with:SyntaxWarning")
@pytest.mark.parametrize("statement", CASES)
def test_what_has_no_form_in_c(statement):
    reason, remedy, *before = CASES[statement]
    with pytest.raises(BuildError) as caught:
        compiler.translate(component(statement, *before), "part")
    text = str(caught.value)
    assert text.startswith("Part ("), text
    assert "\n" not in text
    assert f": `{text.partition(': `')[2]}" in text
    assert reason in text, text
    assert remedy in text, text
    assert text.endswith("."), text
    for foreign in ("Traceback", "ast.", "numba", "UNPACK", "<ast", "clang", "object at"):
        assert foreign not in text


def test_the_line_is_that_of_the_file():
    class Sliced(Component):
        """A slice."""

        y = output("", "out")
        z = local((0.0,) * 3, "", "array")

        def step(self, t, h):
            self.y = t

            self.y = self.z[1:]

    line = Sliced.step.__code__.co_firstlineno + 3
    with pytest.raises(BuildError, match=rf"^Sliced \(\S*test_messages\.py:{line}\): `self\.z\[1:\]` is a slice"):
        compiler.translate(Sliced, "sliced")


def test_a_function_without_source_is_told():
    scope = {}
    exec("def step(self, t, h):\n    self.y = t", scope)
    cls = type("Part", (Component,), {"y": output("", "y"), "step": scope["step"], "__doc__": "A test."})
    with pytest.raises(BuildError, match=r"the source of `step` is not there\. Define it with `def` in a file"):
        compiler.translate(cls, "part")


def test_every_statement_that_has_no_form_is_told():
    cls = component(
        "w = [1.0]\nself.y = w\nif t > 0.0:\n    v = {}\nself.y = raises(t)\nself.y = self.missing\nself.y = w + v"
    )
    with pytest.raises(BuildError) as caught:
        compiler.translate(cls, "part")
    lines = str(caught.value).split("\n")
    assert all(line.startswith("Part (") for line in lines)
    assert [line.partition("`")[2].partition("`")[0] for line in lines] == [
        "[1.0]",
        "{}",
        "raise ValueError",
        "self.missing",
    ]
