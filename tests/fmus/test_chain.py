"""The instrument of bodies: alike in every run, its bounds, and what it says to bad input."""

import hashlib
import json
import re
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from fmus.chain.model import Chain
from fmus.chain_on_wall.model import ChainOnWall
from fmus.sheath.model import Sheath

from benchmarks import bench
from fmus.bodies import anywhere, walls
from fmus.bodies.rod import rounded_down
from tests.every_case import every_case
from twin.component import Role
from twin.coupling import RecordMember
from twin.errors import SceneError, SimulationError
from twin.scenario import load_scenario
from twin.scene import Wall

H = 1e-3
ROOT = Path(__file__).parents[2]
SCRIPT = "from tests.fmus.test_chain import fingerprint; print(fingerprint())"


def driven(part, count, stroke=5e-3, rate=1.0):
    """The part after some steps with a sine of the gripper; yields at each."""
    part.start(0.0)
    for i in range(count):
        part.gripper_position = stroke * np.sin(2.0 * np.pi * rate * i * H)
        part.advance(i * H, H)
        yield part


@pytest.fixture(scope="module")
def cycles():
    """Three cycles of the instrument: gripper, tip, force, kinetic over elastic energy, at each step."""
    kept = [
        (p.gripper_position, p.tip_position, p.reaction_force, p.kinetic_energy / p.elastic_energy)
        for p in driven(Chain(), 3000)
    ]
    return np.array(kept, float).T


def fingerprint(count=150):
    """Of every bit of a short run with contact at the wall."""
    found = hashlib.sha256()
    for part in driven(ChainOnWall(settling=0.05), count):
        part.heart_position = 3e-3 * np.sin(0.02 * len(found.hexdigest()))
        found.update(part.record.tobytes())
    return found.hexdigest()


@pytest.mark.slow
def test_the_same_run_twice_is_the_same_to_the_bit():
    """In one process and in another, whose hashes and addresses differ."""
    first = fingerprint()
    ballast = [bytearray(i) for i in range(5000)]
    assert fingerprint() == first
    del ballast
    done = subprocess.run([sys.executable, "-c", SCRIPT], capture_output=True, text=True, check=True)
    assert done.stdout.split()[-1] == first


@pytest.mark.slow
def test_initialization_can_be_repeated():
    part = Chain(settling=0.05)
    part.start(0.0)
    first = part.record.copy()
    part.start(0.0)
    assert part.record == first
    part.advance(0.0, H)
    part.start(0.0)
    assert part.record == first


def test_stands_where_the_sheath_stands():
    def face(cls):
        roles = (Role.input, Role.output)
        return {(v.name, v.role, v.unit) for v in cls.variables if v.role in roles}

    assert face(Chain) == face(Sheath)
    assert {name: set(one.members) for name, one in Chain.terminals.items()} == {
        name: set(one.members) for name, one in Sheath.terminals.items()
    }


@pytest.mark.slow
def test_the_tip_lags_and_the_loop_has_an_area(cycles):
    x, y, _, _ = cycles
    cycle = slice(1000, 2000)
    area = abs(np.trapezoid(y[cycle], x[cycle]))
    assert 1e-3 < area / np.ptp(x[cycle]) < 2.5e-3
    assert np.ptp(y[cycle]) < np.ptp(x[cycle])


@pytest.mark.slow
def test_more_is_put_in_than_comes_out(cycles):
    """Work of the gripper over closed cycles, tip free, is what friction takes: never negative."""
    x, _, f, _ = cycles
    work = np.cumsum(-0.5 * (f[1:] + f[:-1]) * np.diff(x))
    assert np.all(np.diff(work[[999, 1999, 2998]]) > 1e-3)


@pytest.mark.slow
def test_mass_scaling_is_small_and_bounded(cycles):
    shares = cycles[3]
    part = Chain(settling=0.0)
    part.start(0.0)
    assert max(shares) < 0.03
    assert 1.0 < part.mass_scale < part.largest_mass_scale
    assert part.lowest_mode > 7 * 7.0  # seven times the highest harmonic of the heart, at 60 /min


@pytest.mark.slow
def test_a_load_on_the_tip_is_held_by_friction_until_it_slips():
    part = Chain()
    part.start(0.0)
    moved = []
    for force in (0.1, 6.0):
        part.contact_force = force
        for i in range(300):
            part.advance(i * H, H)
        moved.append(float(part.tip_position))
    assert abs(moved[0]) < 0.05e-3
    assert moved[1] < -1e-3


@pytest.mark.slow
def test_support_forces_carry_the_instrument():
    """Forces of the walls and of the gripper balance when nothing moves."""
    part = ChainOnWall()
    part.start(0.0)
    tip = part.support_force[-1]
    np.testing.assert_allclose(tip, -part.wall_force, atol=2e-3)
    assert part.force == pytest.approx(part.wall_force[0])
    assert 0.05 < part.force < 0.3


@pytest.mark.slow
def test_instrument_and_wall_feel_the_same_while_it_presses_and_leaves():
    """The wall's springs carry what acts on the tip, but for the pad's inertia, which is nothing in the mean over a whole motion."""
    part = ChainOnWall()
    part.start(0.0)
    on_wall, on_tip = [], []
    for i in range(1500):
        part.gripper_position = -12.5e-3 * (1.0 - np.cos(2.0 * np.pi * i * H / 1.5))
        part.advance(i * H, H)
        on_wall.append(np.array(part.wall_force))
        on_tip.append(np.array(part.support_force[-1]))
    on_wall, on_tip = np.array(on_wall), np.array(on_tip)
    touches = np.abs(on_tip).max(axis=1) > 0.0
    assert 0.1 < touches.mean() < 0.9
    assert on_wall[touches].max() > 0.1
    np.testing.assert_allclose(on_wall.mean(axis=0), -on_tip.mean(axis=0), atol=1e-3)
    assert np.sqrt(np.mean((on_wall + on_tip) ** 2)) < 0.01


@pytest.mark.slow
def test_a_fiber_in_the_bodies_feels_both_bends_and_the_leaning_tip():
    part = ChainOnWall()
    part.start(0.0)
    bend = part.fiber_curvature[: int(part.count), 1]
    assert np.all(part.fiber_curvature[:, 0] == 0.0)
    assert np.abs(bend[:14]).max() < 3.0  # straight up to the first bend, 162 mm behind the fiber's begin
    np.testing.assert_allclose(bend[18:22].mean(), 20.0, rtol=0.15)  # bends of radius 50 mm
    np.testing.assert_allclose(bend[26:30].mean(), -20.0, rtol=0.15)

    # all the angle there is: from the fiber's begin, which is straight, to the tip
    angle = np.arctan2(*(part.shape[-1] - part.shape[-2])[::-1])
    assert np.sum(bend) * part.pitch == pytest.approx(angle, abs=0.1)


@pytest.mark.slow
def test_it_does_not_claim_to_come_back():
    """Chipmunk keeps impulses of joints and contacts that nobody can read: a copy of the space goes elsewhere."""
    part = Chain(settling=0.05)
    assert not RecordMember("chain", part).has_cheap_fmu_state
    list(driven(part, 50))
    impulses = [
        sum(one.impulse for one in space.constraints) for space in (part._world.space, part._world.space.copy())
    ]
    assert impulses[0] > 0.0
    assert impulses[1] == 0.0


@pytest.mark.slow
@every_case(
    ("values", "message"),
    [
        ({"bending_stiffness": 0.0}, "chain: bending_stiffness is 0. Give more than 0."),
        ({"friction": -0.1}, "chain: friction is -0.1. Give 0 or more."),
        ({"density": np.nan}, "chain: density is nan. Give more than 0."),
        ({"segments": 1}, "chain: 1 segments do not bend. Use 2 or more, such as 60."),
        ({"substep": 1e-3}, "chain: a substep of 1 ms is unstable for 60 segments, unless they weigh 235 times"),
        ({"diameter": 3e-3}, "inside wall `sheath_left` of two_bends, at"),
    ],
    ids=str,
)
def test_bad_values_are_told_in_one_line(values, message):
    with pytest.raises(SimulationError) as caught:
        Chain(**values).start(0.0)
    assert message in str(caught.value)
    assert "\n" not in str(caught.value)


@pytest.mark.slow
def test_the_step_that_is_offered_does():
    with pytest.raises(SimulationError, match=r"Use substep 0.2 ms") as caught:
        Chain(substep=0.5e-3).start(0.0)
    assert "takes about" not in str(caught.value)
    list(driven(Chain(substep=0.2e-3, settling=0.02), 50))


@pytest.mark.slow
def test_many_segments_are_said_to_be_slow_and_run():
    with pytest.raises(
        SimulationError, match=r"Use substep 0.001 ms, which takes about \d+ s for each second"
    ) as caught:
        Chain(segments=10_000).start(0.0)
    assert "fewer segments" in str(caught.value)
    part = Chain(segments=10_000, largest_mass_scale=1e6, settling=0.0)
    list(driven(part, 2))
    assert np.isfinite(part.shape).all()


def test_a_step_that_is_no_multiple_is_refused():
    part = Chain(settling=0.0)
    part.start(0.0)
    with pytest.raises(SimulationError, match=r"step of 0.9 ms is no multiple of the substep of 0.25 ms. Use substep"):
        part.advance(0.0, 0.9e-3)


def test_segments_that_fly_apart_are_told():
    part = Chain(settling=0.0)
    part.start(0.0)
    part.gripper_position = 1.0
    with pytest.raises(SimulationError, match=r"flew apart at t = 0.001 s. Use substep 0.1 ms, less relaxation, or"):
        part.advance(0.0, H)


def test_an_unknown_environment_is_told():
    with pytest.raises(SceneError, match="two_bends"):
        anywhere.component("two_bend")
    assert anywhere.component("free_gap") is anywhere.component("free_gap")


def vessel(tmp_path, *points):
    """A file with one closed wall beside a straight path."""
    wall = {"type": "Polygon", "coordinates": [[*points, points[0]]]}
    path = {"type": "LineString", "coordinates": [[0, 0], [100, 0]]}
    features = [
        {"type": "Feature", "properties": {"class": "wall", "name": "plate"}, "geometry": wall},
        {"type": "Feature", "properties": {"class": "path", "name": "middle"}, "geometry": path},
    ]
    file = tmp_path / "vessel.geojson"
    file.write_text(json.dumps({"type": "FeatureCollection", "units": "mm", "features": features}))
    return str(file)


def test_a_place_of_ones_own_is_a_file(tmp_path):
    part = anywhere.component(vessel(tmp_path, [0, 5], [100, 5], [100, 8], [0, 8]))(segments=12, settling=0.0)
    list(driven(part, 20))
    assert part.shape[-1, 0] > 0.1


def test_a_wall_that_crosses_itself_is_told(tmp_path):
    with pytest.raises(SceneError, match=r"wall `plate`: crosses itself at \(50, "):
        anywhere.component(vessel(tmp_path, [0, 5], [100, 9], [100, 5], [0, 9]))


def test_an_instrument_that_begins_inside_a_wall_is_told(tmp_path):
    """The path itself may be clear: it is the diameter that is not."""
    part = anywhere.component(vessel(tmp_path, [0, 1], [100, 1], [100, 8], [0, 8]))(segments=12)
    with pytest.raises(SimulationError, match=r"begins 0.3\d* mm inside wall `plate` of vessel, at \("):
        part.start(0.0)


@every_case(("value", "below"), [(3.3e-4, 2e-4), (5e-4, 5e-4), (9.9, 5.0), (1.0, 1.0), (1.7e-6, 1e-6)])
def test_steps_are_offered_in_round_numbers(value, below):
    assert rounded_down(value) == below


def test_what_is_inside_a_wall():
    square = Wall("square", np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]]), closed=True).outline
    assert walls.inside(np.array([0.5, 0.5]), square)
    assert not walls.inside(np.array([1.5, 0.5]), square)
    np.testing.assert_allclose(walls.distance(np.array([[0.5, 0.4], [2.0, 2.0]]), square), [0.4, np.sqrt(2.0)])


@pytest.mark.slow
def test_the_benchmark_measures(capsys):
    bench.measure(0.02, (20,))
    lines = dict(line.split(": ", 1) for line in capsys.readouterr().out.splitlines())
    assert float(lines["bench_20_factor"]) > 0.0
    assert float(lines["bench_20_share_of_space"]) > 0.0


@pytest.mark.slow
def test_swapping_is_one_line(tmp_path):
    """The lumped force experiment with a chain for its sheath, and nothing else changed."""
    file = tmp_path / "swapped.yaml"
    file.write_text(
        "extends: heart_wall_force.yaml\nmembers: {sheath: {component: chain}}\n".replace(
            "heart_wall_force", str(ROOT / "scenarios" / "heart_wall_force")
        )
    )
    assert load_scenario(file).variants[0].members["sheath"].component == "chain"


BLAS = re.compile(r"linalg|\.dot\(|matmul|tensordot|vdot|np\.inner| @ ")


@pytest.mark.parametrize("name", ["part", "rod", "walls", "world"])
def test_no_sum_depends_on_the_processor(name):
    """The kernels of BLAS add in an order of their own on each processor: with AVX-512, the tip differed in the last bit."""
    text = (ROOT / f"fmus/bodies/{name}.py").read_text()
    found = [line for line in text.splitlines() if BLAS.search(line)]
    assert found == []
