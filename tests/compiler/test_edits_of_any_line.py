"""An edit of any line of a module that a component can reach changes its fingerprint wherever it changes the C."""

import importlib
import re
import sys

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from tests.compiler.test_edits import write
from twin import compiler

MODULES = {
    "edited_part": """
import edited_helper
from edited_helper import LEVELS, Limits, clip, shaped
from twin.component import Component, input, output, parameter

OWN = 0.5


class Part(Component):
    \"\"\"Uses everything.\"\"\"

    period = 0.01
    u = input("m", "in")
    y = output("m", "out")
    g = parameter(2.0, "", "gain")

    def step(self, t, h):
        x = clip(self.u * self.g, Limits.low, Limits.high)
        for i in range(3):
            x = x + edited_helper.LEVELS[i] * OWN
        if edited_helper.inner.FAST:
            x = x + shaped(x)
        self.y = x + edited_helper.BOX.offset
""",
    "edited_helper": """
import edited_inner as inner
from edited_inner import Box, square

LEVELS = (1.0, 2.0, 4.0)
BOX = Box(0.25)


class Limits:
    low = -1.0
    high = 3.0


def clip(x: float, low: float, high: float) -> float:
    return min(max(x, low), high)


def shaped(x: float) -> float:
    return square(x) * inner.SCALE
""",
    "edited_inner": """
import numpy as np

SCALE = 1.5
FAST = True
TABLE = np.array([0.1, 0.2, 0.3])


class Box:
    def __init__(self, start):
        self.offset = start * 2.0 + TABLE[1]

    def __repr__(self):
        return "Box"


def square(x: float) -> float:
    return x * x + 0.75
""",
}
NUMBER = re.compile(r"(?<![\w.])\d+\.\d+|(?<![\w.])\d+(?![\w.])")
SWAPS = [
    ("+", "-"),
    ("*", "+"),
    ("True", "False"),
    ("min", "max"),
    ("low", "high"),
    ("self.g", "self.u"),
    ("OWN", "0.5 * OWN"),
]


def translated(folder, texts):
    """C and fingerprint of the component that these modules make; None if they make none."""
    for name, text in texts.items():
        write(folder / f"{name}.py", text)
    importlib.invalidate_caches()
    try:
        cls = importlib.import_module("edited_part").Part
        made = compiler.translate(cls, "Part")
        return made.header + made.source, compiler.component_fingerprint(cls)
    except Exception:  # an edit may leave anything
        return None
    finally:
        compiler.reset_fingerprints()
        for name in texts:
            sys.modules.pop(name, None)


@pytest.mark.slow
@settings(max_examples=60, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(st.data())
def test_an_edit_of_any_line_that_changes_the_c_is_noticed(tmp_path, monkeypatch, data):
    monkeypatch.syspath_prepend(str(tmp_path))
    name = data.draw(st.sampled_from(sorted(MODULES)))
    lines = MODULES[name].splitlines()
    number = data.draw(st.sampled_from([i for i, line in enumerate(lines) if line.strip()]))
    line = lines[number]
    edits = [line.replace(old, new, 1) for old, new in SWAPS if old in line]
    if found := NUMBER.search(line):
        edits.append(
            line[: found.start()]
            + data.draw(st.sampled_from(["7", "0.125", "3.0000000000000004"]))
            + line[found.end() :]
        )
    lines[number] = data.draw(st.sampled_from([*edits, "", line + "  # a remark"]))
    before = translated(tmp_path, MODULES)
    assert before is not None
    assert before[1] is not None
    after = translated(tmp_path, {**MODULES, name: "\n".join(lines) + "\n"})
    if after is not None and after[0] != before[0]:
        assert after[1] != before[1]
