"""Which measured values an identification compares: those that the inputs cover, whatever a delay within its range is."""

import numpy as np
import pytest

from tests.study.recordings import FILE, identify_file, recorded
from twin import clock
from twin.identify import load


@pytest.fixture(scope="module")
def folder(tmp_path_factory, build):
    folder = tmp_path_factory.mktemp("recordings")
    recorded(folder, build)
    return folder


@pytest.mark.slow_repetitions
@pytest.mark.parametrize(
    ("delay", "window", "first", "last", "stop"),
    [
        ("", "", 0.0, 4.0, 4.0),
        ("delay: {from: -0.1 s, to: 0.2 s}", "", 0.2, 3.9, 4.0),  # [begin + most, end + least]
        ("delay: {from: 0.05 s, to: 0.2 s}", "", 0.2, 4.0, 3.95),  # nothing after 4 s - 0.05 s is needed
        ("delay: 0.1 s", "", 0.1, 4.0, 3.9),
        ("delay: -0.1 s", "", 0.0, 3.9, 4.0),
        ("", "from: 1 s\nto: 2 s\n", 1.0, 2.0, 2.0),
        ("delay: {from: -0.1 s, to: 0.2 s}", "from: 1 s\nto: 2 s\n", 1.0, 2.0, 2.1),
    ],
)
def test_values_outside_of_the_inputs_are_left_out(folder, delay, window, first, last, stop):
    output = f"{{signal: sheath.tip_position, {delay}}}" if delay else "sheath.tip_position"
    problem = load(identify_file(folder, FILE.replace("sheath.tip_position}", f"{output}}}") + window))
    (recording,) = problem.recordings
    times = recording.outputs[0].time
    assert times[0] == pytest.approx(first, abs=1e-9)
    assert times[-1] == pytest.approx(last, abs=1e-9)
    np.testing.assert_allclose(np.diff(times), 0.025)
    assert clock.seconds(recording.case.stop_ns) == pytest.approx(stop, abs=1e-9)
