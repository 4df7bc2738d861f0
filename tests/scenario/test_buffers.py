"""A parameter that outgrows a buffer of fixed size is an error when the scenario is loaded, and names both numbers."""

import pytest

from tests.every_case import every_case
from twin.component import Component, buffers, local, output, parameter
from twin.errors import ScenarioError
from twin.run import resolve_catalogs
from twin.scenario import parse_scenario

TEXT = "stop_time: 1 s\nmembers: {{one: {{component: {component}, period: {period}, parameters: {{{values}}}}}}}\n"


@every_case(
    ("component", "period", "values", "problem"),
    [
        ("quasi_periodic_control", "5 ms", "", ""),
        (
            "quasi_periodic_control",
            "2 ms",
            "",
            "rate_minimum = 0.7 Hz needs 714.3 periods of 0.002 s, and its buffer holds 357",
        ),
        ("quasi_periodic_control", "2 ms", "rate_minimum: 1.5 Hz", ""),
        ("phase_locked_control", "0.5 ms", "", "delay = 0.02 s needs 40 periods of 0.0005 s, and its buffer holds 30"),
        ("force_sensor", "5 ms", "latency: 155 ms", ""),
        (
            "force_sensor",
            "5 ms",
            "latency: 160 ms",
            "latency = 0.16 s needs 32 periods of 0.005 s, and its buffer holds 31",
        ),
        ("image_position", "2 ms", "", "latency = 0.3 s needs 150 periods of 0.002 s, and its buffer holds 64"),
    ],
)
def test_a_buffer_that_is_too_small_is_named(component, period, values, problem):
    scenario = parse_scenario(TEXT.format(component=component, period=period, values=values), "one.yaml")
    if not problem:
        resolve_catalogs(scenario)
        return
    with pytest.raises(ScenarioError) as error:
        resolve_catalogs(scenario)
    (line,) = [one for one in error.value.problems if "buffer" in one]
    assert line.startswith("one.yaml:2: one.")
    assert problem in line
    assert "sample less often" in line


class Delay(Component):
    """A delay line."""

    period = 0.01
    buffers = (("delay", 8),)
    y = output("", "out")
    delay = parameter((0.02, 0.05), "s", "delays")
    line = local(0.0, "", "ring", shape=(8,))

    def step(self, t, h):
        self.y = self.line[0]


@pytest.mark.parametrize(("values", "count"), [({}, 0), ({"delay": [0.08, 0.01]}, 0), ({"delay": [0.01, 0.081]}, 1)])
def test_the_largest_of_an_array_counts(values, count):
    assert len(buffers.overflows(Delay, values, 0.01)) == count
