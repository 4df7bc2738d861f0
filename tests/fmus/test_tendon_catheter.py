"""The catheter with its own physics: against what friction, capstan and arcs say, and calibrated as the paper does."""

import importlib.util
import re
import sys
from math import cos, exp, pi, sin
from pathlib import Path

import numpy as np
import pytest
from fmus.tendon_catheter.model import TendonCatheter

H = 10e-3
MM = 1e-3
QUIET = {"friction_deviation": 0.0, "tilt_deviation": 0.0, "warm": 0.0}
ROOT = Path(__file__).parents[2]


@pytest.fixture
def catheter(native):
    def started(**values):
        part = native(TendonCatheter, **QUIET | values)
        part.start(0.0)
        return part

    return started


def move(part, handle=None, wire=None, steps=50):
    """Both slides evenly to a place; the tip there [m]."""
    begin = float(part.handle_position), float(part.wire_position)
    end = begin[0] if handle is None else handle, begin[1] if wire is None else wire
    for k in range(1, steps + 1):
        part.handle_position, part.wire_position = (a + (b - a) * k / steps for a, b in zip(begin, end, strict=True))
        assert part.advance(0.0, H) == 0
    return float(part.tip_y), float(part.tip_z)


def test_a_reversal_costs_the_play_of_friction_and_stiffness(catheter):
    part = catheter(breakaway=1.0, creep=0.0, tilt=0.0)
    ahead = move(part, 20 * MM)[1]
    back = move(part, 10 * MM)[1]
    play = 2.0 * 4.0 / 5.06e3
    assert ahead - back == pytest.approx(10 * MM - play, abs=1e-5)
    assert move(part, 5 * MM)[1] == pytest.approx(back - 5 * MM, abs=1e-5)


def test_breaks_loose_above_the_friction_of_sliding(catheter):
    part = catheter(breakaway=1.2, creep=0.0)
    move(part, 20 * MM)
    move(part, 20 * MM)  # rests: it sticks again
    forces = []
    for k in range(200):
        move(part, (20 + 0.005 * k) * MM, steps=1)
        forces.append(-float(part.handle_force))
    assert max(forces) == pytest.approx(1.2 * 4.0, rel=0.02)
    assert forces[-1] == pytest.approx(4.0, rel=1e-6)


def test_the_guide_creeps_under_a_force_that_stays(catheter):
    part = catheter(creep=0.3, creep_time=5.0)
    move(part, 10 * MM, steps=5)
    move(part, 5 * MM, steps=5)
    before = float(part.tip_z)
    after = move(part, steps=1000)[1]
    assert 0.005 * MM < abs(after - before) < 2 * 0.3 * 4.0 / 80e3


def test_the_wires_friction_is_that_of_a_capstan(catheter):
    part = catheter(friction_coefficient=0.1)
    move(part, wire=8 * MM)
    stiffness = 250e-6 / (29.7e-3 * 0.9e-3)
    angle = float(part.deflection)
    assert -float(part.wire_force) * exp(-0.1 * (pi + angle)) == pytest.approx(stiffness * angle, rel=0.01)
    move(part, wire=6 * MM)
    assert float(part.deflection) == angle  # the friction holds it
    move(part, wire=2 * MM)
    released = float(part.deflection)
    assert released < angle
    assert -float(part.wire_force) * exp(0.1 * (pi + released)) == pytest.approx(stiffness * released, rel=0.03)


def test_without_the_wires_friction_the_way_back_is_the_way_out(catheter):
    part = catheter(friction_coefficient=0.0)
    ways = [[move(part, wire=pull * MM)[0] for pull in pulls] for pulls in (range(10), range(9, -1, -1))]
    assert ways[0] == pytest.approx(ways[1][::-1], abs=1e-9)
    assert np.all(np.diff(ways[0]) > 0.0)


def test_the_tip_is_at_the_end_of_two_arcs(catheter):
    part = catheter(shaft_bending_stiffness=1e9, tilt=0.0)
    y, z = move(part, wire=9 * MM)
    angle = float(part.deflection)
    assert y == pytest.approx(29.7e-3 * (1 - cos(angle)) / angle, abs=1e-8)
    assert z == pytest.approx(29.7e-3 * (sin(angle) / angle - 1), abs=1e-6)


def test_warm_plastic_moves_the_tip(catheter):
    cold, warm = (catheter(warm=25.0, powered=one) for one in (0.0, 1e5))
    grown = 68e-6 * 60e-3 * 25.0
    assert float(warm.tip_z) - float(cold.tip_z) == pytest.approx(grown, rel=1e-3)
    begin = move(cold, 10 * MM)[1]
    for _ in range(90):
        cold.advance(0.0, 10.0)
    assert float(cold.tip_z) - begin == pytest.approx(grown * (1 - exp(-1)), rel=0.2)


@pytest.fixture(scope="module")
def coordinates():
    sys.path.insert(0, str(ROOT / "docs"))
    spec = importlib.util.spec_from_file_location("coordinates", ROOT / "docs" / "coordinates.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    sys.path.remove(str(ROOT / "docs"))
    return module


@pytest.mark.slow
def test_the_papers_calibration_helps_on_a_plant_it_does_not_know(coordinates):
    """One bench that the page's 200 do not have gives what they give."""
    found = coordinates.figures([301], coordinates.FRICTIONLESS, coordinates.AS_PRINTED)
    for control in coordinates.AS_PRINTED:
        (row,) = re.findall(rf"\| no friction, 200 seeds \| {control} \|(.*)", coordinates.PAGE.read_text())
        spans = re.findall(r"\(([\d.]+) to ([\d.]+)\) mm", row)
        for axis, (low, high) in zip(("rms_z", "rms_y"), spans, strict=True):
            (value,) = found[control, axis]
            assert 0.8 * float(low) < value < 1.25 * float(high), (control, axis)
