"""The C of a few lines of Python that work on a record of numbers; constants and functions that they may use."""

import math
from math import ceil, floor, hypot, inf, isnan, nan, pi, sin, sqrt, trunc  # noqa: F401 - names of the cases

import numpy as np

from twin.compiler.component import translate_record
from twin.compiler.machine import write64
from twin.component.generated import define

RECORD = np.dtype(
    [
        *((name, "f8") for name in "xyz"),
        *((name, "i8") for name in "abn"),
        *((name, "i4") for name in "cd"),
        *((name, "?") for name in ("on", "off")),
        ("v", "f8", (4,)),
        ("m", "f8", (3, 2)),
        ("k", "i8", (3,)),
    ],
    align=True,
)
TABLE = (0.5, -2.0, 3.25)
ROWS = ((1, 2, 3), (4, 5, 6))
FEW = 3
GAIN = -0.5


def act(self):
    """An effect and a result."""
    self.n += 1
    return self.n


def store(address):
    """An effect on memory that is no argument."""
    write64(address, 1)
    return 2.0


def store_again(address):
    """The effect of another function."""
    return store(address) + 1.0


def scaled(x, factor=2.0):
    """A default value."""
    return x * factor


def both(a, b):
    """Two results."""
    return b, a


def first(values):
    """An array as an argument."""
    return values[0]


def file_of(body):
    """The whole file of a function with this body."""
    lines = "\n".join(f"    {line}" for line in body.split("\n"))
    run = define("run", f"def run(self):\n{lines}\n", dict(globals()) | {"math": math}, "cases")
    return translate_record(RECORD, "r", run, "head")


def c_of(body):
    """The body of the function in C, without its indent."""
    inner = file_of(body).partition("static void run(")[2].partition("\n{\n")[2].partition("\n}\n")[0]
    return "\n".join(line[4:] for line in inner.split("\n"))
