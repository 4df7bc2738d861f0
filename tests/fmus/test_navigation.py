"""Catheter and guidewire in a vessel: their friction, the guide around the wire, the fluoroscope, and the whole navigation."""

import math
from pathlib import Path

import numpy as np
import pytest
import yaml
from fmus.fluoroscope.model import CENTERLINE_POINTS, Fluoroscope
from fmus.vessel_friction.model import VesselFriction
from fmus.vessel_travel import centerline
from fmus.vessel_travel.model import POINTS, SPACING, VesselTravel

from twin.run import RunOptions, run_scenario
from twin.scenario import load_scenario

H = 1e-3
ROOT = Path(__file__).parents[2]
BEND = {"curvature_1": 10.0, "curvature_2": 0.0}  # radius 100 mm all along
FRAME = 80e-3


def pushed(native, catheter, wire, **values):
    """Forces and limits over given lengths of both in the vessel."""
    part = native(VesselFriction, **{**BEND, **values})
    part.catheter_position, part.wire_position = catheter[0], wire[0]
    part.start(0.0)
    rows = []
    for step, (a, b) in enumerate(zip(catheter, wire, strict=True)):
        part.catheter_position, part.wire_position = a, b
        assert part.advance(step * H, H) == 0
        rows.append((float(part.catheter_force), float(part.wire_force), float(part.wall_force), *part.limit.tolist()))
    return np.array(rows).T


def capstan(dry, coefficient, angle, end=0.0):
    """Thrust that moves what is bent by an angle, against a thrust at its end: dF/da = dry + coefficient F."""
    return (end + dry / coefficient) * math.exp(coefficient * angle) - dry / coefficient


def test_limits_are_those_of_a_capstan(native):
    catheter, wire = 0.2, 0.35
    *_, own, beyond, between = pushed(native, [catheter], [wire])
    beyond_exact = capstan(0.38, 0.1, 10.0 * (wire - catheter))

    # pieces of 20 mm: dry friction of each is taken at its end
    assert own[0] == pytest.approx(0.6 + capstan(0.5, 0.15, 2.0), rel=0.02)
    assert beyond[0] == pytest.approx(beyond_exact, rel=0.02)
    assert between[0] == pytest.approx(capstan(0.38, 0.1, 2.0, beyond_exact) - beyond_exact, rel=0.02)


@pytest.mark.parametrize("speed", [0.005, 0.04])
def test_a_pushed_catheter_feels_its_own_friction_and_the_wires(native, speed):
    way = np.arange(0.0, 0.03, speed * H)
    catheter, wire, wall, own, _, between = pushed(native, 0.2 + way, np.full(len(way), 0.4))
    assert catheter[-1] == pytest.approx((own[-1] + between[-1]) * (1.0 + 5.0 * speed), rel=1e-2)
    assert wire[-1] == pytest.approx(-between[-1] * (1.0 + 5.0 * speed), rel=1e-2)
    assert wall == pytest.approx(catheter + wire, abs=1e-12)


def test_together_they_rub_on_the_vessel_alone(native):
    way = np.arange(0.0, 0.03, 2e-5)
    catheter, wire, _, own, beyond, _ = pushed(native, 0.2 + way, 0.35 + way, viscous=0.0)
    assert catheter[-1] == pytest.approx(own[-1], rel=1e-9)
    assert wire[-1] == pytest.approx(beyond[-1], rel=1e-9)


def test_straight_vessels_and_wires_behind_the_catheter(native):
    assert not pushed(native, [0.1, 0.2], [0.2, 0.3], curvature_1=0.0, entry_friction=0.0).any()
    *_, beyond, between = pushed(native, [0.3], [0.2])
    assert beyond[0] == 0.0
    assert between[0] > 0.0


def test_friction_never_gives_energy(native):
    random = np.random.default_rng(4)
    catheter, wire = 0.2 + np.cumsum(random.normal(0.0, 5e-5, (2, 8000)), axis=1)
    wire = wire + 0.1
    on_catheter, on_wire, *_ = pushed(native, catheter, wire)
    pairs = (on_catheter, catheter), (on_wire, wire)
    work = np.cumsum(sum(0.5 * (force[1:] + force[:-1]) * np.diff(way) for force, way in pairs))
    assert work.min() >= -1e-6
    assert work[-1] > 0.01


def test_a_guide_takes_the_play_of_the_vessel(native):
    values = {**BEND, "diameter": 0.9e-3, "tip_location": 0.4, "lumen": 10e-3, "slack": 0.0, "bending_stiffness": 1e-9}
    alone = native(VesselTravel, **values)
    guided = native(VesselTravel, **values, guide_lumen=1.4e-3, guide_location=0.4)
    half = native(VesselTravel, **values, guide_lumen=1.4e-3, guide_location=0.2)
    for part in (alone, guided, half):
        part.start(0.0)
    rod = 2.0 * float(np.sum(alone.squeeze))
    assert alone.play - rod == pytest.approx(9.1e-3 * 4.0, rel=1e-6)  # clearance times angle
    assert guided.play - rod == pytest.approx(0.5e-3 * 4.0, rel=1e-6)
    assert half.play - rod == pytest.approx((9.1e-3 + 0.5e-3) * 2.0, rel=1e-6)
    half.guide_travel = 0.2
    half.advance(0.0, 4e-3)
    assert half.play == pytest.approx(guided.play, rel=1e-6)


def test_a_circle_is_seen_as_one(native):
    part = native(Fluoroscope, curvature_1=5.0, curvature_2=0.0, lumen=10e-3, view=0.0)
    part.start(0.0)
    part.catheter_travel, part.wire_travel = 0.28, 0.44
    part.advance(0.0, FRAME)
    for name, angle in (("catheter_tip", 1.5), ("wire_tip", 2.5)):
        assert getattr(part, name) == pytest.approx(0.2 * np.array([1.0 - math.cos(angle), math.sin(angle)]), abs=2e-4)
    center = np.array([0.2, 0.0])
    radii = np.linalg.norm(part.vessel - center, axis=1)
    assert radii[1 : CENTERLINE_POINTS - 1] == pytest.approx(0.205, abs=3e-4)
    assert radii[CENTERLINE_POINTS + 1 : -1] == pytest.approx(0.195, abs=3e-4)
    assert np.linalg.norm(part.wire - center, axis=1) == pytest.approx(0.2, abs=3e-4)
    assert part.wire * 5000.0 == pytest.approx(np.round(part.wire * 5000.0), abs=1e-9)
    assert part.wire_location == pytest.approx(0.5)


def test_a_turned_view_sees_the_other_direction(native):
    side = native(Fluoroscope, curvature_1=0.0, curvature_2=5.0, view=math.pi / 2, wire_start=0.3)
    edge = native(Fluoroscope, curvature_1=0.0, curvature_2=5.0, view=0.0, wire_start=0.3)
    for part in (side, edge):
        part.start(0.0)
    assert side.wire_tip[0] == pytest.approx(0.2 * (1.0 - math.cos(1.5)), abs=2e-4)
    assert edge.wire[:, 0] == pytest.approx(0.0, abs=1e-4)


def test_a_centerline_is_for_all_that_know_the_vessel():
    found = yaml.safe_load(centerline.parameter_set(ROOT / "scenarios" / "vessels" / "femoral_to_arch.csv"))
    assert list(found) == ["vessel_travel", "vessel_friction", "fluoroscope"]
    for component, cls in (("vessel_friction", VesselFriction), ("fluoroscope", Fluoroscope)):
        np.testing.assert_array_equal(found[component]["curvature_2"], cls().curvature_2)
    assert len(found["fluoroscope"]["lumen"]) == POINTS == round(0.8 / SPACING) + 1


# ------------------------------------------------------------------------------------------------- the whole navigation


@pytest.fixture(scope="module")
def live(build, tmp_path_factory):
    """Half a minute with an operator who takes over; the whole scenario is run by the conformance tests."""
    scenario = load_scenario(ROOT / "scenarios" / "in_vivo_navigation.yaml")
    root = tmp_path_factory.mktemp("runs")
    outcome = run_scenario(scenario, RunOptions(variants=["live"], root=root, build=build, report=False))
    return outcome, outcome.tables["live", 0]


@pytest.mark.slow
def test_what_is_expected_holds(live):
    outcome, _ = live
    assert outcome.passed


@pytest.mark.slow
def test_the_estimate_begins_where_the_path_bends(live):
    _, signals = live
    status, travel = signals.values["tip_tracking.status"], signals.values["tip_tracking.travel"]
    found = int(np.argmax(status < 2))
    assert signals.time[found] > 8.0  # straight before: nothing to match
    assert travel[found] == pytest.approx(0.0, abs=2e-3)
    error = signals.values["travel_fusion.travel"] - signals.values["catheter_path.travel"]
    assert np.abs(error[found:]).max() < 2e-3


@pytest.mark.slow
def test_one_moves_and_the_other_regrips_nothing(live):
    _, signals = live
    held = signals.values["command.held"]
    for own, name in ((1, "catheter"), (2, "wire")):
        count = signals.values[f"{name}.sequencer.regrip_count"]
        while_held = np.diff(count)[(held[1:] == own) & (held[:-1] == own)]
        assert count[-1] > 3
        assert not while_held.any()
