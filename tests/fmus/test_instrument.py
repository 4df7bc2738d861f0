"""The instrument against closed forms, energy, another component, and arbitrary inputs.

Over 400 lines: everything about one component.
"""

from itertools import pairwise
from math import exp, pi

import numpy as np
import pytest
from fmus.instrument.model import Instrument
from fmus.sheath.model import Sheath
from hypothesis import example, given, settings
from hypothesis import strategies as st

from tests.fmus.instruments import guidewire
from tests.matrix import covering

H = 1e-3
HELD = {
    "limit_distal": (20.0, 0.0),
    "limit_proximal": (20.0, 0.0),
    "torque_limit": (0.04, 0.0),
    "grip_stiffness": (4.4e3, 0.0),
    "grip_torsional_stiffness": (0.1, 0.0),
}
GUIDEWIRE = guidewire("instrument")
OUTSIDE = {"section_length": (0.0, 0.0, 0.0)}


def advance(part, seconds, speed=0.0, turning=0.0, h=H):
    """Move gripper 1 and the frame from where they are at constant speeds."""
    x, angle = float(part.gripper_position[0]), float(part.gripper_angle)
    part.gripper_velocity[0], part.gripper_angular_velocity = speed, turning
    for step in range(round(seconds / h)):
        part.gripper_position[0] = x + speed * step * h
        part.gripper_angle = angle + turning * step * h
        assert part.advance(step * h, h) == 0
    part.gripper_position[0], part.gripper_angle = x + speed * seconds, angle + turning * seconds


@pytest.mark.parametrize("coefficient", [0.05, 0.15, 0.3])
@pytest.mark.parametrize("direction", [1, -1])
def test_thrust_grows_through_the_bends_like_a_rope_on_a_capstan(native, coefficient, direction):
    part = native(
        Instrument,
        **HELD,
        friction=0.0,
        drag=0.0,
        drag_free=1e-3,
        play=0.0,
        friction_coefficient=coefficient,
        tip_force=1.0,
        bending_stiffness=1.0,
        initial_insertion=0.6,
    )
    part.start(0.0)
    advance(part, 3.0, direction * 5e-3)
    # pi rad in all
    assert part.free_length_force == pytest.approx(exp(direction * coefficient * pi), rel=1e-3)


def closed_path(random, samples, size, h):
    """Smooth random path from 0 back to 0."""
    t = np.arange(samples) * h
    phases = random.uniform(0.0, 6.0, 3)
    return sum(size / k * (np.sin(2 * np.pi * k * t / t[-1] + p) - np.sin(p)) for k, p in enumerate(phases, 1))


@pytest.mark.slow
@pytest.mark.parametrize("seed", [0, *(pytest.param(more, marks=pytest.mark.slow) for more in (1, 2, 3))])
@pytest.mark.parametrize("kind", [{}, GUIDEWIRE])
def test_is_passive(native, seed, kind):
    """Work put in by grippers and tip is never negative, from rest on, while grips also open and close."""
    random = np.random.default_rng(seed)
    h, samples = 1e-4, 30000
    part = native(Instrument, **kind)
    paths = [closed_path(random, samples, size, h) for size in (8e-3, 8e-3, 3.0)]
    grips = [0.5 + 0.8 * np.sin(2 * np.pi * random.uniform(1, 3) * np.arange(samples) * h + p) for p in (0.0, 2.0)]
    force = random.uniform(0.1, 0.5) * (1.0 - np.cos(7.0 * np.arange(samples) * h))
    torque = 1e-4 * np.sin(5.0 * np.arange(samples) * h)
    values = []
    for step in range(samples):
        for g in range(2):
            closed = min(max(grips[g][step], 0.0), 1.0)
            part.gripper_position[g] = paths[g][step]
            part.limit_distal[g], part.limit_proximal[g] = 6.0 * closed, 4.0 * closed
            part.torque_limit[g], part.grip_stiffness[g] = 3e-3 * closed, 4.4e3 * closed
            part.grip_torsional_stiffness[g] = 0.1 * closed
        part.gripper_angle, part.tip_force, part.tip_torque = paths[2][step], force[step], torque[step]
        if step == 0:
            part.start(0.0)
        assert part.advance(step * h, h) == 0
        values.append(
            (
                -part.gripper_force[0],
                -part.gripper_force[1],
                -part.gripper_torque,
                -force[step],
                -torque[step],
                part.tip_position,
                part.tip_angle,
            )
        )
    values = np.array(values)
    moves = np.diff(np.column_stack((*paths, values[:, 5:])), axis=0)
    efforts = 0.5 * (values[1:, :5] + values[:-1, :5])
    work = np.cumsum(np.sum(efforts * moves, axis=1))
    assert np.abs(part.slip_distance).max() > 1e-3  # it did slip
    assert work.min() > -2e-5
    assert work[-1] > 5e-3


@pytest.mark.parametrize(("sign", "limit"), [(1, 7.0), (-1, 5.0)])
def test_slips_at_the_limit_of_that_direction(native, sign, limit):
    values = {**HELD, "limit_distal": (7.0, 0.0), "limit_proximal": (5.0, 0.0)}
    part = native(Instrument, **values, **OUTSIDE, drag_free=0.05)
    part.start(0.0)
    load = 0.0
    while not part.slipping[0]:
        load += 1e-3
        part.tip_force = sign * load
        assert part.advance(0.0, H) == 0
        assert load < 10.0
    assert load == pytest.approx(limit, abs=5e-3)
    assert part.slip_distance[0] * sign < 0.0  # the load pushes the instrument back through the sleeve


def test_force_and_torque_share_an_ellipse(native):
    part = native(Instrument, **{**HELD, "limit_distal": (10.0, 0.0), "torque_limit": (0.01, 0.0)}, **OUTSIDE)
    part.tip_force = 6.0
    part.start(0.0)
    advance(part, 0.2)
    torque = 0.0
    while not part.slipping[0]:
        torque += 1e-5
        part.tip_torque = torque
        advance(part, H)
        assert torque < 0.01
    assert torque == pytest.approx(0.008, abs=3e-5)


def test_axial_slip_releases_the_torque(native):
    """Slip goes along the normal of the ellipse, so a held twist is lost while the instrument is pulled through."""
    part = native(Instrument, **{**HELD, "limit_distal": (2.0, 0.0), "torque_limit": (5e-3, 0.0)})
    part.start(0.0)
    advance(part, 1.0, turning=1.0)
    held = abs(float(part.gripper_torque))
    part.friction[...] = 40.0  # the sheath jams
    advance(part, 2.0, speed=5e-3)
    assert held > 2e-3
    assert abs(float(part.gripper_torque)) < 0.01 * held
    assert part.gripper_force[0] == pytest.approx(-2.0, rel=1e-3)


def test_a_new_grip_begins_without_deflection(native):
    part = native(Instrument, **HELD)
    part.start(0.0)
    advance(part, 1.0, 5e-3)
    advance(part, 0.5)
    assert part.gripper_force[0] < -1.0
    part.limit_distal[1] = part.limit_proximal[1] = 20.0
    part.torque_limit[1], part.grip_stiffness[1], part.grip_torsional_stiffness[1] = 0.04, 4.4e3, 0.1
    advance(part, 5 * H)
    assert part.gripper_force[1] == 0.0
    part.limit_distal[0] = part.limit_proximal[0] = part.grip_stiffness[0] = 0.0
    advance(part, 0.2)
    assert part.gripper_force[0] == 0.0
    assert part.slip_distance[1] == 0.0
    # the elastic deflection of the first grip is lost: this is the regripping error
    assert part.gripper_force[1] < -0.5


@pytest.mark.slow
def test_twist_is_that_of_the_closed_form_at_any_speed(native):
    """Steady twist: friction torques downstream of each spring over its stiffness, without the bends' thrust."""
    torques = 1.335e-3 * np.array((2.2, 1.6, 0.8))
    wanted = float(np.sum(torques / np.array((8.7e-3, 46.5e-3, 46.5e-3)))) + 1.335e-3 * 2.2 / 0.1
    loops = []
    for speed in (0.1, 0.25, 1.25):
        part = native(Instrument, **HELD)
        part.start(0.0)
        advance(part, 2.0 / speed, turning=speed)
        forth = part.gripper_angle - part.tip_angle
        advance(part, 2.0 / speed, turning=-speed)
        loops.append(float(forth - (part.gripper_angle - part.tip_angle)))
        assert forth == pytest.approx(wanted, rel=0.01)
    assert np.ptp(loops) < 0.005 * loops[0]


def test_tip_stands_exactly_until_the_twist_is_reversed(native):
    part = native(Instrument, **HELD)
    part.start(0.0)
    advance(part, 4.0, turning=0.5)
    advance(part, 0.3)
    angle = float(part.tip_angle)
    advance(part, 1.6, turning=-0.5)  # 0.8 of 0.87 rad
    assert part.tip_angle == angle
    assert part.tip_position == 0.0
    advance(part, 0.4, turning=-0.5)
    assert part.tip_angle < angle


@pytest.mark.slow_repetitions
@pytest.mark.parametrize(("position", "length"), [(0.0, 0.04), (0.01, 0.03), (-0.02, 0.06)])
def test_free_length_buckles_at_eulers_load(native, position, length):
    values = {name: value[::-1] for name, value in HELD.items()}
    part = native(Instrument, **values, friction=30.0, bending_stiffness=3e-4, gripper_position=(0.0, position))
    part.start(0.0)
    euler = pi**2 * 3e-4 / (0.7 * length) ** 2
    largest = 0.0
    for step in range(12000):
        part.gripper_position[1] = position + 0.5e-6 * step
        assert part.advance(step * H, H) == 0
        largest = max(largest, float(part.free_length_force))
        if part.buckled:
            break
    assert part.buckled
    # by then the gripper has come closer by load over both stiffnesses
    moved = float(part.gripper_position[1]) - position
    assert largest == pytest.approx(pi**2 * 3e-4 / (0.7 * (length - moved)) ** 2, rel=1e-3)
    assert largest > euler

    # bowed out further it passes on the same load, and pulled back it straightens
    buckled_at = largest
    for step in range(3000):
        part.gripper_position[1] += 1e-6
        part.advance(step * H, H)
    assert part.free_length_force == pytest.approx(buckled_at, rel=0.02)
    for step in range(9000):
        part.gripper_position[1] -= 1e-6
        part.advance(step * H, H)
    assert not part.buckled
    assert part.free_length_force < 0.5 * buckled_at


def test_between_the_grippers_it_buckles_only_if_the_second_is_open(native):
    part = native(Instrument, **HELD)
    part.start(0.0)
    assert part.free_length == pytest.approx(0.17 - 0.04 - 0.06)
    both = native(Instrument, **{name: (value[0],) * 2 for name, value in HELD.items()})
    both.start(0.0)
    assert both.free_length == pytest.approx(0.04)


def test_fully_inserted_it_is_the_sheath_behind_a_grip(native):
    """Same path, same contact force, another integrator: tip and reaction agree."""
    part, sheath = native(Instrument, **HELD, drag_free=1e-3), native(Sheath)
    part.start(0.0)
    sheath.start(0.0)
    t = np.arange(0.0, 4.0, H)
    path = 5e-3 * np.sin(2 * np.pi * 0.7 * t) + 2e-3 * np.sin(2 * np.pi * 2.3 * t)
    force = 0.3 * (1.0 - np.cos(2 * np.pi * t))
    found = []
    for step in range(t.size):
        part.gripper_position[0], part.tip_force = path[step], force[step]
        sheath.gripper_position, sheath.contact_force = path[step], force[step]
        part.advance(t[step], H)
        sheath.advance(t[step], H)
        found.append((part.tip_position, sheath.tip_position, part.gripper_force[0], sheath.reaction_force))
    tip, tip_sheath, reaction, reaction_sheath = np.array(found).T
    assert np.ptp(tip_sheath) > 6e-3
    assert np.abs(tip - tip_sheath).max() < 0.03 * np.ptp(tip_sheath)
    assert np.std(reaction - reaction_sheath) < 0.05 * np.std(reaction_sheath)


def test_friction_sets_in_as_the_tip_passes(native):
    part = native(Instrument, **HELD, initial_insertion=-0.01, friction_coefficient=0.0, drag=0.0, drag_free=1e-3)
    part.start(0.0)
    # end of a slow push: before the valve, in the straight part, in the first and in the second bend
    depths, forces = [], []
    for seconds in (0.4, 2.0, 14.0, 3.5, 3.0):
        advance(part, seconds, 0.02)
        depths.append(float(part.insertion_depth))
        forces.append(float(part.free_length_force))
    assert forces[0] == pytest.approx(0.0, abs=1e-3)
    assert forces[1] == pytest.approx(0.6, abs=0.01)
    assert all(later > earlier + 0.1 for earlier, later in pairwise(forces[2:]))
    bends = [
        min(max((depth - start) / 78.5e-3, 0.0), 1.0) for depth, start in zip(depths[3:], (0.343, 0.4215), strict=True)
    ]
    assert forces[3] == pytest.approx(0.6 + 0.8 * bends[0], abs=0.03)
    assert forces[4] == pytest.approx(0.6 + 0.8 + 0.8 * bends[1], abs=0.03)


@pytest.mark.parametrize("kind", [{}, GUIDEWIRE])
def test_free_nodes_outside_of_the_sheath_follow_at_once(native, kind):
    part = native(Instrument, **{**HELD, **kind, **OUTSIDE})
    part.start(0.0)
    part.gripper_position[0], part.gripper_angle = 1e-3, 0.1
    tips = []
    for step in range(100):
        part.advance(step * H, H)
        tips.append((float(part.tip_position), float(part.tip_angle)))
    tips = np.array(tips)
    assert tips[-1] == pytest.approx((1e-3, 0.1), rel=1e-3)
    assert np.all(tips.max(axis=0) < 1.01 * tips[-1])  # hardly any ringing


@pytest.mark.slow_repetitions
@pytest.mark.parametrize("h", [0.25e-3, 2e-3, 5e-3])
def test_the_communication_step_hardly_counts(native, h):
    tips = []
    for size in (h, H):
        part = native(Instrument, **HELD)
        part.start(0.0)
        advance(part, 1.0, 0.01, 1.0, h=size)
        advance(part, 1.0, -0.01, -1.0, h=size)
        tips.append((float(part.tip_position), float(part.tip_angle)))
    assert tips[0] == pytest.approx(tips[1], rel=0.01)


def forth_and_back(part, steps, motion=(2e-3, 0.3)):
    """Push [m] and turn [rad], hold, go back, without compiled code: what nodes, grips and thrusts do."""
    part.start(0.0)
    found = []
    for step in range(steps):
        phase = step * H / 0.05
        part.gripper_position[0], part.gripper_velocity[0] = motion[0] * np.sin(phase) ** 3, 0.0
        part.gripper_angle = motion[1] * np.sin(phase) ** 3
        part.advance(step * H, H)
        found.append((*part.position, *part.angle, part.gripper_force[0], part.thrust[1], 100.0 * part.gripper_torque))
    return np.array(found)


KINDS = {"catheter": {}, "guidewire": {**GUIDEWIRE, "grip_stiffness": (1.7e3, 0.0)}}
ONE_WAY = {"push": (2e-3, 0.0), "turn": (0.0, 0.3)}


@pytest.mark.slow_repetitions
@pytest.mark.parametrize(("kind", "motion"), covering(KINDS, ONE_WAY))
def test_elimination_finds_what_moving_one_node_after_the_other_does(kind, motion, monkeypatch):
    motion = ONE_WAY[motion]
    values = {**HELD, **KINDS[kind], "tip_force": 0.2 if motion[0] else 0.0}
    exact = forth_and_back(Instrument(**values), 50, motion)
    monkeypatch.setattr("fmus.instrument.model.eliminate", lambda part, rate: False)
    swept = forth_and_back(Instrument(**values), 50, motion)
    assert np.all(np.ptp(exact[:, [0, 1]], axis=0) > 2e-4) or not motion[0]
    assert np.all(np.ptp(exact[:, [4, 5]], axis=0) > 5e-3) or not motion[1]
    assert exact[:, :4] == pytest.approx(swept[:, :4], abs=1e-7)
    assert exact[:, 4:8] == pytest.approx(swept[:, 4:8], abs=1e-7)  # of 1e-8 N m that a node may be off balance: 5e-7
    assert exact[:, 8:] == pytest.approx(swept[:, 8:], abs=5e-4)


@pytest.mark.slow_repetitions
@pytest.mark.parametrize(("kind", "motion", "depth"), covering(KINDS, ONE_WAY, [0.5, -0.1]))
def test_grips_that_hold_leave_nothing_to_sweep(kind, motion, depth, monkeypatch):
    """Reversals, play, sticking and free nodes: all solved by elimination, if it is pushed only or turned only."""
    monkeypatch.setattr("fmus.instrument.model.sweep", lambda part, dt: pytest.fail("swept"))
    forth_and_back(Instrument(**{**HELD, **KINDS[kind], "initial_insertion": depth}), 160, ONE_WAY[motion])


@pytest.mark.slow
@pytest.mark.parametrize("kind", KINDS)
def test_nodes_that_slide_both_ways_are_balanced_by_few_sweeps(kind, monkeypatch):
    values = {**HELD, **KINDS[kind], "tip_force": 0.2}
    usual = forth_and_back(Instrument(**values), 80)
    for name, value in (("SWEEPS", 2000), ("FORCE_TOLERANCE", 1e-8), ("TORQUE_TOLERANCE", 1e-12)):
        monkeypatch.setattr(f"fmus.instrument.gauss_seidel.{name}", value)
    exact = forth_and_back(Instrument(**values), 80)
    assert usual[:, :4] == pytest.approx(exact[:, :4], abs=1e-7)
    assert usual[:, 4:8] == pytest.approx(exact[:, 4:8], abs=2e-5)
    assert usual[:, 8:] == pytest.approx(exact[:, 8:], abs=2e-4)


CONTACT = {"friction_coefficient": 0.0, "drag": 0.0, "drag_free": 1e-3, "play": 0.0, "bending_stiffness": 1.0}


@pytest.mark.slow_repetitions
@pytest.mark.parametrize(("speed", "turning"), [(1e-3, 1.25), (-5e-3, 1.25), (2e-3, -6.0), (0.02, 0.5)])
def test_friction_is_against_the_one_direction_of_sliding(native, speed, turning):
    """Steady: the force is friction v / s and the torque radius friction (radius w) / s, with s of v and radius w."""
    part = native(Instrument, **HELD, **CONTACT, torsional_drag=1e-9, initial_insertion=0.7)
    part.start(0.0)
    advance(part, 20e-3 / abs(speed), speed, turning)
    around = 1.335e-3 * turning
    sliding = np.hypot(speed, around)
    assert part.free_length_force == pytest.approx(2.2 * speed / sliding, rel=1e-4)
    assert part.gripper_torque == pytest.approx(-1.335e-3 * 2.2 * around / sliding, rel=1e-4)
    assert part.tip_velocity == pytest.approx(speed, rel=1e-4)


def test_turning_frees_what_friction_holds(native):
    """A push that friction holds back reaches the tip when the instrument is turned; without turning it never does."""
    held = []
    for turning in (0.0, 1.25):
        part = native(Instrument, **HELD, **CONTACT)
        part.start(0.0)
        advance(part, 0.1, 5e-3)
        assert part.tip_position == 0.0
        advance(part, 0.4)
        assert part.free_length_force > 0.5
        advance(part, 8.0, 0.0, turning)
        held.append((float(part.tip_position), float(part.free_length_force)))
    (stuck, thrust), (freed, rest) = held
    assert stuck == 0.0
    assert thrust > 0.5
    assert freed == pytest.approx(0.5e-3, rel=1e-3)
    assert abs(rest) < 1e-3


def test_pushing_lets_the_twist_go(native):
    part = native(Instrument, **HELD, **CONTACT)
    part.start(0.0)
    advance(part, 2.0, turning=0.5)
    assert part.gripper_angle - part.tip_angle > 0.3
    advance(part, 2.0, 5e-3)
    assert part.tip_angle == pytest.approx(float(part.gripper_angle), abs=1e-4)


def test_a_closed_grip_without_stiffness_slips(native):
    part = native(Instrument, **{**HELD, "grip_stiffness": (0.0, 0.0), "grip_torsional_stiffness": (0.0, 0.0)})
    part.start(0.0)
    advance(part, 1.0, 5e-3, 0.1)
    assert part.slipping[0]
    assert part.slip_distance[0] == pytest.approx(-5e-3)
    assert part.slip_angle[0] == pytest.approx(-0.1)
    assert part.slip_distance[1] == 0.0  # an open one does not
    assert part.tip_position == 0.0


PAIR = st.tuples(*[st.floats(0.0, 1.0)] * 2)


@settings(max_examples=60, deadline=None)
@given(
    steps=st.lists(
        st.tuples(PAIR, PAIR, PAIR, PAIR, st.floats(-9.0, 9.0), st.floats(-40.0, 40.0)), min_size=1, max_size=25
    ),
    guidewire=st.booleans(),
    depth=st.floats(-0.1, 0.7),
    h=st.sampled_from((1e-4, 1e-3, 5e-3)),
)
@example(steps=[((0.0, 0.0), (0.0, 0.0), (0.0, 0.0), (0.0, 0.0), 0.0, 2.0)], guidewire=True, depth=2e-309, h=1e-4)
def test_any_motion_grip_and_load_stays_within_the_limits(native, steps, guidewire, depth, h):
    part = native(Instrument, **(GUIDEWIRE if guidewire else {}), initial_insertion=depth)
    part.start(0.0)
    for position, limit, torque_limit, stiffness, angle, load in steps:
        for g in range(2):
            part.gripper_position[g], part.gripper_velocity[g] = 0.05 * position[g] - 0.025, limit[g] - 0.5
            part.limit_distal[g], part.limit_proximal[g] = 30.0 * limit[g], 20.0 * limit[g]
            part.torque_limit[g] = 0.05 * torque_limit[g]
            part.grip_stiffness[g], part.grip_torsional_stiffness[g] = 1e4 * stiffness[g], stiffness[g]
        part.gripper_angle, part.tip_force, part.tip_torque = angle, load, 1e-3 * load
        assert part.advance(0.0, h) == 0
        for name, variable in part.views.items():
            assert np.all(np.isfinite(variable)), name
        for g in range(2):
            force = -part.gripper_force[g]
            bound = part.limit_distal[g] if force > 0.0 else part.limit_proximal[g]
            assert abs(force) <= bound * (1.0 + 1e-6)
            if bound > 0.01 and part.torque_limit[g] > 1e-5:
                share = (force / bound) ** 2 + (part.grip_torque[g] / part.torque_limit[g]) ** 2
                assert share <= 1.0 + 1e-6
        assert part.free_length_force <= part.buckling_load * (1.0 + 1e-9)
        assert part.free_length > 0.0
