"""When a condition is met: how long it must hold, from when on, and how often."""

from types import SimpleNamespace

import numpy as np
import pytest

from twin.coupling.execution import condition_loop
from twin.coupling.execution.condition_loop import DISARMED, LESS, MET, NUMBER, VALUE, WAITING
from twin.coupling.execution.loop import KINDS


@pytest.mark.parametrize(
    ("hold", "first", "repeats", "expected"),
    [
        (0, 0, False, [1]),
        (0, 2, False, [2]),
        (0, 0, True, [1, 5, 8]),
        (2, 0, True, [3, 10]),
        (3, 0, True, [11]),
        (2, 2, True, [10]),
        (4, 0, True, []),
    ],
)
def test_phases(hold, first, repeats, expected):
    is_true = [0, 1, 1, 1, 0, 1, 1, 0, 1, 1, 1, 1, 0]
    value, stack, state = np.zeros(1), np.zeros(2), np.zeros(2, np.int64)
    program = np.array([[NUMBER, 0, 0], [VALUE, value.ctypes.data, KINDS["f8"]], [LESS, 0, 0]], np.int64)
    row = np.array([[program.ctypes.data, 3, hold, first, state.ctypes.data]], np.int64)
    record = SimpleNamespace(conditions=row.ctypes.data, condition_count=1, stack=stack.ctypes.data)
    met = []
    for tick, value[0] in enumerate(is_true):
        if condition_loop.is_met(record, tick):
            assert state[0] == MET
            state[0] = WAITING if repeats else DISARMED
            met.append(tick)
    assert met == expected
