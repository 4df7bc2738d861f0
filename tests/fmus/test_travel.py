"""Travel of an instrument: the vessel and its centerline, Hall sensors, and the fusion with the fiber.

Over 400 lines: three components of one chain, tested on the same vessel.
"""

import math
import re
from pathlib import Path

import numpy as np
import pytest
import yaml
from fmus.hall_travel.model import HallTravel
from fmus.travel_fusion.model import TravelFusion
from fmus.vessel_travel import centerline
from fmus.vessel_travel.model import VesselTravel

from twin.run import RunOptions, run_scenario
from twin.scenario import Backend, parse_scenario

H = 4e-3
SKETCH = Path(__file__).parents[2] / "scenarios" / "vessels" / "femoral_to_arch.csv"
FREE = {"creep": 0.0, "slack": 0.0, "lumen": 2.67e-3, "axial_stiffness": 1e9}


def circle(radius, angle, step=2e-3):
    turned = np.arange(0.0, angle, step / radius)
    ones = np.ones_like(turned)
    return np.column_stack((radius * np.cos(turned), radius * np.sin(turned), 0.1 * ones, 8e-3 * ones))


def test_the_table_of_the_component_is_made_of_the_sketch():
    values = yaml.safe_load(centerline.parameter_set(SKETCH))["vessel_travel"]
    vessel = VesselTravel()
    for name in ("curvature_1", "curvature_2"):
        np.testing.assert_array_equal(values[name], getattr(vessel, name))
    np.testing.assert_allclose([1e-3 * float(one.split()[0]) for one in values["lumen"]], vessel.lumen, atol=1e-9)


def test_a_circle_has_its_curvature_and_straight_ends():
    found = centerline.table(circle(0.1, 4.0))
    size = np.hypot(found["curvature_1"], found["curvature_2"])
    np.testing.assert_allclose(size[4:17], 10.0, rtol=0.03)  # smoothing takes 2 % of the radius
    np.testing.assert_allclose(size[24:], 0.0, atol=1e-6)  # the line ends at 400 mm
    np.testing.assert_allclose(found["lumen"], 16e-3)


def test_directions_do_not_turn_about_a_helix_of_any_start():
    turned = np.arange(0.0, 12.0, 0.02)
    rows = np.column_stack((0.05 * np.cos(turned), 0.05 * np.sin(turned), 0.03 * turned, 0.01 * np.ones_like(turned)))
    found = centerline.table(rows)
    bends = found["curvature_1"] + 1j * found["curvature_2"]
    size = 0.05 / (0.05**2 + 0.03**2)
    torsion = 0.03 / (0.05**2 + 0.03**2)
    np.testing.assert_allclose(np.abs(bends[4:30]), size, rtol=0.15)

    # Frenet's normal turns by the torsion, the two directions do not: so the curvature goes round in them; smoothing narrows the helix
    np.testing.assert_allclose(np.abs(np.angle(bends[5:30] / bends[4:29])), torsion * centerline.SPACING, rtol=0.06)


def write_vtp(path, rows, radius=centerline.RADIUS, kind="ascii"):
    points = " ".join(str(1e3 * value) for value in rows[:, :3].ravel())
    radii = " ".join(str(1e3 * value) for value in rows[:, 3])
    path.write_text(
        f'<VTKFile type="PolyData"><PolyData><Piece><PointData><DataArray Name="{radius}" format="{kind}">{radii}</DataArray>'
        f'</PointData><Points><DataArray NumberOfComponents="3" format="{kind}">{points}</DataArray></Points></Piece></PolyData>'
        "</VTKFile>"
    )
    return path


def test_vtp_is_read_as_csv(tmp_path):
    rows = centerline.read(SKETCH)
    np.testing.assert_allclose(centerline.read(write_vtp(tmp_path / "a.vtp", rows)), rows, atol=1e-12)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("a,b\n1,2\n", "Expected columns x, y, z, radius"),
        ("", "Expected columns x, y, z, radius"),
        ("x,y,z,radius\n0,0,0,5\n0,0,nan,5\n0,0,200,5\n0,0,300,5\n", "point 2 has a value that is no number"),
        ("x,y,z,radius\n0,0,0,5\n0,0,1,5\n0,0,2,5\n0,0,3,5\n", "4 points over 3 mm"),
        ("x,y,z,radius\n0,0,0,5\n0,0,100\n", "Expected columns x, y, z, radius"),
    ],
)
def test_a_bad_centerline_is_told(tmp_path, text, message):
    path = tmp_path / "mine.csv"
    path.write_text(text)
    with pytest.raises(ValueError, match=re.escape(message)) as told:
        centerline.read(path)
    assert "\n" not in str(told.value)


def test_a_bad_vtp_or_name_is_told(tmp_path):
    rows = circle(0.1, 2.0)
    with pytest.raises(ValueError, match="binary data"):
        centerline.read(write_vtp(tmp_path / "a.vtp", rows, kind="binary"))
    with pytest.raises(ValueError, match="no MaximumInscribedSphereRadius"):
        centerline.read(write_vtp(tmp_path / "a.vtp", rows, radius="r"))
    with pytest.raises(ValueError, match="no such file"):
        centerline.read(tmp_path / "none.csv")
    with pytest.raises(ValueError, match=r"ends with '\.stl'"):
        centerline.read(tmp_path / "a.stl")


def drive(vessel, waypoints, speed=0.02, t=0.0):
    for target in waypoints:
        here = float(vessel.carriage_travel)
        for _ in range(round(abs(target - here) / speed / H)):
            vessel.carriage_travel += math.copysign(speed * H, target - here)
            vessel.advance(t, H)
            t += H


def test_without_play_the_tip_does_what_the_gripper_does(native):
    vessel = native(VesselTravel, **FREE)
    vessel.start()
    drive(vessel, [0.1, 0.02])
    assert vessel.travel == pytest.approx(0.02, abs=1e-8)


def test_a_withdrawal_takes_up_all_play_before_the_tip_moves(native):
    vessel = native(VesselTravel, creep=0.0)
    vessel.start()
    drive(vessel, [0.1])
    before, play = float(vessel.travel), float(vessel.play)
    assert 8e-3 < play < 20e-3
    drive(vessel, [0.1 - 0.95 * play])
    assert vessel.travel == pytest.approx(before, abs=1e-5)
    drive(vessel, [0.1 - play - 5e-3])
    assert vessel.travel == pytest.approx(before - 5e-3, abs=0.5e-3)


def test_a_gripper_that_slides_or_creeps_loses_travel(native):
    vessel = native(VesselTravel, grip=0.0)
    vessel.start()
    drive(vessel, [0.05])
    assert vessel.travel == 0.0
    vessel = native(VesselTravel, **{**FREE, "creep": 0.022})
    vessel.start()
    drive(vessel, [0.3])
    assert 0.3 * (1.0 - 0.022) < vessel.travel < 0.3


def test_breath_moves_the_curvature_beyond_the_fixed_part_only(native):
    vessel = native(VesselTravel, heart_motion=0.0, tip_location=0.6)
    vessel.start()
    first = vessel.curvature.copy()
    for k in range(round(2.5 / H)):
        vessel.advance(k * H, H)
    change = np.abs(vessel.curvature - first).sum(axis=1)
    assert change[:3].max() < 1e-12  # 220 to 250 mm from the entry
    assert change.max() > 0.1


def test_hall_sensors_are_right_within_their_errors(native):
    hall = native(HallTravel)
    hall.start()
    for k in range(1000):
        hall.carriage_travel = 135e-3 * k / 1000
        hall.advance(k * H, H)
        assert hall.measured_travel == pytest.approx(hall.carriage_travel, abs=0.5e-3)
        steps = hall.measured_travel / hall.resolution
        assert steps == pytest.approx(round(float(steps)), abs=1e-6)
    assert hall.age == H
    hall.stopped = True
    stood = float(hall.measured_travel)
    hall.carriage_travel = 0.2
    hall.advance(4.0, H)
    hall.advance(4.0 + H, H)
    assert hall.measured_travel == stood
    assert hall.age == pytest.approx(3 * H)


class Made:
    """A gripper at 10 mm/s from 10 s on, a tip that follows, a profile that breathes; `run` yields the fusion."""

    def __init__(self, native, slip=(0.0, 0.0), breath=3e-3, **values):
        self.fusion = native(TravelFusion, **values)
        self.fusion.start()
        self.slip = slip
        self.breath = breath
        self.tip = self.hall = self.t = 0.0
        self.phase = 0.7
        self.noise = np.random.default_rng(3)

    def go(self, until, status=0, hall_age=H, shift=None):
        errors = []
        while self.t < until - 0.5 * H:
            self.t += H
            if self.t > 10.0:
                self.hall += 0.01 * H
                self.tip += 0.0 if self.slip[0] < self.t < self.slip[1] else 0.01 * H * (1.0 - 0.011)
            angle = 2.0 * math.pi * 0.2 * self.t + self.phase
            moved = self.breath * (math.sin(angle) - math.sin(self.phase))
            fusion = self.fusion
            fusion.measured_travel = self.hall
            fusion.hall_age = hall_age
            fusion.shift = self.tip + moved + 0.2e-3 * self.noise.standard_normal() if shift is None else shift
            fusion.tracking_status = status
            fusion.advance(self.t - H, H)
            errors.append([float(fusion.travel) - self.tip, float(fusion.shift) - self.tip, self.hall - self.tip])
        return np.sqrt(np.mean(np.square(errors), axis=0))


def test_breath_is_learned_and_taken_off(native):
    fused, shift, _ = Made(native).go(22.0)
    assert shift > 2e-3
    assert fused < 0.3e-3
    blind, _, _ = Made(native, breath_size=1e-6).go(22.0)
    assert blind > 3.0 * fused


def go_back(made, play, lead):
    """Withdraw at 10 mm/s: the match moves before the tip does, by `play`; `lead` of that is told. rms errors after it is taken up."""
    fusion, began, stood, errors = made.fusion, made.hall, made.tip, []
    while made.hall > began - 0.06:
        made.t += H
        made.hall -= 0.01 * H
        gone = began - made.hall
        made.tip = stood - max(gone - 10e-3 - play, 0.0)
        between = play * max(
            1.0 - (stood - made.tip) / 0.12, 0.0
        )  # what lies between match and tip is another piece, farther back
        behind = min(max(gone - 10e-3, 0.0), between)
        fusion.measured_travel, fusion.shift, fusion.tip_lead = made.hall, made.tip - behind, lead * min(behind, play)
        fusion.advance(made.t - H, H)
        if gone > 20e-3 + play:
            errors.append(float(fusion.travel) - made.tip)
    return float(np.sqrt(np.mean(np.square(errors))))


def test_play_behind_the_tip_is_seen_by_how_the_profile_is_stretched(native):
    found = []
    for lead in (0.0, 1.0):
        made = Made(native, breath=0.0)
        made.go(22.0)
        found.append(go_back(made, 6e-3, lead))
    assert found[0] > 3e-3
    assert found[1] < 0.35 * found[0]


@pytest.mark.slow_repetitions
@pytest.mark.parametrize("lead", [math.nan, math.inf, -math.inf])
def test_a_lead_that_is_no_number_does_no_harm(native, lead):
    made = Made(native, breath=0.0)
    made.go(22.0)
    made.fusion.tip_lead = lead
    go_back(made, 6e-3, lead)
    made.go(made.t + 5.0)
    made.fusion.tip_lead = 0.0
    go_back(made, 6e-3, 0.0)
    assert math.isfinite(made.fusion.travel)
    assert made.fusion.travel == pytest.approx(made.tip, abs=8e-3)  # the play


def test_slip_is_told_while_it_lasts_and_not_without(native):
    made = Made(native, slip=(14.0, 16.0))
    made.go(13.9)
    assert not made.fusion.slipping
    assert made.fusion.status == 0
    made.go(15.8)
    assert made.fusion.slipping
    assert made.fusion.status == 1
    made.go(21.0)
    assert not made.fusion.slipping
    assert abs(made.fusion.travel - made.tip) < 3e-3
    assert made.hall - made.tip > 20e-3
    whole = Made(native)
    whole.go(21.0)
    assert whole.fusion.slip < 1e-3


def test_without_the_fiber_slip_is_neither_seen_nor_told(native):
    made = Made(native, slip=(14.0, 16.0))
    made.go(13.0)
    made.go(20.0, status=2)
    assert made.fusion.status == 1
    assert not made.fusion.slipping
    assert made.fusion.travel - made.tip == pytest.approx(0.02, abs=1e-3)


def test_a_shift_that_counts_anew_is_not_a_jump(native):
    made = Made(native, breath=0.0)
    made.go(14.0)
    before = float(made.fusion.travel)
    made.go(14.5, status=2)
    made.tip -= 0.02  # the tracker lost its count of 20 mm while the tip came 5 mm on
    made.go(15.0)
    assert made.fusion.travel == pytest.approx(before + 0.01, abs=0.5e-3)


def test_a_gripper_that_moves_a_bow_for_long_without_the_fiber_is_lost(native):
    made = Made(native, slip=(10.0, 100.0))
    states = []
    for until in (15.0, 20.0, 25.0, 30.0, 35.0, 40.0):  # 300 mm of the gripper, nothing of the tip
        made.go(until, status=2)
        states.append(int(made.fusion.status))
    assert states[0] == 1
    assert states[-1] == 2
    assert abs(made.fusion.travel - made.tip) < 2.0 * made.fusion.uncertainty
    made.go(41.0)  # that it comes back tells nothing of where the tip is
    assert made.fusion.status == 2


@pytest.mark.parametrize("jump", [-25e-3, 25e-3])
def test_a_bow_that_springs_open_is_no_breath(native, jump):
    made = Made(native)
    made.go(20.0)
    made.hall += 0.0
    for _ in range(125):  # the gripper stands, the tip jumps within half a second
        made.t += H
        made.tip += jump / 125
        made.fusion.measured_travel, made.fusion.shift = made.hall, made.tip + shifted(made)
        made.fusion.advance(made.t - H, H)
    for _ in range(1250):
        made.t += H
        made.fusion.shift = made.tip + shifted(made)
        made.fusion.advance(made.t - H, H)
        assert abs(made.fusion.breath) < 5e-3
        assert abs(made.fusion.travel - made.tip) < 3.0 * made.fusion.uncertainty
    assert abs(made.fusion.travel - made.tip) < 2.5e-3


def shifted(made):
    """By what breath moves the profile, with the noise of the shift [m]."""
    angle = 2.0 * math.pi * 0.2 * made.t + made.phase
    return made.breath * (math.sin(angle) - math.sin(made.phase)) + 0.2e-3 * made.noise.standard_normal()


def test_a_shift_that_contradicts_the_gripper_is_not_called_valid_afterwards(native):
    made = Made(native)
    made.go(12.0)
    made.tip -= 0.05  # one of both measures is wrong by 50 mm from now on: which one cannot be known
    made.go(14.0)
    assert made.fusion.status != 0
    assert made.fusion.uncertainty > 20e-3


def test_a_shift_that_is_not_sure_of_itself_makes_the_travel_less_sure(native):
    sure, unsure = Made(native), Made(native)
    sure.fusion.shift_uncertainty, unsure.fusion.shift_uncertainty = 0.1e-3, 4e-3
    sure.go(20.0)
    unsure.go(20.0)
    assert unsure.fusion.uncertainty > 1.3 * sure.fusion.uncertainty


@pytest.mark.parametrize("uncertainty", [math.nan, math.inf, -1.0])
def test_an_uncertainty_that_is_no_number_is_a_shift_that_is_not_used(native, uncertainty):
    made = Made(native)
    made.go(12.0)
    made.fusion.shift_uncertainty = uncertainty
    made.go(14.0)
    assert math.isfinite(made.fusion.travel)
    assert math.isfinite(made.fusion.uncertainty)
    assert made.fusion.status == 1


@pytest.mark.parametrize("shift", [math.nan, math.inf])
def test_a_shift_that_is_no_number_does_no_harm(native, shift):
    made = Made(native)
    made.go(12.0)
    made.go(13.0, shift=shift)
    assert made.fusion.status == 1
    assert made.fusion.travel == pytest.approx(made.tip, abs=1.5e-3)


def test_a_shift_beyond_belief_counts_anew_and_leaves_the_travel_lost(native):
    made = Made(native)
    made.go(12.0)
    made.go(12.02, shift=5.0)
    assert made.fusion.travel == pytest.approx(made.tip, abs=1.5e-3)
    made.go(13.0, shift=5.0)
    assert made.fusion.status == 2
    assert abs(made.fusion.travel - made.tip) < made.fusion.uncertainty


def test_neither_measure_is_lost(native):
    made = Made(native)
    made.go(11.0)
    made.go(11.1, status=2, hall_age=0.1)
    assert made.fusion.status == 2
    made.go(11.2)
    assert made.fusion.status == 0


def test_hall_sensors_that_come_back_move_nothing_unless_the_fiber_was_away_too(native):
    made = Made(native)
    made.go(14.0)
    held = made.hall
    made.go(15.0, hall_age=0.1)
    assert made.fusion.status == 1
    assert made.fusion.travel == pytest.approx(made.tip, abs=4e-3)
    assert made.hall > held
    made.go(15.5)
    assert made.fusion.travel == pytest.approx(made.tip, abs=4e-3)
    made = Made(native)
    made.go(14.0)
    for _ in range(250):  # both are away while the gripper goes on by 10 mm
        made.t += H
        made.hall += 0.01 * H
        made.tip += 0.01 * H
        made.fusion.measured_travel, made.fusion.hall_age, made.fusion.tracking_status = made.hall - 0.01, 0.1, 2
        made.fusion.advance(made.t - H, H)
    made.go(15.5, status=2)
    assert made.fusion.travel == pytest.approx(made.tip, abs=2e-3)


def verdicts(variant, tmp_path, build, **replaced):
    """Of the scenario's expectations for one variant and seed, with something in its text replaced."""
    path = SKETCH.parents[1] / "travel_distance.yaml"
    text = path.read_text()
    for old, new in replaced.values():
        assert old in text
        text = text.replace(old, new)
    scenario = parse_scenario(text, path)
    outcome = run_scenario(
        scenario,
        RunOptions(
            backend=Backend.compiled, variants=[variant], seeds=[1], root=tmp_path / "runs", build=build, report=False
        ),
    )
    return {one.name: one.verdict for one in outcome.evaluation.expectation_results}


SLIPS = "at: 14 s, set: {vessel_travel.grip: 0}"


@pytest.mark.slow
@pytest.mark.parametrize(
    ("instead", "told"),
    [
        (SLIPS, "pass"),
        ("at: 14 s, set: {vessel_travel.grip: 1}", "fail"),
        ("at: 13 s, set: {fiber.stopped: true}", "fail"),
    ],
)
def test_expectations_fail_without_slip_and_without_fiber(tmp_path, build, instead, told):
    found = verdicts("slip", tmp_path, build, event=(SLIPS, instead))
    assert found["slip is reported"] == told


@pytest.mark.slow
def test_expectations_fail_if_the_fusion_has_no_fiber(tmp_path, build):
    whole = verdicts("abdomen", tmp_path, build)
    assert whole["fused rms error below both sensors'"] == whole["status valid with both sensors"] == "pass"
    deaf = (
        "  - tip_tracking.status -> travel_fusion.tracking_status",
        "  - {from: null, to: travel_fusion.tracking_status}",
    )
    starts = (
        "  travel_fusion: {component: travel_fusion}",
        "  travel_fusion: {component: travel_fusion, parameters: {tracking_status: 2}}",
    )
    found = verdicts("abdomen", tmp_path, build, deaf=deaf, starts=starts)
    for name in (
        "fused rms error below both sensors'",
        "fused rms error at most a third of the worse sensor's",
        "status valid with both sensors",
    ):
        assert found[name] == "fail", name
